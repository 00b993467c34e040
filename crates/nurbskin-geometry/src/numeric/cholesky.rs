//! Symmetric positive definite systems with a band, by Cholesky's factorisation A = L L^T.
//!
//! Only the lower triangle is stored, row by row: the entries `(i, i - w) .. (i, i)` of a row lie side by side, so that
//! the inner products of the factorisation run over contiguous memory (row-oriented form of algorithm 4.3.5 of
//! G. Golub and C. Van Loan, *Matrix Computations*, 4th ed., with four rows at a time).

use crate::{Error, Result};
use glam::DVec3;

/// Rows that are eliminated together.
const ROWS: usize = 4;

/// A symmetric n x n matrix whose entries (i, j) vanish for `|i - j|` above the half-bandwidth w.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_geometry::numeric::cholesky::SymmetricBanded;
/// let mut a = SymmetricBanded::zeros(3, 1)?;
/// for i in 0..3 {
///     a.add(i, i, 2.0);
/// }
/// a.add(1, 0, -1.0);
/// a.add(2, 1, -1.0);
/// let mut x = vec![DVec3::X, DVec3::ZERO, DVec3::ZERO];
/// a.clone().factor()?.solve(&mut x);
/// assert!((x[0].x - 0.75).abs() < 1e-15);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SymmetricBanded {
    order: usize,
    half_band: usize,
    /// Row i, columns i - w ..= i, at `i * (w + 1)`; what lies left of column 0 stays zero.
    rows: Vec<f64>,
}

impl SymmetricBanded {
    /// The zero matrix with n = `order` rows and half-bandwidth w = `half_band`; takes 8 n (w + 1) bytes.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the matrix would take more than 8 GB.
    pub fn zeros(order: usize, half_band: usize) -> Result<Self> {
        let half_band = half_band.min(order.saturating_sub(1));
        match order.checked_mul(half_band + 1) {
            Some(size) if size <= 1 << 30 => Ok(Self {
                order,
                half_band,
                rows: vec![0.0; size],
            }),
            _ => Err(Error::invalid(format!(
                "{order} unknowns with half-bandwidth {half_band} are too many for a banded matrix: allow fewer control points"
            ))),
        }
    }
    /// Number of rows n.
    #[must_use]
    pub fn order(&self) -> usize {
        self.order
    }
    /// Half-bandwidth w.
    #[must_use]
    pub fn half_band(&self) -> usize {
        self.half_band
    }
    /// Adds `value` to the entry (i, j) of the lower triangle, hence to (j, i).
    ///
    /// # Panics
    /// If not `j <= i < n`, or (i, j) lies outside the band.
    #[inline]
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        let k = j + self.half_band - i;
        self.rows[i * (self.half_band + 1) + k] += value;
    }
    /// The entry (i, j); zero outside the band.
    #[must_use]
    pub fn entry(&self, i: usize, j: usize) -> f64 {
        let (i, j) = (i.max(j), i.min(j));
        if i - j > self.half_band {
            return 0.0;
        }
        self.rows[i * (self.half_band + 1) + j + self.half_band - i]
    }
    /// Row i from its first column within the matrix, with that column.
    fn row(&self, i: usize) -> (usize, &[f64]) {
        let first = i.saturating_sub(self.half_band);
        let start = i * (self.half_band + 1) + first + self.half_band - i;
        (first, &self.rows[start..(i + 1) * (self.half_band + 1)])
    }
    /// A x for n vectors with three components each. O(n w).
    #[must_use]
    pub fn multiply(&self, x: &[DVec3]) -> Vec<DVec3> {
        let mut y = vec![DVec3::ZERO; self.order];
        for i in 0..self.order {
            let (first, row) = self.row(i);
            let mut sum = row[i - first] * x[i];
            for ((&a, &xj), yj) in row[..i - first]
                .iter()
                .zip(&x[first..i])
                .zip(&mut y[first..i])
            {
                sum += a * xj;
                *yj += a * x[i];
            }
            y[i] += sum;
        }
        y
    }

    /// The factor L of A = L L^T. O(n w^2).
    ///
    /// # Errors
    /// [`Error::NoSolution`] if the matrix is not positive definite to working precision.
    pub fn factor(mut self) -> Result<BandedCholesky> {
        let (w, stride) = (self.half_band, self.half_band + 1);
        for i in 0..self.order {
            let (done, rest) = self.rows.split_at_mut(i * stride);
            let row_i = &mut rest[..stride];
            let diagonal_before = row_i[w];
            let first = i.saturating_sub(w);
            // Row j from column `first`, which every earlier row of the band reaches.
            let row_j = |j: usize| &done[j * stride + first + w - j..(j + 1) * stride];
            let row_i = &mut row_i[first + w - i..];
            let mut j = first;
            while j + ROWS <= i {
                let rows = [row_j(j), row_j(j + 1), row_j(j + 2), row_j(j + 3)];
                let common = j - first;
                let dots = four_dots(&row_i[..common], rows.map(|r| &r[..common]));
                for (r, &dot) in dots.iter().enumerate() {
                    let mut sum = row_i[common + r] - dot;
                    for k in 0..r {
                        sum -= row_i[common + k] * rows[r][common + k];
                    }
                    row_i[common + r] = sum / rows[r][common + r];
                }
                j += ROWS;
            }
            for j in j..i {
                let row = row_j(j);
                let (n, sum) = (j - first, row_i[j - first]);
                row_i[n] = (sum - dot(&row_i[..n], &row[..n])) / row[n];
            }
            let n = i - first;
            let pivot = row_i[n] - dot(&row_i[..n], &row_i[..n]);
            // Rounding leaves about eps times the diagonal of a pivot that should be zero.
            if pivot.is_nan() || pivot <= 4.0 * f64::EPSILON * diagonal_before {
                return Err(Error::NoSolution(format!(
                    "the normal equations are not positive definite (row {i} of {})",
                    self.order
                )));
            }
            row_i[n] = pivot.sqrt();
        }
        Ok(BandedCholesky { factor: self })
    }
}

