//! P-curves: cubic B-splines in (u, v) along a contour.
//!
//! The line is resampled at half a grid step and split at corners, local maxima of the turn of its chords. Each piece
//! is fitted by penalised least squares over its chord length, and spans are halved until every point is within the
//! allowed distance:
//!
//! ```text
//! minimise sum |C(t_k) - p_k|² + 1e-4 sum |P_i - 2 P_{i+1} + P_{i+2}|²
//! ```
//!
//! A line without corners that closes becomes one periodic curve, clamped at the end. Ends of open curves are exact.
//!
//! Source: Piegl and Tiller 1997, section 9.4; the penalty as in P-splines (Eilers and Marx 1996).

use glam::DVec2;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::cholesky::{SymmetricBanded, solve_refined};
use nurbskin_geometry::nurbs::basis::basis_functions;
use nurbskin_geometry::{DVec3, KnotVector, NurbsCurve, Result};

/// Degree of p-curves. Source: cubic B-splines, C² at simple knots (Piegl and Tiller, The NURBS Book, 1997).
const DEGREE: usize = 3;
/// Least turn at a corner, in radians (35 degrees), over the window around it; it must also exceed the turns before and
/// behind by as much. Trial: not recorded. A smaller one splits curves at bends of the outline, a larger one rounds
/// corners off.
const MIN_CORNER_TURN: f64 = 0.61;
/// Points to either side over which a turn is measured; then twice as many. Trial: not recorded. A smaller one takes
/// the stairs of the grid for corners, a larger one misses corners that lie close together.
const CORNER_WINDOW: usize = 8;
/// Points per grid step along the line. Guard: the contour has about one vertex per step, and half a step keeps all of
/// its shape.
const POINTS_PER_STEP: f64 = 2.0;
/// Most rounds that halve spans. Guard: spans that hold few points are not halved.
const MAX_REFINEMENT_ROUNDS: usize = 10;
/// Weight of the squared second differences of the control points, relative to a point's. Guard: it only has to
/// determine spans without points; it is too small to move spans that have some.
const SMOOTHING_WEIGHT: f64 = 1e-4;
/// Least turn over the double window at a corner, as a share of the turn that makes one. Trial: not recorded; it leaves
/// out notches that turn back.
const LONG_CORNER_SHARE: f64 = 0.8;
/// Weight of the end points of an open curve, in that of a point. Guard: far heavier than all others, since the ends
/// are then set exactly.
const END_WEIGHT: f64 = 1e6;
/// Fewest points of a span that is halved. Guard: each half keeps two points (Schoenberg and Whitney).
const MIN_SPAN_POINTS: usize = 4;
/// Spans of a closed curve at the start. Guard: a periodic cubic needs four.
const CLOSED_SPANS: i32 = 6;
/// Fewest and most points along a line. Guard: a cubic needs four; the most bounds the time.
const PIECE_POINTS: [f64; 2] = [4.0, 1e5];

/// Curves that follow a line within `off` grid steps, split at its corners. A closed line (whose last point is its
/// first) without corners becomes one smooth closed curve, clamped. The ends of the curves are points of the line; the
/// first and the last are the ends of the line. Each curve has the domain \[0, 1\].
pub(super) fn smooth(line: &[DVec2], closed: bool, step: f64, off: f64) -> Result<Vec<NurbsCurve>> {
    let points = evenly(line, step / POINTS_PER_STEP);
    let corners = corners(&points, closed);
    if closed && corners.is_empty() {
        return Ok(vec![follow(&points, true, off * step)?]);
    }
    let mut pieces: Vec<Vec<DVec2>> = Vec::new();
    if closed {
        // Starts at the first corner.
        let ring = &points[..points.len() - 1];
        let mut turned = ring[corners[0]..].to_vec();
        turned.extend_from_slice(&ring[..=corners[0]]);
        let ends = corners.iter().skip(1).map(|&k| k - corners[0]);
        let ends: Vec<usize> = ends.chain([ring.len()]).collect();
        let mut start = 0;
        for end in ends {
            pieces.push(turned[start..=end].to_vec());
            start = end;
        }
    } else {
        let mut start = 0;
        for end in corners.into_iter().chain([points.len() - 1]) {
            pieces.push(points[start..=end].to_vec());
            start = end;
        }
    }
    pieces
        .iter()
        .map(|piece| follow(piece, false, off * step))
        .collect()
}

