//! `fit`.

use super::names::{ParametersName, TopologyName, named};
use super::words::{Heading, InputUnit, command_line, degree, fraction, share, surface_format};
use super::{INPUT, ORDERED, OUTPUT, SURFACE, TOLERANCE};
use clap::Args;
use nurbskin::io::iges::write::Layout;
use nurbskin::io::step::Schema;
use nurbskin::pipeline::words::{counts, sharp};
use nurbskin::pipeline::{FaceLayout, Method, Sharp, Trim};
use nurbskin::pipeline::{
    InputOptions, Length, Options, OutputOptions, Rarefaction, SurfacingOptions,
};
use std::path::PathBuf;

/// Fit NURBS surfaces to a scan and write them as a CAD file
///
/// Where one smooth surface can be the part and keeps the tolerance, it is one: an open sheet, a tube, or a surface
/// closed like a sphere or a torus. Any other part, one with branches, handles or sharp edges, becomes a watertight
/// network of four-sided faces (see --layout and --sharp).
///
/// With -t the verdict says whether the surface keeps the tolerance. Without -t the fit goes on while more control
/// points pay, and the deviation is printed without a verdict on it.
#[derive(Args, Debug)]
#[command(
    after_help = "\
Examples:
  nurbskin fit face.ply                      writes face.step
  nurbskin fit pot.ply -o pot.step -o pot.igs -t 0.1mm
  nurbskin fit pot.ply -o pot.step --report pot.html
  nurbskin fit rows.txt --grid 29x13 --method interpolate --rarefy off
  nurbskin fit scans/*.ply --output-dir out/ --report .html",
    after_long_help = "\
Examples:
  nurbskin fit face.ply                      writes face.step
  nurbskin fit pot.ply -o pot.step -o pot.igs -t 0.1mm
  nurbskin fit pot.ply -o pot.step --report pot.html
  nurbskin fit rows.txt --grid 29x13 --method interpolate --rarefy off
  nurbskin fit scans/*.ply --output-dir out/ --report .html

Verdict: the worst of four: the deviation against the tolerance, the quality check of the CAD file, the part of the scan that is covered, and the sanity of units and sizes.

Exit status: 0 `pass`, or no tolerance given and nothing amiss; 1 an error, nothing written; 2 wrong usage; 3 written, but `fail` or `cannot tell`. Of several scans it is the worst: 1 if one could not be fitted (the others are written), else 3 if one did not pass, else 0."
)]
pub(crate) struct Fit {
    /// Scans to fit; `-` reads standard input
    ///
    /// PLY, STL, OBJ, OFF, PCD, PTX, E57, LAS, LAZ, NPY, XYZ, ASC, TXT, CSV, PTS, VTK and VTP, any of them also with .gz.
    #[arg(required = true, value_name = "SCAN")]
    pub(crate) scans: Vec<PathBuf>,

    /// File to write; may be repeated [default: SCAN with .step]
    ///
    /// The format follows the extension: .step, .stp, .igs and .iges hold the trimmed surface; .stl, .obj, .ply and .glb
    /// triangles within a tenth of the tolerance. `-` writes to standard output. A file named here is replaced if it is
    /// there already; a default one never is without --force.
    #[arg(short, long, value_name = "OUT", help_heading = OUTPUT)]
    pub(crate) output: Vec<PathBuf>,
    /// Folder for the STEP files and reports of several scans, each named after its scan
    #[arg(long, value_name = "DIR", conflicts_with = "output", help_heading = OUTPUT)]
    pub(crate) output_dir: Option<PathBuf>,
    /// Replace existing files that were not named with -o
    #[arg(long, help_heading = OUTPUT)]
    pub(crate) force: bool,
    /// Format of standard output, for `-o -` [default: step]
    #[arg(long, value_name = "FORMAT", help_heading = OUTPUT, value_parser = surface_format())]
    pub(crate) to: Option<String>,
    /// Deviation report; may be repeated: .html, .json or .csv
    ///
    /// .html is one page with the surface and its deviation in 3-D that works offline; .json has the figures, .csv a line
    /// for each record of the file, with the deviation of its point and whether it was used. The extension alone, as
    /// `.html`, names the report after the scan; of several scans each gets one.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(crate) report: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) heading: Heading,
    /// Write the scanned points into the CAD file, too
    ///
    /// They are on a level (IGES) or in a geometric set (STEP) of their own.
    #[arg(long, help_heading = OUTPUT)]
    pub(crate) with_points: bool,
    /// Application protocol of STEP files [default: ap214]
    #[arg(long, value_parser = named::<Schema>(), default_value = "ap214", hide_default_value = true, value_name = "SCHEMA", help_heading = OUTPUT)]
    pub(crate) step_schema: Schema,
    /// Numbers and packing of IGES files [default: exact]
    #[arg(long, value_parser = named::<Layout>(), default_value = "exact", hide_default_value = true, value_name = "LAYOUT", help_heading = OUTPUT)]
    pub(crate) iges_layout: Layout,
    /// Author, for the header of STEP and IGES files
    #[arg(long, value_name = "NAME", help_heading = OUTPUT)]
    pub(crate) author: Option<String>,
    /// Organization, for the header of STEP and IGES files
    #[arg(long, value_name = "NAME", help_heading = OUTPUT)]
    pub(crate) organization: Option<String>,

    /// Largest distance allowed between scan and surface
    ///
    /// `0.05mm`, `20um`, `2thou`, `0.1%` of the diagonal of the scan's box, or a bare number in the scan's unit. Without
    /// it the fit goes on while more control points pay, and no verdict on the deviation is given.
    #[arg(short, long, value_name = "LENGTH", allow_hyphen_values = true, help_heading = TOLERANCE)]
    pub(crate) tolerance: Option<Length>,
    /// Share of the points that must be within the tolerance [default: 99.5%, ordered scans 100%]
    ///
    /// `99.5%` or `0.995`. Whatever the share, no region of the surface may be biased to one side.
    #[arg(long, value_name = "SHARE", requires = "tolerance", allow_hyphen_values = true, value_parser = share, help_heading = TOLERANCE)]
    pub(crate) within: Option<f64>,
    /// Share of the surface's area that must have scan data under it [default: none]
    #[arg(long, value_name = "SHARE", allow_hyphen_values = true, value_parser = share, help_heading = TOLERANCE)]
    pub(crate) min_coverage: Option<f64>,
    /// Largest number of control points
    ///
    /// The fit returns the best surface of that size or smaller, and the verdict says whether it keeps the tolerance.
    /// [default: 20000 with -t; without -t 5000 for scans that are not ordered]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(4..), help_heading = TOLERANCE)]
    pub(crate) max_control_points: Option<u64>,
    /// Share of the points kept out of the fit, as a test [default: 0]
    ///
    /// Every k-th point is kept out and its deviation reported apart. From 0 to 0.5.
    #[arg(long, value_name = "FRACTION", default_value_t = 0.0, hide_default_value = true, allow_hyphen_values = true, value_parser = fraction, help_heading = TOLERANCE)]
    pub(crate) hold_out: f64,

    /// One surface, or a network of faces [default: auto]
    #[arg(long, value_parser = named::<FaceLayout>(), default_value = "auto", hide_default_value = true, help_heading = SURFACE)]
    pub(crate) layout: FaceLayout,
    /// Feature lines that stay sharp in a network [default: auto]
    ///
    /// `auto` keeps lines at which the surface bends by more than 40 degrees, `30` those of more than 30 degrees, `off` none.
    #[arg(long, value_name = "DEGREES|auto|off", value_parser = sharp, default_value = "auto", hide_default_value = true, help_heading = SURFACE)]
    pub(crate) sharp: Sharp,
    /// Shape of a single surface [default: auto]
    #[arg(long, value_parser = named::<TopologyName>(), default_value = "auto", hide_default_value = true, help_heading = SURFACE)]
    pub(crate) topology: TopologyName,
    /// Degree in u and v
    #[arg(long, value_name = "P[,Q]", default_value = "3", value_parser = degree, help_heading = SURFACE)]
    pub(crate) degree: [usize; 2],
    /// How the surface meets the points [default: auto]
    #[arg(long, value_parser = named::<Method>(), default_value = "auto", hide_default_value = true, help_heading = SURFACE)]
    pub(crate) method: Method,
    /// Where the surface ends [default: auto]
    #[arg(long, value_parser = named::<Trim>(), default_value = "auto", hide_default_value = true, help_heading = SURFACE)]
    pub(crate) trim: Trim,

    /// The scan is ordered: N rows, each of M points
    ///
    /// Rows follow each other along v, the points of a row along u.
    #[arg(long, value_name = "MxN", value_parser = counts, help_heading = ORDERED)]
    pub(crate) grid: Option<[usize; 2]>,
    /// Parameters for interpolation [default: auto]
    #[arg(long, value_parser = named::<ParametersName>(), default_value = "auto", hide_default_value = true, help_heading = ORDERED)]
    pub(crate) parameters: ParametersName,
    /// Which lines of points are kept for interpolation [default: auto]
    ///
    /// `auto` keeps the fewest lines with which all points are within the tolerance; `off` keeps all; `20` or `12,18` keeps
    /// a line where a normal has turned by that many degrees (for u and v) since the last one; `18x18` keeps that many.
    #[arg(long, value_name = "DEGREES|MxN|auto|off", default_value = "auto", hide_default_value = true, help_heading = ORDERED)]
    pub(crate) rarefy: Rarefaction,
    /// Catmull-Clark levels that densify a sparse grid first [default: 0]
    #[arg(long, value_name = "LEVELS", default_value_t = 0, hide_default_value = true, value_parser = clap::value_parser!(u8).range(0..=6), help_heading = ORDERED)]
    pub(crate) enrich: u8,

    #[command(flatten)]
    pub(crate) unit: InputUnit,
    /// Format of the scan [default: from its extension, else from its content]
    #[arg(long, value_name = "FORMAT", value_parser = super::words::scan_format(), help_heading = INPUT)]
    pub(crate) from: Option<String>,
    /// Has no effect: nothing in a fit is random.
    #[arg(long, value_name = "N", hide = true)]
    pub(crate) seed: Option<u64>,
}

impl Fit {
    /// The options of the library that these words mean.
    pub(crate) fn options(&self) -> Options {
        let count = |n: u64| usize::try_from(n).unwrap_or(usize::MAX);
        Options {
            input: InputOptions {
                grid: self.grid,
                unit: self.unit.unit,
            },
            surfacing: SurfacingOptions {
                tolerance: self.tolerance,
                within: self.within,
                layout: self.layout,
                sharp: self.sharp,
                method: self.method,
                topology: self.topology,
                degree: self.degree,
                parameters: self.parameters,
                rarefy: self.rarefy,
                enrich: usize::from(self.enrich),
                max_control_points: self.max_control_points.map(count),
                trim: self.trim,
                hold_out: self.hold_out,
                ..SurfacingOptions::default()
            },
            min_coverage: self.min_coverage,
            output: OutputOptions {
                step_schema: self.step_schema,
                iges_layout: self.iges_layout,
                with_points: self.with_points,
                reports: self.report.clone(),
                command: Some(command_line()),
                heading: self.heading.given(),
                author: self.author.clone().unwrap_or_default(),
                organization: self.organization.clone().unwrap_or_default(),
                time: None,
            },
        }
    }
}
