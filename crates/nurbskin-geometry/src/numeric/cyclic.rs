//! Cyclic banded linear systems, as periodic splines have them.

use super::banded::{BandedLu, BandedMatrix, Lanes, Lines, subtract};
use crate::{Error, Result};
use std::ops::Range;

/// Most unknowns a border may have.
const MAX_BORDER: usize = 32;

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
    /// [`Error::NoSolution`] if the matrix is singular; [`Error::Unsupported`] if `half` is above 32.
    pub fn factor(count: usize, half: usize, entry: impl Fn(usize, isize) -> f64) -> Result<Self> {
        if half > MAX_BORDER {
            return Err(Error::Unsupported(format!(
                "a cyclic band of {half} entries on either side: at most {MAX_BORDER} are supported"
            )));
        }
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
        self.lu.count() + self.border
    }

    /// Solves A X = B in place, as [`BandedLu::solve`].
    ///
    /// # Panics
    /// If `rows` is shorter than `count * width`.
    pub fn solve(&self, rows: &mut [f64], width: usize) {
        if width > 0 {
            let mut rows: Vec<&mut [f64]> = rows.chunks_exact_mut(width).collect();
            self.solve_rows(&mut rows, 0..width);
        }
    }

    /// Solves in place for the right-hand sides `lanes`, given row by row.
    pub fn solve_rows<R: Lanes>(&self, rows: &mut [R], lanes: Range<usize>) {
        self.lu
            .solve_rows(&mut rows[..self.lu.count()], lanes.clone());
        self.solve_border(rows, lanes);
    }

    /// Solves in place for many lines of points at once, as [`BandedLu::solve_lines`].
    pub fn solve_lines(&self, lines: &mut Lines<'_>) {
        self.lu.solve_lines(lines);
        if self.border > 0 {
            let count = self.count();
            lines.each(|line| self.solve_border(&mut line[..count], 0..3));
        }
    }

    /// The rest of the work once the leading block is solved.
    fn solve_border<R: Lanes>(&self, rows: &mut [R], lanes: Range<usize>) {
        let (head, tail) = rows.split_at_mut(self.lu.count());
        // 1. Right-hand side of the border.
        for &(r, j, value) in &self.left {
            let target = &mut tail[r].as_mut()[lanes.clone()];
            subtract(target, value, &head[j].as_ref()[lanes.clone()]);
        }
        // 2. The border's unknowns, lane by lane.
        let mut right = [0.0; MAX_BORDER];
        let right = &mut right[..self.border];
        for lane in lanes.clone() {
            for (b, row) in right.iter_mut().zip(&*tail) {
                *b = row.as_ref()[lane];
            }
            for (row, factors) in tail
                .iter_mut()
                .zip(self.schur_inverse.chunks_exact(self.border.max(1)))
            {
                row.as_mut()[lane] = factors.iter().zip(&*right).map(|(f, b)| f * b).sum();
            }
        }
        // 3. What the border takes from the leading block.
        for (i, factors) in &self.spread {
            let target = &mut head[*i].as_mut()[lanes.clone()];
            for (x, &factor) in tail.iter().zip(factors) {
                subtract(target, factor, &x.as_ref()[lanes.clone()]);
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
pub(super) mod tests {
    use super::*;

    /// A diagonally dominant test matrix entry, reproducible.
    pub(in super::super) fn entry(i: usize, d: isize, half: usize) -> f64 {
        if d == 0 {
            2.0 + half as f64
        } else {
            (i as f64 * 1.7 + d as f64 * 2.3).sin()
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

    pub(in super::super) fn check(dense: &[f64], n: usize, solve: impl Fn(&mut [f64])) {
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
        // The circulant 1, 2, 1 has a null vector of alternating signs for even n.
        assert!(CyclicLu::factor(6, 1, |_, d| if d == 0 { 2.0 } else { 1.0 }).is_err());
    }
}
