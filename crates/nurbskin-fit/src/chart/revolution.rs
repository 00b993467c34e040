//! Surfaces of revolution: the axis, the profile, and the sector that a scan covers.
//!
//! All normal lines of a surface of revolution meet its axis, which a linear complex through them determines (Pottmann
//! and Wallner 2001). Points turned into one half plane (radius, height) lie on the profile and are ordered along it by
//! a walk. Axis and profile are then refined together by the distances of the points, by variable projection (Golub and
//! Pereyra 1973).
//!
//! Whether the scan *is* a surface of revolution is decided later, by the residuals
//! ([`fit::revolution`](crate::fit::revolution)).

mod axis;
mod ends;
mod profile;
mod refine;
mod sector;
mod trace;

pub use axis::Axis;
pub use profile::{ProfileCurve, ProfileEnd};
pub use sector::Sector;

pub(crate) use axis::Sample;
pub(crate) use profile::{Target, knots_over};

use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{DVec2, DVec3, Result};
use rayon::prelude::*;
use refine::{Fitted, refine};
use trace::{Meridian, Trace, trace};

/// Most points that recognition uses; of more it takes a sample. Guard: bounds its time to about 0.1 s.
pub(crate) const RECOGNITION_POINTS: usize = 20_000;
/// Fewest points with normals that determine a profile. Trial: not recorded.
const MIN_POINTS: usize = 60;
/// Largest median distance by which normal lines may miss the axis, in extents (root mean square distances from the
/// middle): about 10 degrees at the mean distance. Trial: not recorded. A smaller one refuses noisy normals, a larger
/// one accepts shapes without an axis.
const MAX_AXIS_MISS: f64 = 0.2;
/// Largest share of the points that may lie off the ordered profile. Trial: not recorded. A smaller one refuses scans
/// with outliers, a larger one takes parts that are no surface of revolution.
const MAX_OFF_PROFILE: f64 = 0.06;
/// Smallest scale of the robust weights, in steps, since a dense profile is off by about as much where it bends. Trial:
/// without it, points of sharp bends of clean scans were rejected as outliers; the data are not recorded.
const MIN_ROBUST_SCALE: f64 = 0.05;
/// Steps of the walk along the profile that are tried in turn, as factors of the step that the density of the points
/// suggests. Trial: not recorded.
const STEP_FACTORS: [f64; 3] = [1.0, 0.6, 1.6];
/// Most spans of the profile during recognition. Trial: 80 in an earlier version; the data are not recorded. Fewer blur
/// fine profiles, more cost time.
const MAX_PROFILE_SPANS: f64 = 160.0;
/// Fewest spans of the profile during recognition. Guard: a periodic cubic needs four control points of its own.
const MIN_PROFILE_SPANS: f64 = 4.0;
/// Spans of the profile per step of the walk. Trial: not recorded; each span then holds two steps, with some 24 points
/// each.
const SPANS_PER_STEP: f64 = 0.5;
/// Points of the sample that a step of the walk holds in the mean. Trial: not recorded. Fewer make local means noisy,
/// more cut corners of the profile.
const POINTS_PER_STEP: f64 = 24.0;
/// Shortest step of the walk, in sigma of the noise, so that the walk does not turn with the noise. Trial: not
/// recorded.
const STEP_PER_NOISE: f64 = 5.0;
/// Largest robust standard deviation from a sphere that makes a scan a sphere: in sigma of the noise, or in radii if
/// that is more. Trial: not recorded.
const SPHERE_SIGMA: [f64; 2] = [2.0, 2e-4];
/// Passes of ordering and refining, each with the axis of the one before. Trial: not recorded.
const ORDERING_PASSES: usize = 2;
/// Squared length of the part of a unit normal in the half plane through the axis, above which it gives the direction
/// of the profile. Trial: not recorded; it is cos² 60°, so that normals at most 60 degrees off the half plane count.
const MIN_MERIDIAN_NORMAL: f64 = 0.25;

/// A recognised surface of revolution: an axis, a profile about it, and the sector covered.
#[derive(Clone, Debug)]
pub struct Revolution {
    /// The axis.
    pub axis: Axis,
    /// A dense profile over its length in the scan's unit. It runs so that the surface normal points as most normals of
    /// the scan do.
    pub profile: ProfileCurve,
    /// How the profile begins and ends.
    pub ends: [ProfileEnd; 2],
    /// The sector covered.
    pub sector: Sector,
    /// Robust standard deviation of the points about it.
    pub sigma: f64,
    /// Whether the sides of the normals were used.
    pub oriented: bool,
    /// The step in which the profile was ordered. Points farther from it than a few steps are not on the surface.
    pub step: f64,
    /// Whether the points form a sphere, whose axis was chosen to suit the scanned part.
    pub sphere: bool,
    /// The ordered profile.
    trace: Trace,
}

