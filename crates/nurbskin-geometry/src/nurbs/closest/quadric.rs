//! The squared distance to a piece as a polynomial in Bernstein form, cut until its coefficients prove a lower bound.
//!
//! For a homogeneous piece (X, W) and a point p, `N = |X - W p|^2` and `W^2` are polynomials of twice the degrees, and
//! the squared distance is their quotient. With positive weights the smallest quotient of coefficients is a lower
//! bound of it. Where all points are equally far (the centre of a sphere) the quotients are all equal, so that such
//! points cost nothing. Near a minimum, where cutting alone would leave many small rectangles, the second differences
//! show that `N - t W^2` is convex and Newton's point with its small gradient bounds it.

use super::extract::restrict_net;
use super::piece::{Pieces, smallest};
use super::search::{Place, Search, minimize};
use super::trim::Cover;
use glam::{DVec2, DVec3, DVec4};

/// Most bisections of a rectangle.
const MOST_CUTS: u8 = 90;

/// A rectangle still to be examined; its nets lie on the stack.
#[derive(Clone, Copy, Debug)]
struct Rectangle {
    /// `[x0, x1, y0, y1]`.
    within: [f64; 4],
    cuts: u8,
    /// How many there were when the nets were last made from the piece, and the rounding error they have had since.
    made: u8,
    rounding: f64,
    /// Whether all of it counts.
    inside: bool,
}

/// Buffers of the search; empty until first needed, then kept.
#[derive(Debug, Default)]
pub(super) struct Quadric {
    degree: [usize; 2],
    /// Reciprocals of products of binomials for the coefficients of the squared distance, and the products for those of
    /// the piece.
    twice: Vec<f64>,
    once: Vec<f64>,
    rectangles: Vec<Rectangle>,
    /// N, then `W^2` where rational, of each rectangle of the stack.
    nets: Vec<f64>,
    current: Vec<f64>,
    net: Vec<DVec4>,
    scaled: Vec<[f64; 4]>,
    values: Vec<f64>,
}

impl Quadric {
    /// Proves that the piece has no point nearer than the best less the tolerance, improving the best on the way, within
    /// the budget of the search.
    pub(super) fn search(&mut self, search: &mut Search, pieces: &Pieces, id: usize, p: DVec3) {
        let whole = [-1.0, 1.0, -1.0, 1.0];
        let rounding = self.prepare(pieces, id, p, whole);
        let stride = self.current.len();
        self.rectangles.clear();
        self.nets.clear();
        self.nets.extend_from_slice(&self.current);
        self.rectangles.push(Rectangle {
            within: whole,
            cuts: 0,
            made: 0,
            rounding,
            inside: search.part.is_none(),
        });
        while let Some(mut rectangle) = self.rectangles.pop() {
            let from = self.nets.len() - stride;
            self.current.copy_from_slice(&self.nets[from..]);
            self.nets.truncate(from);
            // A point so close that the rounding of the whole piece's coefficients hides what is asked.
            let hidden = rectangle.rounding > 0.25 * (search.best - search.enough());
            if hidden && rectangle.cuts >= rectangle.made + 6 {
                rectangle.made = rectangle.cuts;
                rectangle.rounding = self.prepare(pieces, id, p, rectangle.within);
            }
            let rounding = rectangle.rounding;
            let (lower, place) = self.lowest(pieces.rational);
            let lower = (lower - rounding).max(0.0);
            if lower >= search.enough() {
                search.proven = search.proven.min(lower);
                continue;
            }
            if search.budget == 0 || rectangle.cuts >= MOST_CUTS {
                search.proven = search.proven.min(lower);
                continue;
            }
            search.budget -= 1;
            let (hessian, convex) = self.hessian(search.best, pieces.rational);
            if !rectangle.inside {
                if self.needless(search, pieces, id, &mut rectangle, lower) {
                    continue;
                }
                // Nearer than the border curve only where that is off the border.
                let reach = search.best.sqrt() - search.tolerance - 2.0 * search.gap;
                if !rectangle.inside && reach > 0.0 && lower >= reach * reach {
                    search.proven = search.proven.min(lower);
                    continue;
                }
            }
            if convex || rectangle.cuts % 4 == 0 {
                let [x0, x1, y0, y1] = rectangle.within;
                let start = DVec2::new(x0 + (x1 - x0) * place.x, y0 + (y1 - y0) * place.y);
                let found = minimize(pieces, id, p, rectangle.within, start, 12);
                search.offer(pieces, id, found.squared, found.x, found.y, &found.jet);
                let lower = lower.max(self.quadratic_bound(
                    &found,
                    p,
                    rectangle.within,
                    hessian,
                    search.best,
                    rounding,
                    pieces.rational,
                ));
                if lower >= search.enough() {
                    search.proven = search.proven.min(lower);
                    continue;
                }
                let uncovered = found.squared < search.best;
                if uncovered && convex && !pieces.rational && lower >= search.below(found.squared) {
                    // As on convex pieces: the border is nearer than what is covered.
                    continue;
                }
            }
            self.cut(rectangle, pieces.rational);
        }
    }

