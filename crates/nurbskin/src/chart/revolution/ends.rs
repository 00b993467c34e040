//! Where an open profile ends: on the axis, or where its points end.

use super::profile::ProfileEnd;
use super::trace::{Meridian, Trace};
use crate::numeric::statistics::median_in_place;
use glam::DVec2;

/// Points nearer to the axis than this many spacings make the end of a profile a pole.
const POLE: f64 = 1.6;
/// Slope against the perpendicular of the axis below which a pole has a normal.
const POLE_SLOPE: f64 = 0.35;
/// The first so many points after the outermost one must lie dense: outliers lie thin.
const DENSE_POINTS: [usize; 2] = [2, 6];
/// Part of the usual number of points per length of the profile that is dense.
const DENSE: f64 = 0.2;
/// Fewest places that are left of a trace.
const PLACES: usize = 4;

/// Makes the trace end at each open end where its points end, or on the axis where points come close to it; the
/// ends, and the length put in front (negative where some was taken off). `s` as of [`Trace::locate`]. O(n log n).
pub(super) fn finish(
    trace: &mut Trace,
    flat: &Meridian,
    s: &[f64],
    spacing: f64,
) -> ([ProfileEnd; 2], f64) {
    if trace.closed {
        return ([ProfileEnd::Rim; 2], 0.0);
    }
    // 1. The outermost points that others support; a walk may have gone on along a few outliers.
    let usual = usual_density(trace, flat, s);
    let rims = [0, 1].map(|side| {
        let points = along(trace, flat, s, side);
        rim(&points, usual)
    });
    let length = trace.length();
    let low = rims[0].map_or(0.0, |rim| -rim);
    let high = rims[1].map_or(length, |rim| length + rim);
    let taken = keep(trace, low, high);
    let (length, step) = (trace.length(), trace.step);
    let s: Vec<f64> = s.iter().map(|s| s - taken).collect();
    let beyond = [taken - low, high - taken - length];
    // 2. Each end.
    let mut ends = [ProfileEnd::Rim; 2];
    let mut grown = [0.0; 2];
    for (side, (end, grown)) in ends.iter_mut().zip(&mut grown).enumerate() {
        let last = trace.places.len() - 1;
        let (at, inner) = if side == 0 { (0, 1) } else { (last, last - 1) };
        let out = (trace.places[at] - trace.places[inner]).normalize_or(DVec2::Y);
        // One point near the axis may be an outlier.
        let mut radii: Vec<f64> = along(trace, flat, &s, side)
            .iter()
            .filter(|(far, _)| *far > -2.0 * step)
            .map(|&(_, radius)| radius)
            .collect();
        radii.sort_by(f64::total_cmp);
        let innermost = radii.get(1).copied().unwrap_or(f64::INFINITY);
        let to_axis = trace.places[at].x / -out.x;
        let inward = out.x < -0.2;
        if inward && innermost < POLE * spacing && to_axis < 4.0 * step {
            *end = if (out.y / out.x).abs() < POLE_SLOPE {
                ProfileEnd::Pole
            } else {
                ProfileEnd::Tip
            };
            *grown = to_axis.max(0.0);
        } else {
            *grown = beyond[side].clamp(-0.5 * step, 4.0 * step);
        }
        // The end itself moves: segments next to it were continued beyond it already.
        trace.places[at] += *grown * out;
    }
    let last = trace.lengths.len() - 1;
    for length in &mut trace.lengths[1..last] {
        *length += grown[0];
    }
    trace.lengths[last] += grown[0] + grown[1];
    (ends, grown[0] - taken)
}

/// How far each point lies beyond the last place at one end, and its radius, from the outermost on; beyond it only
/// those that lie near the line there.
fn along(trace: &Trace, flat: &Meridian, s: &[f64], side: usize) -> Vec<(f64, f64)> {
    let last = trace.places.len() - 1;
    let (at, inner) = if side == 0 { (0, 1) } else { (last, last - 1) };
    let out = (trace.places[at] - trace.places[inner]).normalize_or(DVec2::Y);
    let length = trace.length();
    let mut points: Vec<(f64, f64)> = s
        .iter()
        .zip(&flat.points)
        .filter(|(s, _)| s.is_finite())
        .map(|(s, q)| (if side == 0 { -s } else { s - length }, q))
        .filter(|&(far, q)| {
            far < 0.0 || (*q - trace.places[at]).perp_dot(out).abs() < 0.5 * trace.step
        })
        .map(|(far, q)| (far, q.x))
        .collect();
    points.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.total_cmp(&b.1)));
    points
}

/// Points per length of the profile and per radius, in the median over its steps.
fn usual_density(trace: &Trace, flat: &Meridian, s: &[f64]) -> f64 {
    let length = trace.length();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at least one; a step per place"
    )]
    let count = (length / trace.step).clamp(1.0, 1e4) as usize;
    let mut bins = vec![0.0; count];
    for (s, q) in s.iter().zip(&flat.points) {
        if *s >= 0.0 && *s < length && q.x > 0.0 {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a fraction of the bins"
            )]
            let k = (s / length * count as f64) as usize;
            bins[k.min(count - 1)] += 1.0 / q.x;
        }
    }
    median_in_place(&mut bins) * count as f64 / length
}

/// How far beyond the last place the outermost point lies that has enough others next to it, inwards.
fn rim(points: &[(f64, f64)], usual: f64) -> Option<f64> {
    let dense = |w: &&[(f64, f64)]| {
        DENSE_POINTS
            .iter()
            .all(|&n| n as f64 >= DENSE * usual * w[n].1 * (w[0].0 - w[n].0))
    };
    let wide = DENSE_POINTS.iter().copied().max().unwrap_or(0) + 1;
    points.windows(wide).find(dense).map(|w| w[0].0)
}

/// Takes the places off that lie outside of the range; the length taken off in front.
fn keep(trace: &mut Trace, low: f64, high: f64) -> f64 {
    let inside = |l: &f64| *l >= low && *l <= high;
    let first = trace.lengths.iter().position(inside).unwrap_or(0);
    let count = trace.lengths.iter().filter(|l| inside(l)).count();
    if count < PLACES {
        return 0.0;
    }
    let range = first..first + count;
    trace.places = trace.places[range.clone()].to_vec();
    trace.normals = trace.normals[range.clone()].to_vec();
    let taken = trace.lengths[first];
    trace.lengths = trace.lengths[range].iter().map(|l| l - taken).collect();
    taken
}