/// The result of [`recognise`].
#[derive(Clone, Debug)]
pub enum Recognition {
    /// An axis and a profile were found; the residuals of the points are still to be tested.
    Found(Box<Revolution>),
    /// There is no axis or no profile, with the reason.
    None(String),
}

/// Finds an axis of revolution and the profile about it from at most 20 000 of the points. `normals` are unit vectors
/// or zero, `spacing` and `noise` as of [`CleanScan`](nurbskin_scan::CleanScan). The estimate is robust to outliers and
/// does not depend on the order of the points. About 0.1 s.
///
/// # Errors
/// [`Error::Cancelled`](nurbskin_geometry::Error::Cancelled) if `progress` cancels.
pub fn recognise(
    points: &[DVec3],
    normals: &[DVec3],
    spacing: f64,
    noise: f64,
    progress: &dyn Progress,
) -> Result<Recognition> {
    let sample = Sample::new(points, normals, RECOGNITION_POINTS);
    let (found, _) = look(&sample, points.len(), spacing, noise, true, progress)?;
    Ok(found)
}

/// As [`recognise`], for at most 20 000 points of a sample that was drawn from `of_points`; also whether they form a
/// sphere. Spheres are only recognised if `spheres`; otherwise a sphere gets the axis of its normals.
pub(crate) fn look(
    sample: &Sample,
    of_points: usize,
    spacing: f64,
    noise: f64,
    spheres: bool,
    progress: &dyn Progress,
) -> Result<(Recognition, bool)> {
    let sample = Sample::new(&sample.points, &sample.normals, RECOGNITION_POINTS);
    let thinned = spacing * (of_points as f64 / sample.points.len().max(1) as f64).sqrt();
    let thinned = thinned.max(spacing);
    if sample.points.len() < MIN_POINTS {
        return none(format!(
            "{} points with normals are too few to tell a profile",
            sample.points.len()
        ));
    }
    // 1. The axis from the normals.
    progress.check()?;
    let Some((mut axis, missed)) = axis::axis_of_normals(&sample) else {
        return none("the normals determine no axis");
    };
    let mut turn = true;
    if spheres
        && let Some((centre, radius, sigma)) = axis::sphere(&sample)
        && sigma <= (SPHERE_SIGMA[0] * noise).max(SPHERE_SIGMA[1] * radius)
    {
        (axis, turn) = (axis::axis_of_sphere(&sample, centre), false);
    } else if missed > MAX_AXIS_MISS {
        return none(format!(
            "the normals miss every axis, the best one by {missed:.2} extents in the median"
        ));
    }
    // 2. Order the profile and refine; repeat with the better axis.
    let mut found: Option<Found> = None;
    for _ in 0..ORDERING_PASSES {
        progress.check()?;
        match Found::new(&sample, axis, thinned, noise, turn)? {
            Ok(next) => {
                axis = next.fitted.axis;
                found = Some(next);
            }
            Err(why) => return Ok((Recognition::None(why), !turn)),
        }
    }
    let Some(found) = found else {
        return none("there is no profile");
    };
    let found = found.revolution(&sample, thinned, !turn);
    Ok((Recognition::Found(Box::new(found)), !turn))
}

fn none(why: impl Into<String>) -> Result<(Recognition, bool)> {
    Ok((Recognition::None(why.into()), false))
}

/// Points and normals turned into the half plane.
fn meridian(axis: &Axis, points: &[DVec3], normals: &[DVec3]) -> Meridian {
    let all = points.iter().zip(normals);
    let (points, normals) = all.map(|(&p, &n)| turned(axis, p, n)).unzip();
    Meridian { points, normals }
}

/// A point and its normal turned into the half plane. A normal far from the half plane gives no direction of the
/// profile and becomes zero.
fn turned(axis: &Axis, p: DVec3, n: DVec3) -> (DVec2, DVec2) {
    let (height, across) = axis.split(p);
    let radius = across.length();
    let out = if radius > 0.0 {
        n.dot(across) / radius
    } else {
        0.0
    };
    let flat = DVec2::new(out, n.dot(axis.direction));
    let square = flat.length_squared();
    let flat = if square > MIN_MERIDIAN_NORMAL {
        flat / square.sqrt()
    } else {
        DVec2::ZERO
    };
    (DVec2::new(radius, height), flat)
}

/// One pass of ordering and refining.
struct Found {
    fitted: Fitted,
    trace: Trace,
    ends: [ProfileEnd; 2],
}

