//! The knot cells of a surface, and what loops take of each.

use super::patch::{Patch, Rules};
use crate::model::Loop;
use crate::pcurve::planar::crossings;
use crate::region::{loop_pieces, scale_of, start_of};
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::nurbs::NurbsSurface;
use nurbskin_geometry::nurbs::bezier;
use nurbskin_geometry::nurbs::bezier::BezierCurve;
use std::ops::{Add, AddAssign, Mul};

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

/// A surface and its knot cells.
pub(super) struct Cells<'a> {
    surface: &'a NurbsSurface,
    apex: DVec3,
    breaks: [Vec<f64>; 2],
}

/// What is to be integrated within one cell.
enum Work {
    /// F dv along a curve, F being counted from the left side of the cell.
    Along(BezierCurve),
    /// The part of the cell below v, so often.
    Below(f64, f64),
}

/// All that loops ask of the cells.
#[derive(Default)]
struct Order {
    /// By cell, the number along u plus that along v times their count along u.
    work: Vec<(usize, Work)>,
    /// How often the loops leave a row of cells upwards in a column: all cells to the left count so often.
    leaves: Vec<i32>,
}

impl<'a> Cells<'a> {
    pub(super) fn new(surface: &'a NurbsSurface, apex: DVec3) -> Self {
        Self {
            surface,
            apex,
            breaks: [
                surface.knots_u().breakpoints(),
                surface.knots_v().breakpoints(),
            ],
        }
    }

    fn rules(&self) -> Rules {
        let [low, high] = self.surface.bounding_box();
        let [(a, b), (c, d)] = self.surface.domain();
        let reach = (high - self.apex).abs().max((low - self.apex).abs());
        let size = (scale_of(self.surface) * DVec2::new(b - a, d - c)).element_product();
        Rules::new(self.surface, reach.length(), size)
    }

    /// The cell that holds a place.
    fn cell(&self, place: DVec2) -> [usize; 2] {
        [(place.x, &self.breaks[0]), (place.y, &self.breaks[1])].map(|(x, breaks)| {
            let after = breaks.partition_point(|&b| b <= x);
            after.clamp(1, breaks.len() - 1) - 1
        })
    }

    /// The integral over the region inside loops: positive where they run counter-clockwise.
    pub(super) fn integrate(&self, loops: &[Loop]) -> Result<Sums> {
        let [m, n] = [self.breaks[0].len() - 1, self.breaks[1].len() - 1];
        let mut order = Order {
            leaves: vec![0; m * n],
            ..Order::default()
        };
        for each in loops {
            let mut parts = Vec::new();
            for piece in loop_pieces(each)? {
                self.cut(piece.curve, &mut parts);
            }
            let Some(last) = parts.last() else { continue };
            let mut at = self.cell(last.point(0.5).truncate());
            for part in parts {
                let cell = self.cell(part.point(0.5).truncate());
                let v = start_of(&part).y;
                self.step(at, cell, v, &mut order);
                at = cell;
                #[expect(clippy::float_cmp, reason = "exactly level")]
                let level = part.points.iter().all(|h| h.y == v * h.w);
                if !level {
                    order.work.push((cell[1] * m + cell[0], Work::Along(part)));
                }
            }
        }
        self.carry_out(order)
    }

    /// Does the work of each cell, one after the other.
    fn carry_out(&self, order: Order) -> Result<Sums> {
        let m = self.breaks[0].len() - 1;
        let mut times = order.leaves;
        for row in times.chunks_exact_mut(m) {
            let mut right = 0;
            for each in row.iter_mut().rev() {
                right += std::mem::replace(each, right);
            }
        }
        let mut work = order.work;
        work.sort_by_key(|(cell, _)| *cell);
        let mut rest = work.into_iter().peekable();
        let (mut sum, mut rules) = (Sums::default(), self.rules());
        bezier::visit(self.surface, |[i, j], piece| {
            let cell = j * m + i;
            let patch = Patch::new(piece, self.apex);
            let [u, v] = piece.range;
            let times = times.get(cell).copied().unwrap_or(0);
            if times != 0 {
                let whole = patch.rectangle([0.0, 1.0], [0.0, 1.0], &mut rules);
                sum += whole * f64::from(times);
            }
            while let Some((_, task)) = rest.next_if(|(at, _)| *at == cell) {
                sum += match task {
                    Work::Along(part) => patch.along(&within(part, u, v), &mut rules),
                    Work::Below(top, times) => {
                        let top = (top - v.0) / (v.1 - v.0);
                        patch.rectangle([0.0, 1.0], [0.0, top], &mut rules) * times
                    }
                };
            }
        })?;
        Ok(sum)
    }

    /// What the cells to the left change when the curve goes from one cell to another at v: first to its column, then
    /// to its row.
    fn step(&self, from: [usize; 2], to: [usize; 2], v: f64, order: &mut Order) {
        let m = self.breaks[0].len() - 1;
        if v > self.breaks[1][from[1]] {
            let times = if to[0] > from[0] { -1.0 } else { 1.0 };
            for i in from[0].min(to[0])..from[0].max(to[0]) {
                order.work.push((from[1] * m + i, Work::Below(v, times)));
            }
        }
        for j in from[1]..to[1] {
            order.leaves[j * m + to[0]] += 1;
        }
        for j in to[1]..from[1] {
            order.leaves[j * m + to[0]] -= 1;
        }
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

/// A curve by the shares of the cell with these ranges.
fn within(mut part: BezierCurve, u: (f64, f64), v: (f64, f64)) -> BezierCurve {
    for h in &mut part.points {
        h.x = (h.x - u.0 * h.w) / (u.1 - u.0);
        h.y = (h.y - v.0 * h.w) / (v.1 - v.0);
    }
    part
}
