//! Eigenvalues of small symmetric matrices.

use crate::math;

/// Sweeps of rotations at most; a handful suffices for any matrix of this size.
const SWEEPS: usize = 40;

/// Eigenvalues, ascending, and unit eigenvectors of a symmetric N x N matrix, by cyclic Jacobi rotations (G. Golub and
/// C. Van Loan, *Matrix Computations*, 4th ed., section 8.5). Only meant for small N: O(N^3) per sweep. A matrix that
/// is not finite gives numbers that are not finite.
///
/// ```
/// use nurbskin_geometry::numeric::eigen::symmetric_eigen;
/// let [(low, _), (high, vector)] = symmetric_eigen([[2.0, 1.0], [1.0, 2.0]]);
/// assert!((low - 1.0).abs() < 1e-15 && (high - 3.0).abs() < 1e-15);
/// assert!((vector[0] - vector[1]).abs() < 1e-15);
/// ```
#[must_use]
pub fn symmetric_eigen<const N: usize>(mut a: [[f64; N]; N]) -> [(f64, [f64; N]); N] {
    let mut vectors = [[0.0; N]; N];
    for (i, row) in vectors.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    for _ in 0..SWEEPS {
        let mut off = 0.0;
        let mut diagonal = 0.0;
        for (i, row) in a.iter().enumerate() {
            off += row[i + 1..].iter().map(|x| x.abs()).sum::<f64>();
            diagonal += row[i].abs();
        }
        if off <= f64::EPSILON * 1e-3 * diagonal {
            break;
        }
        for p in 0..N {
            for q in p + 1..N {
                rotate(&mut a, &mut vectors, p, q);
            }
        }
    }
    let mut pairs = std::array::from_fn(|k| (a[k][k], std::array::from_fn(|i| vectors[i][k])));
    pairs.sort_by(|x: &(f64, [f64; N]), y| x.0.total_cmp(&y.0));
    pairs
}

/// The rotation in the plane (p, q) that makes the entry (p, q) vanish.
fn rotate<const N: usize>(a: &mut [[f64; N]; N], vectors: &mut [[f64; N]; N], p: usize, q: usize) {
    if a[p][q].abs() <= f64::MIN_POSITIVE {
        return;
    }
    let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    let t = theta.signum() / (theta.abs() + math::hypot(theta, 1.0));
    let c = 1.0 / math::hypot(t, 1.0);
    let s = t * c;
    for row in a.iter_mut().chain(vectors.iter_mut()) {
        let (x, y) = (row[p], row[q]);
        (row[p], row[q]) = (c * x - s * y, s * x + c * y);
    }
    let (above, below) = a.split_at_mut(q);
    for (x, y) in above[p].iter_mut().zip(&mut below[0]) {
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A = sum of lambda v v^T is rebuilt, and the vectors are orthonormal.
    #[test]
    fn rebuilds_the_matrix() {
        let a: [[f64; 6]; 6] = std::array::from_fn(|i| {
            std::array::from_fn(|j| ((i + 1) * (j + 1)) as f64 / (1.0 + (i + j) as f64).powi(2))
        });
        let pairs = symmetric_eigen(a);
        for i in 0..6 {
            for j in 0..6 {
                let rebuilt: f64 = pairs.iter().map(|(l, v)| l * v[i] * v[j]).sum();
                assert!((rebuilt - a[i][j]).abs() < 1e-13);
                let dot: f64 = (0..6).map(|k| pairs[i].1[k] * pairs[j].1[k]).sum();
                assert!((dot - f64::from(u8::from(i == j))).abs() < 1e-13);
            }
        }
        assert!(pairs.windows(2).all(|w| w[0].0 <= w[1].0));
    }
}
