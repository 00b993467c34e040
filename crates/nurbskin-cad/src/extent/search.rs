//! The largest value of one coordinate.

use super::Part;
use super::borders::Borders;
use crate::region::{Cover, Region};
use glam::{DVec2, DVec3, DVec4};
use nurbskin_geometry::Result;
use nurbskin_geometry::nurbs::bezier::{BezierCurve, BezierPatch, curve_pieces, visit};
use nurbskin_geometry::nurbs::refine::Direction;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Pieces that a search looks at before it gives up and says how far it may be off.
const BUDGET: usize = 200_000;

/// What may hold the largest value.
enum Piece {
    /// All of a face.
    Face(usize),
    /// A part of a face.
    Patch(usize, BezierPatch),
    /// A part of an edge.
    Edge(BezierCurve),
    /// A part of a crease of a face, at a parameter of a direction.
    Crease(usize, Direction, f64, BezierCurve),
}

/// A piece, its bound, and the order in which it came: the heap's order is total.
struct Task {
    bound: f64,
    number: usize,
    piece: Piece,
}

impl PartialEq for Task {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Task {}
impl PartialOrd for Task {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Task {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_bound = self.bound.total_cmp(&other.bound);
        by_bound.then(other.number.cmp(&self.number))
    }
}

/// The search for the largest value of `sign` times a coordinate.
pub(super) struct Search<'a> {
    parts: &'a [Part<'a>],
    axis: usize,
    sign: f64,
    tolerance: f64,
    best: f64,
    heap: BinaryHeap<Task>,
    count: usize,
}