impl Found {
    fn new(
        sample: &Sample,
        axis: Axis,
        spacing: f64,
        noise: f64,
        turn: bool,
    ) -> Result<std::result::Result<Self, String>> {
        let flat = meridian(&axis, &sample.points, &sample.normals);
        // 1. A step holds enough points and is longer than the noise is wide.
        let mut radii: Vec<f64> = flat.points.iter().map(|q| q.x).collect();
        let radius = median_in_place(&mut radii);
        let n = sample.points.len() as f64;
        let length = n * spacing * spacing / (std::f64::consts::TAU * radius);
        let step = spacing
            .max(POINTS_PER_STEP * length / n)
            .max(STEP_PER_NOISE * noise);
        let mut best: Option<(f64, Vec<f64>, Trace)> = None;
        // Sides of the normals of a cloud may be wrong: walks that ignore them are tried last.
        for (oriented, tried) in [true, false]
            .into_iter()
            .flat_map(|o| STEP_FACTORS.map(|t| (o, t)))
        {
            if best
                .as_ref()
                .is_some_and(|(lost, _, _)| *lost <= MAX_OFF_PROFILE)
            {
                break;
            }
            if let Some(trace) = trace(&flat, tried * step, oriented) {
                let s = trace.locate(&flat);
                let lost = s.iter().filter(|s| s.is_nan()).count() as f64 / n;
                if best.as_ref().is_none_or(|(b, _, _)| lost < *b) {
                    best = Some((lost, s, trace));
                }
            }
        }
        let Some((lost, s, mut trace)) = best else {
            return Ok(Err(
                "turned about the best axis, the points do not lie along one line".into(),
            ));
        };
        if lost > MAX_OFF_PROFILE {
            return Ok(Err(format!(
                "turned about the best axis, {:.1} % of the points lie off one profile line",
                100.0 * lost
            )));
        }
        // 2. Ends: on the axis, or at the outermost points.
        let (ends, before) = ends::finish(&mut trace, &flat, &s, spacing);
        // 3. Refine on a dense profile.
        let spans = (SPANS_PER_STEP * trace.length() / step)
            .clamp(MIN_PROFILE_SPANS, MAX_PROFILE_SPANS)
            .round();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most MAX_PROFILE_SPANS"
        )]
        let spans = spans as usize;
        let breaks: Vec<f64> = (0..=spans)
            .map(|k| trace.length() * k as f64 / spans as f64)
            .collect();
        let knots = knots_over(&breaks, trace.closed)?;
        let s = s.into_iter().map(|s| s + before).collect();
        let fitted = refine(sample, axis, &knots, s, ends, turn, MIN_ROBUST_SCALE * step)?;
        Ok(Ok(Self {
            fitted,
            trace,
            ends,
        }))
    }

    fn revolution(self, sample: &Sample, spacing: f64, sphere: bool) -> Revolution {
        let Fitted {
            axis,
            curve,
            weights,
            sigma,
            ..
        } = self.fitted;
        let on: Vec<DVec3> = sample
            .points
            .iter()
            .zip(&weights)
            .filter(|(_, w)| **w > 0.0)
            .map(|(&p, _)| p)
            .collect();
        Revolution {
            sector: sector::sector(&on, &axis, spacing),
            axis,
            profile: curve,
            ends: self.ends,
            sphere,
            sigma,
            oriented: self.trace.oriented,
            step: self.trace.step,
            trace: self.trace,
        }
    }
}

impl Revolution {
    /// For each point the parameter of its foot point on the profile, or NaN for a point that is not on it. O(points).
    #[must_use]
    pub fn locate(&self, points: &[DVec3], normals: &[DVec3]) -> Vec<f64> {
        self.for_each(points, normals, |_, q, s| {
            if s.is_finite() {
                self.profile.foot(q, s)
            } else {
                f64::NAN
            }
        })
    }
    /// Maps each point through `f`, which gets the point, the point turned into the half plane, and its approximate
    /// parameter along the profile (NaN for a point that is not on it). O(points).
    pub(crate) fn for_each<T: Send>(
        &self,
        points: &[DVec3],
        normals: &[DVec3],
        f: impl Fn(DVec3, DVec2, f64) -> T + Sync + Send,
    ) -> Vec<T> {
        let places = self.trace.places_of_all();
        let one = |(&p, &n): (&DVec3, &DVec3)| {
            let (q, m) = turned(&self.axis, p, n);
            f(p, q, places.of(q, m))
        };
        points.par_iter().zip(normals).map(one).collect()
    }
    /// Length of the profile, the end of its parameter.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.profile.knots().domain().1
    }
    /// Whether the profile is a closed section, as of a torus.
    #[must_use]
    pub fn closed(&self) -> bool {
        self.trace.closed
    }
}