    /// Whether a rectangle that may not count as a whole needs no search: nothing of it counts, or the distance has no
    /// stationary point in it, so that what counts of it has its nearest point on the border.
    fn needless(
        &self,
        search: &Search,
        pieces: &Pieces,
        id: usize,
        rectangle: &mut Rectangle,
        lower: f64,
    ) -> bool {
        let Some(part) = search.part else {
            return false;
        };
        let [x0, x1, y0, y1] = rectangle.within;
        let piece = &pieces.all[id];
        match part.cover(piece.parameters(x0, y0), piece.parameters(x1, y1)) {
            Cover::Outside => return true,
            Cover::Inside => {
                rectangle.inside = true;
                return false;
            }
            Cover::Border => {}
        }
        // On a crease between pieces the nearest point need not be stationary.
        let side = x0 <= -1.0 || x1 >= 1.0 || y0 <= -1.0 || y1 >= 1.0;
        let creased = search.creased && side;
        !creased && self.is_monotone([lower, search.best], rectangle.rounding, pieces.rational)
    }

    /// Whether the squared distance has no stationary point where it is between these levels: along x or y, the
    /// coefficients of `N - t W^2` rise, or fall, for both levels t, and so for all between them.
    fn is_monotone(&self, levels: [f64; 2], rounding: f64, rational: bool) -> bool {
        if rational && !levels[1].is_finite() {
            return false;
        }
        let dp = self.degree[0];
        let (width, size) = (dp + 1, self.size());
        let (n, w) = self.current.split_at(size);
        let step = |a: usize, b: usize| {
            let rise = n[b] - n[a];
            if !rational {
                return [rise; 2];
            }
            let by = levels.map(|t| rise - t * (w[b] - w[a]));
            [by[0].min(by[1]), by[0].max(by[1])]
        };
        let slack = 2.0 * rounding;
        let along = |pairs: &mut dyn Iterator<Item = (usize, usize)>| {
            let start = [f64::INFINITY, f64::NEG_INFINITY];
            let [low, high] = pairs.fold(start, |[low, high], (a, b)| {
                let [x, y] = step(a, b);
                [low.min(x), high.max(y)]
            });
            low > slack || high < -slack
        };
        let mut rows = (0..size).filter(|k| k % width < dp).map(|k| (k, k + 1));
        let mut columns = (0..size - width).map(|k| (k, k + width));
        along(&mut rows) || along(&mut columns)
    }

    /// Number of coefficients of N.
    fn size(&self) -> usize {
        (self.degree[0] + 1) * (self.degree[1] + 1)
    }

    /// N and `W^2` over a rectangle of the piece into `current`; returns a bound of the rounding error of N.
    fn prepare(&mut self, pieces: &Pieces, id: usize, p: DVec3, within: [f64; 4]) -> f64 {
        let [a, b] = pieces.degree;
        if self.degree != [2 * a, 2 * b] {
            self.degree = [2 * a, 2 * b];
            let (ba, bb) = (binomials(a), binomials(b));
            self.once = products(&ba, &bb);
            let (ba, bb) = (binomials(2 * a), binomials(2 * b));
            self.twice = products(&ba, &bb).into_iter().map(|x| 1.0 / x).collect();
        }
        let size = self.size();
        let stride = if pieces.rational { 2 * size } else { size };
        self.current.clear();
        self.current.resize(stride, 0.0);
        self.net.clear();
        self.net.extend_from_slice(pieces.net(id));
        let (length, weight) = self.net.iter().fold((0.0f64, 0.0f64), |(x, w), h| {
            (x.max(h.truncate().abs().max_element()), w.max(h.w))
        });
        if within[0] > -1.0 || within[1] < 1.0 || within[2] > -1.0 || within[3] < 1.0 {
            restrict_net(
                &mut self.net,
                pieces.degree,
                within.map(|x| 0.5 * (1.0 + x)),
            );
        }
        self.scaled.clear();
        let mut largest = 0.0f64;
        for (h, &f) in self.net.iter().zip(&self.once) {
            let d = h.truncate() - h.w * p;
            largest = largest.max(d.length_squared());
            let d = d * f;
            self.scaled.push([d.x, d.y, d.z, h.w * f]);
        }
        // Every difference X - W p carries the rounding of its terms, every product and mean that of its factors.
        let terms = length + weight * p.abs().max_element();
        let rounding =
            f64::EPSILON * (4 * (a + b) + 16) as f64 * (largest + largest.sqrt() * terms);
        let (n, w) = self.current.split_at_mut(size);
        for (j, left) in self.scaled.chunks_exact(a + 1).enumerate() {
            for (l, right) in self.scaled.chunks_exact(a + 1).enumerate().skip(j) {
                let factor = if l > j { 2.0 } else { 1.0 };
                let row = (j + l) * (2 * a + 1);
                for (i, c) in left.iter().enumerate() {
                    let target = &mut n[row + i..row + i + a + 1];
                    for (t, d) in target.iter_mut().zip(right) {
                        *t += factor * (c[0] * d[0] + c[1] * d[1] + c[2] * d[2]);
                    }
                    if pieces.rational {
                        for (t, d) in w[row + i..row + i + a + 1].iter_mut().zip(right) {
                            *t += factor * c[3] * d[3];
                        }
                    }
                }
            }
        }
        for net in self.current.chunks_exact_mut(size) {
            for (c, f) in net.iter_mut().zip(&self.twice) {
                *c *= f;
            }
        }
        rounding
    }

