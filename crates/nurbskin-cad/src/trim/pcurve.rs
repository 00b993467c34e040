//! Smooth p-curves along a line of points.

use glam::DVec2;
use nurbskin_geometry::numeric::cholesky::{SymmetricBanded, solve_refined};
use nurbskin_geometry::nurbs::basis::basis_functions;
use nurbskin_geometry::{DVec3, KnotVector, NurbsCurve, Result};

const DEGREE: usize = 3;
/// A corner turns by more than this over the steps beside it, in radians (35 degrees), and by so much more than what lies
/// before and behind it.
const CORNER: f64 = 0.61;
/// Points of the resampled line over which a turn is measured, and twice as many.
const REACH: usize = 8;
/// Points per step along the line.
const PER_STEP: f64 = 2.0;
/// Rounds of halving spans.
const ROUNDS: usize = 10;
/// Second differences of control points weigh this much of a point: it holds spans without points.
const CALM: f64 = 1e-4;

/// Curves that follow a line within `off` steps, split at its corners; a closed line (whose last point is its first)
/// without corners becomes one smooth closed curve, clamped. Their ends lie on points of the line, the first and the last
/// on its ends. Each runs over \[0, 1\].
pub(super) fn smooth(line: &[DVec2], closed: bool, step: f64, off: f64) -> Result<Vec<NurbsCurve>> {
    let points = evenly(line, step / PER_STEP);
    let corners = corners(&points, closed);
    if closed && corners.is_empty() {
        return Ok(vec![follow(&points, true, off * step)?]);
    }
    let mut pieces: Vec<Vec<DVec2>> = Vec::new();
    if closed {
        // Around from the first corner.
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
    let count = (length / step).round().clamp(4.0, 1e5) as usize;
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

/// Where the line turns sharply, by the places of the points; never an end.
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
        (b - a).angle_to(c - b)
    };
    if count <= 4 * REACH {
        return Vec::new();
    }
    let turns: Vec<f64> = (0..count).map(|k| turn(k, REACH)).collect();
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
    let reach = isize::try_from(REACH).unwrap_or(0);
    let is_corner = |k: usize| {
        let here = turns[k].abs();
        let beside = 0.5 * (near(k, -reach).abs() + near(k, reach).abs());
        let highest = (1..=reach).all(|by| near(k, -by).abs() <= here && near(k, by).abs() < here);
        here > CORNER
            && here > beside + CORNER
            && highest
            && turn(k, 2 * REACH).abs() > 0.8 * CORNER
    };
    (0..count).filter(|&k| is_corner(k)).collect()
}

/// A cubic B-spline by least squares, its spans halved until it follows the points.
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
    let spans = if closed { 6 } else { 1 };
    let mut breaks: Vec<f64> = (0..=spans)
        .map(|k| f64::from(k) / f64::from(spans))
        .collect();
    let mut curve = solve(points, &at, &breaks, closed)?;
    for _ in 0..ROUNDS {
        let far = |k: usize| curve.point(at[k]).truncate().distance(points[k]) > off;
        let mut finer = vec![0.0];
        for w in breaks.windows(2) {
            let inside = |k: &usize| at[*k] >= w[0] && at[*k] <= w[1];
            let own: Vec<usize> = (0..points.len()).filter(inside).collect();
            if own.len() >= 4 && own.iter().any(|&k| far(k)) {
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
    // Around a ring neighbours in the order 0, n - 1, 1, n - 2, .. are never far apart: the matrix stays banded.
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
    // A ring's last point is its first.
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
        add(&terms, DVec2::ZERO, CALM);
    }
    if !closed {
        // Far heavier than all others: then set exactly.
        let heavy = 1e6;
        add(&[(0, 1.0)], points[0], heavy);
        add(&[(count - 1, 1.0)], points[points.len() - 1], heavy);
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

/// The clamped curve with its last point a copy of its first: rounding shall not open it.
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
