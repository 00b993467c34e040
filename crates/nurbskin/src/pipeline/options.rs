//! All options of a fit, by stage.
//!
//! Front ends build an [`Options`] from their arguments. Every field has a default, so that `Options::default()` leaves
//! every choice to the data.

use crate::report::Heading;
use crate::surfacing::SurfacingOptions;
use nurbskin_cad::io::Timestamp;
use nurbskin_cad::io::iges::write::Layout;
use nurbskin_cad::io::step::Schema;
use nurbskin_geometry::unit::Unit;
use std::path::PathBuf;

/// Options of a fit. `Default` leaves every choice to the data.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Unit and order of the scan.
    pub input: InputOptions,
    /// The surfaces: tolerance, method, degrees, trimming.
    pub surfacing: SurfacingOptions,
    /// Required share (0 to 1) of the surface's area with data; no requirement if absent.
    pub min_coverage: Option<f64>,
    /// The files.
    pub output: OutputOptions,
}

/// Properties of the scan that its file may lack.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InputOptions {
    /// Unit of the scan's numbers; if absent, that of the file, else millimetres.
    pub unit: Option<Unit>,
    /// The input lists N rows, each of M points along u: `[M, N]`.
    pub grid: Option<[usize; 2]>,
}

/// Options of the writers.
#[derive(Clone, Debug, Default)]
pub struct OutputOptions {
    /// Application protocol of STEP files.
    pub step_schema: Schema,
    /// Packing of IGES files.
    pub iges_layout: Layout,
    /// Whether the IGES file contains the scan's points, on a separate level.
    pub with_points: bool,
    /// Author of the surface, for the headers of CAD files; may be empty.
    pub author: String,
    /// The author's organisation, for the same headers; may be empty.
    pub organization: String,
    /// The date in the headers of CAD files and on the HTML page; [`Timestamp::now`] if absent. Use one date for all fits of a run.
    pub time: Option<Timestamp>,
    /// Reports to write besides the surface: `.html`, `.json` or `.csv`.
    pub reports: Vec<PathBuf>,
    /// The command line, for the HTML page.
    pub command: Option<String>,
    /// Title and notes of the HTML page.
    pub heading: Heading,
}
