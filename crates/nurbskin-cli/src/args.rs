//! What can be typed, and what it means.

mod words;

use clap::{Args, Parser, Subcommand, ValueEnum};
use nurbskin::Unit;
use nurbskin::chart::Topology;
use nurbskin::fit::parameters::Parameterization;
use nurbskin::io::iges::write::Layout;
use nurbskin::io::step::Schema;
use nurbskin::pipeline::words::counts;
use nurbskin::pipeline::{
    ConvertOptions, DeviationOptions, Length, Method, Options, Rarefaction, Trim,
};
use std::path::PathBuf;
pub(crate) use words::command_line;
use words::{degree, fraction, non_negative};

/// Skin a scan with one clean NURBS surface, from points to CAD in seconds, with the proof.
#[derive(Parser, Debug)]
#[command(
    name = "nurbskin",
    version,
    about,
    propagate_version = true,
    after_help = "\
Exit status:
  0  written and within tolerance
  1  an error, or stopped by Ctrl-C; nothing was written
  2  wrong usage
  3  written, but the verdict is not `pass` (the reason is printed)

Run `nurbskin VERB --help` for the options and examples of a verb."
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) verb: Verb,
    #[command(flatten)]
    pub(crate) common: Common,
}

/// Options of every verb.
#[derive(Args, Debug)]
pub(crate) struct Common {
    /// Print one JSON object on stdout, and nothing else there
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Print no messages and no progress, only errors
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
    /// Number of threads (default: all cores); the result is the same for any number
    #[arg(long, value_name = "N", global = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
}

#[derive(Subcommand, Debug)]
pub(crate) enum Verb {
    Fit(Fit),
    Info(Info),
    Rarefy(Rarefy),
    Enrich(Enrich),
    Deviation(Deviation),
    Check(Check),
    Convert(Convert),
    Simulate(Simulate),
    View(View),
    /// Print a completion script for a shell
    #[command(hide = true)]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Write the manual pages, one for each verb, into a folder
    #[command(hide = true)]
    Man {
        /// The folder; it must exist
        folder: PathBuf,
    },
}