/// Points evenly spaced along a line, about `step` apart; its ends stay.
fn evenly(line: &[DVec2], step: f64) -> Vec<DVec2> {
    let length: f64 = line.windows(2).map(|w| w[0].distance(w[1])).sum();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 4 and a hundred thousand"
    )]
    let count = (length / step)
        .round()
        .clamp(PIECE_POINTS[0], PIECE_POINTS[1]) as usize;
    let (Some(&first), Some(&last)) = (line.first(), line.last()) else {
        return Vec::new();
    };
    let mut points = vec![first];
    let (mut k, mut before) = (0, 0.0);
    for i in 1..count {
        let at = length * i as f64 / count as f64;
        while k + 2 < line.len() && before + line[k].distance(line[k + 1]) < at {
            before += line[k].distance(line[k + 1]);
            k += 1;
        }
        let side = line[k].distance(line[k + 1]).max(f64::MIN_POSITIVE);
        points.push(line[k].lerp(line[k + 1], ((at - before) / side).clamp(0.0, 1.0)));
    }
    points.push(last);
    points
}

/// Indices of the points at which the line turns sharply; never an end.
fn corners(points: &[DVec2], closed: bool) -> Vec<usize> {
    let count = if closed {
        points.len() - 1
    } else {
        points.len()
    };
    let turn = |k: usize, reach: usize| -> f64 {
        let at = |k: usize| points[if closed { k % count } else { k.min(count - 1) }];
        if !closed && (k < reach || k + reach >= count) {
            return 0.0;
        }
        let (a, b, c) = (at(k + count - reach), at(k + count), at(k + count + reach));
        let (a, b, c) = if closed {
            (a, b, c)
        } else {
            (at(k - reach), at(k), at(k + reach))
        };
        math::turn(b - a, c - b)
    };
    if count <= 4 * CORNER_WINDOW {
        return Vec::new();
    }
    let turns: Vec<f64> = (0..count).map(|k| turn(k, CORNER_WINDOW)).collect();
    let near = |k: usize, by: isize| -> f64 {
        let at = k.checked_add_signed(by).unwrap_or(k + count);
        let at = if by < 0 && k < by.unsigned_abs() {
            k + count - by.unsigned_abs()
        } else {
            at
        };
        if closed {
            turns[at % count]
        } else {
            turns.get(at).copied().unwrap_or(0.0)
        }
    };
    let reach = isize::try_from(CORNER_WINDOW).unwrap_or(0);
    let is_corner = |k: usize| {
        let here = turns[k].abs();
        let beside = 0.5 * (near(k, -reach).abs() + near(k, reach).abs());
        let highest = (1..=reach).all(|by| near(k, -by).abs() <= here && near(k, by).abs() < here);
        here > MIN_CORNER_TURN
            && here > beside + MIN_CORNER_TURN
            && highest
            && turn(k, 2 * CORNER_WINDOW).abs() > LONG_CORNER_SHARE * MIN_CORNER_TURN
    };
    (0..count).filter(|&k| is_corner(k)).collect()
}

/// A least-squares cubic B-spline whose spans are halved until it follows the points.
fn follow(points: &[DVec2], closed: bool, off: f64) -> Result<NurbsCurve> {
    // Chord lengths.
    let mut at = vec![0.0];
    for w in points.windows(2) {
        at.push(at[at.len() - 1] + w[0].distance(w[1]));
    }
    let length = at[at.len() - 1].max(f64::MIN_POSITIVE);
    at.iter_mut().for_each(|t| *t /= length);
    let last = at.len() - 1;
    at[last] = 1.0;
    let spans = if closed { CLOSED_SPANS } else { 1 };
    let mut breaks: Vec<f64> = (0..=spans)
        .map(|k| f64::from(k) / f64::from(spans))
        .collect();
    let mut curve = solve(points, &at, &breaks, closed)?;
    for _ in 0..MAX_REFINEMENT_ROUNDS {
        let far = |k: usize| curve.point(at[k]).truncate().distance(points[k]) > off;
        let mut finer = vec![0.0];
        for w in breaks.windows(2) {
            let inside = |k: &usize| at[*k] >= w[0] && at[*k] <= w[1];
            let own: Vec<usize> = (0..points.len()).filter(inside).collect();
            if own.len() >= MIN_SPAN_POINTS && own.iter().any(|&k| far(k)) {
                finer.push(f64::midpoint(w[0], w[1]));
            }
            finer.push(w[1]);
        }
        if finer.len() == breaks.len() {
            break;
        }
        breaks = finer;
        curve = solve(points, &at, &breaks, closed)?;
    }
    Ok(curve)
}

