//! The axis and the profile together, by the distances of the points from the surface.

use super::axis::{Axis, Sample};
use super::profile::{ProfileCurve, ProfileEnd, Scalars, Target};
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::eigen::symmetric_eigen;
use nurbskin_geometry::numeric::statistics::{SIGMA_PER_MAD, median_in_place};
use nurbskin_geometry::nurbs::KnotVector;

/// Steps of the Gauss-Newton method at most.
const STEPS: usize = 6;
/// Directions in which the data say less than this part of what they say in the best one are left alone.
const BLIND: f64 = 1e-9;
/// Distances beyond so many sigma count for nothing.
const OUT: f64 = 6.0;

/// The state of the refinement.
pub(super) struct Fitted {
    pub(super) axis: Axis,
    pub(super) curve: ProfileCurve,
    /// Robust weights; zero for points that are not on the profile.
    pub(super) weights: Vec<f64>,
    /// Robust standard deviation of the distances.
    pub(super) sigma: f64,
}

/// Weights that fall with the distance, and its standard deviation, from the median over the points that are `on` the
/// profile. Distances of about `least` are no sign of an outlier.
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
        if !on || sigma.is_nan() || e.abs() > OUT * scale {
            return 0.0;
        }
        (1.0 + (e / (3.0 * scale)).powi(2)).powi(-2)
    };
    (offsets.iter().zip(on).map(weight).collect(), sigma)
}

/// Refines axis and profile by variable projection: of the change that a motion of the axis makes to the distances,
/// only what no change of the profile could make as well counts (G. Golub and V. Pereyra 1973, DOI 10.1137/0710036).
/// `s` holds the places of the points along the knots, NaN for those that are on no place; `turn` is false where
/// the direction of the axis is no question; a dense profile may be off by `least`. O(points) per step.
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
        // 1. The profile for this axis, first through the points as placed, then across only.
        let flat: Vec<DVec2> = sample
            .points
            .iter()
            .map(|&p| axis.radius_height(p))
            .collect();
        let mut offsets = vec![0.0; flat.len()];
        let mut normals = vec![DVec2::ZERO; flat.len()];
        let mut curve = before;
        let rounds = if curve.is_some() { 1 } else { 3 };
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
        if step == STEPS {
            return Ok(Fitted {
                axis,
                curve,
                weights,
                sigma,
            });
        }
        step += 1;
        // 2. What moving and tilting the axis does to each distance, less what the profile can do.
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
        // 3. The step, leaving alone what the data do not say.
        let change = solve(&moved, &tilted, &weights, turn);
        let shift = change[0] * x + change[1] * y;
        let tilt = ((change[2] * x + change[3] * y) / size).clamp_length_max(0.2);
        axis = Axis {
            point: axis.point + shift.clamp_length_max(0.2 * size),
            direction: (axis.direction + tilt).normalize_or(axis.direction),
        };
        before = Some(curve);
        let small = 1e-3 * sigma.max(1e-12 * (b - a)) / (sample.points.len() as f64).sqrt();
        if shift.length() < small && tilt.length() * size < small {
            step = STEPS;
        }
    }
}

/// The change of (x, y, tilt x, tilt y) that lowers the sum of squares most.
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
        if value > BLIND * most && value > 0.0 {
            let along: f64 = vector.iter().zip(&right).map(|(v, r)| v * r).sum::<f64>() / value;
            for (c, v) in change.iter_mut().zip(&vector) {
                *c += along * v;
            }
        }
    }
    change
}
