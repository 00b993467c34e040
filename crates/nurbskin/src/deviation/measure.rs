//! The deviation of every point of a scan from a surface.
//!
//! Each distance comes from a certified closest-point search, with a guaranteed lower and upper bound. The sign follows
//! the outward normal at the foot point. Statistics use the upper bounds.

use glam::{DVec2, DVec3};
pub use nurbskin_cad::Place;
use nurbskin_cad::{ClosestOnModel, ModelFoot};
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::nurbs::closest::{ClosestPoint, Foot};
use nurbskin_geometry::progress::Progress;
use nurbskin_scan::Reason;
use serde::{Deserialize, Serialize};

/// Which side of the surface counts as outside, where deviations are positive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outside {
    /// The side of the normal dS/du x dS/dv.
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
    /// Upper bound of the distance: the distance to the foot point.
    pub upper: f64,
    /// 1 outside and on the surface, -1 inside.
    pub side: f64,
    /// Parameter u of the foot point.
    pub u: f64,
    /// Parameter v of the foot point.
    pub v: f64,
    /// Index of the face of the foot point.
    pub face: u32,
    /// Whether the foot point lies on a free boundary.
    pub place: Place,
}

impl PointDeviation {
    /// The signed deviation: the upper bound, positive outside.
    #[must_use]
    pub fn signed(&self) -> f64 {
        self.side * self.upper
    }
}

/// A point of the file that is not used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unused {
    /// Its index in the scan.
    pub index: u32,
    /// The point, minus the origin of the scan.
    pub point: DVec3,
    /// Why it is not used.
    pub reason: Reason,
    /// Its deviation; `None` for a point that is not finite.
    pub deviation: Option<PointDeviation>,
}

/// Statistics of deviations; lengths in the unit of the points. All zero without points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Number of points.
    pub count: usize,
    /// Largest distance.
    pub max: f64,
    /// Mean distance, the mean of the unsigned deviations.
    pub mean: f64,
    /// Root mean square of the distances.
    pub rms: f64,
    /// Median distance.
    pub p50: f64,
    /// 95th percentile of the distance.
    pub p95: f64,
    /// 99th percentile of the distance.
    pub p99: f64,
    /// Smallest signed deviation.
    pub signed_min: f64,
    /// Largest signed deviation.
    pub signed_max: f64,
    /// Mean of the signed deviations; zero if the deviations to both sides balance.
    pub signed_mean: f64,
    /// Standard deviation of the signed deviations about their mean.
    pub signed_std: f64,
    /// Share (0..=1) of the points with a distance within the tolerance; `None` without a tolerance or without points.
    pub within_tolerance: Option<f64>,
    /// Number of points farther outside than the tolerance; `None` without a tolerance or without points.
    #[serde(default)]
    pub above_tolerance: Option<usize>,
    /// Number of points farther inside than the tolerance; `None` without a tolerance or without points.
    #[serde(default)]
    pub below_tolerance: Option<usize>,
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
        let tolerance = tolerance.into();
        let within_tolerance = tolerance.map(within);
        let beyond = |side: f64| {
            let limit = tolerance?;
            let far = points.iter().filter(|p| p.side * side > 0.0);
            Some(far.filter(|p| p.upper > limit).count())
        };
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
            above_tolerance: beyond(1.0),
            below_tolerance: beyond(-1.0),
        }
    }

    /// The statistics of the points of each of `faces` faces, by the face of the foot point. O(n).
    #[must_use]
    pub fn by_face(points: &[PointDeviation], faces: usize, tolerance: Option<f64>) -> Vec<Self> {
        let mut of_face = vec![Vec::new(); faces];
        for point in points {
            if let Some(list) = of_face.get_mut(point.face as usize) {
                list.push(*point);
            }
        }
        let all = of_face.iter();
        all.map(|points| Self::new(points, tolerance)).collect()
    }
}

/// The deviation of a scan from a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Deviation {
    /// One per point, in the order of the points.
    pub points: Vec<PointDeviation>,
    /// Over all points: `scan_to_surface` of the JSON contract.
    pub statistics: Statistics,
    /// Over the points with the foot point on a free boundary, which `statistics` includes: `free_edges` of the
    /// contract.
    pub free_edges: Statistics,
}

/// The certified deviation of every point: the distance to the nearest point of the entire surface. `starts` are
/// approximate foot points where known (the parameters of a fit); they save time and do not change the result.
///
/// About a microsecond per point and core; the result does not depend on the number of threads. Reports to `progress`
/// every thousand points.
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

/// The certified deviation of every point from the trimmed faces of a model, edges and corners included. Positive on
/// the outward side of the nearest face. `starts` are faces and approximate foot points, where known.
///
/// About a microsecond per point and core near a bicubic face; the result does not depend on the number of threads.
/// Reports to `progress` every thousand points. A model without faces gives an empty result.
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
    /// The deviation with the statistics of these points.
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

/// With the outward normal.
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
