//! Curves in space that lie on a surface.

use nurbskin_geometry::nurbs::bezier::curve_pieces;
use nurbskin_geometry::nurbs::tessellate::derivatives::DerivativeBounds;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve, NurbsSurface};
use nurbskin_geometry::unit::three_digits;
use nurbskin_geometry::{DVec3, Error, Result};

/// Places of a piece at which the gap is looked at first, ...
const PLACES: usize = 8;
/// ... and at most where it is certified.
const MOST_PLACES: f64 = 2000.0;
/// The share of the gap that may lie between places.
const BETWEEN: f64 = 0.3;
/// A piece is halved so often at most.
const DEPTH: usize = 20;

/// The curve C(t) over the parameters of a p-curve that stays within `gap` of S(p(t)) at every t: cubic pieces with the
/// places and directions of S(p(t)) at their ends, halved until they are close enough.
///
/// The gap is certified. Between two places of a piece, h apart, a vector e(t) is no longer than the longer one of theirs
/// plus h^2 / 8 times the largest second derivative; that of S(p(t)) is bounded by those of the surface over the rectangle
/// that the p-curve crosses, and of the p-curve by its control points.
///
/// # Errors
/// [`Error::NoSolution`] if no halving brings it that close.
pub(crate) fn curve(surface: &NurbsSurface, pcurve: &NurbsCurve, gap: f64) -> Result<NurbsCurve> {
    let bounds = DerivativeBounds::new(surface)?;
    let end = |t: f64| -> [DVec3; 2] {
        let [p, d, _] = pcurve.derivatives(t);
        let s = surface.derivatives(p.x, p.y);
        [s.point, s.du * d.x + s.dv * d.y]
    };
    let breaks = pcurve.knots().breakpoints();
    let mut pieces: Vec<(f64, [DVec3; 4])> = Vec::new();
    for (w, flat) in breaks.windows(2).zip(curve_pieces(pcurve)?) {
        let flat: Vec<DVec3> = flat.points.iter().map(|h| h.truncate() / h.w).collect();
        let bend = Bend::new(&flat, w[1] - w[0], &bounds);
        // Those still to be looked at, the next one last.
        let mut open = vec![(w[0], w[1], 0)];
        while let Some((a, b, depth)) = open.pop() {
            let ([p, d], [q, e]) = (end(a), end(b));
            let third = (b - a) / 3.0;
            let cubic = [p, p + third * d, q - third * e, q];
            let off = |count: usize| -> f64 {
                let at = |k: usize| {
                    let s = k as f64 / count as f64;
                    let at = pcurve.point(a + (b - a) * s);
                    bezier(&cubic, s).distance(surface.point(at.x, at.y))
                };
                (1..count).map(at).fold(0.0, f64::max)
            };
            let sag = bend.sag(b - a, &cubic);
            let needed = (sag / (BETWEEN * gap)).sqrt().max(2.0).ceil();
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "2 to 2000"
            )]
            let close = off(PLACES) <= gap
                && needed <= MOST_PLACES
                && off(needed as usize) + sag / (needed * needed) <= gap;
            if close {
                pieces.push((b, cubic));
            } else if depth < DEPTH {
                let middle = f64::midpoint(a, b);
                open.push((middle, b, depth + 1));
                open.push((a, middle, depth + 1));
            } else {
                return Err(Error::NoSolution(format!(
                    "an edge is {} away from its surface, farther than the {} allowed",
                    three_digits(off(PLACES)),
                    three_digits(gap)
                )));
            }
        }
    }
    join(breaks[0], &pieces)
}

/// Bounds of the second derivative of S(p(t)) over one polynomial piece of p.
struct Bend {
    largest: f64,
}

impl Bend {
    /// `points`: the Bezier points of p over an interval of this length.
    fn new(points: &[DVec3], length: f64, bounds: &DerivativeBounds) -> Self {
        let degree = points.len().saturating_sub(1) as f64;
        let largest = |differences: &mut dyn Iterator<Item = DVec3>| {
            differences.fold(DVec3::ZERO, |most, d| most.max(d.abs()))
        };
        let first = largest(&mut points.windows(2).map(|w| w[1] - w[0])) * (degree / length);
        let second = largest(&mut points.windows(3).map(|w| w[2] - 2.0 * w[1] + w[0]))
            * (degree * (degree - 1.0) / (length * length));
        let [low, high] = nurbskin_geometry::point_grid::bounding_box(points);
        let [u, v, uu, uv, vv] = bounds.over([low.x, low.y], [high.x, high.y]);
        let largest = uu * first.x * first.x
            + 2.0 * uv * first.x * first.y
            + vv * first.y * first.y
            + u * second.x
            + v * second.y;
        Self { largest }
    }

    /// The largest distance of S(p(t)) less a cubic over an interval of this length from a chord of it, both together.
    fn sag(&self, length: f64, cubic: &[DVec3; 4]) -> f64 {
        let bend = |k: usize| (cubic[k + 2] - 2.0 * cubic[k + 1] + cubic[k]).length();
        (self.largest * length * length + 6.0 * bend(0).max(bend(1))) / 8.0
    }
}

/// Cubic pieces that follow each other, each with the parameter at its end, as one curve with double knots.
fn join(start: f64, pieces: &[(f64, [DVec3; 4])]) -> Result<NurbsCurve> {
    let mut knots = vec![start; 4];
    let mut points = Vec::with_capacity(2 * pieces.len() + 2);
    for (k, (b, cubic)) in pieces.iter().enumerate() {
        if k == 0 {
            points.push(cubic[0]);
        }
        points.extend([cubic[1], cubic[2]]);
        if k + 1 == pieces.len() {
            points.push(cubic[3]);
            knots.extend([*b; 4]);
        } else {
            knots.extend([*b; 2]);
        }
    }
    NurbsCurve::new(KnotVector::new(3, knots)?, points, None)
}

fn bezier(c: &[DVec3; 4], s: f64) -> DVec3 {
    let r = 1.0 - s;
    c[0] * (r * r * r) + 3.0 * (c[1] * (r * r * s) + c[2] * (r * s * s)) + c[3] * (s * s * s)
}
