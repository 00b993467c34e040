//! The polynomial pieces of B-splines, in Chebyshev form.
//!
//! On a span of the knots every basis function is a polynomial of degree p, and every product of two of them one of
//! degree 2p. As sums of Chebyshev polynomials `T_0, T_1, ...` of the local coordinate s in \[-1, 1\] they are well
//! conditioned at any degree, and least squares needs only few sums over the points: see
//! [`cell_moments`](super::cell_moments).
//!
//! Source: interpolation at Chebyshev nodes and `T_a T_b = (T_(a + b) + T_|a - b|) / 2`; Trefethen, *Approximation
//! Theory and Approximation Practice*, 2013.

use super::spline_space::{filled_spans, values_and_slopes};
use nurbskin_geometry::math;
use nurbskin_geometry::nurbs::{KnotVector, MAX_DEGREE};

/// Most Chebyshev coefficients of a product of two basis functions. Count.
/// Derived: its degree is 2p.
pub(super) const MAX_PRODUCT: usize = 2 * MAX_DEGREE + 1;

/// The pieces of the basis functions of one direction.
#[derive(Clone, Debug)]
pub(super) struct Pieces {
    degree: usize,
    /// Per span (p + 1) x (p + 1): function i has the Chebyshev coefficients `[i * (p + 1)..][..=p]`.
    functions: Vec<f64>,
    /// Middle and half length of each span.
    spans: Vec<[f64; 2]>,
    /// The first of the functions of each span.
    first: Vec<usize>,
}

impl Pieces {
    /// Those of the spans between the distinct knots of the domain. O(spans p^3).
    ///
    /// Interpolation at Chebyshev's nodes, which is exact: `c_a = (2 - [a = 0]) / n sum_k f(x_k) T_a(x_k)`.
    pub(super) fn new(knots: &KnotVector) -> Self {
        let p = knots.degree();
        let n = p + 1;
        let angle = |k: usize| std::f64::consts::PI * (k as f64 + 0.5) / n as f64;
        let (mut values, mut slopes) = ([0.0; MAX_DEGREE + 1], [0.0; MAX_DEGREE + 1]);
        let filled = filled_spans(knots);
        let mut functions = vec![0.0; filled.len() * n * n];
        let mut spans = Vec::with_capacity(filled.len());
        for (&(first, w), out) in filled.iter().zip(functions.chunks_mut(n * n)) {
            let (middle, half) = (0.5 * (w[0] + w[1]), 0.5 * (w[1] - w[0]));
            spans.push([middle, half]);
            for k in 0..n {
                let t = middle + half * math::cos(angle(k));
                values_and_slopes(knots, first, t, &mut values, &mut slopes);
                for (row, &f) in out.chunks_mut(n).zip(&values) {
                    for (a, c) in row.iter_mut().enumerate() {
                        let once = if a == 0 { 1.0 } else { 2.0 };
                        *c += once / n as f64 * f * math::cos(a as f64 * angle(k));
                    }
                }
            }
        }
        Self {
            degree: p,
            functions,
            spans,
            first: filled.iter().map(|&(first, _)| first).collect(),
        }
    }
    /// Number of spans.
    pub(super) fn len(&self) -> usize {
        self.spans.len()
    }
    /// The first of the p + 1 functions of a span, which is its number where knots are simple.
    pub(super) fn first(&self, span: usize) -> usize {
        self.first[span]
    }
    /// Middle and half length of a span.
    #[inline]
    pub(super) fn span(&self, span: usize) -> [f64; 2] {
        self.spans[span]
    }
    /// Chebyshev coefficients of the p + 1 functions of a span, function by function.
    pub(super) fn functions(&self, span: usize) -> &[f64] {
        let size = (self.degree + 1) * (self.degree + 1);
        &self.functions[span * size..][..size]
    }
    /// Chebyshev coefficients of the products of all pairs i <= k of functions of a span, 2p + 1 per pair, the pairs of
    /// i = 0 first: `T_a T_b = (T_(a + b) + T_|a - b|) / 2`.
    pub(super) fn products(&self, span: usize, out: &mut [f64]) {
        let n = self.degree + 1;
        let functions = self.functions(span);
        let mut rows = out.chunks_mut(2 * n - 1);
        for i in 0..n {
            for k in i..n {
                let Some(row) = rows.next() else { return };
                row.fill(0.0);
                for (a, &x) in functions[i * n..][..n].iter().enumerate() {
                    for (b, &y) in functions[k * n..][..n].iter().enumerate() {
                        let half = 0.5 * x * y;
                        row[a + b] += half;
                        row[a.abs_diff(b)] += half;
                    }
                }
            }
        }
    }
    /// The functions of a span as sums of powers of s, `c_0 + c_1 s + ...`, function by function.
    pub(super) fn powers(&self, span: usize, out: &mut [f64]) {
        let n = self.degree + 1;
        for (f, row) in self.functions(span).chunks(n).zip(out.chunks_mut(n)) {
            row.fill(0.0);
            // T_a and the one before it, as powers.
            let (mut before, mut here) = ([0.0; MAX_DEGREE + 2], [0.0; MAX_DEGREE + 2]);
            here[0] = 1.0;
            for (a, &c) in f.iter().enumerate() {
                for (x, &t) in row.iter_mut().zip(&here) {
                    *x += c * t;
                }
                let mut next = [0.0; MAX_DEGREE + 2];
                let twice = if a == 0 { 1.0 } else { 2.0 };
                for k in 0..=a {
                    next[k + 1] += twice * here[k];
                    next[k] -= before[k];
                }
                (before, here) = (here, next);
            }
        }
    }
}

