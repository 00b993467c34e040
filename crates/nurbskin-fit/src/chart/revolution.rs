//! Surfaces of revolution: the axis, the profile, and the sector that a scan covers.
//!
//! The axis comes from the normals, which all meet it; the points, turned into one half plane, are ordered along the
//! profile; then axis and profile are refined together by the distances of the points. Whether the scan *is* a surface
//! of revolution is not decided here but by what is left over ([`fit::revolution`](crate::fit::revolution)).

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

/// Points that are looked at, at most.
pub(crate) const POINTS: usize = 20_000;
/// Fewer points than this do not tell a profile.
const FEWEST: usize = 60;
/// Median of what normals miss the axis by, in extents, above which there is none: 10 degrees at the mean distance.
const MISSED: f64 = 0.2;
/// Part of the points that may lie off the ordered profile.
const ASTRAY: f64 = 0.06;
/// Part of a step by which a dense profile may be off where it bends.
const LEAST: f64 = 0.05;
/// Steps that are tried, in that of the points.
const TRIED: [f64; 3] = [1.0, 0.6, 1.6];
/// Most spans of the profile during recognition.
const SPANS: f64 = 160.0;

/// What was recognised: an axis, a profile about it, and the sector covered.
#[derive(Clone, Debug)]
pub struct Revolution {
    /// The axis.
    pub axis: Axis,
    /// A dense profile over its length in the scan's unit; runs so that its surface's normal looks as most normals do.
    pub profile: ProfileCurve,
    /// How the profile begins and ends.
    pub ends: [ProfileEnd; 2],
    /// The sector covered.
    pub sector: Sector,
    /// Robust standard deviation of the points about it.
    pub sigma: f64,
    /// Whether the normals' sides were of use.
    pub oriented: bool,
    /// The step in which the profile was ordered; points farther than a few of it are not on the surface.
    pub step: f64,
    /// Whether the points were taken for a sphere, whose axis was chosen by what of it was scanned.
    pub sphere: bool,
    /// The ordered profile.
    trace: Trace,
}

/// What [`recognise`] says.
#[derive(Clone, Debug)]
pub enum Recognition {
    /// An axis and a profile were found; whether the points agree is to be seen.
    Found(Box<Revolution>),
    /// There is none, and why.
    None(String),
}

/// Looks for an axis of revolution and the profile about it, in at most 20 000 of the points. `normals` are unit
/// vectors or zero, `spacing` and `noise` as of [`CleanScan`](nurbskin_scan::CleanScan). Outliers do no harm; the result
/// does not depend on the order of the points. About 0.1 s.
///
/// # Errors
/// [`Error::Cancelled`](nurbskin_geometry::Error::Cancelled) if `progress` says so.
pub fn recognise(
    points: &[DVec3],
    normals: &[DVec3],
    spacing: f64,
    noise: f64,
    progress: &dyn Progress,
) -> Result<Recognition> {
    let sample = Sample::new(points, normals, POINTS);
    let (found, _) = look(&sample, points.len(), spacing, noise, true, progress)?;
    Ok(found)
}

/// As [`recognise`], in at most 20 000 of a sample of so many points; and whether they were taken for a sphere, which
/// is only asked if `spheres`: else a sphere is given the axis of its normals.
pub(crate) fn look(
    sample: &Sample,
    of_points: usize,
    spacing: f64,
    noise: f64,
    spheres: bool,
    progress: &dyn Progress,
) -> Result<(Recognition, bool)> {
    let sample = Sample::new(&sample.points, &sample.normals, POINTS);
    let thinned = spacing * (of_points as f64 / sample.points.len().max(1) as f64).sqrt();
    let thinned = thinned.max(spacing);
    if sample.points.len() < FEWEST {
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
        && sigma <= (2.0 * noise).max(2e-4 * radius)
    {
        (axis, turn) = (axis::axis_of_sphere(&sample, centre), false);
    } else if missed > MISSED {
        return none(format!(
            "the normals miss every axis, the best one by {missed:.2} extents in the median"
        ));
    }
    // 2. Order the profile, refine, and again with the better axis.
    let mut found: Option<Found> = None;
    for _ in 0..2 {
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

/// A point and its normal turned into the half plane; a normal that does not lie in it tells nothing of the profile and
/// becomes zero.
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
    let flat = if square > 0.25 {
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
        // 1. A step holds enough points, and is longer than noise is wide.
        let mut radii: Vec<f64> = flat.points.iter().map(|q| q.x).collect();
        let radius = median_in_place(&mut radii);
        let n = sample.points.len() as f64;
        let length = n * spacing * spacing / (std::f64::consts::TAU * radius);
        let step = spacing.max(24.0 * length / n).max(5.0 * noise);
        let mut best: Option<(f64, Vec<f64>, Trace)> = None;
        // Normals of clouds may err in their side, so that they are tried without it last.
        for (oriented, tried) in [true, false]
            .into_iter()
            .flat_map(|o| TRIED.map(|t| (o, t)))
        {
            if best.as_ref().is_some_and(|(lost, _, _)| *lost <= ASTRAY) {
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
        if lost > ASTRAY {
            return Ok(Err(format!(
                "turned about the best axis, {:.1} % of the points lie off one profile line",
                100.0 * lost
            )));
        }
        // 2. Ends: on the axis, or where points end.
        let (ends, before) = ends::finish(&mut trace, &flat, &s, spacing);
        // 3. Refine on a dense profile.
        let spans = (0.5 * trace.length() / step).clamp(4.0, SPANS).round();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most SPANS"
        )]
        let spans = spans as usize;
        let breaks: Vec<f64> = (0..=spans)
            .map(|k| trace.length() * k as f64 / spans as f64)
            .collect();
        let knots = knots_over(&breaks, trace.closed)?;
        let s = s.into_iter().map(|s| s + before).collect();
        let fitted = refine(sample, axis, &knots, s, ends, turn, LEAST * step)?;
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
    /// For each point the place of its foot along the profile, or NaN where it is not on it. O(points).
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
    /// What `f` makes of each point: of the point itself, turned into the half plane, and of about where along the profile
    /// it is; NaN where it is not on it. O(points).
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
