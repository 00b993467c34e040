//! Banded linear systems: LU without pivoting.
//!
//! The collocation matrices of B-spline interpolation are totally positive, for which elimination without row
//! exchanges is stable (C. de Boor and A. Pinkus, *Numerische Mathematik* 27, 1977, 485-490). Everything here costs
//! O(n) per right-hand side for a fixed bandwidth.

use crate::{Error, Result};
use std::ops::Range;

/// Something that holds one row of right-hand sides: `[f64; 3]` for a point, `&mut [f64]` for a strip of a table.
pub trait Lanes: AsRef<[f64]> + AsMut<[f64]> {}
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
            self.solve_rows(&mut rows, 0..width);
        }
    }

    /// Solves in place for the right-hand sides `lanes`, given row by row.
    pub fn solve_rows<R: Lanes>(&self, rows: &mut [R], lanes: Range<usize>) {
        match (self.lower, self.upper) {
            (1, 1) => self.sweep_rows::<R, 1, 1>(rows, lanes),
            (2, 2) => self.sweep_rows::<R, 2, 2>(rows, lanes),
            _ => self.sweep_rows_any(rows, lanes),
        }
    }

    fn sweep_rows_any<R: Lanes>(&self, rows: &mut [R], lanes: Range<usize>) {
        for i in 0..self.count {
            let (done, rest) = rows.split_at_mut(i);
            let row = &mut rest[0].as_mut()[lanes.clone()];
            let factors = &self.below[i * self.lower..(i + 1) * self.lower];
            for (other, &factor) in done.iter().rev().zip(factors) {
                subtract(row, factor, &other.as_ref()[lanes.clone()]);
            }
        }
        for i in (0..self.count).rev() {
            let (head, done) = rows.split_at_mut(i + 1);
            let row = &mut head[i].as_mut()[lanes.clone()];
            for x in row.iter_mut() {
                *x *= self.inverse[i];
            }
            let factors = &self.above[i * self.upper..(i + 1) * self.upper];
            for (other, &factor) in done[..self.count - i - 1].iter().zip(factors) {
                subtract(row, factor, &other.as_ref()[lanes.clone()]);
            }
        }
    }

    /// As [`Self::sweep_rows_any`], with the bandwidth known: one pass over each row.
    fn sweep_rows<R: Lanes, const L: usize, const U: usize>(
        &self,
        rows: &mut [R],
        lanes: Range<usize>,
    ) {
        let below = self.below.as_chunks::<L>().0;
        let above = self.above.as_chunks::<U>().0;
        // The first and last rows have fewer neighbours.
        for (i, &(mut factors)) in below.iter().enumerate().take(self.count) {
            let (done, rest) = rows.split_at_mut(i);
            let row = &mut rest[0].as_mut()[lanes.clone()];
            if let Some((_, near)) = done.split_last_chunk::<L>() {
                let near = near.each_ref().map(|r| &r.as_ref()[lanes.clone()]);
                factors.reverse();
                combine(row, 1.0, factors, near);
            } else {
                for (other, &factor) in done.iter().rev().zip(&factors) {
                    subtract(row, factor, &other.as_ref()[lanes.clone()]);
                }
            }
        }
        for i in (0..self.count).rev() {
            let (head, done) = rows.split_at_mut(i + 1);
            let done = &done[..self.count - i - 1];
            let row = &mut head[i].as_mut()[lanes.clone()];
            if let Some((near, _)) = done.split_first_chunk::<U>() {
                let mut near = near.each_ref().map(|r| &r.as_ref()[lanes.clone()]);
                let mut factors = above[i];
                near.reverse();
                factors.reverse();
                combine(row, self.inverse[i], factors, near);
            } else {
                for x in row.iter_mut() {
                    *x *= self.inverse[i];
                }
                for (other, &factor) in done.iter().zip(&above[i]) {
                    subtract(row, factor, &other.as_ref()[lanes.clone()]);
                }
            }
        }
    }

    /// Solves in place for many lines of points, each with its unknowns along the line. Several lines go side by side,
    /// because along one of them each step waits for the one before.
    pub fn solve_lines(&self, lines: &mut Lines<'_>) {
        match (self.lower, self.upper) {
            (1, 1) => lines.fours(
                |four| self.sweep_four::<1, 1>(four),
                |line| self.solve_rows(line, 0..3),
            ),
            (2, 2) => lines.fours(
                |four| self.sweep_four::<2, 2>(four),
                |line| self.solve_rows(line, 0..3),
            ),
            _ => lines.each(|line| self.sweep_rows_any(line, 0..3)),
        }
    }

    fn sweep_four<const L: usize, const U: usize>(&self, lines: [&mut [[f64; 3]]; 4]) {
        let count = self.count;
        let [a, b, c, d] = lines;
        let (a, b, c, d) = (
            &mut a[..count],
            &mut b[..count],
            &mut c[..count],
            &mut d[..count],
        );
        // Places outside the matrix hold zero factors; the history starts with zeros.
        let mut near = [[[0.0; 3]; 4]; L];
        for (((((a, b), c), d), factors), _) in a
            .iter_mut()
            .zip(b.iter_mut())
            .zip(c.iter_mut())
            .zip(d.iter_mut())
            .zip(self.below.as_chunks::<L>().0)
            .zip(0..count)
        {
            let now = advance([*a, *b, *c, *d], factors, &mut near);
            [*a, *b, *c, *d] = now;
        }
        let mut near = [[[0.0; 3]; 4]; U];
        for (((((a, b), c), d), factors), &inverse) in a
            .iter_mut()
            .zip(b.iter_mut())
            .zip(c.iter_mut())
            .zip(d.iter_mut())
            .zip(self.above.as_chunks::<U>().0)
            .zip(&self.inverse)
            .rev()
        {
            let scaled = [*a, *b, *c, *d].map(|p| p.map(|x| x * inverse));
            [*a, *b, *c, *d] = advance(scaled, factors, &mut near);
        }
    }
}

