//! The deviation of every point of a scan from a surface.

use glam::{DVec2, DVec3};
pub use nurbskin_cad::Place;
use nurbskin_cad::{ClosestOnModel, ModelFoot};
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::nurbs::closest::{ClosestPoint, Foot};
use nurbskin_geometry::progress::Progress;
use serde::{Deserialize, Serialize};

/// Which side of the surface counts as outside, where deviations are positive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outside {
    /// The side that the normal dS/du x dS/dv points to.
    #[default]
    Normal,
    /// The other side.
    Opposite,
}

/// The deviation of one point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointDeviation {
    /// Certified lower bound of the distance to the surface.
    pub lower: f64,
    /// Upper bound of the distance: the distance to the foot.
    pub upper: f64,
    /// 1 outside and on the surface, -1 inside.
    pub side: f64,
    /// Parameter u of the foot.
    pub u: f64,
    /// Parameter v of the foot.
    pub v: f64,
    /// Index of the face that the foot lies on.
    pub face: u32,
    /// Whether the foot lies on a free border.
    pub place: Place,
}

impl PointDeviation {
    /// The signed deviation: the upper bound, positive outside.
    #[must_use]
    pub fn signed(&self) -> f64 {
        self.side * self.upper
    }
}

/// What many deviations amount to; lengths in the unit of the points. All zero for no points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Number of points.
    pub count: usize,
    /// Largest distance.
    pub max: f64,
    /// Mean distance: of the deviations without their signs.
    pub mean: f64,
    /// Root mean square of the distances.
    pub rms: f64,
    /// Median distance.
    pub p50: f64,
    /// Distance that 95 % of the points do not exceed.
    pub p95: f64,
    /// Distance that 99 % of the points do not exceed.
    pub p99: f64,
    /// Smallest signed deviation.
    pub signed_min: f64,
    /// Largest signed deviation.
    pub signed_max: f64,
    /// Mean of the signed deviations: zero where as much lies outside as inside.
    pub signed_mean: f64,
    /// Standard deviation of the signed deviations about their mean.
    pub signed_std: f64,
    /// Share (0..=1) of the points whose distance is the tolerance at most; `None` where no tolerance was asked for, or
    /// there are no points.
    pub within_tolerance: Option<f64>,
}

impl Statistics {
    /// The statistics of these deviations; the tolerance is a number or `None`. O(n).
    #[must_use]
    pub fn new(points: &[PointDeviation], tolerance: impl Into<Option<f64>>) -> Self {
        if points.is_empty() {
            return Self::default();
        }
        let count = points.len() as f64;
        let mut distances: Vec<f64> = points.iter().map(|p| p.upper).collect();
        let signed = || points.iter().map(PointDeviation::signed);
        let within = |tolerance: f64| {
            let inside = distances.iter().filter(|&&d| d <= tolerance).count();
            inside as f64 / count
        };
        let within_tolerance = tolerance.into().map(within);
        let signed_mean = signed().sum::<f64>() / count;
        let square = |d: f64| (d - signed_mean) * (d - signed_mean);
        Self {
            count: points.len(),
            max: distances.iter().copied().fold(0.0, f64::max),
            mean: distances.iter().sum::<f64>() / count,
            rms: (distances.iter().map(|d| d * d).sum::<f64>() / count).sqrt(),
            p50: quantile_in_place(&mut distances, 0.5),
            p95: quantile_in_place(&mut distances, 0.95),
            p99: quantile_in_place(&mut distances, 0.99),
            signed_min: signed().fold(f64::INFINITY, f64::min),
            signed_max: signed().fold(f64::NEG_INFINITY, f64::max),
            signed_mean,
            signed_std: (signed().map(square).sum::<f64>() / count).sqrt(),
            within_tolerance,
        }
    }
}

/// The deviation of a scan from a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Deviation {
    /// One per point, in the order of the points.
    pub points: Vec<PointDeviation>,
    /// Over all points: `scan_to_surface` of the JSON contract.
    pub statistics: Statistics,
    /// Over the points whose foot is on a free border, which `statistics` counts too: `free_edges` of the contract.
    pub free_edges: Statistics,
}

