//! Banded linear systems: LU without pivoting, plain and cyclic.
//!
//! The collocation matrices of B-spline interpolation are totally positive, for which elimination without row
//! exchanges is stable (C. de Boor and A. Pinkus, *Numerische Mathematik* 27, 1977, 485-490). Everything here costs
//! O(n) per right-hand side for a fixed bandwidth.

use crate::{Error, Result};

/// Something that holds one row of right-hand sides: `[f64; 3]` for a point, `&mut [f64]` for a strip of a table.
pub(crate) trait Lanes: AsRef<[f64]> + AsMut<[f64]> {}
impl<T: AsRef<[f64]> + AsMut<[f64]>> Lanes for T {}

/// A square matrix whose entry (i, j) vanishes unless `i - lower <= j <= i + upper`.
#[derive(Clone, Debug, PartialEq)]
pub struct BandedMatrix {
    count: usize,
    lower: usize,
    upper: usize,
    /// Row i holds its entries i - lower ..= i + upper; those outside the matrix stay zero.
    entries: Vec<f64>,
}

impl BandedMatrix {
    /// The zero matrix with `count` rows, `lower` diagonals below the main one and `upper` above.
    #[must_use]
    pub fn zeros(count: usize, lower: usize, upper: usize) -> Self {
        Self {
            count,
            lower,
            upper,
            entries: vec![0.0; count * (lower + upper + 1)],
        }
    }
    /// Number of rows.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }
    /// Adds `value` to entry (i, j).
    ///
    /// # Panics
    /// If (i, j) lies outside the band.
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        self.entries[i * (self.lower + self.upper + 1) + j + self.lower - i] += value;
    }

    /// L and U with A = L U, L with a unit diagonal, no rows exchanged. O(n lower upper).
    ///
    /// # Errors
    /// [`Error::NoSolution`] if a pivot is zero or not finite.
    pub fn factor(mut self) -> Result<BandedLu> {
        let Self {
            count,
            lower,
            upper,
            ..
        } = self;
        let width = lower + upper + 1;
        let entries = &mut self.entries;
        let mut inverse = vec![0.0; count];
        let mut below = vec![0.0; count * lower];
        let mut above = vec![0.0; count * upper];
        for i in 0..count {
            // 1. Eliminate the entries left of the diagonal with the rows above.
            let (done, row) = entries.split_at_mut(i * width);
            for k in i.saturating_sub(lower)..i {
                let multiplier = row[k + lower - i] * inverse[k];
                below[i * lower + i - k - 1] = multiplier;
                let from = &done[k * width + lower + 1..(k + 1) * width];
                for (entry, &a) in row[k + lower + 1 - i..].iter_mut().zip(from) {
                    *entry -= multiplier * a;
                }
            }
            // 2. The pivot, and the row of U divided by it.
            let pivot = row[lower];
            inverse[i] = 1.0 / pivot;
            if !(pivot.is_finite() && inverse[i].is_finite()) {
                return Err(Error::NoSolution(format!(
                    "the banded system is singular at row {i}"
                )));
            }
            for (target, &a) in above[i * upper..(i + 1) * upper]
                .iter_mut()
                .zip(&row[lower + 1..])
            {
                *target = a * inverse[i];
            }
        }
        Ok(BandedLu {
            count,
            lower,
            upper,
            below,
            above,
            inverse,
        })
    }
}

/// The factors of a [`BandedMatrix`].
#[derive(Clone, Debug, PartialEq)]
pub struct BandedLu {
    count: usize,
    lower: usize,
    upper: usize,
    /// Multiplier of row i - 1 - d at `i * lower + d`.
    below: Vec<f64>,
    /// U(i, i + 1 + d) / U(i, i) at `i * upper + d`.
    above: Vec<f64>,
    /// 1 / U(i, i).
    inverse: Vec<f64>,
}

impl BandedLu {
    /// Number of unknowns.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Solves A X = B in place; `rows` holds B, one row of right-hand sides after the other, `width` numbers each.
    ///
    /// # Panics
    /// If `rows` is shorter than `count * width`.
    pub fn solve(&self, rows: &mut [f64], width: usize) {
        if width > 0 {
            let mut rows: Vec<&mut [f64]> = rows.chunks_exact_mut(width).collect();
            self.solve_rows(&mut rows);
        }
    }