    /// The smallest quotient of coefficients, and its place in the rectangle (fractions).
    fn lowest(&self, rational: bool) -> (f64, DVec2) {
        let size = self.size();
        let (n, w) = self.current.split_at(size);
        let mut least = (f64::INFINITY, 0);
        for (k, &value) in n.iter().enumerate() {
            let value = if rational { value / w[k] } else { value };
            if value < least.0 {
                least = (value, k);
            }
        }
        let [dp, dq] = self.degree;
        let (i, j) = (least.1 % (dp + 1), least.1 / (dp + 1));
        let place = DVec2::new(i as f64 / dp as f64, j as f64 / dq as f64);
        (least.0, place)
    }

    /// Lower bounds of the pure second derivatives of `N - t W^2` in the fractions of the rectangle, an upper bound of the
    /// mixed one's magnitude; and whether these show it convex.
    fn hessian(&mut self, t: f64, rational: bool) -> ([f64; 3], bool) {
        let [dp, dq] = self.degree;
        let size = self.size();
        let (n, w) = self.current.split_at(size);
        self.values.clear();
        if rational {
            self.values.extend(n.iter().zip(w).map(|(n, w)| n - t * w));
        } else {
            self.values.extend(n);
        }
        let width = dp + 1;
        let g = &self.values;
        let (mut xx, mut xy, mut yy) = (f64::INFINITY, 0.0f64, f64::INFINITY);
        for row in g.chunks_exact(width) {
            for c in row.windows(3) {
                xx = xx.min(c[0] - 2.0 * c[1] + c[2]);
            }
        }
        for j in 0..dq {
            let (a, b) = (&g[j * width..], &g[(j + 1) * width..]);
            for i in 0..dp {
                xy = xy.max((a[i] - a[i + 1] - b[i] + b[i + 1]).abs());
            }
        }
        for j in 0..dq - 1 {
            let (a, b, c) = (
                &g[j * width..],
                &g[(j + 1) * width..],
                &g[(j + 2) * width..],
            );
            for i in 0..width {
                yy = yy.min(a[i] - 2.0 * b[i] + c[i]);
            }
        }
        let (p, q) = (dp as f64, dq as f64);
        let (xx, xy, yy) = (xx * p * (p - 1.0), xy * p * q, yy * q * (q - 1.0));
        ([xx, xy, yy], xx > 0.0 && xx * yy > xy * xy)
    }

    /// A lower bound of the squared distance over the rectangle from a point of it and the bounds of the Hessian of
    /// `G = N - t W^2`: `G(q + d) >= G(q) + g d + d^T H d / 2`.
    fn quadratic_bound(
        &self,
        found: &Place,
        p: DVec3,
        [x0, x1, y0, y1]: [f64; 4],
        [hxx, hxy, hyy]: [f64; 3],
        t: f64,
        rounding: f64,
        rational: bool,
    ) -> f64 {
        let jet = &found.jet;
        let e = jet.s - p;
        let (width, height) = (x1 - x0, y1 - y0);
        let (weight, over) = (jet.w * jet.w, found.squared - t);
        let gradient = |s: DVec3, w: f64, at: f64, low: f64, high: f64, length: f64| {
            let g = 2.0 * (weight * e.dot(s) + over * jet.w * w) * length;
            let pressed = (at <= low && g >= 0.0) || (at >= high && g <= 0.0);
            if pressed { 0.0 } else { g.abs() }
        };
        // Scaled so that both diagonal entries become about the same.
        let scale = |h: f64| if h > 0.0 { 1.0 / h.sqrt() } else { 0.0 };
        let (a, b) = match (scale(hxx), scale(hyy)) {
            (0.0, 0.0) => (1.0, 1.0),
            (0.0, b) => (b, b),
            (a, 0.0) => (a, a),
            both => both,
        };
        let gx = a * gradient(jet.sx, jet.wx, found.x, x0, x1, width);
        let gy = b * gradient(jet.sy, jet.wy, found.y, y0, y1, height);
        let least = smallest(hxx * a * a, hxy * a * b, hyy * b * b);
        let g = (gx * gx + gy * gy).sqrt();
        // The farthest point of the rectangle, in scaled fractions.
        let reach = |at: f64, low: f64, high: f64, length: f64, scale: f64| {
            (at - low).max(high - at) / (length * scale)
        };
        let dx = reach(found.x, x0, x1, width, a);
        let dy = reach(found.y, y0, y1, height, b);
        let far = (dx * dx + dy * dy).sqrt();
        let drop = if least * far > g {
            0.5 * g * g / least
        } else {
            g * far - 0.5 * least * far * far
        };
        let g_low = weight * over - drop - rounding;
        if !rational {
            return t + g_low;
        }
        let w = &self.current[self.size()..];
        let (low, high) = w
            .iter()
            .fold((f64::INFINITY, 0.0f64), |(a, b), &w| (a.min(w), b.max(w)));
        t + g_low / if g_low < 0.0 { low } else { high }
    }

