//! How far triangles in the parameter plane may miss the surface.

use glam::DVec2;
use nurbskin_geometry::Result;
use nurbskin_geometry::nurbs::bezier::{BezierPatch, visit};
use nurbskin_geometry::nurbs::tessellate::bounds::Bounds;
use nurbskin_geometry::nurbs::{KnotVector, NurbsSurface};
use std::ops::RangeInclusive;

/// Bounds of the second derivatives of a surface, per knot cell.
pub(super) struct Metric {
    breaks: [Vec<f64>; 2],
    /// `|S_uu|`, `|S_uv|`, `|S_vv|` per cell, u fastest.
    cells: Vec<[f64; 3]>,
    /// The largest steps of u and of v that lead as far as vertices may be apart, per knot cell; none where that does not
    /// matter.
    strides: Vec<[f64; 2]>,
    /// Parameters of creases: interior knots of multiplicity p or more.
    pub(super) creases: [Vec<f64>; 2],
    /// How far the surface may be off what the bounds say, by knot spans that are left out.
    pub(super) slack: f64,
}

/// Which knot spans are wider than rounding: files hold knots that differ in their last digits only, and the
/// derivatives in between say nothing.
fn wide(breaks: &[f64]) -> Vec<bool> {
    let least = match (breaks.first(), breaks.last()) {
        (Some(a), Some(b)) => 1e-12 * (b - a),
        _ => 0.0,
    };
    breaks.windows(2).map(|w| w[1] - w[0] > least).collect()
}

/// The ends of the spans that are kept, each going on where the one before ends, and which of them are creases.
fn joints(knots: &KnotVector, breaks: &[f64], kept: &[bool]) -> (Vec<f64>, Vec<f64>) {
    let (mut joints, mut creases) = (vec![breaks[0]], Vec::new());
    let spans: Vec<usize> = (0..kept.len()).filter(|&k| kept[k]).collect();
    for pair in spans.windows(2) {
        let at = breaks[pair[0] + 1];
        joints.push(at);
        if pair[1] > pair[0] + 1 || knots.multiplicity(at) >= knots.degree() {
            creases.push(at);
        }
    }
    joints.push(breaks[breaks.len() - 1]);
    (joints, creases)
}

/// How far a piece may extend along an axis: the degree times the largest step between its control points and, if it is
/// rational, the square of the ratio of its weights (M. Floater, *Derivatives of rational Bezier curves*, CAGD 9, 1992).
fn extent(patch: &BezierPatch, axis: usize) -> f64 {
    let width = patch.degree[0] + 1;
    let stride = if axis == 0 { 1 } else { width };
    let at = |k: usize| patch.points[k].truncate() / patch.points[k].w;
    let inner = |&k: &usize| {
        let along = if axis == 0 { k % width } else { k / width };
        along < patch.degree[axis]
    };
    let steps = (0..patch.points.len()).filter(inner);
    let step = steps
        .map(|k| at(k).distance(at(k + stride)))
        .fold(0.0, f64::max);
    let weights = patch.points.iter().map(|h| h.w);
    let (low, high) = weights.fold((f64::INFINITY, 0.0_f64), |(l, h), w| (l.min(w), h.max(w)));
    patch.degree[axis] as f64 * (high / low).powi(2) * step
}

/// The largest `|S_u|` and `|S_v|` of a piece of a surface, on samples.
fn speeds(surface: &NurbsSurface, patch: &BezierPatch) -> [f64; 2] {
    let [(a, b), (c, d)] = patch.range;
    let mut most = [0.0_f64; 2];
    for k in 0..9 {
        let share = |k: i32| 0.05 + 0.45 * f64::from(k);
        let (u, v) = (a + share(k % 3) * (b - a), c + share(k / 3) * (d - c));
        let at = surface.derivatives(u, v);
        most = [most[0].max(at.du.length()), most[1].max(at.dv.length())];
    }
    most
}

/// An interval that begins where the one before ends, cut evenly.
struct Step {
    to: f64,
    /// A whole number.
    count: f64,
}

/// The parameters where intervals are cut.
fn lines(from: f64, steps: &[Step]) -> Vec<f64> {
    let (mut lines, mut a) = (vec![from], from);
    for step in steps {
        let mut k = 1.0;
        while k < step.count {
            lines.push(a + (step.to - a) * (k / step.count));
            k += 1.0;
        }
        lines.push(step.to);
        a = step.to;
    }
    lines.dedup();
    lines
}

impl Metric {
    /// `step`: how far vertices may be apart, infinite where that does not matter.
    pub(super) fn new(surface: &NurbsSurface, step: f64) -> Result<Self> {
        let rational = surface.is_rational();
        let knots = [surface.knots_u(), surface.knots_v()];
        let all = knots.map(KnotVector::breakpoints);
        let kept = all.each_ref().map(|breaks| wide(breaks));
        let count = kept[0].len();
        let (mut cells, mut slack, mut k) = (Vec::new(), 0.0_f64, 0);
        let mut strides = Vec::new();
        visit(surface, |_, patch| {
            let place = [k % count, k / count];
            k += 1;
            for axis in 0..2 {
                if !kept[axis][place[axis]] {
                    slack = slack.max(2.0 * extent(patch, axis));
                }
            }
            if !kept[0][place[0]] || !kept[1][place[1]] {
                return;
            }
            if step.is_finite() {
                strides.push(speeds(surface, patch).map(|speed| step / speed));
            }
            let bounds = Bounds::new(patch, rational);
            let [w, h] = patch.range.map(|(a, b)| b - a);
            cells.push([
                bounds.uu / (w * w),
                bounds.uv / (w * h),
                bounds.vv / (h * h),
            ]);
        })?;
        let [(us, creases_u), (vs, creases_v)] =
            [0, 1].map(|axis| joints(knots[axis], &all[axis], &kept[axis]));
        Ok(Self {
            breaks: [us, vs],
            cells,
            strides,
            creases: [creases_u, creases_v],
            slack,
        })
    }

