//! Everything that can be asked of a fit, by stage.

use crate::surfacing::SurfacingOptions;
use nurbskin_cad::io::Timestamp;
use nurbskin_cad::io::iges::write::Layout;
use nurbskin_cad::io::step::Schema;
use nurbskin_geometry::unit::Unit;
use std::path::PathBuf;

/// Everything asked of a fit. `Default` asks nothing: every choice is made from the data.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// What the file does not say of itself.
    pub input: InputOptions,
    /// The surfaces: tolerance, way of fitting, degrees, trimming.
    pub surfacing: SurfacingOptions,
    /// Share (0 to 1) of the surface's area that must have data under it; not asked where absent.
    pub min_coverage: Option<f64>,
    /// The files.
    pub output: OutputOptions,
}

/// What the file of a scan does not say of itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InputOptions {
    /// Unit of the scan's numbers; from the file, else millimetres, where absent.
    pub unit: Option<Unit>,
    /// The input lists N rows, each of M points along u: `[M, N]`.
    pub grid: Option<[usize; 2]>,
}

/// How the files are written.
#[derive(Clone, Debug, Default)]
pub struct OutputOptions {
    /// Application protocol of STEP files.
    pub step_schema: Schema,
    /// Packing of IGES files.
    pub iges_layout: Layout,
    /// Whether the scan's points go into the IGES file, on a level of their own.
    pub with_points: bool,
    /// Who made the surface, for the headers of CAD files; may be empty.
    pub author: String,
    /// The author's organisation, for the same headers; may be empty.
    pub organization: String,
    /// The date in the headers of CAD files; [`Timestamp::now`] where absent. Give one to all fits of a run.
    pub time: Option<Timestamp>,
    /// Files to write besides the surface: `.html`, `.json` or `.csv`.
    pub reports: Vec<PathBuf>,
    /// The command line, to be told in a page of HTML.
    pub command: Option<String>,
}