/// Inner product with four running sums, which the compiler turns into vectors; the order of summation is fixed.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a4, a_rest) = a.as_chunks::<4>();
    let (b4, b_rest) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (x, y) in a4.iter().zip(b4) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// The inner products of `a` with four vectors.
fn four_dots(a: &[f64], b: [&[f64]; ROWS]) -> [f64; ROWS] {
    let (a4, a_rest) = a.as_chunks::<4>();
    let b4 = b.map(|row| row.as_chunks::<4>().0);
    let [b0, b1, b2, b3] = b4.map(|rows| &rows[..a4.len()]);
    let mut sums = [[0.0; 4]; ROWS];
    for (n, x) in a4.iter().enumerate() {
        let ys = [&b0[n], &b1[n], &b2[n], &b3[n]];
        for (sum, y) in sums.iter_mut().zip(ys) {
            for k in 0..4 {
                sum[k] += x[k] * y[k];
            }
        }
    }
    let tail = a.len() - a_rest.len();
    std::array::from_fn(|r| {
        let rest: f64 = a_rest.iter().zip(&b[r][tail..]).map(|(x, y)| x * y).sum();
        (sums[r][0] + sums[r][2]) + (sums[r][1] + sums[r][3]) + rest
    })
}

/// The Cholesky factor L of a [`SymmetricBanded`] matrix.
#[derive(Clone, Debug)]
pub struct BandedCholesky {
    factor: SymmetricBanded,
}