    /// Two halves of `current`, across the direction in which it bends most, onto the stack.
    fn cut(&mut self, rectangle: Rectangle, rational: bool) {
        let [dp, dq] = self.degree;
        let width = dp + 1;
        let size = self.size();
        let n = &self.values[..size];
        let mut bend = [0.0f64; 2];
        for row in n.chunks_exact(width) {
            for c in row.windows(3) {
                bend[0] = bend[0].max((c[0] - 2.0 * c[1] + c[2]).abs());
            }
        }
        for k in 0..size - 2 * width {
            bend[1] = bend[1].max((n[k] - 2.0 * n[k + width] + n[k + 2 * width]).abs());
        }
        let [x0, x1, y0, y1] = rectangle.within;
        let (dx, dy) = (x1 - x0, y1 - y0);
        // A rectangle too long to have both derivatives small is cut across, whatever its bends.
        let in_x = bend[0] * (dp * (dp - 1)) as f64 >= bend[1] * (dq * (dq - 1)) as f64;
        let in_x = if in_x {
            dx > dy * 1e-12
        } else {
            dy < dx * 1e-12
        };
        let from = self.nets.len();
        self.nets.extend_from_slice(&self.current);
        self.nets.extend_from_slice(&self.current);
        let stride = self.current.len();
        let (left, right) = self.nets[from..].split_at_mut(stride);
        let parts = if rational { 2 } else { 1 };
        for part in 0..parts {
            let left = &mut left[part * size..(part + 1) * size];
            let right = &mut right[part * size..(part + 1) * size];
            if in_x {
                for (left, right) in left
                    .chunks_exact_mut(width)
                    .zip(right.chunks_exact_mut(width))
                {
                    halve(left, right, width, 1);
                }
            } else {
                halve(left, right, dq + 1, width);
            }
        }
        let cuts = rectangle.cuts + 1;
        let (mx, my) = (0.5 * (x0 + x1), 0.5 * (y0 + y1));
        let (a, b) = if in_x {
            ([x0, mx, y0, y1], [mx, x1, y0, y1])
        } else {
            ([x0, x1, y0, my], [x0, x1, my, y1])
        };
        for within in [a, b] {
            self.rectangles.push(Rectangle {
                within,
                cuts,
                ..rectangle
            });
        }
        // The one with the lower coefficient is examined first.
        let least = |net: &[f64]| net[..size].iter().fold(f64::INFINITY, |a, &b| a.min(b));
        if least(left) < least(right) {
            left.swap_with_slice(right);
            let last = self.rectangles.len() - 1;
            self.rectangles.swap(last - 1, last);
        }
    }
}

/// De Casteljau at 1/2 along `count` rows of `width` values each: `left` (a copy of `right`) becomes the left half,
/// `right` the right one.
fn halve(left: &mut [f64], right: &mut [f64], count: usize, width: usize) {
    for r in 1..count {
        for row in 0..count - r {
            for k in 0..width {
                let at = row * width + k;
                right[at] = 0.5 * (right[at] + right[at + width]);
            }
        }
        left[r * width..(r + 1) * width].copy_from_slice(&right[..width]);
    }
}

/// One row of Pascal's triangle; exact up to the 50 that twice the highest degree needs.
fn binomials(n: usize) -> Vec<f64> {
    let mut row = vec![1.0; n + 1];
    for i in 1..n {
        for k in (1..=i).rev() {
            row[k] += row[k - 1];
        }
    }
    row
}

/// Products of all pairs, `a` fastest.
fn products(a: &[f64], b: &[f64]) -> Vec<f64> {
    b.iter()
        .flat_map(|y| a.iter().map(move |x| x * y))
        .collect()
}
