//! Surfaces of revolution in exact rational form.
//!
//! ```text
//! S(u, v) = rational quadratic circle arcs in v about the axis, swept by the profile C(u) = (radius, height)
//! numbers: 2 per control point of the profile + 4 of the axis + 2 of a sector
//! ```
//!
//! A scan of a turned part is described by far fewer numbers than a free form. It is accepted only if the points agree
//! with it everywhere, along the profile and around the axis: the median of every cell lies on the surface as closely
//! as noise allows to decide.
//!
//! Source: recognition of the axis after Pottmann and Wallner; A8.1 of *The NURBS Book* for the sweep; the tests are
//! ours.

mod accept;
mod data;
mod knots;
mod support;

use crate::chart::Topology;
use crate::chart::revolution::{
    Axis, ProfileCurve, ProfileEnd, Recognition, Revolution, Sample, Sector, look,
};
use crate::fit::approximate::NOISE_SHARE;
use data::{Data, MAX_SAMPLE_POINTS};
use knots::Aim;
use nurbskin_geometry::math;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve, NurbsSurface, conic};
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{DVec2, DVec3, Error, Result};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Least angle of a sector, in radians, that determines an axis.
/// Trial: not recorded. The sagitta of 0.6 rad is 4.5 % of the radius.
const MIN_SECTOR_ANGLE: f64 = 0.6;
/// Most numbers per point that may determine the surface.
/// Trial: not recorded. With more a profile fits its points whatever they are.
const MAX_NUMBERS_PER_POINT: f64 = 0.1;
/// Samples of the profile among which the start of a projection is found. Count.
/// Guard: only for outliers.
const PROFILE_SAMPLES: u32 = 200;
/// Most Newton steps of the final projection to the profile. Count.
/// Guard: bounds the time.
const MAX_PROJECTION_STEPS: usize = 12;

/// A surface of revolution through the middle of points.
#[derive(Clone, Debug)]
pub struct RevolutionFit {
    /// The surface on \[0, 1\] x \[0, 1\]: cubic along the profile (u), rational quadratic around the axis (v), both
    /// clamped but for a closed profile, whose u is periodic.
    pub surface: NurbsSurface,
    /// Which directions are closed: a tube (at most one pole), a sphere (two), a torus, or a disk (less than a turn).
    pub topology: Topology,
    /// (u, v) of the foot of each point, in the order of the points.
    pub parameters: Vec<DVec2>,
    /// Signed distance of each point from the whole turn of the profile, positive on the side of `S_u x S_v`.
    pub residuals: Vec<f64>,
    /// Robust standard deviation of the points across the surface.
    pub sigma: f64,
    /// The axis.
    pub axis: Axis,
    /// The sector of the surface around the axis.
    pub sector: Sector,
    /// The kind of its ends along u.
    pub ends: [ProfileEnd; 2],
    /// Numbers that determine the surface: two per control point of the profile, four of the axis, two of a sector.
    pub freedom: usize,
    /// A sentence for the user.
    pub reason: String,
}

/// The result of [`fit`].
#[derive(Clone, Debug)]
pub enum Outcome {
    /// The points are a scan of a surface of revolution.
    Fitted(Box<RevolutionFit>),
    /// They are not, or cannot be decided; a sentence with the figure that refused them.
    Refused(String),
}

fn refused(why: &str) -> Result<Outcome> {
    Ok(Outcome::Refused(format!(
        "not a surface of revolution: {why}"
    )))
}