impl BandedCholesky {
    /// Solves A x = b in place for three right-hand sides. O(n w).
    pub fn solve(&self, x: &mut [DVec3]) {
        let l = &self.factor;
        for i in 0..l.order {
            let (first, row) = l.row(i);
            let n = i - first;
            let sum = row[..n]
                .iter()
                .zip(&x[first..i])
                .fold(DVec3::ZERO, |s, (&a, &xj)| s + a * xj);
            x[i] = (x[i] - sum) / row[n];
        }
        for i in (0..l.order).rev() {
            let (first, row) = l.row(i);
            let n = i - first;
            x[i] /= row[n];
            let xi = x[i];
            for (&a, xj) in row[..n].iter().zip(&mut x[first..i]) {
                *xj -= a * xi;
            }
        }
    }
}

/// Solves A x = b with one step of iterative refinement; returns x and the residual `max |b - A x|` relative to
/// `max |b|`.
///
/// # Errors
/// As [`SymmetricBanded::factor`].
pub fn solve_refined(matrix: &SymmetricBanded, b: &[DVec3]) -> Result<(Vec<DVec3>, f64)> {
    Ok(matrix.clone().factor()?.solve_refined(matrix, b))
}

impl BandedCholesky {
    /// The same as [`solve_refined`] with the factor of the matrix at hand. O(n w).
    #[must_use]
    pub fn solve_refined(&self, matrix: &SymmetricBanded, b: &[DVec3]) -> (Vec<DVec3>, f64) {
        let mut x = b.to_vec();
        self.solve(&mut x);
        let residual = |x: &[DVec3]| -> Vec<DVec3> {
            let ax = matrix.multiply(x);
            b.iter().zip(ax).map(|(&b, ax)| b - ax).collect()
        };
        let mut correction = residual(&x);
        self.solve(&mut correction);
        for (x, c) in x.iter_mut().zip(correction) {
            *x += c;
        }
        let largest = |v: &[DVec3]| v.iter().fold(0.0, |m: f64, p| m.max(p.abs().max_element()));
        let scale = largest(b);
        let left = largest(&residual(&x));
        (x, if scale > 0.0 { left / scale } else { left })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A random diagonally dominant band and its dense copy.
    fn example(n: usize, w: usize) -> SymmetricBanded {
        let mut a = SymmetricBanded::zeros(n, w).unwrap();
        let mut state = 12345_u64;
        let mut random = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for i in 0..n {
            for j in i.saturating_sub(w)..i {
                let value = random();
                a.add(i, j, value);
            }
            a.add(i, i, w as f64 + 1.0);
        }
        a
    }

    #[test]
    fn solves_bands_of_any_width() {
        for (n, w) in [
            (1, 0),
            (5, 0),
            (7, 1),
            (12, 5),
            (20, 19),
            (60, 13),
            (200, 31),
        ] {
            let a = example(n, w);
            let truth: Vec<DVec3> = (0..n)
                .map(|i| DVec3::new(i as f64, (i as f64).sin(), 1.0))
                .collect();
            let b = a.multiply(&truth);
            let (x, residual) = solve_refined(&a, &b).unwrap();
            assert!(residual < 1e-14, "{n} {w}: {residual}");
            let error = x
                .iter()
                .zip(&truth)
                .map(|(x, t)| (*x - *t).length())
                .fold(0.0, f64::max);
            assert!(error < 1e-11, "{n} {w}: {error}");
        }
    }

    #[test]
    fn multiplication_agrees_with_the_dense_product() {
        let a = example(9, 3);
        let x: Vec<DVec3> = (0..9).map(|i| DVec3::splat(1.0 + i as f64)).collect();
        for (i, y) in a.multiply(&x).iter().enumerate() {
            let dense: f64 = (0..9).map(|j| a.entry(i, j) * x[j].x).sum();
            assert!((y.x - dense).abs() < 1e-13);
        }
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        let mut a = SymmetricBanded::zeros(2, 1).unwrap();
        a.add(0, 0, 1.0);
        a.add(1, 1, 1.0);
        a.add(1, 0, 1.0);
        assert!(matches!(a.factor(), Err(Error::NoSolution(_))));
    }
}