/// The deviation of every point, certified: every distance to the nearest point of the surface anywhere. `starts` are
/// places near the feet where they are known (a fit's own parameters); they save time and change nothing.
///
/// About a microsecond per point and core; the same for any number of threads. `progress` is told of every thousand
/// points done.
///
/// # Errors
/// [`Error::Cancelled`](nurbskin_geometry::Error::Cancelled).
///
/// ```
/// use nurbskin::{ControlNet, DVec3, KnotVector, NurbsSurface};
/// use nurbskin::deviation::measure::{Outside, measure};
/// use nurbskin::nurbs::closest::ClosestPoint;
/// use nurbskin::progress::Silent;
/// let net = ControlNet::from_fn(4, 4, |i, j| DVec3::new(i as f64, j as f64, 0.0))?;
/// let knots = KnotVector::uniform(3, 4)?;
/// let plane = ClosestPoint::new(&NurbsSurface::new(knots.clone(), knots, net, None)?)?;
/// let points = [DVec3::new(1.0, 1.0, 0.2), DVec3::new(2.0, 1.5, -0.1)];
/// let deviation = measure(&plane, &points, None, 0.15, Outside::Normal, &Silent)?;
/// assert!((deviation.statistics.signed_min + 0.1).abs() < 1e-12);
/// assert_eq!(deviation.statistics.within_tolerance, Some(0.5));
/// # Ok::<(), nurbskin::Error>(())
/// ```
pub fn measure(
    surface: &ClosestPoint,
    points: &[DVec3],
    starts: Option<&[DVec2]>,
    tolerance: impl Into<Option<f64>>,
    outside: Outside,
    progress: &dyn Progress,
) -> Result<Deviation> {
    let feet = surface.closest_all_with(points, starts, progress)?;
    let of = |(&point, foot): (&DVec3, &Foot)| {
        let place = if surface.on_free_edge(foot) {
            Place::FreeEdge
        } else {
            Place::Interior
        };
        let sense = if outside == Outside::Normal {
            1.0
        } else {
            -1.0
        };
        deviation_of(point, foot, sense * foot.normal, 0, place)
    };
    Ok(Deviation::new(
        points.iter().zip(&feet).map(of).collect(),
        tolerance,
    ))
}

/// The deviation of every point from the faces of a model as they are trimmed, edges and corners included; certified.
/// Positive on the outward side of the nearest face. `starts` are faces and places on them near the feet, where known.
///
/// About a microsecond per point and core near a bicubic face; the same for any number of threads. `progress` is told of
/// every thousand points done. No points at all come back from a model without faces.
///
/// # Errors
/// [`Error::Cancelled`](nurbskin_geometry::Error::Cancelled).
pub fn measure_model(
    model: &ClosestOnModel<'_>,
    points: &[DVec3],
    starts: Option<&[(usize, DVec2)]>,
    tolerance: impl Into<Option<f64>>,
    progress: &dyn Progress,
) -> Result<Deviation> {
    let of = |point: DVec3, found: &ModelFoot| {
        let face = u32::try_from(found.face).unwrap_or(u32::MAX);
        deviation_of(point, &found.foot, found.foot.normal, face, found.place)
    };
    let deviations = model.closest_all_as(points, starts, progress, of)?;
    Ok(Deviation::new(deviations, tolerance))
}

impl Deviation {
    /// With the statistics of these points.
    #[must_use]
    pub fn new(points: Vec<PointDeviation>, tolerance: impl Into<Option<f64>>) -> Self {
        let tolerance = tolerance.into();
        let on_edges = points.iter().filter(|p| p.place == Place::FreeEdge);
        let on_edges: Vec<PointDeviation> = on_edges.copied().collect();
        Self {
            statistics: Statistics::new(&points, tolerance),
            free_edges: Statistics::new(&on_edges, tolerance),
            points,
        }
    }
}

/// With the normal that points outwards.
fn deviation_of(
    point: DVec3,
    foot: &Foot,
    normal: DVec3,
    face: u32,
    place: Place,
) -> PointDeviation {
    let positive = normal.dot(point - foot.point) >= 0.0 || foot.distance <= 0.0;
    PointDeviation {
        lower: foot.lower,
        upper: foot.distance,
        side: if positive { 1.0 } else { -1.0 },
        u: foot.u,
        v: foot.v,
        face,
        place,
    }
}