    /// Solves in place, the right-hand sides given row by row.
    pub(crate) fn solve_rows<R: Lanes>(&self, rows: &mut [R]) {
        for i in 0..self.count {
            let (done, rest) = rows.split_at_mut(i);
            let row = rest[0].as_mut();
            for (d, &factor) in self.below[i * self.lower..(i + 1) * self.lower]
                .iter()
                .enumerate()
                .take(i)
            {
                subtract(row, factor, done[i - 1 - d].as_ref());
            }
        }
        for i in (0..self.count).rev() {
            let (head, done) = rows.split_at_mut(i + 1);
            let row = head[i].as_mut();
            for x in row.iter_mut() {
                *x *= self.inverse[i];
            }
            for (&factor, other) in self.above[i * self.upper..(i + 1) * self.upper]
                .iter()
                .zip(&done[..(self.count - i - 1).min(self.upper)])
            {
                subtract(row, factor, other.as_ref());
            }
        }
    }
}

/// `row -= factor * other`.
#[inline]
fn subtract(row: &mut [f64], factor: f64, other: &[f64]) {
    for (x, &y) in row.iter_mut().zip(other) {
        *x -= factor * y;
    }
}

/// The factors of a cyclic banded matrix: entry (i, j) vanishes unless j is within `half` of i, counted around.
///
/// The last `half` unknowns form a border; what remains is banded and, for periodic splines, totally positive, so
/// that it is eliminated without pivoting. The border's Schur complement is dense, small and pivoted.
#[derive(Clone, Debug)]
pub struct CyclicLu {
    /// The leading block.
    lu: BandedLu,
    /// Number of border unknowns b.
    border: usize,
    /// Border rows left of the border: (border row, column, entry).
    left: Vec<(usize, usize, f64)>,
    /// G = (leading block)^-1 (border columns): the rows whose entries matter, b entries each.
    spread: Vec<(usize, Vec<f64>)>,
    /// Inverse of the Schur complement, b x b, row by row.
    schur_inverse: Vec<f64>,
}

impl CyclicLu {
    /// Factors the `count` x `count` matrix whose entry (i, (i + d) mod count) is the sum of the `entry(i, d)` for
    /// d in -half..=half that fall there. O(count half^2).
    ///
    /// # Errors
    /// [`Error::NoSolution`] if the matrix is singular.
    pub fn factor(count: usize, half: usize, entry: impl Fn(usize, isize) -> f64) -> Result<Self> {
        let border = half.min(count);
        let inner = count - border;
        let mut leading = BandedMatrix::zeros(inner, half, half);
        let mut columns = vec![0.0; inner * border];
        let mut left = Vec::new();
        let mut schur = vec![0.0; border * border];
        let reach = half.cast_signed();
        for i in 0..count {
            for d in -reach..=reach {
                let value = entry(i, d);
                let j = (i.cast_signed() + d).rem_euclid(count.cast_signed().max(1));
                let j = j.unsigned_abs();
                match (i < inner, j < inner) {
                    (true, true) => leading.add(i, j, value),
                    (true, false) => columns[i * border + j - inner] += value,
                    (false, true) => left.push((i - inner, j, value)),
                    (false, false) => schur[(i - inner) * border + j - inner] += value,
                }
            }
        }
        let lu = leading.factor()?;
        lu.solve(&mut columns, border);
        for &(r, j, value) in &left {
            for c in 0..border {
                schur[r * border + c] -= value * columns[j * border + c];
            }
        }
        // A pivot that cancelled down to the rounding of the largest entry is noise.
        let largest = (0..count)
            .flat_map(|i| (-reach..=reach).map(move |d| (i, d)))
            .fold(0.0_f64, |s, (i, d)| s.max(entry(i, d).abs()));
        let smallest = 16.0 * f64::EPSILON * largest;
        let schur_inverse = invert(schur, border, smallest)
            .ok_or_else(|| Error::NoSolution("the cyclic system is singular".into()))?;
        // G decays geometrically away from the seam; entries below the rounding of 1 change nothing.
        let negligible = f64::EPSILON / 16.0;
        let spread = columns
            .chunks_exact(border.max(1))
            .enumerate()
            .filter(|(_, g)| g.iter().any(|x| x.abs() > negligible))
            .map(|(i, g)| (i, g.to_vec()))
            .collect();
        Ok(Self {
            lu,
            border,
            left,
            spread,
            schur_inverse,
        })
    }

    /// Number of unknowns.
    #[must_use]
    pub fn count(&self) -> usize {
        self.lu.count + self.border
    }

    /// Solves A X = B in place, as [`BandedLu::solve`].
    ///
    /// # Panics
    /// If `rows` is shorter than `count * width`.
    pub fn solve(&self, rows: &mut [f64], width: usize) {
        if width > 0 {
            let mut rows: Vec<&mut [f64]> = rows.chunks_exact_mut(width).collect();
            self.solve_rows(&mut rows);
        }
    }