/// Fit a surface to a scan and write it as a CAD file
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin fit face.ply -o face.step
  nurbskin fit pot.ply -o pot.step -o pot.igs -t 0.1mm --json
  nurbskin fit pot.ply -o pot.step --report pot.html
  nurbskin fit rows.txt --grid 29x13 --method interpolate --rarefy off -o face.igs
  nurbskin fit scans/*.ply --output-dir out/

Formats by extension: .step, .stp, .igs, .iges (the trimmed surface); .stl, .obj, .ply, .glb (triangles within a tenth of
the tolerance).")]
pub(crate) struct Fit {
    /// Scans: PLY, STL, OBJ, OFF, PCD, PTX, E57, LAS, LAZ, NPY, XYZ, ASC, TXT, CSV, PTS; any of them also with .gz
    #[arg(required = true, value_name = "SCAN")]
    pub(crate) scans: Vec<PathBuf>,
    /// File to write; the format follows the extension; may be repeated (default: SCAN with .step)
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: Vec<PathBuf>,
    /// Folder for the results of several scans, each named after its scan
    #[arg(long, value_name = "DIR", conflicts_with = "output")]
    pub(crate) output_dir: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) shaping: Shaping,
    /// `interpolate`: the paper's, through every kept point; `approximate`: least squares within the tolerance
    #[arg(long, value_enum, default_value_t)]
    pub(crate) method: MethodName,
    /// The budget; the best surface within it, and the verdict says if the tolerance was met (default: none, but 1600
    /// for scans without order where no -t is given)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(4..))]
    pub(crate) max_control_points: Option<u64>,
    /// `auto`: the surface ends where the scan does, holes wider than three spacings included, but a closed one stays
    /// closed where its holes make up 2.5 % of it at most; `always`: those are cut out, too; `off`: it ends at the sides of
    /// its parameter rectangle
    #[arg(long, value_enum, default_value_t)]
    pub(crate) trim: TrimName,
    /// Deviation report: .html (a page with the surface in 3-D), .json or .csv; may be repeated
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Vec<PathBuf>,
    /// Keep this fraction of the points, every k-th, out of the fit and report their deviation apart (0 to 0.5)
    #[arg(long, value_name = "FRACTION", default_value_t = 0.0, allow_hyphen_values = true, value_parser = fraction)]
    pub(crate) hold_out: f64,
    /// Application protocol of STEP files; `ap242` adds area, volume and centroid for the receiver to compare with
    #[arg(long, value_enum, default_value_t)]
    pub(crate) step_schema: SchemaName,
    /// IGES. `exact`: numbers read back to the same value; `paper`: six decimals and the packing of Pal & Ballav 2007
    #[arg(long, value_enum, default_value_t)]
    pub(crate) iges_layout: LayoutName,
    /// Put the scan's points into the CAD file too, on a level or in a set of their own
    #[arg(long)]
    pub(crate) with_points: bool,
    /// Seed of everything random (nothing in a fit is; same input, options and version give the same bytes)
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
}

/// Say what is in scans and CAD files
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin info face.ply
  nurbskin info scans/*.ply --json
  nurbskin info part.step

Of a scan: points, those that cannot be used, order, box, spacing, noise, separate parts, and the topology where it can be
told. Of a CAD file (.step, .stp, .igs, .iges): faces, area, degrees, control points, entities. Exit status 1 if a file cannot be read; the
others are shown all the same.")]
pub(crate) struct Info {
    /// Scans (PLY, STL, OBJ, OFF, PCD, PTX, E57, LAS, LAZ, NPY, XYZ, ASC, TXT, CSV, PTS, also with .gz), STEP or IGES files
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
}

/// Options that `fit`, `rarefy` and `enrich` share.
#[derive(Args, Debug)]
pub(crate) struct Shaping {
    /// The surface shall be this close to the scan: `0.05mm`, or a bare number in the scan's unit (default: chosen
    /// from the measured noise, and said)
    #[arg(short, long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub(crate) tolerance: Option<Length>,
    /// Shape of the surface's domain
    #[arg(long, value_enum, default_value_t)]
    pub(crate) topology: TopologyName,
    /// Degree in u and v
    #[arg(long, value_name = "P[,Q]", default_value = "3", value_parser = degree)]
    pub(crate) degree: [usize; 2],
    /// Parameters for interpolation (auto: the better of chord and uniform when every second line is left out)
    #[arg(long, value_enum, default_value_t)]
    pub(crate) parameters: ParametersName,
    /// The input is ordered: N rows along v, each of M points along u
    #[arg(long, value_name = "MxN", value_parser = counts)]
    pub(crate) grid: Option<[usize; 2]>,
    /// Threshold of the angle between normals in degrees, for u and v or both; or `MxN`: the thresholds at which that
    /// many lines remain; `auto`: the fewest lines within the tolerance on all points; `off`: keep all
    #[arg(
        long,
        value_name = "DEGREES[,DEGREES]|MxN|auto|off",
        default_value = "auto"
    )]
    pub(crate) rarefy: Rarefaction,
    /// Catmull-Clark levels for a sparse grid
    #[arg(long, value_name = "LEVELS", value_parser = clap::value_parser!(u8).range(0..=6))]
    pub(crate) enrich: Option<u8>,
    /// Unit of the scan's numbers (auto: from the file where it says so, else mm, and said)
    #[arg(long, value_enum, default_value_t)]
    pub(crate) unit: UnitName,
}

/// Keep the points of an ordered scan that its shape needs, as an m x n grid
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin rarefy pot.ply -o kept.ply -t 0.1        the fewest lines within 0.1 on all points
  nurbskin rarefy pot.ply -o kept.ply --rarefy 20   the paper's threshold between normals
  nurbskin rarefy pot.ply -o kept.txt --rarefy 18x18")]
pub(crate) struct Rarefy {
    /// Ordered scan
    pub(crate) scan: PathBuf,
    /// File to write: .ply, .xyz, .txt or .csv
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) shaping: Shaping,
}

/// Enrich a sparse grid by Catmull-Clark subdivision; the original points stay on the surface
#[derive(Args, Debug)]
#[command(after_help = "\
Example:
  nurbskin enrich sparse.txt --grid 8x8 --enrich 2 -o dense.txt")]
pub(crate) struct Enrich {
    /// Ordered scan
    pub(crate) grid_file: PathBuf,
    /// File to write: .ply, .xyz, .txt or .csv
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) shaping: Shaping,
}

/// Measure how far a scan is from a CAD file, and the CAD file from the scan
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin deviation scan.ply part.step
  nurbskin deviation scan.ply part.igs -t 0.2mm --align --report points.csv

Distances are to the nearest point of the trimmed faces, edges included, with certified bounds; positive outside. Every
finite point counts. Exit status 3 if the verdict is not `pass`.")]
pub(crate) struct Deviation {
    /// Scan: PLY, STL, OBJ, OFF, PCD, PTX, E57, LAS, LAZ, NPY, XYZ, ASC, TXT, CSV, PTS; any of them also with .gz
    pub(crate) scan: PathBuf,
    /// STEP or IGES file
    pub(crate) cad: PathBuf,
    /// Allowed deviation: `0.05mm`, or a bare number in the scan's unit (default: chosen from the measured noise, and
    /// said)
    #[arg(short, long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub(crate) tolerance: Option<Length>,
    /// Unit of the scan's numbers (auto: from the file where it says so, else mm, and said)
    #[arg(long, value_enum, default_value_t)]
    pub(crate) unit: UnitName,
    /// Move the scan to where it fits best first; it must lie roughly in place
    #[arg(long)]
    pub(crate) align: bool,
    /// Report to write: .html (a page with the surface in 3-D), .json or .csv; may be repeated
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Vec<PathBuf>,
}

/// Check the quality of a CAD file, and that it reads back
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin check part.step
  nurbskin check part.igs --json

Gaps between edges and surfaces, tangency and curvature across edges and knots, degrees, narrow knot spans, tiny edges,
folds and self-intersections, loops, orientation, and whether the file reads back the same. Exit status 3 if a check
fails.")]
pub(crate) struct Check {
    /// STEP or IGES file
    pub(crate) cad: PathBuf,
}

/// Convert a file: scan to scan, CAD to CAD, CAD to mesh
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin convert part.igs -o again.step
  nurbskin convert part.step -o part.glb -t 0.01mm
  nurbskin convert pot.ply -o pot.xyz")]
pub(crate) struct Convert {
    /// Scan, STEP or IGES file
    pub(crate) input: PathBuf,
    /// File to write; may be repeated: .step, .igs, .stl, .obj, .ply, .glb; of a scan .ply, .xyz, .csv, .stl, .obj
    #[arg(short, long, value_name = "OUT", required = true)]
    pub(crate) output: Vec<PathBuf>,
    /// Chordal tolerance of meshes (default: a ten-thousandth of the diagonal)
    #[arg(short, long, value_name = "LENGTH")]
    pub(crate) tolerance: Option<Length>,
    /// Unit of the output (auto: that of the input)
    #[arg(long, value_enum, default_value_t)]
    pub(crate) unit: UnitName,
    /// Application protocol of STEP
    #[arg(long, value_enum, default_value_t)]
    pub(crate) step_schema: SchemaName,
}

/// Scan a known shape with a virtual scanner
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin simulate pot -o pot.ply                      the paper's pot, 13159 points in order
  nurbskin simulate face --noise 0.1 --outliers 0.005 --shuffled -o face.xyz")]
pub(crate) struct Simulate {
    /// pot, patch, face, handle, sphere, ellipsoid, torus, tube, saddle, blade or plane
    pub(crate) shape: String,
    /// File to write: .ply, .xyz, .txt or .csv
    #[arg(short, long, value_name = "SCAN")]
    pub(crate) output: PathBuf,
    /// Number of points (default: the paper's for its four objects, else 10000)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(16..=100_000_000))]
    pub(crate) points: Option<u64>,
    /// Standard deviation of the noise along the normal, mm
    #[arg(long, value_name = "SIGMA", default_value_t = 0.0, allow_hyphen_values = true, value_parser = non_negative)]
    pub(crate) noise: f64,
    /// Share of the points thrown far off the surface
    #[arg(long, value_name = "FRACTION", default_value_t = 0.0, allow_hyphen_values = true, value_parser = fraction)]
    pub(crate) outliers: f64,
    /// Number of round holes without points
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) holes: usize,
    /// Seed of the noise, the outliers, the holes and the shuffling
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Points in scan order (the default)
    #[arg(long, conflicts_with = "shuffled")]
    pub(crate) ordered: bool,
    /// Points in random order
    #[arg(long)]
    pub(crate) shuffled: bool,
    /// Leave a longitudinal opening in a closed shape, as the paper's handle has
    #[arg(long)]
    pub(crate) opening: bool,
}

/// Show scans and CAD files in the browser
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin view part.step --no-open
  nurbskin view face.ply -o face.html --no-open

The page is one file that works offline. Without -o it goes to the folder for temporary files. Exit status 1 if a file
cannot be read; the others are shown all the same.")]
pub(crate) struct View {
    /// Scans (PLY, STL, OBJ, OFF, PCD, PTX, E57, LAS, LAZ, NPY, XYZ, ASC, TXT, CSV, PTS, also with .gz), STEP or IGES files
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// Where the page of a single file goes
    #[arg(short, long, value_name = "FILE.html")]
    pub(crate) output: Option<PathBuf>,
    /// Open nothing, print where the page is
    #[arg(long)]
    pub(crate) no_open: bool,
}

#[derive(ValueEnum, Clone, Copy, Debug, Default)]
pub(crate) enum MethodName {
    #[default]
    Auto,
    Interpolate,
    Approximate,
}

#[derive(ValueEnum, Clone, Copy, Debug, Default)]
pub(crate) enum TopologyName {
    #[default]
    Auto,
    Disk,
    Tube,
    Sphere,
    Torus,
}

#[derive(ValueEnum, Clone, Copy, Debug, Default)]
pub(crate) enum ParametersName {
    #[default]
    Auto,
    Uniform,
    Chord,
    Centripetal,
}

#[derive(ValueEnum, Clone, Copy, Debug, Default)]
pub(crate) enum UnitName {
    #[default]
    Auto,
    Mm,
    Cm,
    M,
    Um,
    In,
    Ft,
}

#[derive(ValueEnum, Clone, Copy, Debug, Default)]
pub(crate) enum LayoutName {
    #[default]
    Exact,
    Paper,
}

#[derive(ValueEnum, Clone, Copy, Debug, Default)]
pub(crate) enum SchemaName {
    #[default]
    Ap214,
    Ap242,
}

impl SchemaName {
    fn schema(self) -> Schema {
        match self {
            SchemaName::Ap214 => Schema::Ap214,
            SchemaName::Ap242 => Schema::Ap242,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug, Default)]
pub(crate) enum TrimName {
    #[default]
    Auto,
    Always,
    Off,
}

impl UnitName {
    fn unit(self) -> Option<Unit> {
        match self {
            UnitName::Auto => None,
            UnitName::Mm => Some(Unit::Millimetre),
            UnitName::Cm => Some(Unit::Centimetre),
            UnitName::M => Some(Unit::Metre),
            UnitName::Um => Some(Unit::Micrometre),
            UnitName::In => Some(Unit::Inch),
            UnitName::Ft => Some(Unit::Foot),
        }
    }
}

impl Shaping {
    /// The options of the library that these words mean.
    pub(crate) fn options(&self) -> Options {
        Options {
            tolerance: self.tolerance,
            topology: match self.topology {
                TopologyName::Auto => None,
                TopologyName::Disk => Some(Topology::Disk),
                TopologyName::Tube => Some(Topology::Tube),
                TopologyName::Sphere => Some(Topology::Sphere),
                TopologyName::Torus => Some(Topology::Torus),
            },
            degree: self.degree,
            parameters: match self.parameters {
                ParametersName::Auto => None,
                ParametersName::Uniform => Some(Parameterization::Uniform),
                ParametersName::Chord => Some(Parameterization::ChordLength),
                ParametersName::Centripetal => Some(Parameterization::Centripetal),
            },
            grid: self.grid,
            rarefy: self.rarefy,
            enrich: usize::from(self.enrich.unwrap_or(0)),
            unit: self.unit.unit(),
            ..Options::default()
        }
    }
}

impl Deviation {
    /// The options of the library that these words mean.
    pub(crate) fn options(&self) -> DeviationOptions {
        DeviationOptions {
            tolerance: self.tolerance,
            unit: self.unit.unit(),
            align: self.align,
            reports: self.report.clone(),
            command: Some(command_line()),
        }
    }
}

impl Convert {
    /// The options of the library that these words mean.
    pub(crate) fn options(&self) -> ConvertOptions {
        ConvertOptions {
            tolerance: self.tolerance,
            to_unit: self.unit.unit(),
            schema: self.step_schema.schema(),
            ..ConvertOptions::default()
        }
    }
}

impl Fit {
    /// The options of the library that these words mean.
    pub(crate) fn options(&self) -> Options {
        Options {
            method: match self.method {
                MethodName::Auto => Method::Auto,
                MethodName::Interpolate => Method::Interpolate,
                MethodName::Approximate => Method::Approximate,
            },
            max_control_points: self
                .max_control_points
                .map(|n| usize::try_from(n).unwrap_or(usize::MAX)),
            hold_out: self.hold_out,
            iges_layout: match self.iges_layout {
                LayoutName::Exact => Layout::Exact,
                LayoutName::Paper => Layout::Paper,
            },
            with_points: self.with_points,
            step_schema: self.step_schema.schema(),
            trim: match self.trim {
                TrimName::Auto => Trim::Auto,
                TrimName::Always => Trim::Always,
                TrimName::Off => Trim::Off,
            },
            reports: self.report.clone(),
            command: Some(command_line()),
            ..self.shaping.options()
        }
    }
}
