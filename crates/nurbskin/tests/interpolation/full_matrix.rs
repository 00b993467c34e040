//! The paper's own route: the full matrix of rational basis functions, inverted by Gauss-Jordan elimination. It is kept
//! as the oracle and shares no code with the library. Pal & Ballav 2007, figures 8 to 10, and what follows from them.

use super::*;
use nurbskin::fit::interpolate::parameters::averaged_knots;

/// Pal & Ballav 2007, eq. (2), by its recursion, spans half open and the last one closed.
fn basis(knots: &[f64], i: usize, p: usize, u: f64) -> f64 {
    if p == 0 {
        let last = knots[knots.len() - 1];
        let closed = u >= last && knots[i + 1] >= last && knots[i] < last;
        return f64::from((knots[i] <= u && u < knots[i + 1]) || closed);
    }
    let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
    ratio(u - knots[i], knots[i + p] - knots[i]) * basis(knots, i, p - 1, u)
        + ratio(knots[i + p + 1] - u, knots[i + p + 1] - knots[i + 1])
            * basis(knots, i + 1, p - 1, u)
}

/// Eq. (9), word for word.
fn knots(parameters: &[f64], p: usize) -> Vec<f64> {
    let m = parameters.len() - 1;
    let mut knots = vec![0.0; p + 1];
    for j in 1..=m - p {
        knots.push(parameters[j..j + p].iter().sum::<f64>() / p as f64);
    }
    knots.resize(m + p + 2, 1.0);
    knots
}

/// Row n k + l, column n i + j: `N_i(u_k) N_j(v_l)` over the sum of all, which the unit weights make 1.
fn matrix(u: &[f64], v: &[f64], p: usize) -> Vec<Vec<f64>> {
    let table = |t: &[f64]| -> Vec<Vec<f64>> {
        let knots = knots(t, p);
        t.iter()
            .map(|&t| {
                (0..knots.len() - p - 1)
                    .map(|i| basis(&knots, i, p, t))
                    .collect()
            })
            .collect()
    };
    let (bu, bv) = (table(u), table(v));
    let mut rows = Vec::new();
    for row_u in &bu {
        for row_v in &bv {
            let row: Vec<f64> = row_u
                .iter()
                .flat_map(|a| row_v.iter().map(move |b| a * b))
                .collect();
            let sum: f64 = row.iter().sum();
            rows.push(row.iter().map(|x| x / sum).collect());
        }
    }
    rows
}

/// Gauss-Jordan elimination with partial pivoting of [A | I].
fn inverse(mut a: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let n = a.len();
    for (i, row) in a.iter_mut().enumerate() {
        row.resize(2 * n, 0.0);
        row[n + i] = 1.0;
    }
    for k in 0..n {
        let best = (k..n)
            .max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))
            .unwrap();
        a.swap(k, best);
        let pivot = a[k][k];
        a[k][k..].iter_mut().for_each(|x| *x /= pivot);
        let row = a[k].clone();
        for (i, other) in a.iter_mut().enumerate() {
            let factor = other[k];
            if i != k && factor != 0.0 {
                for (x, y) in other[k..].iter_mut().zip(&row[k..]) {
                    *x -= factor * y;
                }
            }
        }
    }
    a.into_iter().map(|row| row[n..].to_vec()).collect()
}

/// Pal & Ballav 2007, figures 8 to 10: the 16 x 16 matrix, its inverse, and the control net.
#[test]
fn figures_8_9_and_10() {
    let t = uniform(4);
    let matrix = matrix(&t, &t, 3);
    let non_zeros = |rows: &[Vec<f64>]| rows.iter().flatten().filter(|x| x.abs() > 1e-14).count();
    assert_eq!(non_zeros(&matrix), 100);
    close(
        &matrix[5].iter().map(|x| 729.0 * x).collect::<Vec<_>>(),
        &[
            64., 96., 48., 8., 96., 144., 72., 12., 48., 72., 36., 6., 8., 12., 6., 1.,
        ],
        1e-12,
    );
    let inverse = inverse(matrix);
    assert_eq!(non_zeros(&inverse), 100);
    close(
        &inverse[5].iter().map(|x| 36.0 * x).collect::<Vec<_>>(),
        &[
            25., -90., 45., -10., -90., 324., -162., 36., 45., -162., 81., -18., -10., 36., -18.,
            4.,
        ],
        1e-11,
    );
    let norm = inverse
        .iter()
        .map(|row| row.iter().map(|x| x.abs()).sum::<f64>())
        .fold(0.0, f64::max);
    assert!((norm - 289.0 / 9.0).abs() < 1e-12);
    let largest = inverse
        .iter()
        .flatten()
        .fold(0.0_f64, |m, x| m.max(x.abs()));
    assert!((largest - 9.0).abs() < 1e-12);
    assert!(against_full_matrix(4, 4) <= 1e-14);
    // A plain Bezier patch.
    let fit = interpolate(&sheet(4, 4), Topology::Disk, [3, 3], Uniform).unwrap();
    assert_eq!(
        fit.surface.knots_u().knots(),
        [0., 0., 0., 0., 1., 1., 1., 1.]
    );
}

