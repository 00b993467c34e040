//! Integrals over parts of one Bezier piece of a surface.

use super::Sums;
use crate::pcurve::planar::{place_and_velocity, rule};
use glam::{DVec3, DVec4};
use nurbskin_geometry::nurbs::bezier::{BezierCurve, BezierPatch};
use nurbskin_geometry::nurbs::{MAX_DEGREE, NurbsSurface};

/// Two rules may differ by this share of what they integrate; the better one is off by a hundredth of that or less.
const AGREEMENT: f64 = 1e-8;
/// ... and by this share of about the area of the whole surface, so that what is next to nothing is not looked at
/// closely.
const FLOOR: f64 = 1e-12;
/// Boxes are cut in four this often at most: where the surface has no normal, the density has a kink.
const DEPTH: usize = 7;
/// Cuts for all of a face: a surface full of kinks shall end, too.
const MOST_CUTS: usize = 10_000;

type Rule = Vec<(f64, f64)>;

/// The ranges of the outer and the inner variable.
type Ranges = [[f64; 2]; 2];

/// Gauss' rules of rising order, the outer and the inner one.
type Ladder = Vec<[Rule; 2]>;

/// How closely integrals are looked at.
pub(super) struct Rules {
    /// Along v and u, for rectangles.
    rectangle: Ladder,
    /// Along a curve and from it to the left side of its cell; short parts of curves need few points.
    along: Ladder,
    /// Largest distance from the apex.
    reach: f64,
    /// About the area of the whole surface.
    size: f64,
    /// Cuts that are left.
    cuts: usize,
}

impl Rules {
    pub(super) fn new(surface: &NurbsSurface, reach: f64, size: f64) -> Self {
        // The cone of a polynomial surface has the degree 3 p - 1; quotients and roots need more.
        let more = if surface.is_rational() { 4 } else { 1 };
        let [p, q] = surface.degree().map(|p| (p + more).clamp(4, 20));
        let ladder = |counts: &[[usize; 2]]| {
            let rungs = counts.iter().map(|&[a, b]| [rule(a), rule(b)]);
            rungs.collect::<Ladder>()
        };
        Self {
            rectangle: ladder(&[[q, p], [q + 2, p + 2], [q + 6, p + 6]]),
            along: ladder(&[[2, p], [3, p + 2], [6, p + 3], [10, p + 6]]),
            reach,
            size,
            cuts: MOST_CUTS,
        }
    }

    /// Whether two results for the same integral agree.
    fn agree(&self, one: &Sums, two: &Sums) -> bool {
        let reach = self.reach;
        let slack = AGREEMENT * one.area.abs().max(two.area.abs()) + FLOOR * self.size;
        (one.area - two.area).abs() <= slack
            && (one.area_moment - two.area_moment).length() <= slack * reach
            && (one.cone - two.cone).abs() <= slack * reach
            && (one.cone_moment - two.cone_moment).length() <= slack * reach * reach
    }

    /// The integral over a box by rules of rising order until two agree; the box is cut in four where none do.
    fn adaptive(
        &mut self,
        ladder: fn(&Self) -> &Ladder,
        [a, b]: Ranges,
        by: &mut dyn FnMut(&[Rule; 2], Ranges) -> Sums,
        depth: usize,
    ) -> Sums {
        let mut before: Option<Sums> = None;
        for rung in 0..ladder(self).len() {
            let next = by(&ladder(self)[rung], [a, b]);
            if before.is_some_and(|before| self.agree(&next, &before)) {
                return next;
            }
            before = Some(next);
        }
        if depth == 0 || self.cuts == 0 {
            return before.unwrap_or_default();
        }
        self.cuts -= 1;
        let halves = |[low, high]: [f64; 2]| {
            let middle = f64::midpoint(low, high);
            [[low, middle], [middle, high]]
        };
        let mut sum = Sums::default();
        for a in halves(a) {
            for b in halves(b) {
                sum += self.adaptive(ladder, [a, b], by, depth - 1);
            }
        }
        sum
    }
}

/// A piece of a surface over the unit square.
pub(super) struct Patch<'a> {
    piece: &'a BezierPatch,
    apex: DVec3,
}

/// A piece at constant v: its control points along u and their derivatives by v.
struct Row {
    points: [DVec4; MAX_DEGREE + 1],
    slopes: [DVec4; MAX_DEGREE + 1],
}

/// Bernstein polynomials of one degree less at a parameter.
struct Basis {
    at: f64,
    values: [f64; MAX_DEGREE + 1],
}

