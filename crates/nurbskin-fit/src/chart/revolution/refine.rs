//! Joint refinement of axis and profile by the distances of the points from the surface.
//!
//! Gauss-Newton steps change four parameters of the axis: two shifts and two tilts. By variable projection, only the
//! part of a change that no change of the profile can make counts: with the Jacobian J of the distances and the
//! projector P onto splines over the profile's knots,
//!
//! ```text
//! minimise |(I - P) (e + J a)|²        over a = (shift, tilt)
//! ```
//!
//! Directions with eigenvalues near zero are left alone. The weights are robust.
//!
//! Source: G. Golub and V. Pereyra 1973, DOI 10.1137/0710036.

use super::axis::{Axis, Sample};
use super::profile::{ProfileCurve, ProfileEnd, Scalars, Target};
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::eigen::symmetric_eigen;
use nurbskin_geometry::numeric::statistics::{SIGMA_PER_MAD, median_in_place};
use nurbskin_geometry::nurbs::KnotVector;

/// Most Gauss-Newton steps of the axis. Guard: convergence is fast from the axis of the normals, and an earlier end is
/// tested.
const MAX_AXIS_STEPS: usize = 6;
/// Eigenvalue of the normal matrix, as a share of the largest, below which its direction is left alone. Guard: the data
/// do not determine such directions, such as a tilt about the centre of a sphere; the step along them would be
/// rounding.
const MIN_EIGENVALUE: f64 = 1e-9;
/// Distance from the profile, in sigma, beyond which a point has no weight. Trial: not recorded.
const OUTLIER_SIGMAS: f64 = 6.0;
/// Scale c of the weights (1 + (e/c)²)⁻² of points within that distance, in sigma. Trial: not recorded.
const PROFILE_WEIGHT_SIGMAS: f64 = 3.0;
/// Largest change of the axis in one step: its tilt in radians, its shift in extents. Guard: keeps a poor first profile
/// from throwing the axis away.
const MAX_AXIS_CHANGE: f64 = 0.2;
/// Change of the axis, in its standard error sigma/√n, at which the refinement ends. Guard: the noise hides smaller
/// changes.
const SETTLED_CHANGE: f64 = 1e-3;
/// Rounds of the first profile: one through the points as ordered, the others by distances across. Trial: not recorded;
/// later steps take one round each.
const FIRST_PROFILE_ROUNDS: usize = 3;

/// The result of the refinement.
pub(super) struct Fitted {
    pub(super) axis: Axis,
    pub(super) curve: ProfileCurve,
    /// Robust weights; zero for points that are not on the profile.
    pub(super) weights: Vec<f64>,
    /// Robust standard deviation of the distances.
    pub(super) sigma: f64,
}

/// Robust weights and the standard deviation of the distances, from the median over the points that are `on` the
/// profile. Distances up to about `least` keep their weight.
fn robust_weights(offsets: &[f64], on: &[bool], least: f64) -> (Vec<f64>, f64) {
    let mut absolute: Vec<f64> = offsets
        .iter()
        .zip(on)
        .filter(|(_, on)| **on)
        .map(|(e, _)| e.abs())
        .collect();
    let sigma = SIGMA_PER_MAD * median_in_place(&mut absolute);
    let weight = |(e, on): (&f64, &bool)| {
        let scale = sigma.max(least);
        if !on || sigma.is_nan() || e.abs() > OUTLIER_SIGMAS * scale {
            return 0.0;
        }
        (1.0 + (e / (PROFILE_WEIGHT_SIGMAS * scale)).powi(2)).powi(-2)
    };
    (offsets.iter().zip(on).map(weight).collect(), sigma)
}

