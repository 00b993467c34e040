//! The paper's own way (figures 8 to 10): the (mn) x (mn) matrix of basis functions, its inverse by Gauss-Jordan
//! elimination, and the inverse times the points. Only here to be timed and compared with; it shares no code with the
//! library.

use nurbskin::{DVec3, PointGrid};

/// The paper's degree.
const DEGREE: usize = 3;

/// The control points through a grid of at least 4 x 4 points at uniform parameters; index i along u fastest.
pub(crate) fn control_points(grid: &PointGrid) -> Vec<DVec3> {
    let [m, n] = grid.counts();
    let [along_u, along_v] = [m, n].map(collocation);
    let size = m * n;
    // [B | I], row by row.
    let mut matrix = vec![0.0; 2 * size * size];
    for (row, values) in matrix.chunks_exact_mut(2 * size).enumerate() {
        for column in 0..size {
            values[column] =
                along_u[(row % m) * m + column % m] * along_v[(row / m) * n + column / m];
        }
        values[size + row] = 1.0;
    }
    gauss_jordan(&mut matrix, size);
    let times_points = |row: &[f64]| {
        let terms = row[size..].iter().zip(grid.points());
        terms.map(|(&factor, &point)| factor * point).sum()
    };
    matrix.chunks_exact(2 * size).map(times_points).collect()
}

/// The matrix `N_i(u_k)` of one direction, row k, at the uniform parameters of eq. (7) with the knots of eq. (9).
fn collocation(count: usize) -> Vec<f64> {
    let parameters: Vec<f64> = (0..count).map(|k| k as f64 / (count - 1) as f64).collect();
    let mut knots = vec![0.0; DEGREE + 1];
    for j in 1..count - DEGREE {
        knots.push(parameters[j..j + DEGREE].iter().sum::<f64>() / DEGREE as f64);
    }
    knots.resize(count + DEGREE + 1, 1.0);
    let row = |&u: &f64| (0..count).map(move |i| (i, u));
    let places = parameters.iter().flat_map(row);
    places.map(|(i, u)| basis(&knots, i, DEGREE, u)).collect()
}

/// The basis function of eq. (2), by its recursion: spans half open, the last one closed.
fn basis(knots: &[f64], i: usize, p: usize, u: f64) -> f64 {
    if p == 0 {
        let (a, b) = (knots[i], knots[i + 1]);
        return f64::from(a <= u && (u < b || (u >= 1.0 && a < b && b >= 1.0)));
    }
    let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
    ratio(u - knots[i], knots[i + p] - knots[i]) * basis(knots, i, p - 1, u)
        + ratio(knots[i + p + 1] - u, knots[i + p + 1] - knots[i + 1])
            * basis(knots, i + 1, p - 1, u)
}

/// Turns [A | I] into [I | inverse of A], with partial pivoting.
fn gauss_jordan(matrix: &mut [f64], size: usize) {
    let width = 2 * size;
    for k in 0..size {
        let larger = |&a: &usize, &b: &usize| {
            let [a, b] = [a, b].map(|row| matrix[row * width + k].abs());
            a.total_cmp(&b)
        };
        let best = (k..size).max_by(larger).unwrap_or(k);
        for column in 0..width {
            matrix.swap(k * width + column, best * width + column);
        }
        let pivot = matrix[k * width + k];
        let row: Vec<f64> = matrix[k * width..(k + 1) * width]
            .iter()
            .map(|x| x / pivot)
            .collect();
        for (i, other) in matrix.chunks_exact_mut(width).enumerate() {
            let factor = other[k];
            if i == k {
                other.copy_from_slice(&row);
            } else if factor != 0.0 {
                for (x, y) in other.iter_mut().zip(&row) {
                    *x -= factor * y;
                }
            }
        }
    }
}