impl Basis {
    /// Source: A1.3, *The NURBS Book*, 2nd ed., p. 21.
    fn new(degree: usize, at: f64) -> Self {
        let mut values = [0.0; MAX_DEGREE + 1];
        values[0] = 1.0;
        for j in 1..degree {
            let mut saved = 0.0;
            for value in values.iter_mut().take(j) {
                let old = *value;
                *value = saved + (1.0 - at) * old;
                saved = at * old;
            }
            values[j] = saved;
        }
        Self { at, values }
    }

    /// A Bezier polynomial and its derivative.
    #[inline]
    fn apply(&self, degree: usize, point: impl Fn(usize) -> DVec4) -> [DVec4; 2] {
        let (mut value, mut slope) = (DVec4::ZERO, DVec4::ZERO);
        let mut before = point(0);
        for (k, &share) in self.values.iter().take(degree).enumerate() {
            let next = point(k + 1);
            let rise = next - before;
            value += share * (before + self.at * rise);
            slope += share * rise;
            before = next;
        }
        [value, slope * degree as f64]
    }

    /// A Bezier polynomial.
    #[inline]
    fn value(&self, points: &[DVec4]) -> DVec4 {
        let pairs = points.windows(2).zip(&self.values);
        pairs.fold(DVec4::ZERO, |sum, (pair, &share)| {
            sum + share * (pair[0] + self.at * (pair[1] - pair[0]))
        })
    }
}

impl<'a> Patch<'a> {
    pub(super) fn new(piece: &'a BezierPatch, apex: DVec3) -> Self {
        Self { piece, apex }
    }

    /// The integral over a rectangle.
    pub(super) fn rectangle(&self, u: [f64; 2], v: [f64; 2], rules: &mut Rules) -> Sums {
        let [p, _] = self.piece.degree;
        let mut row = Row::new();
        let mut columns: Vec<(Basis, f64)> = Vec::new();
        let mut by = |[outer, inner]: &[Rule; 2], [[c, d], [a, b]]: Ranges| {
            let basis = |&(x, weight): &(f64, f64)| (Basis::new(p, a + x * (b - a)), weight);
            columns.clear();
            columns.extend(inner.iter().map(basis));
            let mut sum = Sums::default();
            for &(y, weight) in outer {
                self.row(c + y * (d - c), &mut row);
                for (basis, share) in &columns {
                    sum += self.density(&row, basis) * (weight * share);
                }
            }
            sum * ((b - a) * (d - c))
        };
        rules.adaptive(|rules| &rules.rectangle, [v, u], &mut by, DEPTH)
    }

    /// The integral of F dv along a curve, F being counted from the left side: by the substitution u = x times that of
    /// the curve, one over the unit square.
    pub(super) fn along(&self, part: &BezierCurve, rules: &mut Rules) -> Sums {
        let [p, _] = self.piece.degree;
        let mut row = Row::new();
        let mut by = |[outer, inner]: &[Rule; 2], [[a, b], [c, d]]: Ranges| {
            let mut sum = Sums::default();
            for &(x, weight) in outer {
                let [place, velocity] = place_and_velocity(part, a + x * (b - a));
                self.row(place.y, &mut row);
                let share = weight * velocity.y * place.x;
                for &(x, weight) in inner {
                    let basis = Basis::new(p, place.x * (c + x * (d - c)));
                    sum += self.density(&row, &basis) * (weight * share);
                }
            }
            sum * ((b - a) * (d - c))
        };
        rules.adaptive(|rules| &rules.along, [[0.0, 1.0]; 2], &mut by, DEPTH)
    }

    fn row(&self, v: f64, row: &mut Row) {
        let [p, q] = self.piece.degree;
        let basis = Basis::new(q, v);
        let points = &self.piece.points;
        for k in 0..=p {
            let line = |l: usize| points[l * (p + 1) + k];
            [row.points[k], row.slopes[k]] = basis.apply(q, line);
        }
    }

    fn density(&self, row: &Row, basis: &Basis) -> Sums {
        let [p, _] = self.piece.degree;
        let [h, hu] = basis.apply(p, |k| row.points[k]);
        let hv = basis.value(&row.slopes[..=p]);
        let inverse = 1.0 / h.w;
        let point = h.truncate() * inverse;
        let du = (hu.truncate() - hu.w * point) * inverse;
        let dv = (hv.truncate() - hv.w * point) * inverse;
        let normal = du.cross(dv);
        let (area, from) = (normal.length(), point - self.apex);
        let height = from.dot(normal);
        Sums {
            area,
            area_moment: area * from,
            cone: height / 3.0,
            cone_moment: height / 4.0 * from,
        }
    }
}

impl Row {
    fn new() -> Self {
        Self {
            points: [DVec4::ZERO; MAX_DEGREE + 1],
            slopes: [DVec4::ZERO; MAX_DEGREE + 1],
        }
    }
}