/// `T_0(s) .. T_(n - 1)(s)` into the first n places.
#[inline(always)]
pub(super) fn chebyshev(s: f64, out: &mut [f64]) {
    let (mut before, mut here) = (s, 1.0);
    for x in out {
        *x = here;
        (before, here) = (here, 2.0 * s * here - before);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Functions, products and powers against the recursion, for all degrees and uneven knots.
    #[test]
    fn pieces_are_the_basis_functions() {
        for p in 1..=MAX_DEGREE {
            let breaks = [0.0, 0.1, 0.15, 0.6, 0.61, 1.0];
            for closed in [false, true] {
                let knots = if closed {
                    KnotVector::periodic(p, &[0.0, 0.1, 0.15, 0.3, 0.4, 0.5, 0.6, 0.61, 0.8, 1.0])
                } else {
                    KnotVector::clamped(p, &breaks)
                };
                let Ok(knots) = knots else { continue };
                let breaks: &[f64] = if closed {
                    &[0.0, 0.1, 0.15, 0.3, 0.4, 0.5, 0.6, 0.61, 0.8, 1.0]
                } else {
                    &breaks
                };
                let pieces = Pieces::new(&knots);
                let n = p + 1;
                let mut products = vec![0.0; n * (n + 1) / 2 * (2 * n - 1)];
                let mut powers = vec![0.0; n * n];
                for (span, w) in breaks.windows(2).enumerate() {
                    pieces.products(span, &mut products);
                    pieces.powers(span, &mut powers);
                    for part in [0.0, 0.13, 0.5, 0.99, 1.0] {
                        let t = w[0] + part * (w[1] - w[0]);
                        let s = (t - pieces.span(span)[0]) / pieces.span(span)[1];
                        let (mut b, mut slopes) = ([0.0; MAX_DEGREE + 1], [0.0; MAX_DEGREE + 1]);
                        values_and_slopes(&knots, span, t, &mut b, &mut slopes);
                        let mut ts = [0.0; MAX_PRODUCT];
                        chebyshev(s, &mut ts);
                        let sum = |c: &[f64]| c.iter().zip(&ts).map(|(c, t)| c * t).sum::<f64>();
                        let mut rows = products.chunks(2 * n - 1);
                        for i in 0..n {
                            let f = sum(&pieces.functions(span)[i * n..][..n]);
                            assert!((f - b[i]).abs() < 1e-13, "{p} {span} {i}");
                            let horner = powers[i * n..][..n].iter().rev();
                            let f = horner.fold(0.0, |v, c| v * s + c);
                            assert!((f - b[i]).abs() < 1e-12, "{p} {span} {i}: {f} {}", b[i]);
                            for k in i..n {
                                let f = sum(rows.next().unwrap());
                                assert!((f - b[i] * b[k]).abs() < 1e-13);
                            }
                        }
                    }
                }
            }
        }
    }
}