/// Difference between the two banded passes and the inverse of the full matrix times the points.
fn against_full_matrix(m: usize, n: usize) -> f64 {
    let grid = sheet(m, n);
    let (u, v) = (uniform(m), uniform(n));
    let ours = interpolate_at(&grid, Topology::Disk, [3, 3], [&u, &v]).unwrap();
    let inverse = inverse(matrix(&u, &v, 3));
    let points: Vec<DVec3> = (0..m).flat_map(|i| grid.column(i)).collect();
    let net: Vec<DVec3> = inverse
        .iter()
        .map(|row| {
            row.iter()
                .zip(&points)
                .fold(DVec3::ZERO, |s, (&a, &q)| s + a * q)
        })
        .collect();
    let net = PointGrid::from_fn(m, n, |i, j| net[i * n + j]).unwrap();
    close(ours.knots_u().knots(), &knots(&u, 3), 1e-15);
    let theirs =
        NurbsSurface::new(ours.knots_u().clone(), ours.knots_v().clone(), net, None).unwrap();
    difference(&ours, &theirs)
}

/// The sizes of Table 1.
#[test]
fn two_passes_equal_the_full_matrix() {
    for (m, n) in [(18, 18), (29, 13), (25, 32)] {
        let d = against_full_matrix(m, n);
        assert!(d <= 1e-12, "{m} x {n}: {d:e}");
    }
}

/// Row by row, the inverse of the collocation matrix at n uniform parameters, from unit vectors as points.
fn inverse_collocation(n: usize) -> Vec<Vec<f64>> {
    let mut inverse = vec![vec![0.0; n]; n];
    for start in (0..n).step_by(3) {
        let unit = |i: usize, k: usize| f64::from(i == k);
        let points: Vec<DVec3> = (0..n)
            .map(|i| DVec3::new(unit(i, start), unit(i, start + 1), unit(i, start + 2)))
            .collect();
        let curve = interpolate_curve_at(&points, false, 3, &uniform(n)).unwrap();
        for (row, p) in inverse.iter_mut().zip(curve.control_points()) {
            for (k, x) in p.to_array().into_iter().enumerate().take(n - start) {
                row[start + k] = x;
            }
        }
    }
    inverse
}

#[test]
fn inverses_and_their_norms() {
    let rational = |n: usize, row: usize, expected: &[f64]| {
        close(&inverse_collocation(n)[row], expected, 1e-14);
    };
    rational(4, 1, &[-5. / 6., 3., -3. / 2., 1. / 3.]);
    rational(5, 1, &[-5. / 18., 20. / 9., -4. / 3., 4. / 9., -1. / 18.]);
    rational(5, 2, &[1. / 6., -4. / 3., 10. / 3., -4. / 3., 1. / 6.]);
    // The gain does not grow with the size.
    let limit = 4.745_868_102_344_67;
    for (n, expected) in [
        (4, 17. / 3.),
        (5, 19. / 3.),
        (6, 125. / 27.),
        (7, 33. / 7.),
        (50, limit),
        (1000, limit),
    ] {
        let norm = inverse_collocation(n)
            .iter()
            .map(|row| row.iter().map(|x| x.abs()).sum::<f64>())
            .fold(0.0, f64::max);
        assert!((norm - expected).abs() < 1e-12, "{n}: {norm}");
    }
}

#[test]
fn knots_of_six_and_seven_points() {
    let inner = |n: usize| {
        let knots = averaged_knots(&uniform(n), 3).unwrap();
        knots.breakpoints()[1..knots.breakpoints().len() - 1].to_vec()
    };
    close(&inner(6), &[2. / 5., 3. / 5.], 1e-15);
    close(&inner(7), &[1. / 3., 1. / 2., 2. / 3.], 1e-15);
}
