//! How far triangles in the parameter plane may miss the surface.

use crate::Result;
use crate::nurbs::bezier::visit;
use crate::nurbs::tessellate::bounds::Bounds;
use crate::nurbs::{KnotVector, NurbsSurface};
use glam::DVec2;

/// Bounds of the second derivatives of a surface, per knot cell.
pub(super) struct Metric {
    breaks: [Vec<f64>; 2],
    /// `|S_uu|`, `|S_uv|`, `|S_vv|` per cell, u fastest.
    cells: Vec<[f64; 3]>,
    /// Parameters of creases: interior knots of multiplicity p or more.
    pub(super) creases: [Vec<f64>; 2],
}

impl Metric {
    pub(super) fn new(surface: &NurbsSurface) -> Result<Self> {
        let rational = surface.is_rational();
        let mut cells = Vec::new();
        visit(surface, |_, patch| {
            let bounds = Bounds::new(patch, rational);
            let [w, h] = patch.range.map(|(a, b)| b - a);
            cells.push([
                bounds.uu / (w * w),
                bounds.uv / (w * h),
                bounds.vv / (h * h),
            ]);
        })?;
        let creases = |knots: &KnotVector| {
            let breaks = knots.breakpoints();
            let inner = breaks[1..breaks.len() - 1].iter().copied();
            let sharp = inner.filter(|&t| knots.multiplicity(t) >= knots.degree());
            sharp.collect()
        };
        Ok(Self {
            breaks: [
                surface.knots_u().breakpoints(),
                surface.knots_v().breakpoints(),
            ],
            cells,
            creases: [creases(surface.knots_u()), creases(surface.knots_v())],
        })
    }

    /// The largest bounds in a rectangle.
    pub(super) fn largest(&self, low: DVec2, high: DVec2) -> [f64; 3] {
        let range = |axis: usize| {
            let breaks = &self.breaks[axis];
            let last = breaks.len() - 2;
            // Half open: a rectangle that ends at a knot line does not reach beyond it.
            let from = breaks.partition_point(|&b| b <= low[axis]).max(1) - 1;
            let to = breaks.partition_point(|&b| b < high[axis]).max(1) - 1;
            let from = from.min(last);
            from..=to.min(last).max(from)
        };
        let width = self.breaks[0].len() - 1;
        let mut most = [0.0_f64; 3];
        for j in range(1) {
            for cell in &self.cells[j * width..][range(0)] {
                for (most, x) in most.iter_mut().zip(cell) {
                    *most = most.max(*x);
                }
            }
        }
        most
    }

    /// Lines across both axes, as few as possible, such that triangles between them miss by at most `error`.
    ///
    /// `2 |S_uv| du dv <= |S_uv| (r du^2 + dv^2 / r)` gives the mixed term to both directions; the share r is the one of
    /// nine that needs the fewest points.
    pub(super) fn grid(&self, error: f64) -> [Vec<f64>; 2] {
        let count = |lines: &[Vec<f64>; 2]| lines[0].len() as f64 * lines[1].len() as f64;
        let with = |r: f64| [0, 1].map(|axis| self.lines(axis, error / 2.0, r));
        let mut best = with(1.0);
        for r in [0.25, 4.0, 0.06, 16.0, 0.015, 64.0, 0.004, 256.0] {
            let lines = with(r);
            if count(&lines) < count(&best) {
                best = lines;
            }
        }
        best
    }

    /// Lines across an axis so close that the second derivatives along it leave at most `share` of error: spans are cut
    /// evenly, or joined where that is still enough.
    fn lines(&self, axis: usize, share: f64, r: f64) -> Vec<f64> {
        let breaks = &self.breaks[axis];
        let (m, n) = (self.breaks[0].len() - 1, self.breaks[1].len() - 1);
        let (spans, others) = if axis == 0 { (m, n) } else { (n, m) };
        let width = |axis: usize, k: usize| self.breaks[axis][k + 1] - self.breaks[axis][k];
        // The share is that of a cell stretched to a square.
        let bound = |k: usize| {
            let value = |l: usize| {
                let cell = self.cells[if axis == 0 { l * m + k } else { k * m + l }];
                let shape = width(1 - axis, l) / width(axis, k);
                let mixed = if axis == 0 { shape * r } else { shape / r };
                cell[2 * axis] + cell[1] * mixed
            };
            (0..others).map(value).fold(0.0, f64::max)
        };
        let bounds: Vec<f64> = (0..spans).map(bound).collect();
        let step = |bound: f64| (8.0 * share / bound).sqrt();
        let sharp = |t: f64| self.creases[axis].binary_search_by(|x| x.total_cmp(&t)).is_ok();
        let mut lines = vec![breaks[0]];
        let mut k = 0;
        while k < spans {
            let (a, b) = (breaks[k], breaks[k + 1]);
            // Far more than any limit of triangles allows.
            let count = ((b - a) / step(bounds[k])).ceil().clamp(1.0, 1e6);
            let mut next = 1.0;
            while next < count {
                lines.push(a + (b - a) * (next / count));
                next += 1.0;
            }
            let mut last = k;
            let mut most = bounds[k];
            while count < 2.0 && last + 1 < spans && !sharp(breaks[last + 1]) {
                let joined = most.max(bounds[last + 1]);
                if breaks[last + 2] - a > step(joined) {
                    break;
                }
                (most, last) = (joined, last + 1);
            }
            lines.push(breaks[last + 1]);
            k = last + 1;
        }
        lines.dedup();
        lines
    }

    /// By how much a chord between two places may miss the surface, and a triangle.
    ///
    /// With `Q = |S_uu| du^2 + 2 |S_uv| du dv + |S_vv| dv^2` made a sum of two squares, linear interpolation misses by at
    /// most half the square of the radius of the smallest circle around the triangle in that metric.
    pub(super) fn chord(&self, a: DVec2, b: DVec2) -> f64 {
        let d = (b - a).abs();
        let [uu, uv, vv] = self.largest(a.min(b), a.max(b));
        (uu * d.x * d.x + 2.0 * uv * d.x * d.y + vv * d.y * d.y) / 8.0
    }

    /// As [`Metric::chord`], and which side is the longest in that metric: k from corner k to k + 1.
    pub(super) fn triangle(&self, corners: [DVec2; 3]) -> (f64, usize) {
        let [a, b, c] = corners;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let [uu, uv, vv] = self.largest(low, high);
        let size = high - low;
        // 2 du dv <= r du^2 + dv^2 / r for any r.
        let ratio = if size.x > 0.0 && size.y > 0.0 {
            size.y / size.x
        } else {
            1.0
        };
        let (x, y) = (uu + uv * ratio, vv + uv / ratio);
        let square = |p: DVec2, q: DVec2| {
            let d = p - q;
            x * d.x * d.x + y * d.y * d.y
        };
        let sides = [square(a, b), square(b, c), square(c, a)];
        let longest = (0..3).fold(0, |k, l| if sides[l] > sides[k] { l } else { k });
        let rest = sides[0] + sides[1] + sides[2] - sides[longest];
        let radius = if sides[longest] >= rest {
            sides[longest] / 4.0
        } else {
            // Of the circle through the corners; at most a third of the longest side.
            let [p, q, r] = sides;
            let area = 2.0 * (p * q + q * r + r * p) - (p * p + q * q + r * r);
            (p * q * r / area).min(sides[longest] / 3.0)
        };
        (radius / 2.0, longest)
    }
}
