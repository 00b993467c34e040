//! Options for the surfaces of a scan.
//!
//! Every field of [`SurfacingOptions`] has a default with which the choice is made from the data.

use nurbskin_fit::chart::Topology;
use nurbskin_fit::fit::interpolate::parameters::Parameterization;
use nurbskin_geometry::unit::Unit;
use nurbskin_network::layout::lines::Sharp;
use serde::{Deserialize, Serialize};

/// A length as the user gives it. It parses from text: see its [`FromStr`](#impl-FromStr-for-Length).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Length {
    /// In the unit of the scan or model it refers to.
    Plain(f64),
    /// In a unit of its own.
    In(f64, Unit),
    /// A share of the diagonal of the scan or model: 0.001 is 0.1 %.
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

impl Method {
    /// `auto`, `interpolate` or `approximate`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Interpolate => "interpolate",
            Self::Approximate => "approximate",
        }
    }
}

/// How a dense ordered scan is thinned before it is interpolated.
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
    /// It does: regions without a scan under them are cut off, except gaps narrower than three spacings and, on a
    /// closed surface, gaps that make up 2.5 % of it at most; it stays closed.
    #[default]
    Auto,
    /// The same, and closed surfaces are cut open, too.
    Always,
    /// It ends at the sides of its parameter rectangle.
    Off,
}

/// Whether a part becomes one surface or a network of faces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FaceLayout {
    /// One surface where it can be the object and meets the tolerance, else a network.
    #[default]
    Auto,
    /// One surface: an open sheet, a tube, a sphere or a torus.
    Single,
    /// A watertight network of four-sided faces, for any shape.
    Network,
}

impl FaceLayout {
    /// `auto`, `single` or `network`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Single => "single",
            Self::Network => "network",
        }
    }
}

/// Options for the surfaces of a scan. With `Default`, every choice is made from the data.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfacingOptions {
    /// Largest distance allowed between scan and surface. `None`: the fit aims at the tolerance that the noise of the
    /// scan allows.
    pub tolerance: Option<Length>,
    /// Share (0 to 1) of the points that must be within the tolerance. Where absent, 1 for ordered points and 0.995 for
    /// clouds, meshes and range images.
    pub within: Option<f64>,
    /// One surface for a part, or a network of faces.
    pub layout: FaceLayout,
    /// Which edges of the scan stay sharp in a network.
    pub sharp: Sharp,
    /// Interpolate or approximate.
    pub method: Method,
    /// The topology; `None`: found from the data.
    pub topology: Option<Topology>,
    /// Degrees along u and v.
    pub degree: [usize; 2],
    /// Parameterization for interpolation; the better of chord length and uniform where absent.
    pub parameters: Option<Parameterization>,
    /// Rarefaction of dense ordered scans.
    pub rarefy: Rarefaction,
    /// Catmull-Clark levels for sparse ordered scans.
    pub enrich: usize,
    /// The budget of control points.
    pub max_control_points: Option<usize>,
    /// Whether the surface ends where the scan does.
    pub trim: Trim,
    /// Whether a scan that cannot be fitted in its order is refused, instead of being fitted as a cloud.
    pub keeps_order: bool,
    /// Fraction of the points that is excluded from the fit and reported separately.
    pub hold_out: f64,
}

impl Default for SurfacingOptions {
    fn default() -> Self {
        Self {
            tolerance: None,
            within: None,
            layout: FaceLayout::Auto,
            sharp: Sharp::Auto,
            method: Method::Auto,
            topology: None,
            degree: [3, 3],
            parameters: None,
            rarefy: Rarefaction::Auto,
            enrich: 0,
            max_control_points: None,
            trim: Trim::Auto,
            keeps_order: false,
            hold_out: 0.0,
        }
    }
}
