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

    /// Lines across an axis so close that second derivatives along it leave at most `share` of error: at creases, at
    /// both ends, and as far apart as possible between.
    pub(super) fn lines(&self, axis: usize, share: f64, limit: usize) -> Vec<f64> {
        let breaks = &self.breaks[axis];
        let (m, n) = (self.breaks[0].len() - 1, self.breaks[1].len() - 1);
        let (spans, others) = if axis == 0 { (m, n) } else { (n, m) };
        let bound = |k: usize| {
            let cell = |l: usize| if axis == 0 { l * m + k } else { k * m + l };
            let values = (0..others).map(|l| self.cells[cell(l)][2 * axis]);
            values.fold(0.0, f64::max)
        };
        let step: Vec<f64> = (0..spans)
            .map(|k| (8.0 * share / bound(k)).sqrt())
            .collect();
        let mut lines = vec![breaks[0]];
        let mut from = 0;
        for k in 0..spans {
            let end = breaks[k + 1];
            let sharp = k + 1 == spans
                || self.creases[axis]
                    .binary_search_by(|x| x.total_cmp(&end))
                    .is_ok();
            if !sharp {
                continue;
            }
            // Number of steps from the last sharp line to this one; then evenly in that measure.
            let measure: Vec<f64> = (from..=k)
                .map(|l| (breaks[l + 1] - breaks[l]) / step[l])
                .collect();
            let total: f64 = measure.iter().sum();
            let count = total.ceil().clamp(1.0, limit as f64);
            let (mut at, mut before) = (0, 0.0);
            let mut next = 1.0;
            while next < count {
                let target = total * next / count;
                while at + 1 < measure.len() && before + measure[at] < target {
                    before += measure[at];
                    at += 1;
                }
                let part = ((target - before) / measure[at]).clamp(0.0, 1.0);
                let (a, b) = (breaks[from + at], breaks[from + at + 1]);
                lines.push(a + part * (b - a));
                next += 1.0;
            }
            lines.push(end);
            from = k + 1;
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