    /// Solves in place, the right-hand sides given row by row.
    pub(crate) fn solve_rows<R: Lanes>(&self, rows: &mut [R]) {
        let inner = self.lu.count;
        let (head, tail) = rows.split_at_mut(inner);
        self.lu.solve_rows(head);
        for &(r, j, value) in &self.left {
            subtract(tail[r].as_mut(), value, head[j].as_ref());
        }
        let b = self.border;
        if b > 0 {
            let width = tail[0].as_ref().len();
            let mut solution = vec![0.0; b * width];
            for (target, factors) in solution
                .chunks_exact_mut(width.max(1))
                .zip(self.schur_inverse.chunks_exact(b))
            {
                for (row, &factor) in tail.iter().zip(factors) {
                    subtract(target, -factor, row.as_ref());
                }
            }
            for (row, x) in tail.iter_mut().zip(solution.chunks_exact(width.max(1))) {
                row.as_mut().copy_from_slice(x);
            }
        }
        for (i, factors) in &self.spread {
            let row = head[*i].as_mut();
            for (x, &factor) in tail.iter().zip(factors) {
                subtract(row, factor, x.as_ref());
            }
        }
    }
}

/// Inverse of a small dense n x n matrix by Gauss-Jordan elimination with partial pivoting; `None` if a pivot is not
/// above `smallest`.
fn invert(mut a: Vec<f64>, n: usize, smallest: f64) -> Option<Vec<f64>> {
    let mut inverse = vec![0.0; n * n];
    for i in 0..n {
        inverse[i * n + i] = 1.0;
    }
    for k in 0..n {
        let best = (k..n).max_by(|&i, &j| a[i * n + k].abs().total_cmp(&a[j * n + k].abs()))?;
        for c in 0..n {
            a.swap(k * n + c, best * n + c);
            inverse.swap(k * n + c, best * n + c);
        }
        let pivot = a[k * n + k];
        if !(pivot.is_finite() && pivot.abs() > smallest) {
            return None;
        }
        for c in 0..n {
            a[k * n + c] /= pivot;
            inverse[k * n + c] /= pivot;
        }
        for i in (0..n).filter(|&i| i != k) {
            let factor = a[i * n + k];
            for c in 0..n {
                a[i * n + c] -= factor * a[k * n + c];
                inverse[i * n + c] -= factor * inverse[k * n + c];
            }
        }
    }
    Some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A diagonally dominant test matrix entry, reproducible.
    fn entry(i: usize, d: isize, half: usize) -> f64 {
        if d == 0 {
            2.0 + half as f64
        } else {
            (i as f64 * 1.7 + d as f64 * 2.3).sin()
        }
    }

    #[test]
    fn banded_solution_satisfies_the_system() {
        for (n, lower, upper) in [
            (1, 0, 0),
            (1, 2, 2),
            (2, 3, 1),
            (7, 1, 1),
            (30, 2, 1),
            (31, 0, 3),
            (40, 4, 4),
        ] {
            let half = lower.max(upper);
            let mut matrix = BandedMatrix::zeros(n, lower, upper);
            let mut dense = vec![0.0; n * n];
            for i in 0..n {
                for j in i.saturating_sub(lower)..(i + upper + 1).min(n) {
                    let value = entry(i, j.cast_signed() - i.cast_signed(), half);
                    matrix.add(i, j, value);
                    dense[i * n + j] = value;
                }
            }
            check(&dense, n, |x| matrix.clone().factor().unwrap().solve(x, 2));
        }
    }

    #[test]
    fn cyclic_solution_satisfies_the_system() {
        for half in 0..5_usize {
            for n in 1..40_usize {
                let mut dense = vec![0.0; n * n];
                for i in 0..n {
                    for d in -half.cast_signed()..=half.cast_signed() {
                        let j = (i.cast_signed() + d)
                            .rem_euclid(n.cast_signed())
                            .unsigned_abs();
                        dense[i * n + j] += entry(i, d, half);
                    }
                }
                let lu = CyclicLu::factor(n, half, |i, d| entry(i, d, half)).unwrap();
                check(&dense, n, |x| lu.solve(x, 2));
            }
        }
    }

    fn check(dense: &[f64], n: usize, solve: impl Fn(&mut [f64])) {
        let b: Vec<f64> = (0..2 * n).map(|k| (k as f64).cos()).collect();
        let mut x = b.clone();
        solve(&mut x);
        for i in 0..n {
            for c in 0..2 {
                let sum: f64 = (0..n).map(|j| dense[i * n + j] * x[2 * j + c]).sum();
                assert!((sum - b[2 * i + c]).abs() < 1e-12, "{n} {i} {c}");
            }
        }
    }

    #[test]
    fn singular_systems_are_refused() {
        assert!(BandedMatrix::zeros(3, 1, 1).factor().is_err());
        // The circulant 1, 2, 1 has a null vector of alternating signs for even n.
        assert!(CyclicLu::factor(6, 1, |_, d| if d == 0 { 2.0 } else { 1.0 }).is_err());
    }
}