/// Penalised least squares over these spans; an open curve keeps the first and the last point.
fn solve(points: &[DVec2], at: &[f64], breaks: &[f64], closed: bool) -> Result<NurbsCurve> {
    let knots = if closed {
        KnotVector::periodic(DEGREE, breaks)?
    } else {
        KnotVector::clamped(DEGREE, breaks)?
    };
    let count = knots.distinct_count();
    // In the order 0, n - 1, 1, n - 2, ... neighbours around a ring are never far apart, so that the matrix stays
    // banded.
    let row = |k: usize| {
        if !closed {
            k
        } else if 2 * k < count {
            2 * k
        } else {
            2 * (count - 1 - k) + 1
        }
    };
    let mut matrix = SymmetricBanded::zeros(count, 2 * DEGREE + 1)?;
    let mut right = vec![DVec3::ZERO; count];
    let mut add = |terms: &[(usize, f64)], value: DVec2, weight: f64| {
        for &(i, a) in terms {
            right[row(i)] += weight * a * value.extend(0.0);
            for &(j, b) in terms {
                if row(j) <= row(i) {
                    matrix.add(row(i), row(j), weight * a * b);
                }
            }
        }
    };
    let mut values = [0.0; DEGREE + 1];
    // The last point of a ring is its first.
    let own = if closed {
        points.len() - 1
    } else {
        points.len()
    };
    for (p, &t) in points.iter().zip(at).take(own) {
        let span = knots.span(t);
        basis_functions(&knots, span, t, &mut values);
        let terms: Vec<(usize, f64)> = (0..=DEGREE)
            .map(|k| ((span - DEGREE + k) % count, values[k]))
            .collect();
        add(&terms, *p, 1.0);
    }
    let triples = if closed { count } else { count - 2 };
    for k in 0..triples {
        let terms = [(k, 1.0), ((k + 1) % count, -2.0), ((k + 2) % count, 1.0)];
        add(&terms, DVec2::ZERO, SMOOTHING_WEIGHT);
    }
    if !closed {
        add(&[(0, 1.0)], points[0], END_WEIGHT);
        add(&[(count - 1, 1.0)], points[points.len() - 1], END_WEIGHT);
    }
    let (solved, _) = solve_refined(&matrix, &right)?;
    let mut net: Vec<DVec3> = (0..count).map(|k| solved[row(k)]).collect();
    if closed {
        net.extend_from_within(..DEGREE);
        return closed_ends(&NurbsCurve::new(knots, net, None)?.clamped()?);
    }
    net[0] = points[0].extend(0.0);
    net[count - 1] = points[points.len() - 1].extend(0.0);
    NurbsCurve::new(knots, net, None)
}

/// The clamped curve with its last point set to its first, so that rounding does not open it.
fn closed_ends(curve: &NurbsCurve) -> Result<NurbsCurve> {
    let mut points = curve.control_points().to_vec();
    let last = points.len() - 1;
    points[last] = points[0];
    NurbsCurve::new(curve.knots().clone(), points, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_is_one_smooth_curve_and_a_square_four() {
        let circle: Vec<DVec2> = (0..=200)
            .map(|k| DVec2::from_angle(std::f64::consts::TAU * f64::from(k % 200) / 200.0) * 5.0)
            .collect();
        let curves = smooth(&circle, true, 0.2, 0.75).unwrap();
        assert_eq!(curves.len(), 1);
        assert_eq!(
            curves[0].control_points().first(),
            curves[0].control_points().last()
        );
        for k in 0..50 {
            let p = curves[0].point(f64::from(k) / 50.0);
            assert!((p.length() - 5.0).abs() < 0.15);
        }
        let corner = |k: usize| {
            [
                DVec2::ZERO,
                DVec2::new(4.0, 0.0),
                DVec2::splat(4.0),
                DVec2::new(0.0, 4.0),
            ][k % 4]
        };
        let square: Vec<DVec2> = (0..=80)
            .map(|k| corner(k / 20).lerp(corner(k / 20 + 1), (k % 20) as f64 / 20.0))
            .collect();
        // Starting in the middle of a side.
        let mut turned = square[10..80].to_vec();
        turned.extend_from_slice(&square[..=10]);
        let curves = smooth(&turned, true, 0.1, 0.75).unwrap();
        assert_eq!(curves.len(), 4);
        for curve in &curves {
            assert!(curve.control_points().len() <= 5);
        }
        for pair in curves.windows(2) {
            assert_eq!(
                pair[0].control_points().last(),
                pair[1].control_points().first()
            );
        }
    }
}
