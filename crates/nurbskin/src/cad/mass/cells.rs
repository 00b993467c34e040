//! Integrals over the knot cells of a surface and along loops through them.

use crate::Result;
use crate::cad::model::Loop;
use crate::cad::planar::{crossings, place_and_velocity, rule};
use crate::cad::region::{loop_pieces, start_of};
use crate::nurbs::NurbsSurface;
use crate::nurbs::bezier::BezierCurve;
use glam::{DVec2, DVec3};
use std::ops::{Add, AddAssign, Mul};

/// Two rules may differ by this share of what they integrate.
const AGREEMENT: f64 = 1e-11;

/// Intervals are halved this often at most: where the surface has no normal, the density has a kink.
const DEPTH: usize = 12;

/// What is integrated, all by one pass. Vectors are from the apex.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    pub(super) area: f64,
    pub(super) area_moment: DVec3,
    pub(super) cone: f64,
    pub(super) cone_moment: DVec3,
}

impl Add for Sums {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            area: self.area + other.area,
            area_moment: self.area_moment + other.area_moment,
            cone: self.cone + other.cone,
            cone_moment: self.cone_moment + other.cone_moment,
        }
    }
}

impl AddAssign for Sums {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Mul<f64> for Sums {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self {
            area: self.area * factor,
            area_moment: self.area_moment * factor,
            cone: self.cone * factor,
            cone_moment: self.cone_moment * factor,
        }
    }
}

/// A surface, its knot cells and the rules for them.
pub(super) struct Cells<'a> {
    surface: &'a NurbsSurface,
    apex: DVec3,
    breaks: [Vec<f64>; 2],
    /// The rule and the lower one it is compared with, along u and along v.
    rules: [[Vec<(f64, f64)>; 2]; 2],
    /// Largest distance from the apex.
    reach: f64,
    /// The area of the net's box in the parameter plane's scale: what is small against it does not matter.
    size: f64,
}

impl<'a> Cells<'a> {
    pub(super) fn new(surface: &'a NurbsSurface, apex: DVec3) -> Result<Self> {
        let [low, high] = surface.bounding_box();
        let reach = (high - apex).abs().max((low - apex).abs()).length();
        let rules = surface.degree().map(|degree| {
            // The cone of a polynomial surface has the degree 3 p - 1, its moment 4 p - 1.
            // Quotients and roots need more, for a quarter turn of a circle 12.
            let more = if surface.is_rational() { 9 } else { 4 };
            let count = (degree + degree.div_ceil(2) + more).clamp(6, 24);
            [rule(count), rule(count - 2)]
        });
        Ok(Self {
            surface,
            apex,
            breaks: [
                surface.knots_u().breakpoints(),
                surface.knots_v().breakpoints(),
            ],
            rules,
            reach,
            size: (high - low).length_squared(),
        })
    }

    fn density(&self, u: f64, v: f64) -> Sums {
        let d = self.surface.derivatives(u, v);
        let normal = d.du.cross(d.dv);
        let (area, from) = (normal.length(), d.point - self.apex);
        let height = from.dot(normal);
        Sums {
            area,
            area_moment: area * from,
            cone: height / 3.0,
            cone_moment: height / 4.0 * from,
        }
    }

    /// Whether two results for the same integral agree; `whole` is the share of the domain that it covers.
    fn agree(&self, one: Sums, two: Sums) -> bool {
        let most = one.area.abs().max(two.area.abs());
        let slack = AGREEMENT * most + 1e-3 * AGREEMENT * AGREEMENT.sqrt() * self.size;
        let reach = self.reach;
        (one.area - two.area).abs() <= slack
            && (one.area_moment - two.area_moment).length() <= slack * reach
            && (one.cone - two.cone).abs() <= slack * reach
            && (one.cone_moment - two.cone_moment).length() <= slack * reach * reach
    }

    /// The integral of f from `a` to `b` by a rule, halved as long as a lower one says something else.
    fn adaptive(
        &self,
        axis: usize,
        [a, b]: [f64; 2],
        f: &dyn Fn(f64) -> Sums,
        depth: usize,
    ) -> Sums {
        let by = |rule: &[(f64, f64)]| {
            let mut sum = Sums::default();
            for &(x, weight) in rule {
                sum += f(a + x * (b - a)) * weight;
            }
            sum * (b - a)
        };
        let [fine, coarse] = &self.rules[axis];
        let result = by(fine);
        if depth == 0 || self.agree(result, by(coarse)) {
            return result;
        }
        let middle = f64::midpoint(a, b);
        self.adaptive(axis, [a, middle], f, depth - 1)
            + self.adaptive(axis, [middle, b], f, depth - 1)
    }

    /// The integral along u from `a` to `b` at v, within one cell.
    fn strip(&self, u: [f64; 2], v: f64) -> Sums {
        self.adaptive(0, u, &|u| self.density(u, v), DEPTH)
    }

