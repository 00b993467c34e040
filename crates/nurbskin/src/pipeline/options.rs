//! Everything that can be asked of a fit.

use nurbskin_cad::io::Timestamp;
use nurbskin_cad::io::iges::write::Layout;
use nurbskin_cad::io::step::Schema;
use nurbskin_fit::chart::Topology;
use nurbskin_fit::fit::interpolate::parameters::Parameterization;
use nurbskin_geometry::unit::Unit;
use std::path::PathBuf;

/// A length as the user says it. It parses from text: see its [`FromStr`](#impl-FromStr-for-Length).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Length {
    /// In the unit of the scan or model that it is said of.
    Plain(f64),
    /// In a unit of its own.
    In(f64, Unit),
    /// A share of the diagonal of what it is said of: 0.001 is 0.1 %.
    OfDiagonal(f64),
}

impl Length {
    /// The length in `unit`, the unit of a scan or model whose bounding box has this diagonal, in the same unit.
    ///
    /// ```
    /// use nurbskin::{Unit, pipeline::Length};
    /// assert_eq!(Length::In(0.5, Unit::Inch).resolve(Unit::Millimetre, 200.0), 12.7);
    /// assert_eq!(Length::OfDiagonal(0.001).resolve(Unit::Millimetre, 200.0), 0.2);
    /// ```
    #[must_use]
    pub fn resolve(self, unit: Unit, diagonal: f64) -> f64 {
        match self {
            Self::Plain(value) => value,
            Self::In(value, own) => value * own.millimetres() / unit.millimetres(),
            Self::OfDiagonal(share) => share * diagonal,
        }
    }
}

/// How the surface meets the points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Interpolation where the scan is ordered and its noise small against the tolerance, else approximation.
    #[default]
    Auto,
    /// The paper's: through every kept point.
    Interpolate,
    /// Least squares within the tolerance, with the fewest control points.
    Approximate,
}

/// What becomes of a dense ordered scan before it is interpolated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Rarefaction {
    /// The fewest grid lines with which every point, kept or discarded, is within the tolerance.
    #[default]
    Auto,
    /// Every point is kept.
    Off,
    /// The paper's rule: a line is kept when a normal has turned by more than this since the last kept one; degrees
    /// along u and v.
    Threshold([f64; 2]),
    /// The paper's rule with the thresholds at which this many lines remain.
    Counts([usize; 2]),
}

/// Whether the surface ends where the scan does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Trim {
    /// It does: what has no scan under it is cut off, but for gaps narrower than three spacings; and but for those of a
    /// closed surface that make up 2.5 % of it at most, which stays closed.
    #[default]
    Auto,
    /// The same, and closed surfaces are cut open, too.
    Always,
    /// It ends at the sides of its parameter rectangle.
    Off,
}

/// Everything asked of a fit. `Default` asks nothing: every choice is made from the data.
#[derive(Clone, Debug)]
pub struct Options {
    /// Largest distance allowed between scan and surface. Where absent, the fit aims at what the scan's noise can carry,
    /// and the deviation is not judged.
    pub tolerance: Option<Length>,
    /// Share (0 to 1) of the points that must be within the tolerance. Where absent, 1 for ordered points and 0.995 for
    /// clouds, meshes and range images.
    pub within: Option<f64>,
    /// Share (0 to 1) of the surface's area that must have data under it; not asked where absent.
    pub min_coverage: Option<f64>,
    /// Interpolate or approximate.
    pub method: Method,
    /// The topology, where it is not to be found from the data.
    pub topology: Option<Topology>,
    /// Degrees along u and v.
    pub degree: [usize; 2],
    /// Parameterization for interpolation; the better of chord length and uniform where absent.
    pub parameters: Option<Parameterization>,
    /// The input lists N rows, each of M points along u: `[M, N]`.
    pub grid: Option<[usize; 2]>,
    /// Rarefaction of dense ordered scans.
    pub rarefy: Rarefaction,
    /// Catmull-Clark levels for sparse ordered scans.
    pub enrich: usize,
    /// The budget of control points.
    pub max_control_points: Option<usize>,
    /// Whether the surface ends where the scan does.
    pub trim: Trim,
    /// Unit of the scan's numbers; from the file, else millimetres, where absent.
    pub unit: Option<Unit>,
    /// Fraction of the points kept out of the fit and reported apart.
    pub hold_out: f64,
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

impl Default for Options {
    fn default() -> Self {
        Self {
            tolerance: None,
            within: None,
            min_coverage: None,
            method: Method::Auto,
            topology: None,
            degree: [3, 3],
            parameters: None,
            grid: None,
            rarefy: Rarefaction::Auto,
            enrich: 0,
            max_control_points: None,
            trim: Trim::Auto,
            unit: None,
            hold_out: 0.0,
            step_schema: Schema::default(),
            iges_layout: Layout::Exact,
            with_points: false,
            author: String::new(),
            organization: String::new(),
            time: None,
            reports: Vec::new(),
            command: None,
        }
    }
}
