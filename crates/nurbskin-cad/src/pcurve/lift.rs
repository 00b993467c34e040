//! Curves on surfaces from the parameter plane into space.

use glam::{DVec2, DVec3};
use nurbskin_geometry::nurbs::bezier::curve_pieces;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve};
use nurbskin_geometry::{Error, Result};

/// Pieces of a lifted curve at most; more would mean that it cannot be followed.
const MOST_PIECES: usize = 4096;

/// A p-curve may leave an open direction of its surface by this share of the domain, which is rounding.
const OUTSIDE: f64 = 1e-6;

/// Whether a p-curve leaves an open direction of the domain of its surface by more than rounding: there is no surface
/// there, whatever the nearest border says. Closed directions run on over their seams. Looked at in eight places and more
/// of each span.
pub(crate) fn leaves(pcurve: &NurbsCurve, domain: [(f64, f64); 2], closed: [bool; 2]) -> bool {
    let out = |t: f64, axis: usize| {
        let (a, b) = domain[axis];
        let slack = OUTSIDE * (b - a);
        // Not a number is outside.
        !closed[axis] && !(a - slack..=b + slack).contains(&t)
    };
    let parts = 8.max(2 * pcurve.knots().degree());
    let place = |w: &[f64], k: usize| {
        let p = pcurve.point(w[0] + (w[1] - w[0]) * k as f64 / parts as f64);
        out(p.x, 0) || out(p.y, 1)
    };
    let breaks = pcurve.knots().breakpoints();
    breaks.windows(2).any(|w| (0..=parts).any(|k| place(w, k)))
}

/// The curve S(p(t)) over the parameters of p: cubic pieces with its derivatives, within `tolerance` at samples. `jet` is
/// the point of the surface at (u, v) and its derivatives along u and v.
///
/// # Errors
/// [`Error::Invalid`] if that takes too many pieces.
pub(crate) fn lift(
    pcurve: &NurbsCurve,
    tolerance: f64,
    jet: impl Fn(DVec2) -> [DVec3; 3],
) -> Result<NurbsCurve> {
    let (mut points, mut breaks): (Vec<DVec3>, Vec<f64>) = (Vec::new(), Vec::new());
    for piece in curve_pieces(&pcurve.clamped()?)? {
        let degree = piece.points.len() - 1;
        let knots = KnotVector::clamped(degree, &[piece.range.0, piece.range.1])?;
        let flat = NurbsCurve::from_homogeneous(knots, &piece.points, true)?;
        let at = |t: f64| jet(flat.point(t).truncate())[0];
        // A little into the interval: across a knot or a seam of the surface the derivative may be another one.
        let velocity = |t: f64, inward: f64| {
            let [uv, d, _] = flat.derivatives(t + 1e-9 * inward);
            let [_, du, dv] = jet(uv.truncate());
            du * d.x + dv * d.y
        };
        // Spans to do, the first on top.
        let mut open = vec![(piece.range.0, piece.range.1, 0)];
        while let Some((a, b, depth)) = open.pop() {
            let (h, (p, q)) = (b - a, (at(a), at(b)));
            let control = [
                p,
                p + velocity(a, h) * (h / 3.0),
                q - velocity(b, -h) * (h / 3.0),
                q,
            ];
            let off = |s: f64| {
                let (r, w) = (1.0 - s, [1.0, 3.0, 3.0, 1.0]);
                let bernstein = [r * r * r, r * r * s, r * s * s, s * s * s];
                let cubic = (0..4).fold(DVec3::ZERO, |x, k| x + control[k] * (bernstein[k] * w[k]));
                cubic.distance(at(a + h * s))
            };
            let error = [0.25, 0.5, 0.75].into_iter().map(off).fold(0.0, f64::max);
            let middle = f64::midpoint(a, b);
            if error > tolerance && depth < 24 && a < middle && middle < b {
                open.push((middle, b, depth + 1));
                open.push((a, middle, depth + 1));
            } else {
                if points.is_empty() {
                    points.push(p);
                    breaks.push(a);
                }
                points.extend(&control[1..]);
                breaks.extend([b; 3]);
            }
            if breaks.len() > 3 * MOST_PIECES || open.len() > MOST_PIECES {
                return Err(Error::invalid(
                    "a curve on its surface takes too many pieces to follow",
                ));
            }
        }
    }
    breaks.truncate(breaks.len().saturating_sub(2));
    NurbsCurve::new(KnotVector::clamped(3, &breaks)?, points, None)
}

/// What is wrong with a curve that is given in the parameter plane only, and [`leaves`] its surface.
pub(crate) fn outside() -> Error {
    Error::invalid("a curve in the parameter plane, without one in space, leaves its surface")
}