/// Refines axis and profile by variable projection: only the part of a change of the distances counts that no change of
/// the profile can make (G. Golub and V. Pereyra 1973, DOI 10.1137/0710036). `s` holds the parameters of the points,
/// NaN for points off the profile; `turn` is false where the direction of the axis is fixed; `least` is the smallest
/// scale of the weights. O(points) per step.
pub(super) fn refine(
    sample: &Sample,
    axis: Axis,
    knots: &KnotVector,
    s: Vec<f64>,
    ends: [ProfileEnd; 2],
    turn: bool,
    least: f64,
) -> Result<Fitted> {
    let on: Vec<bool> = s.iter().map(|s| s.is_finite()).collect();
    let (_, size) = sample.extent();
    let (a, b) = knots.domain();
    let mut weights: Vec<f64> = on.iter().map(|&on| f64::from(u8::from(on))).collect();
    let mut s: Vec<f64> = s
        .into_iter()
        .map(|s| if s.is_finite() { knots.wrap(s) } else { a })
        .collect();
    let mut axis = axis;
    let mut before: Option<ProfileCurve> = None;
    let mut sigma = 0.0;
    let mut step = 0;
    loop {
        // 1. The profile for this axis: first by point distances, then by distances across.
        let flat: Vec<DVec2> = sample
            .points
            .iter()
            .map(|&p| axis.radius_height(p))
            .collect();
        let mut offsets = vec![0.0; flat.len()];
        let mut normals = vec![DVec2::ZERO; flat.len()];
        let mut curve = before;
        let rounds = if curve.is_some() {
            1
        } else {
            FIRST_PROFILE_ROUNDS
        };
        for _ in 0..rounds {
            let targets: Vec<Target> = flat
                .iter()
                .zip(&s)
                .zip(&weights)
                .map(|((&at, &s), &weight)| Target { at, s, weight })
                .collect();
            let next = ProfileCurve::fit(knots, &targets, ends, curve.as_ref())?;
            for (k, &q) in flat.iter().enumerate().filter(|(k, _)| on[*k]) {
                s[k] = next.foot(q, s[k]);
                (offsets[k], normals[k]) = next.offset(q, s[k]);
            }
            (weights, sigma) = robust_weights(&offsets, &on, least);
            curve = Some(next);
        }
        let Some(curve) = curve else {
            return Err(nurbskin_geometry::Error::NoSolution(
                "the profile has no points".into(),
            ));
        };
        if step == MAX_AXIS_STEPS {
            return Ok(Fitted {
                axis,
                curve,
                weights,
                sigma,
            });
        }
        step += 1;
        // 2. Derivatives of the distances by shifts and tilts of the axis, without their projection onto changes of the
        //    profile.
        let [x, y] = axis.frame();
        let mut moved = Vec::with_capacity(flat.len());
        let mut tilted = Vec::with_capacity(flat.len());
        for (k, &p) in sample.points.iter().enumerate() {
            let (height, across) = axis.split(p);
            let out = across.normalize_or_zero();
            let (cx, cy) = (out.dot(x), out.dot(y));
            let n = normals[k];
            let lever = (n.y * flat[k].x - n.x * height) / size;
            moved.push(DVec3::new(-n.x * cx, -n.x * cy, offsets[k]));
            tilted.push(DVec3::new(lever * cx, lever * cy, 0.0));
        }
        let scalars = Scalars::new(knots, &s, &weights)?;
        scalars.rest(&s, &weights, &mut moved);
        scalars.rest(&s, &weights, &mut tilted);
        // 3. The step, without undetermined directions.
        let change = solve(&moved, &tilted, &weights, turn);
        let shift = change[0] * x + change[1] * y;
        let tilt = ((change[2] * x + change[3] * y) / size).clamp_length_max(MAX_AXIS_CHANGE);
        axis = Axis {
            point: axis.point + shift.clamp_length_max(MAX_AXIS_CHANGE * size),
            direction: (axis.direction + tilt).normalize_or(axis.direction),
        };
        before = Some(curve);
        let small =
            SETTLED_CHANGE * sigma.max(1e-12 * (b - a)) / (sample.points.len() as f64).sqrt();
        if shift.length() < small && tilt.length() * size < small {
            step = MAX_AXIS_STEPS;
        }
    }
}

/// The Gauss-Newton change of (x, y, tilt x, tilt y).
fn solve(moved: &[DVec3], tilted: &[DVec3], weights: &[f64], turn: bool) -> [f64; 4] {
    let mut square = [[0.0; 4]; 4];
    let mut right = [0.0; 4];
    for ((m, t), &w) in moved.iter().zip(tilted).zip(weights) {
        let line = if turn {
            [m.x, m.y, t.x, t.y]
        } else {
            [m.x, m.y, 0.0, 0.0]
        };
        for i in 0..4 {
            right[i] -= w * line[i] * m.z;
            for j in 0..4 {
                square[i][j] += w * line[i] * line[j];
            }
        }
    }
    let pairs = symmetric_eigen(square);
    let most = pairs[3].0;
    let mut change = [0.0; 4];
    for (value, vector) in pairs {
        if value > MIN_EIGENVALUE * most && value > 0.0 {
            let along: f64 = vector.iter().zip(&right).map(|(v, r)| v * r).sum::<f64>() / value;
            for (c, v) in change.iter_mut().zip(&vector) {
                *c += along * v;
            }
        }
    }
    change
}
