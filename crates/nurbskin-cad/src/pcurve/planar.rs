//! Gauss' rule, and pieces of p-curves: their velocity, and where they cross lines.

use glam::{DVec2, DVec4};
use nurbskin_geometry::math;
use nurbskin_geometry::nurbs::MAX_DEGREE;
use nurbskin_geometry::nurbs::bezier::BezierCurve;

/// Abscissae in (0, 1) and weights of Gauss' rule with `count` points, at least one: exact for polynomials of degree
/// 2 `count` - 1.
///
/// Source: Newton's method on the Legendre polynomial from Tricomi's estimate of its roots; W. Press et al.,
/// *Numerical Recipes*, 3rd ed., section 4.6.
pub(crate) fn rule(count: usize) -> Vec<(f64, f64)> {
    let n = count.max(1) as f64;
    let root = |k: usize| {
        let mut x = math::cos(std::f64::consts::PI * (k as f64 + 0.75) / (n + 0.5));
        let mut slope = 1.0;
        // Quadratic convergence from three digits.
        for _ in 0..6 {
            let (mut p0, mut p1, mut j) = (1.0, 0.0, 0.0);
            while j < n {
                (p0, p1) = (((2.0 * j + 1.0) * x * p0 - j * p1) / (j + 1.0), p0);
                j += 1.0;
            }
            slope = n * (x * p0 - p1) / (x * x - 1.0);
            x -= p0 / slope;
        }
        let weight = 1.0 / ((1.0 - x * x) * slope * slope);
        (f64::midpoint(1.0, -x), weight)
    };
    (0..count.max(1)).map(root).collect()
}

/// The (u, v) of a piece of a p-curve at `s` in \[0, 1\], and its derivative by s.
pub(crate) fn place_and_velocity(curve: &BezierCurve, s: f64) -> [DVec2; 2] {
    let mut work = [DVec4::ZERO; MAX_DEGREE + 1];
    let count = curve.points.len().min(MAX_DEGREE + 1);
    work[..count].copy_from_slice(&curve.points[..count]);
    let degree = count.saturating_sub(1);
    for last in (2..count).rev() {
        for k in 0..last {
            work[k] = (1.0 - s) * work[k] + s * work[k + 1];
        }
    }
    let (h, slope) = if degree == 0 {
        (work[0], DVec4::ZERO)
    } else {
        let rise = work[1] - work[0];
        (work[0] + s * rise, degree as f64 * rise)
    };
    let place = h.truncate().truncate() / h.w;
    let velocity = (slope.truncate().truncate() - slope.w * place) / h.w;
    [place, velocity]
}

/// Where a piece crosses a line of constant u (axis 0) or v, by its range: it cannot where all its control points are on
/// one side, does once where they change sides once (Descartes' rule), and is split otherwise.
pub(crate) fn crossings(piece: &BezierCurve, axis: usize, value: f64, found: &mut Vec<f64>) {
    let mut stack = vec![(piece.clone(), 0)];
    while let Some((part, depth)) = stack.pop() {
        let (mut low, mut high) = (0.0_f64, 0.0_f64);
        for h in &part.points {
            let side = h[axis] - value * h.w;
            low = low.min(side / h.w);
            high = high.max(side / h.w);
        }
        let rounding = 1e-14 * value.abs();
        if low >= -rounding || high <= rounding {
            continue;
        }
        if let Some(root) = single_root(&part, axis, value) {
            let (a, b) = part.range;
            found.push(a + root * (b - a));
            continue;
        }
        if depth == 48 || high - low <= 4.0 * rounding {
            found.push(f64::midpoint(part.range.0, part.range.1));
            continue;
        }
        stack.extend(part.split(0.5).map(|half| (half, depth + 1)));
    }
}

/// The share of a piece where it crosses the line, if its control points change sides once, from one end to the other.
fn single_root(piece: &BezierCurve, axis: usize, value: f64) -> Option<f64> {
    let mut sides = [0.0; MAX_DEGREE + 1];
    let count = piece.points.len().min(MAX_DEGREE + 1);
    for (side, h) in sides.iter_mut().zip(&piece.points) {
        *side = h[axis] - value * h.w;
    }
    let sides = &sides[..count];
    let (first, last) = (*sides.first()?, *sides.last()?);
    let changes = sides.windows(2).filter(|w| (w[0] < 0.0) != (w[1] < 0.0));
    let zero = sides.contains(&0.0);
    if zero || changes.count() != 1 || (first < 0.0) == (last < 0.0) {
        return None;
    }
    if count == 2 {
        return Some(first / (first - last));
    }
    let at = |s: f64| {
        let mut work = [0.0; MAX_DEGREE + 1];
        work[..count].copy_from_slice(sides);
        for last in (1..count).rev() {
            for k in 0..last {
                work[k] += s * (work[k + 1] - work[k]);
            }
        }
        work[0]
    };
    let (mut low, mut high) = (0.0_f64, 1.0_f64);
    for _ in 0..52 {
        let middle = f64::midpoint(low, high);
        if (at(middle) < 0.0) == (first < 0.0) {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(f64::midpoint(low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_are_exact_for_polynomials() {
        for count in 1..30 {
            let rule = rule(count);
            for degree in [0, 1, 2 * count - 1] {
                let degree = i32::try_from(degree).unwrap();
                let sum: f64 = rule.iter().map(|&(x, w)| w * x.powi(degree)).sum();
                let exact = 1.0 / f64::from(degree + 1);
                assert!((sum - exact).abs() < 1e-15, "{count} {degree} {sum}");
            }
        }
    }
}
