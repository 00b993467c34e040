//! Dense linear algebra for the placement of knots: a Cholesky factorisation and the leading singular directions.
//!
//! ```text
//! A = L Lᵀ,   bᵀ A⁻¹ b = |L⁻¹ b|²
//! ```
//!
//! The matrices have some dozens of rows; no library is worth a dependency for them.
//!
//! Source: Golub and Van Loan, *Matrix Computations*, 4.2 and 8.2.4.

use super::PROFILE_DIMENSIONS;

/// Steps of the subspace iteration. Count.
/// Trial: not recorded. Each step multiplies the error by the squared ratio of the neglected to the kept singular
/// values.
const SUBSPACE_ITERATIONS: usize = 4;
/// Number added to the diagonal, relative to its largest entry, and the least pivot.
/// Guard: keeps the factorisation finite where a spline has no place in its support; far below the weights of places
/// and above rounding.
const RELATIVE_RIDGE: f64 = 1e-13;
/// Length of an orthogonalised column relative to its length before, up to which it counts as linearly dependent.
/// Guard: some thousand times rounding.
const DEPENDENT_LENGTH: f64 = 1e-12;

/// `b . A^-1 b`, summed over all columns of b, for a symmetric matrix given by its lower half. Both are overwritten: A
/// = L L^T by L, and b by `L^-1 b`.
pub(super) fn explained<const N: usize>(a: &mut [f64], b: &mut [[f64; N]]) -> f64 {
    let n = b.len();
    let ridge = RELATIVE_RIDGE * (0..n).map(|i| a[i * n + i]).fold(0.0, f64::max);
    let mut sum = 0.0;
    for i in 0..n {
        let (above, row) = a.split_at_mut(i * n);
        let first = row[..i].iter().position(|&x| x != 0.0).unwrap_or(i);
        for j in first..i {
            let other = &above[j * n..j * n + j];
            let dot: f64 = row[first..j]
                .iter()
                .zip(&other[first..])
                .map(|(x, y)| x * y)
                .sum();
            row[j] = (row[j] - dot) / above[j * n + j];
        }
        let square: f64 = row[first..i].iter().map(|x| x * x).sum();
        let diagonal = (row[i] + ridge - square)
            .max(ridge.max(f64::MIN_POSITIVE))
            .sqrt();
        row[i] = diagonal;
        let (done, rest) = b.split_at_mut(i);
        for (&l, done) in row[first..i].iter().zip(&done[first..]) {
            for (x, y) in rest[0].iter_mut().zip(done) {
                *x -= l * y;
            }
        }
        for x in &mut rest[0] {
            *x /= diagonal;
            sum += *x * *x;
        }
    }
    sum
}

/// Solves `L^T x = b` for what [`explained`] leaves.
pub(super) fn backwards<const N: usize>(lower: &[f64], b: &mut [[f64; N]]) {
    let n = b.len();
    for i in (0..n).rev() {
        let (before, rest) = b.split_at_mut(i);
        rest[0].iter_mut().for_each(|x| *x /= lower[i * n + i]);
        for (&l, other) in lower[i * n..].iter().zip(before) {
            for (x, y) in other.iter_mut().zip(&rest[0]) {
                *x -= l * y;
            }
        }
    }
}

/// The weighted rows of a matrix in its leading right singular directions.
///
/// Source: subspace iteration, Golub and Van Loan, *Matrix Computations*, 8.2.4.
pub(super) fn principal(
    matrix: &[f64],
    columns: usize,
    weights: &[f64],
) -> Vec<[f64; PROFILE_DIMENSIONS]> {
    // A pseudo-random start, the same each time (a linear congruential generator of Knuth).
    let mut state = 1_u64;
    let mut start = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut directions: Vec<[f64; PROFILE_DIMENSIONS]> = (0..columns)
        .map(|_| std::array::from_fn(|_| start()))
        .collect();
    let project = |directions: &[[f64; PROFILE_DIMENSIONS]]| -> Vec<[f64; PROFILE_DIMENSIONS]> {
        let row = |row: &[f64]| {
            let mut out = [0.0; PROFILE_DIMENSIONS];
            for (&y, x) in row.iter().zip(directions) {
                for (o, x) in out.iter_mut().zip(x) {
                    *o += y * x;
                }
            }
            out
        };
        matrix.chunks(columns).map(row).collect()
    };
    for _ in 0..SUBSPACE_ITERATIONS {
        let rows = project(&directions);
        directions.fill([0.0; PROFILE_DIMENSIONS]);
        for ((row, values), w) in matrix.chunks(columns).zip(&rows).zip(weights) {
            for (x, &y) in directions.iter_mut().zip(row) {
                for (x, v) in x.iter_mut().zip(values) {
                    *x += w * y * v;
                }
            }
        }
        orthonormalise(&mut directions);
    }
    project(&directions)
}

/// Gram-Schmidt on the columns; dependent ones become zero.
fn orthonormalise(columns: &mut [[f64; PROFILE_DIMENSIONS]]) {
    for k in 0..PROFILE_DIMENSIONS {
        let before: f64 = columns.iter().map(|c| c[k] * c[k]).sum::<f64>().sqrt();
        // Twice is enough (B. N. Parlett, The Symmetric Eigenvalue Problem, 6.9).
        for _ in 0..2 {
            for l in 0..k {
                let dot: f64 = columns.iter().map(|c| c[k] * c[l]).sum();
                columns.iter_mut().for_each(|c| c[k] -= dot * c[l]);
            }
        }
        let length: f64 = columns.iter().map(|c| c[k] * c[k]).sum::<f64>().sqrt();
        let scale = if length > DEPENDENT_LENGTH * before && length > 0.0 {
            1.0 / length
        } else {
            0.0
        };
        columns.iter_mut().for_each(|c| c[k] *= scale);
    }
}
