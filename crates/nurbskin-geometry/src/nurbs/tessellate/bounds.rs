//! Bounds of second derivatives, and the cuts they ask for.
//!
//! A polynomial is within the hull of its Bernstein coefficients, hence `|N / W| <= max |N_i| / W_i` for a quotient
//! with positive `W_i`. Here N and W are the numerator and denominator of a second derivative of a rational patch, as in
//! `S_u = (A_u w - A w_u) / w^2` and `S_uu = (B_u w - 2 B w_u) / w^3` with B the numerator of `S_u`, formed as
//! polynomials: what cancels between their terms is not lost. For a polynomial patch the bound is the largest second
//! difference of the control points.

use crate::nurbs::bezier::BezierPatch;
use glam::{DVec3, DVec4};

/// Bounds of the second derivatives of a piece over the unit square.
#[derive(Clone, Copy, Debug, Default)]
pub struct Bounds {
    /// Bound of the length of `S_uu`.
    pub uu: f64,
    /// Bound of the length of `S_uv`.
    pub uv: f64,
    /// Bound of the length of `S_vv`.
    pub vv: f64,
}

impl Bounds {
    /// The bounds of a piece: by the second differences of its control points, or of a rational one by those of its
    /// numerator and denominator.
    pub fn new(patch: &BezierPatch, rational: bool) -> Self {
        if rational {
            let [low, high] = patch.bounding_box();
            return Self::rational(&Polynomial::new(patch, (low + high) / 2.0));
        }
        let [p, q] = patch.degree;
        let at = |i: usize, j: usize| patch.points[j * (p + 1) + i].truncate();
        // Largest length over the differences that exist.
        let largest = |k: usize, l: usize, difference: &dyn Fn(usize, usize) -> DVec3| {
            let places = (0..(q + 1).saturating_sub(l))
                .flat_map(|j| (0..(p + 1).saturating_sub(k)).map(move |i| (i, j)));
            places
                .map(|(i, j)| difference(i, j).length())
                .fold(0.0, f64::max)
        };
        let [pf, qf] = patch.degree.map(|degree| degree as f64);
        let uu = largest(2, 0, &|i, j| at(i + 2, j) - 2.0 * at(i + 1, j) + at(i, j));
        let vv = largest(0, 2, &|i, j| at(i, j + 2) - 2.0 * at(i, j + 1) + at(i, j));
        let uv = largest(1, 1, &|i, j| {
            at(i + 1, j + 1) - at(i + 1, j) - at(i, j + 1) + at(i, j)
        });
        Self {
            uu: pf * (pf - 1.0) * uu,
            uv: pf * qf * uv,
            vv: qf * (qf - 1.0) * vv,
        }
    }

    fn rational(a: &Polynomial) -> Self {
        let (a_u, a_v) = (a.derivative(0), a.derivative(1));
        let b = a_u.times(a, 1.0).plus(a.times(&a_u, -1.0));
        let c = a_v.times(a, 1.0).plus(a.times(&a_v, -1.0));
        let denominator = a.times(a, 1.0).times(a, 1.0);
        let largest = |first: &Polynomial, axis: usize, a_axis: &Polynomial| {
            let numerator = first
                .derivative(axis)
                .times(a, 1.0)
                .plus(first.times(a_axis, -2.0));
            let terms = numerator.terms.iter().zip(&denominator.terms);
            terms
                .map(|(n, d)| n.truncate().length() / d.w)
                .fold(0.0, f64::max)
        };
        Self {
            uu: largest(&b, 0, &a_u),
            uv: largest(&b, 1, &a_v),
            vv: largest(&c, 1, &a_v),
        }
    }

    /// Eight times the chordal error with m and n cuts.
    pub(super) fn error(self, m: f64, n: f64) -> f64 {
        self.uu / (m * m) + 2.0 * self.uv / (m * n) + self.vv / (n * n)
    }

    pub(super) fn transposed(self) -> Self {
        Self {
            uu: self.vv,
            uv: self.uv,
            vv: self.uu,
        }
    }

    /// Fewest cuts along u, given n along v, for an error of at most `eighths` / 8.
    pub(super) fn fewest(self, n: f64, eighths: f64) -> f64 {
        // The positive root x of uu x^2 + 2 b x = rest, with m = 1 / x.
        let (b, rest) = (self.uv / n, eighths - self.vv / (n * n));
        ((b + (b * b + self.uu * rest).sqrt()) / rest)
            .ceil()
            .max(1.0)
    }
}

/// A polynomial in two parameters with four components, by Bernstein coefficients times their binomials: products are
/// plain convolutions then, and the factors drop out of quotients.
struct Polynomial {
    degree: [usize; 2],
    terms: Vec<DVec4>,
}

impl Polynomial {
    /// The homogeneous patch around `centre`.
    fn new(patch: &BezierPatch, centre: DVec3) -> Self {
        let binomials = |n: usize| {
            let next = move |&c: &(f64, usize)| {
                (c.1 < n).then(|| (c.0 * (n - c.1) as f64 / (c.1 + 1) as f64, c.1 + 1))
            };
            std::iter::successors(Some((1.0, 0)), next).map(|c| c.0)
        };
        let [p, q] = patch.degree;
        let factors = binomials(q).flat_map(|y| binomials(p).map(move |x| x * y));
        let centred = patch
            .points
            .iter()
            .map(|h| (h.truncate() - centre * h.w).extend(h.w));
        Self {
            degree: patch.degree,
            terms: centred.zip(factors).map(|(h, f)| h * f).collect(),
        }
    }

    /// The derivative along an axis, written with the same degree.
    fn derivative(&self, axis: usize) -> Self {
        let width = self.degree[0] + 1;
        let (n, stride) = (self.degree[axis], if axis == 0 { 1 } else { width });
        let term = |at: usize| {
            let k = if axis == 0 { at % width } else { at / width };
            let mut sum = (2.0 * k as f64 - n as f64) * self.terms[at];
            if k < n {
                sum += (k + 1) as f64 * self.terms[at + stride];
            }
            if k > 0 {
                sum -= (n - k + 1) as f64 * self.terms[at - stride];
            }
            sum
        };
        Self {
            degree: self.degree,
            terms: (0..self.terms.len()).map(term).collect(),
        }
    }

    /// This times `factor` times the last component of the other.
    fn times(&self, other: &Self, factor: f64) -> Self {
        let degree = [
            self.degree[0] + other.degree[0],
            self.degree[1] + other.degree[1],
        ];
        let [m, n, width] = [self.degree[0] + 1, other.degree[0] + 1, degree[0] + 1];
        let mut terms = vec![DVec4::ZERO; width * (degree[1] + 1)];
        for (j, row) in self.terms.chunks_exact(m).enumerate() {
            for (l, weights) in other.terms.chunks_exact(n).enumerate() {
                for (i, &term) in row.iter().enumerate() {
                    let out = &mut terms[(j + l) * width + i..][..n];
                    for (sum, weight) in out.iter_mut().zip(weights) {
                        *sum += factor * weight.w * term;
                    }
                }
            }
        }
        Self { degree, terms }
    }

    fn plus(mut self, other: Self) -> Self {
        self.terms
            .iter_mut()
            .zip(other.terms)
            .for_each(|(a, b)| *a += b);
        self
    }
}
