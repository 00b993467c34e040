//! `convert` and `simulate`.

use super::names::{UnitName, named};
use super::words::{InputUnit, any_format, fraction, non_negative, points_or_cad};
use super::{INPUT, OUTPUT};
use clap::Args;
use nurbskin::io::step::Schema;
use nurbskin::pipeline::{ConvertOptions, Length, SCAN_FORMATS};
use std::path::PathBuf;

/// Convert scan to scan, CAD to CAD, or CAD to mesh
///
/// To make a CAD file of a scan use `fit`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin convert part.igs -o again.step
  nurbskin convert part.step -o part.glb -t 0.01mm
  nurbskin convert pot.ply -o pot.xyz
  nurbskin convert pot.xyz --unit m --to-unit mm -o pot_mm.csv")]
pub(crate) struct Convert {
    /// Scan, STEP or IGES file; `-` reads standard input
    pub(crate) input: PathBuf,
    /// File to write; may be repeated
    ///
    /// The format follows the extension: .step, .stp, .igs or .iges; .stl, .obj, .ply or .glb; of a scan .ply, .xyz, .txt,
    /// .asc, .csv, .stl or .obj. `-` writes to standard output. A file that is there is replaced.
    #[arg(short, long, value_name = "OUT", required = true, help_heading = OUTPUT)]
    pub(crate) output: Vec<PathBuf>,
    /// Format of standard output, for `-o -` [default: step]
    #[arg(long, value_name = "FORMAT", value_parser = points_or_cad(), help_heading = OUTPUT)]
    pub(crate) to: Option<String>,
    /// Unit of the output; numbers are converted [default: the input's]
    #[arg(long, value_parser = named::<UnitName>(), default_value = "auto", hide_default_value = true, value_name = "UNIT", help_heading = OUTPUT)]
    pub(crate) to_unit: UnitName,
    /// Largest distance between a CAD surface and the triangles of a mesh [default: 0.01% of the diagonal]
    #[arg(short, long, value_name = "LENGTH", allow_hyphen_values = true, help_heading = OUTPUT)]
    pub(crate) tolerance: Option<Length>,
    /// Application protocol of STEP files [default: ap214]
    #[arg(long, value_parser = named::<Schema>(), default_value = "ap214", hide_default_value = true, value_name = "SCHEMA", help_heading = OUTPUT)]
    pub(crate) step_schema: Schema,
    /// Author, for the header of STEP and IGES files [default: the input's]
    #[arg(long, value_name = "NAME", help_heading = OUTPUT)]
    pub(crate) author: Option<String>,
    /// Organization, for the header of STEP and IGES files [default: the input's]
    #[arg(long, value_name = "NAME", help_heading = OUTPUT)]
    pub(crate) organization: Option<String>,
    #[command(flatten)]
    pub(crate) unit: InputUnit,
    /// Format of the input [default: from its extension, else from its content]
    #[arg(long, value_name = "FORMAT", value_parser = any_format(), help_heading = INPUT)]
    pub(crate) from: Option<String>,
}

impl Convert {
    /// The options of the library that these words mean.
    pub(crate) fn options(&self) -> ConvertOptions {
        ConvertOptions {
            tolerance: self.tolerance,
            unit: self.unit.unit,
            to_unit: self.to_unit,
            schema: self.step_schema,
            author: self.author.clone().unwrap_or_default(),
            organization: self.organization.clone().unwrap_or_default(),
            time: None,
        }
    }
}

/// Scan a known shape with a virtual scanner
///
/// For tests and demonstrations: the true shape, the noise and the outliers are known. Lengths are in millimetres.
/// Bodies have handles, branches or sharp edges; their scans are clouds in random order, or meshes.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  nurbskin simulate pot -o pot.ply      the pot of Pal & Ballav 2007
  nurbskin simulate face --noise 0.1 --outliers 0.005 --shuffled -o face.xyz
  nurbskin simulate drill --points 50000 --mesh -o drill.ply            a body as a mesh")]
pub(crate) struct Simulate {
    /// pot, patch, face, handle, sphere, ellipsoid, torus, tube, saddle, blade or plane; or a body: double-torus, mug,
    /// hammer, drill, tee, bracket or knot
    pub(crate) shape: String,
    /// File to write: .ply, .xyz, .txt, .asc or .csv; `-` for standard output
    #[arg(short, long, value_name = "SCAN", help_heading = OUTPUT)]
    pub(crate) output: PathBuf,
    /// Format of standard output, for `-o -` [default: ply]
    #[arg(long, value_name = "FORMAT", value_parser = SCAN_FORMATS, help_heading = OUTPUT)]
    pub(crate) to: Option<String>,
    /// Number of points [default: 10000; pot, patch, face and handle: as in the paper; bodies: 20000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(16..=100_000_000), help_heading = SCANNER)]
    pub(crate) points: Option<u64>,
    /// Standard deviation of the noise along the normal, mm
    #[arg(long, value_name = "SIGMA", default_value_t = 0.0, allow_hyphen_values = true, value_parser = non_negative, help_heading = SCANNER)]
    pub(crate) noise: f64,
    /// Share of the points thrown far off the surface
    #[arg(long, value_name = "FRACTION", default_value_t = 0.0, allow_hyphen_values = true, value_parser = fraction, help_heading = SCANNER)]
    pub(crate) outliers: f64,
    /// Number of round holes without points
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = SCANNER)]
    pub(crate) holes: usize,
    /// Seed of noise, outliers, holes and order; the same seed gives the same scan
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = SCANNER)]
    pub(crate) seed: u64,
    /// Points in scan order (the default; not for bodies)
    #[arg(long, conflicts_with = "shuffled", help_heading = SCANNER)]
    pub(crate) ordered: bool,
    /// Points in random order
    #[arg(long, help_heading = SCANNER)]
    pub(crate) shuffled: bool,
    /// Leave a longitudinal opening in a closed shape, as the handle of the paper has
    #[arg(long, help_heading = SCANNER)]
    pub(crate) opening: bool,
    /// A mesh of a body, of about the number of points
    #[arg(long, conflicts_with_all = ["ordered", "shuffled"], help_heading = SCANNER)]
    pub(crate) mesh: bool,
    /// The mesh cuts the sharp edges of the body, instead of following them
    #[arg(long, requires = "mesh", help_heading = SCANNER)]
    pub(crate) unaligned: bool,
}

/// Heading of `simulate --help`.
const SCANNER: &str = "Scanner";