    /// The integral over a rectangle within one cell: by the product of both rules, cut in four where the lower ones
    /// say something else.
    fn rectangle(&self, [a, b]: [f64; 2], [c, d]: [f64; 2], depth: usize) -> Sums {
        let by = |k: usize| {
            let mut sum = Sums::default();
            for &(y, weight) in &self.rules[1][k] {
                let mut row = Sums::default();
                for &(x, weight) in &self.rules[0][k] {
                    row += self.density(a + x * (b - a), c + y * (d - c)) * weight;
                }
                sum += row * weight;
            }
            sum * ((b - a) * (d - c))
        };
        let result = by(0);
        if depth == 0 || self.agree(result, by(1)) {
            return result;
        }
        let (u, v) = (f64::midpoint(a, b), f64::midpoint(c, d));
        let mut sum = Sums::default();
        for v in [[c, v], [v, d]] {
            for u in [[a, u], [u, b]] {
                sum += self.rectangle(u, v, depth - 1);
            }
        }
        sum
    }

    /// The cell that holds a place.
    fn cell(&self, place: DVec2) -> [usize; 2] {
        [(place.x, &self.breaks[0]), (place.y, &self.breaks[1])].map(|(x, breaks)| {
            let after = breaks.partition_point(|&b| b <= x);
            after.clamp(1, breaks.len() - 1) - 1
        })
    }

    fn range(&self, axis: usize, cell: usize) -> [f64; 2] {
        [self.breaks[axis][cell], self.breaks[axis][cell + 1]]
    }

    /// The integral over the region inside loops: positive where they run counter-clockwise.
    pub(super) fn integrate(&self, loops: &[Loop]) -> Result<Sums> {
        let [m, n] = [self.breaks[0].len() - 1, self.breaks[1].len() - 1];
        // How often the loops leave a row of cells upwards in a column: all cells to the left count so often.
        let mut leaves = vec![0_i32; m * n];
        let mut sum = Sums::default();
        for each in loops {
            let mut parts = Vec::new();
            for piece in loop_pieces(each)? {
                self.cut(piece.curve, &mut parts);
            }
            let Some(last) = parts.last() else { continue };
            let mut at = self.cell(last.point(0.5).truncate());
            for part in &parts {
                let cell = self.cell(part.point(0.5).truncate());
                sum += self.step(at, cell, start_of(part).y, &mut leaves, m);
                sum += self.along(part, cell);
                at = cell;
            }
        }
        let row = |j: usize| {
            let (mut sum, mut times) = (Sums::default(), 0);
            for i in (0..m).rev() {
                if times != 0 {
                    let cell = self.rectangle(self.range(0, i), self.range(1, j), DEPTH / 2);
                    sum += cell * f64::from(times);
                }
                times += leaves[j * m + i];
            }
            sum
        };
        #[cfg(feature = "parallel")]
        let rows: Vec<Sums> = {
            use rayon::prelude::*;
            (0..n).into_par_iter().map(row).collect()
        };
        #[cfg(not(feature = "parallel"))]
        let rows: Vec<Sums> = (0..n).map(row).collect();
        rows.into_iter().for_each(|row| sum += row);
        Ok(sum)
    }

    /// What the cells to the left change when the curve goes from one cell to another at v: first to its column, then
    /// to its row.
    fn step(&self, from: [usize; 2], to: [usize; 2], v: f64, leaves: &mut [i32], m: usize) -> Sums {
        let mut sum = Sums::default();
        let [bottom, _] = self.range(1, from[1]);
        for i in from[0].min(to[0])..from[0].max(to[0]) {
            let below = self.rectangle(self.range(0, i), [bottom, v], DEPTH / 2);
            sum += below * if to[0] > from[0] { -1.0 } else { 1.0 };
        }
        for j in from[1]..to[1] {
            leaves[j * m + to[0]] += 1;
        }
        for j in to[1]..from[1] {
            leaves[j * m + to[0]] -= 1;
        }
        sum
    }

    /// The integral of F dv along a part within a cell, F being counted from the left side of the cell.
    fn along(&self, part: &BezierCurve, cell: [usize; 2]) -> Sums {
        let left = self.breaks[0][cell[0]];
        let v = start_of(part).y;
        #[expect(clippy::float_cmp, reason = "exactly level")]
        if part.points.iter().all(|h| h.y == v * h.w) {
            return Sums::default();
        }
        let f = |s: f64| {
            let [place, velocity] = place_and_velocity(part, s);
            self.strip([left, place.x], place.y) * velocity.y
        };
        self.adaptive(1, [0.0, 1.0], &f, DEPTH)
    }

    /// Cuts a piece where it crosses knot lines.
    fn cut(&self, mut piece: BezierCurve, parts: &mut Vec<BezierCurve>) {
        piece.range = (0.0, 1.0);
        let places = piece.points.iter().map(|h| h.truncate().truncate() / h.w);
        let [low, high] = places.fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[a, b], p| {
            [a.min(p), b.max(p)]
        });
        let mut cuts = Vec::new();
        for (axis, breaks) in self.breaks.iter().enumerate() {
            let from = breaks.partition_point(|&b| b <= low[axis]);
            let to = breaks.partition_point(|&b| b < high[axis]);
            for &value in breaks.get(from..to).unwrap_or_default() {
                crossings(&piece, axis, value, &mut cuts);
            }
        }
        cuts.sort_by(f64::total_cmp);
        let mut rest = piece;
        for cut in cuts {
            let (a, b) = rest.range;
            let share = (cut - a) / (b - a);
            if share > 1e-12 && share < 1.0 - 1e-12 {
                let [before, after] = rest.split(share);
                parts.push(before);
                rest = after;
                rest.range = (cut, 1.0);
            }
        }
        parts.push(rest);
    }
}