    /// The knot spans that an interval reaches into.
    pub(super) fn spans(&self, axis: usize, low: f64, high: f64) -> RangeInclusive<usize> {
        let breaks = &self.breaks[axis];
        let last = breaks.len() - 2;
        // Half open: an interval that ends at a knot line does not reach beyond it.
        let from = breaks.partition_point(|&b| b <= low).max(1) - 1;
        let to = breaks.partition_point(|&b| b < high).max(1) - 1;
        let from = from.min(last);
        from..=to.min(last).max(from)
    }

    /// The largest bounds in knot spans.
    pub(super) fn most(&self, us: RangeInclusive<usize>, vs: RangeInclusive<usize>) -> [f64; 3] {
        let width = self.breaks[0].len() - 1;
        let mut most = [0.0_f64; 3];
        for j in vs {
            for cell in &self.cells[j * width..][us.clone()] {
                for (most, x) in most.iter_mut().zip(cell) {
                    *most = most.max(*x);
                }
            }
        }
        most
    }

    /// The largest bounds in a rectangle.
    pub(super) fn largest(&self, low: DVec2, high: DVec2) -> [f64; 3] {
        self.most(self.spans(0, low.x, high.x), self.spans(1, low.y, high.y))
    }

    /// Lines across both axes of a rectangle, as few as possible, such that triangles between them miss by at most
    /// `error`; `None` if they cross more than `limit` times.
    ///
    /// `2 |S_uv| du dv <= |S_uv| (r du^2 + dv^2 / r)` gives the mixed term to both directions; the share r is the one of
    /// nine that needs the fewest points.
    pub(super) fn grid(
        &self,
        error: f64,
        rectangle: [DVec2; 2],
        limit: usize,
    ) -> Option<[Vec<f64>; 2]> {
        let count = |steps: &[Vec<Step>; 2]| {
            let sum = |steps: &Vec<Step>| steps.iter().map(|step| step.count).sum::<f64>() + 1.0;
            sum(&steps[0]) * sum(&steps[1])
        };
        let with = |r: f64| [0, 1].map(|axis| self.steps(axis, error / 2.0, r, rectangle));
        let mut best = with(1.0);
        for r in [0.25, 4.0, 0.06, 16.0, 0.015, 64.0, 0.004, 256.0] {
            let steps = with(r);
            if count(&steps) < count(&best) {
                best = steps;
            }
        }
        if count(&best) > limit as f64 {
            return None;
        }
        let [low, _] = rectangle;
        Some([0, 1].map(|axis| lines(low[axis], &best[axis])))
    }

    /// Steps across an axis so small that the second derivatives along it leave at most `share` of error, and no larger
    /// than the strides: spans are cut evenly, or joined where that is still enough.
    fn steps(&self, axis: usize, share: f64, r: f64, [low, high]: [DVec2; 2]) -> Vec<Step> {
        let breaks = &self.breaks[axis];
        let m = self.breaks[0].len() - 1;
        let spans = self.spans(axis, low[axis], high[axis]);
        let others = self.spans(1 - axis, low[1 - axis], high[1 - axis]);
        let width = |axis: usize, k: usize| self.breaks[axis][k + 1] - self.breaks[axis][k];
        // The share is that of a cell stretched to a square.
        let bound = |k: usize| {
            let value = |l: usize| {
                let cell = self.cells[if axis == 0 { l * m + k } else { k * m + l }];
                let shape = width(1 - axis, l) / width(axis, k);
                let mixed = if axis == 0 { shape * r } else { shape / r };
                cell[2 * axis] + cell[1] * mixed
            };
            others.clone().map(value).fold(0.0, f64::max)
        };
        let stride = |k: usize| {
            let value = |l: usize| {
                let stride = self
                    .strides
                    .get(if axis == 0 { l * m + k } else { k * m + l });
                stride.map_or(f64::INFINITY, |stride| stride[axis])
            };
            others.clone().map(value).fold(f64::INFINITY, f64::min)
        };
        let longest = |bound: f64, stride: f64| (8.0 * share / bound).sqrt().min(stride);
        let sharp = |t: f64| {
            self.creases[axis]
                .binary_search_by(|x| x.total_cmp(&t))
                .is_ok()
        };
        let (first, end) = (*spans.start(), *spans.end());
        let start_of = |k: usize| if k == first { low[axis] } else { breaks[k] };
        let end_of = |k: usize| if k == end { high[axis] } else { breaks[k + 1] };
        let mut steps = Vec::new();
        let mut k = first;
        while k <= end {
            let (a, mut most, mut least) = (start_of(k), bound(k), stride(k));
            // Far more than any limit of triangles allows.
            let count = ((end_of(k) - a) / longest(most, least))
                .ceil()
                .clamp(1.0, 1e9);
            while count < 2.0 && k < end && !sharp(breaks[k + 1]) {
                let joined = (most.max(bound(k + 1)), least.min(stride(k + 1)));
                if end_of(k + 1) - a > longest(joined.0, joined.1) {
                    break;
                }
                ((most, least), k) = (joined, k + 1);
            }
            steps.push(Step {
                to: end_of(k),
                count,
            });
            k += 1;
        }
        steps
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