/// Fits a surface of revolution to `points`, if they are a scan of one.
///
/// `normals` are unit vectors or zero; `tolerance`, `noise` and `spacing` are in the unit of the points, the latter two
/// as [`CleanScan`](nurbskin_scan::CleanScan) has them.
///
/// 1. Recognise axis, ordered profile and sector.
/// 2. Refuse unless the points agree with a dense profile.
/// 3. Fit the profile with as few control points as are good enough: with noise in the mean over pieces of it, without
///    in the largest distance.
/// 4. Refuse unless the points agree with that as well, each piece of the profile, both its ends and each sector hold
///    points, and the surface has fewer numbers than a tenth of theirs.
///
/// The result does not depend on the order of the points. O(points); about 0.3 s for 13 000.
///
/// # Errors
/// [`Error::Invalid`] if the tolerance is not positive, [`Error::Cancelled`] if `progress` says so.
pub fn fit(
    points: &[DVec3],
    normals: &[DVec3],
    tolerance: f64,
    noise: f64,
    spacing: f64,
    progress: &dyn Progress,
) -> Result<Outcome> {
    if !(tolerance > 0.0 && tolerance.is_finite()) {
        return Err(Error::Invalid(format!(
            "the tolerance must be a positive length, not {tolerance}"
        )));
    }
    // 1. Axis, profile, sector.
    let scan = Given {
        points,
        normals,
        sample: &Sample::new(points, normals, MAX_SAMPLE_POINTS),
        tolerance,
        noise,
        spacing,
    };
    let (outcome, sphere) = attempt(&scan, true, progress)?;
    // A near-sphere may have an axis after all.
    if sphere && matches!(outcome, Outcome::Refused(_)) {
        let (other, _) = attempt(&scan, false, progress)?;
        if matches!(other, Outcome::Fitted(_)) {
            return Ok(other);
        }
    }
    Ok(outcome)
}

/// All steps of [`fit`], and whether the points were taken for a sphere. A failed computation is a refusal: a free form
/// remains.
fn attempt(scan: &Given<'_>, spheres: bool, progress: &dyn Progress) -> Result<(Outcome, bool)> {
    let &Given {
        points,
        sample,
        noise,
        spacing,
        ..
    } = scan;
    let mut sphere = false;
    let looked = look(sample, points.len(), spacing, noise, spheres, progress);
    let outcome = looked.and_then(|(recognition, round)| {
        sphere = round;
        match recognition {
            Recognition::Found(found) => decide(scan, &found, progress),
            Recognition::None(why) => refused(&why),
        }
    });
    match outcome {
        Err(Error::NoSolution(why)) => Ok((refused(&why)?, sphere)),
        other => Ok((other?, sphere)),
    }
}

/// The input of [`fit`].
struct Given<'a> {
    points: &'a [DVec3],
    normals: &'a [DVec3],
    /// The sample for the profile and the decision.
    sample: &'a Sample,
    tolerance: f64,
    noise: f64,
    spacing: f64,
}

/// Steps 2 to 4 of [`fit`].
fn decide(scan: &Given<'_>, found: &Revolution, progress: &dyn Progress) -> Result<Outcome> {
    let &Given {
        points,
        normals,
        sample,
        tolerance,
        noise,
        spacing,
    } = scan;
    if found.sector.sweep < MIN_SECTOR_ANGLE {
        let degrees = found.sector.sweep.to_degrees();
        return refused(&format!(
            "a sector of {degrees:.0} degrees does not tell the axis"
        ));
    }
    // 2. Do the points agree with a dense profile?
    progress.check()?;
    let noisy = noise > NOISE_SHARE * tolerance;
    let mut data = Data::new(sample, points.len(), found, spacing, tolerance);
    if let Some(why) = accept::objection(&data, found, &found.profile, tolerance, noisy, false) {
        return refused(&why);
    }
    // 3. Few control points.
    let targets = if noisy {
        data.means(&found.profile)
    } else {
        data.extremes(&found.profile)
    };
    let aim = Aim {
        targets: &targets,
        ends: found.ends,
        dense: &found.profile,
        tolerance,
        sigma: noisy.then_some(data.sigma),
        widest: data.row(),
    };
    let (curve, reached) = aim.reach(progress)?;
    if !reached {
        return refused("the profile does not come within the tolerance where its points are few");
    }
    // 4. Do they agree with that?
    data.measure(&curve, tolerance);
    if let Some(why) = accept::objection(&data, found, &curve, tolerance, noisy, true) {
        return refused(&why);
    }
    let partial = if found.sector.whole() { 0 } else { 2 };
    let freedom = 2 * curve.knots().distinct_count() + 4 + partial;
    if freedom as f64 > MAX_NUMBERS_PER_POINT * points.len() as f64 {
        return refused(&format!(
            "{freedom} numbers would be needed for {} points",
            points.len()
        ));
    }
    progress.check()?;
    finish(points, normals, found, &curve, data.sigma, freedom)
}