impl<'a> Search<'a> {
    pub(super) fn new(parts: &'a [Part<'a>], axis: usize, sign: f64, tolerance: f64) -> Self {
        Self {
            parts,
            axis,
            sign,
            tolerance,
            best: f64::NEG_INFINITY,
            heap: BinaryHeap::new(),
            count: 0,
        }
    }

    fn value(&self, point: DVec3) -> f64 {
        self.sign * point[self.axis]
    }

    fn bound(&self, points: &[DVec4]) -> f64 {
        let values = points.iter().map(|&h| self.value(h.truncate() / h.w));
        values.fold(f64::NEG_INFINITY, f64::max)
    }

    fn push(&mut self, bound: f64, piece: Piece) {
        if bound > self.best + self.tolerance {
            self.count += 1;
            let number = self.count;
            self.heap.push(Task {
                bound,
                number,
                piece,
            });
        }
    }

    fn found(&mut self, point: DVec3) {
        self.best = self.best.max(self.value(point));
    }

    /// The largest value, and by how much it may be too small.
    pub(super) fn run(mut self, points: &[DVec3], borders: &Borders) -> Result<[f64; 2]> {
        points.iter().for_each(|&p| self.found(p));
        for loose in &borders.loose {
            self.best = self.best.max(loose.largest(|p| self.value(p)));
        }
        for curve in &borders.edges {
            for piece in curve_pieces(curve)? {
                self.found(piece.point(0.0));
                self.found(piece.point(1.0));
                self.push(self.bound(&piece.points), Piece::Edge(piece));
            }
        }
        for (k, part) in self.parts.iter().enumerate() {
            let corners = part.face.surface.bounding_box();
            let bound = corners.map(|p| self.value(p));
            self.push(bound[0].max(bound[1]), Piece::Face(k));
        }
        let mut seen = 0;
        while let Some(task) = self.heap.pop() {
            if task.bound <= self.best + self.tolerance {
                break;
            }
            seen += 1;
            // The first piece that is left has the highest bound of all.
            if seen > BUDGET {
                return Ok([self.best, task.bound - self.best]);
            }
            match task.piece {
                Piece::Face(k) => self.open(k)?,
                Piece::Patch(k, patch) => self.patch(k, &patch),
                Piece::Edge(curve) => {
                    if !self.is_monotone(&curve.points) {
                        self.split(&curve, &|_| true, Piece::Edge);
                    }
                }
                Piece::Crease(k, direction, at, curve) => self.crease(k, direction, at, &curve),
            }
        }
        Ok([self.best, self.tolerance])
    }

    /// The patches and creases of a face.
    fn open(&mut self, k: usize) -> Result<()> {
        let parts = self.parts;
        let surface = &parts[k].face.surface;
        for direction in Direction::BOTH {
            let knots = surface.knots(direction);
            let breaks = knots.breakpoints();
            for &at in breaks.get(1..breaks.len() - 1).unwrap_or_default() {
                if knots.multiplicity(at) < knots.degree() {
                    continue;
                }
                for piece in curve_pieces(&surface.iso_curve(direction, at)?)? {
                    let bound = self.bound(&piece.points);
                    self.push(bound, Piece::Crease(k, direction, at, piece));
                }
            }
        }
        visit(surface, |_, patch| {
            let bound = self.bound(&patch.points);
            if bound > self.best + self.tolerance {
                self.push(bound, Piece::Patch(k, patch.clone()));
            }
        })
    }

    fn patch(&mut self, k: usize, patch: &BezierPatch) {
        let [(a, b), (c, d)] = patch.range;
        let parts = self.parts;
        let region = parts[k].region();
        let cover = region.map_or(Cover::Inside, |region| {
            region.cover(DVec2::new(a, c), DVec2::new(b, d))
        });
        if cover == Cover::Outside || self.is_monotone_patch(patch) {
            return;
        }
        let middle = DVec2::new(f64::midpoint(a, b), f64::midpoint(c, d));
        if cover == Cover::Inside || region.is_none_or(|region| region.contains(middle)) {
            self.found(patch.point(0.5, 0.5));
        }
        for half in patch.split(self.most_bent(patch), 0.5) {
            self.push(self.bound(&half.points), Piece::Patch(k, half));
        }
    }

    fn crease(&mut self, k: usize, direction: Direction, at: f64, curve: &BezierCurve) {
        let place = |t: f64| match direction {
            Direction::U => DVec2::new(at, t),
            Direction::V => DVec2::new(t, at),
        };
        let parts = self.parts;
        let region: Option<&Region> = parts[k].region();
        let outside = region.is_some_and(|region| {
            region.cover(place(curve.range.0), place(curve.range.1)) == Cover::Outside
        });
        if outside || self.is_monotone(&curve.points) {
            return;
        }
        let inside = |t: f64| region.is_none_or(|region| region.contains(place(t)));
        self.split(curve, &inside, |half| Piece::Crease(k, direction, at, half));
    }

    fn split(
        &mut self,
        curve: &BezierCurve,
        inside: &dyn Fn(f64) -> bool,
        piece: impl Fn(BezierCurve) -> Piece,
    ) {
        let halves = curve.split(0.5);
        if inside(halves[0].range.1) {
            self.found(halves[1].point(0.0));
        }
        for half in halves {
            self.push(self.bound(&half.points), piece(half));
        }
    }

    /// (coordinate less `best` times weight, weight): what the derivative of the quotient is made of, small where the
    /// coordinate is close to the best.
    fn relative(&self, h: DVec4) -> [f64; 2] {
        let best = if self.best.is_finite() {
            self.best
        } else {
            0.0
        };
        [self.sign * h[self.axis] - best * h.w, h.w]
    }

    /// Whether the coordinate rises or falls strictly along a line of Bezier points `stride` apart: its derivative has
    /// the sign of `x' w - x w'`, bounded by the differences.
    fn rises(&self, points: &[DVec4], lines: &[usize], count: usize, stride: usize) -> bool {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let (mut turn, mut reach) = (0.0_f64, 0.0_f64);
        let (mut light, mut heavy) = (f64::INFINITY, 0.0_f64);
        for &first in lines {
            for i in 0..count {
                let [x, w] = self.relative(points[first + i * stride]);
                reach = reach.max(x.abs());
                (light, heavy) = (light.min(w), heavy.max(w));
                if i > 0 {
                    let [before, weight] = self.relative(points[first + (i - 1) * stride]);
                    low = low.min(x - before);
                    high = high.max(x - before);
                    turn = turn.max((w - weight).abs());
                }
            }
        }
        // Far above rounding: where the coordinate is flatter, its bound is close enough anyway.
        let margin = 1e-2 * self.tolerance * heavy;
        let slack = reach * turn / light + margin;
        low > slack || high < -slack
    }

    fn is_monotone(&self, points: &[DVec4]) -> bool {
        self.rises(points, &[0], points.len(), 1)
    }

    fn is_monotone_patch(&self, patch: &BezierPatch) -> bool {
        let [m, n] = patch.degree.map(|degree| degree + 1);
        let rows: Vec<usize> = (0..n).map(|j| j * m).collect();
        let columns: Vec<usize> = (0..m).collect();
        self.rises(&patch.points, &rows, m, 1) || self.rises(&patch.points, &columns, n, m)
    }

    /// The direction along which the coordinate is least linear.
    fn most_bent(&self, patch: &BezierPatch) -> Direction {
        let [m, n] = patch.degree.map(|degree| degree + 1);
        let at = |i: usize, j: usize| self.relative(patch.points[j * m + i])[0];
        let (mut along_u, mut along_v) = (0.0_f64, 0.0_f64);
        for j in 0..n {
            for i in 0..m {
                let here = at(i, j);
                if i + 2 < m {
                    along_u = along_u.max((at(i + 2, j) - 2.0 * at(i + 1, j) + here).abs());
                }
                if j + 2 < n {
                    along_v = along_v.max((at(i, j + 2) - 2.0 * at(i, j + 1) + here).abs());
                }
                // A twist or a slope is made smaller by either.
                if i + 1 < m {
                    along_u = along_u.max(1e-2 * (at(i + 1, j) - here).abs());
                }
                if j + 1 < n {
                    along_v = along_v.max(1e-2 * (at(i, j + 1) - here).abs());
                }
            }
        }
        if along_u >= along_v {
            Direction::U
        } else {
            Direction::V
        }
    }
}