/// `row - factors * near` for four points; the nearest neighbours are moved on.
#[inline(always)]
fn advance<const K: usize>(
    mut row: [[f64; 3]; 4],
    factors: &[f64; K],
    near: &mut [[[f64; 3]; 4]; K],
) -> [[f64; 3]; 4] {
    // The nearest neighbour last: it was ready last.
    for (factor, other) in factors.iter().zip(near.iter()).rev() {
        for (p, q) in row.iter_mut().zip(other) {
            for (x, y) in p.iter_mut().zip(q) {
                *x -= factor * y;
            }
        }
    }
    for k in (1..K).rev() {
        near[k] = near[k - 1];
    }
    near[0] = row;
    row
}

/// `row = scale * row - factors * near`, the farthest neighbour first, as [`advance`] does it.
#[inline(always)]
fn combine<const K: usize>(row: &mut [f64], scale: f64, factors: [f64; K], near: [&[f64]; K]) {
    let width = row.len();
    let near = near.map(|other| &other[..width]);
    for (k, x) in row.iter_mut().enumerate() {
        let mut value = *x * scale;
        for (factor, other) in factors.iter().zip(&near) {
            value -= factor * other[k];
        }
        *x = value;
    }
}

/// Lines of points within a table: the points `from..` of each row of `width` points.
#[derive(Debug)]
pub struct Lines<'a> {
    /// The table, row by row.
    pub points: &'a mut [[f64; 3]],
    /// Points in a row of the table.
    pub width: usize,
    /// First point of a line within its row.
    pub from: usize,
}

impl Lines<'_> {
    /// Calls `f` with each line.
    pub(crate) fn each(&mut self, mut f: impl FnMut(&mut [[f64; 3]])) {
        for row in self.points.chunks_exact_mut(self.width) {
            f(&mut row[self.from..]);
        }
    }

    /// Calls `f` with four lines at a time and `rest` with each that is left over.
    fn fours(
        &mut self,
        mut f: impl FnMut([&mut [[f64; 3]]; 4]),
        mut rest: impl FnMut(&mut [[f64; 3]]),
    ) {
        let (width, from) = (self.width, self.from);
        let mut blocks = self.points.chunks_exact_mut(4 * width);
        for block in &mut blocks {
            let (ab, cd) = block.split_at_mut(2 * width);
            let (a, b) = ab.split_at_mut(width);
            let (c, d) = cd.split_at_mut(width);
            f([a, b, c, d].map(|row| &mut row[from..]));
        }
        for row in blocks.into_remainder().chunks_exact_mut(width) {
            rest(&mut row[from..]);
        }
    }
}

/// `row -= factor * other`.
#[inline]
pub(super) fn subtract(row: &mut [f64], factor: f64, other: &[f64]) {
    for (x, &y) in row.iter_mut().zip(other) {
        *x -= factor * y;
    }
}

#[cfg(test)]
mod tests {
    use super::super::cyclic::tests::{check, entry};
    use super::*;

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
    fn singular_systems_are_refused() {
        assert!(BandedMatrix::zeros(3, 1, 1).factor().is_err());
    }
}