/// The surface, and the parameters of the points on it.
fn finish(
    points: &[DVec3],
    normals: &[DVec3],
    found: &Revolution,
    curve: &ProfileCurve,
    sigma: f64,
    freedom: usize,
) -> Result<Outcome> {
    let surface = turned(curve, &found.axis, &found.sector)?;
    let length = curve.knots().domain().1;
    let place = |p: DVec3, flat: DVec2, s: f64| {
        // A point without a place on the profile is an outlier: the nearest sample suffices.
        let s = if s.is_finite() {
            s
        } else {
            nearest(curve, flat)
        };
        let s = curve.foot_in(flat, s, MAX_PROJECTION_STEPS);
        let angle = found.sector.angle(&found.axis, p);
        let at = DVec2::new(s / length, parameter(angle, found.sector.sweep));
        let far = curve.derivatives(s)[0].distance(flat);
        (at, far.copysign(curve.offset(flat, s).0))
    };
    let placed = found.for_each(points, normals, place);
    let (parameters, residuals) = placed.into_iter().unzip();
    let topology = topology(found);
    let Axis { point, direction } = found.axis;
    let [m, n] = surface.distinct_counts();
    let round = |p: DVec3| format!("({:.6}, {:.6}, {:.6})", p.x, p.y, p.z);
    let part = if found.sector.whole() {
        String::new()
    } else {
        format!(", {:.1} degrees of it", found.sector.sweep.to_degrees())
    };
    Ok(Outcome::Fitted(Box::new(RevolutionFit {
        reason: format!(
            "a surface of revolution about the axis through {} (direction {}){part}: {m} x {n} control points, \
             determined by {freedom} numbers",
            round(point),
            round(direction)
        ),
        surface,
        topology,
        parameters,
        residuals,
        sigma,
        axis: found.axis,
        sector: found.sector,
        ends: found.ends,
        freedom,
    })))
}

fn topology(found: &Revolution) -> Topology {
    if !found.sector.whole() {
        Topology::Disk
    } else if found.closed() {
        Topology::Torus
    } else if found.ends.iter().all(|&end| end != ProfileEnd::Rim) {
        Topology::Sphere
    } else {
        Topology::Tube
    }
}

/// The parameter of the nearest of [`PROFILE_SAMPLES`] points of the curve.
fn nearest(curve: &ProfileCurve, q: DVec2) -> f64 {
    let length = curve.knots().domain().1;
    let places = (0..=PROFILE_SAMPLES).map(|k| length * f64::from(k) / f64::from(PROFILE_SAMPLES));
    let mut best = (f64::INFINITY, 0.0);
    for s in places {
        let far = curve.derivatives(s)[0].distance_squared(q);
        if far < best.0 {
            best = (far, s);
        }
    }
    best.1
}

/// The profile turned about the axis over the sector, on the unit square: u along the profile, v around.
fn turned(curve: &ProfileCurve, axis: &Axis, sector: &Sector) -> Result<NurbsSurface> {
    let knots: KnotVector = curve.knots().with_domain(0.0, 1.0)?;
    let control = curve.control_points().iter();
    let control = control
        .map(|q| axis.point + q.x * sector.start + q.y * axis.direction)
        .collect();
    let profile = NurbsCurve::new(knots, control, None)?;
    Ok(conic::revolve(&profile, axis.point, axis.direction, sector.sweep)?.transposed())
}

/// The parameter of an angle on a rational circle over `sweep`, in arcs of equal angle: within an arc the tangent of
/// half the angle from its middle is linear in the parameter.
fn parameter(angle: f64, sweep: f64) -> f64 {
    let whole = sweep >= TAU;
    let pieces = if whole {
        4.0
    } else {
        (sweep / FRAC_PI_2).ceil().clamp(1.0, 4.0)
    };
    let step = if whole { FRAC_PI_2 } else { sweep / pieces };
    let piece = (angle / step).floor().clamp(0.0, pieces - 1.0);
    let from_middle = angle - (piece + 0.5) * step;
    let t = math::tan(0.5 * from_middle) / math::tan(0.25 * step);
    ((piece + (0.5 + 0.5 * t).clamp(0.0, 1.0)) / pieces).clamp(0.0, 1.0)
}
