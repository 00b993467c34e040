//! The NURBS Book's examples and identities, and exact rational values.

#![expect(clippy::unwrap_used, reason = "a panic is how a test fails")]

use nurbskin::nurbs::basis::{basis_derivatives, basis_functions};
use nurbskin::nurbs::conic;
use nurbskin::{DVec3, KnotVector, NurbsCurve};

type Matrix = Vec<Vec<f64>>;

/// Numbers such as "1/8 -3 0".
fn rationals(text: &str) -> Vec<f64> {
    let number = |word: &str| {
        let (top, bottom) = word.split_once('/').unwrap_or((word, "1"));
        top.parse::<f64>().unwrap() / bottom.parse::<f64>().unwrap()
    };
    text.split_whitespace().map(number).collect()
}

/// Rows separated by semicolons; the lower half is the upper one turned by half a turn, as all are here.
fn matrix(n: usize, upper_half: &str) -> Matrix {
    let mut rows: Matrix = upper_half.split(';').map(rationals).collect();
    for k in rows.len()..n {
        rows.push(rows[n - 1 - k].iter().rev().copied().collect());
    }
    rows
}

/// Cubic interpolation at n even parameters: knots by averaging (eq. 9.8), and `B[k][i] = N_{i,3}(u_k)`.
fn collocation(n: usize) -> (KnotVector, Matrix) {
    let parameter = |k: usize| k as f64 / (n - 1) as f64;
    let inner = (1..n - 3).map(|j| (j..j + 3).map(parameter).sum::<f64>() / 3.0);
    let breaks: Vec<f64> = std::iter::once(0.0).chain(inner).chain([1.0]).collect();
    let knots = KnotVector::clamped(3, &breaks).unwrap();
    let row = |k: usize| {
        let (mut row, mut basis) = (vec![0.0; n], [0.0; 4]);
        let span = knots.span(parameter(k));
        basis_functions(&knots, span, parameter(k), &mut basis);
        row[span - 3..=span].copy_from_slice(&basis);
        row
    };
    let rows = (0..n).map(row).collect();
    (knots, rows)
}

/// Gauss-Jordan inverse with pivots.
fn inverse(a: &Matrix) -> Matrix {
    let n = a.len();
    let mut work: Matrix = a.clone();
    for (k, row) in work.iter_mut().enumerate() {
        row.extend((0..n).map(|i| if i == k { 1.0 } else { 0.0 }));
    }
    for k in 0..n {
        let pivot = (k..n)
            .max_by(|&i, &j| work[i][k].abs().total_cmp(&work[j][k].abs()))
            .unwrap();
        work.swap(k, pivot);
        let divisor = work[k][k];
        work[k].iter_mut().for_each(|x| *x /= divisor);
        let pivot_row = work[k].clone();
        for (_, row) in work.iter_mut().enumerate().filter(|(i, _)| *i != k) {
            let factor = row[k];
            row.iter_mut()
                .zip(&pivot_row)
                .for_each(|(x, y)| *x -= factor * y);
        }
    }
    work.iter().map(|row| row[n..].to_vec()).collect()
}

fn kronecker(a: &Matrix, b: &Matrix) -> Matrix {
    let row = |x: &Vec<f64>, y: &Vec<f64>| -> Vec<f64> {
        x.iter()
            .flat_map(|p| y.iter().map(move |q| p * q))
            .collect()
    };
    a.iter()
        .flat_map(|x| b.iter().map(move |y| row(x, y)))
        .collect()
}

fn norm(a: &Matrix) -> f64 {
    a.iter()
        .map(|row| row.iter().map(|x| x.abs()).sum())
        .fold(0.0, f64::max)
}

fn assert_close(a: &[f64], b: &[f64], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    let worst = a
        .iter()
        .zip(b)
        .map(|(x, y)| (x - y).abs())
        .fold(0.0, f64::max);
    assert!(worst <= tolerance, "{a:?} is not {b:?}");
}

/// Collocation matrices of cubic interpolation at even parameters, exact.
#[test]
fn collocation_matrices_are_the_exact_rationals() {
    let exact = [
        (4, "", "1 0 0 0; 8/27 4/9 2/9 1/27"),
        (5, "1/2", "1 0 0 0 0; 1/8 19/32 1/4 1/32 0; 0 1/4 1/2 1/4 0"),
        (
            6,
            "2/5 3/5",
            "1 0 0 0 0 0; 1/8 37/72 59/180 1/30 0 0; 0 1/9 28/45 4/15 0 0",
        ),
        (
            7,
            "1/3 1/2 2/3",
            "1 0 0 0 0 0 0; 1/8 37/72 23/72 1/24 0 0 0; 0 1/9 5/9 1/3 0 0 0; 0 0 1/8 3/4 1/8 0 0",
        ),
    ];
    for (n, inner, upper_half) in exact {
        let (knots, b) = collocation(n);
        assert_close(&knots.knots()[4..n], &rationals(inner), 1e-15);
        for (row, exact) in b.iter().zip(matrix(n, upper_half)) {
            assert_close(row, &exact, 1e-15);
            assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        }
    }
}

/// Their inverses, exact.
#[test]
fn inverse_collocation_matrices_are_the_exact_rationals() {
    let exact = [
        (4, "17/3", "1 0 0 0; -5/6 3 -3/2 1/3"),
        (
            5,
            "19/3",
            "1 0 0 0 0; -5/18 20/9 -4/3 4/9 -1/18; 1/6 -4/3 10/3 -4/3 1/6",
        ),
        (
            6,
            "125/27",
            "1 0 0 0 0 0; -38/135 304/135 -191/135 74/135 -16/135 2/135; \
             17/270 -68/135 629/270 -148/135 32/135 -4/135",
        ),
        (
            7,
            "33/7",
            "1 0 0 0 0 0 0; -71/252 142/63 -359/252 4/7 -37/252 2/63 -1/252; \
             4/63 -32/63 148/63 -8/7 37/126 -4/63 1/126; -1/84 2/21 -37/84 12/7 -37/84 2/21 -1/84",
        ),
    ];
    for (n, size, upper_half) in exact {
        let inverse = inverse(&collocation(n).1);
        for (row, exact) in inverse.iter().zip(matrix(n, upper_half)) {
            assert_close(row, &exact, 1e-14);
        }
        assert!((norm(&inverse) - rationals(size)[0]).abs() < 1e-14);
    }
}

/// The condition of interpolation does not grow with the number of points.
#[test]
fn condition_is_independent_of_size() {
    for (n, exact, tolerance) in [
        (10, 4.745_257_452_574_527, 1e-13),
        (20, 4.745_868_101_179_585, 1e-13),
        (60, 4.745_868_102_344_67, 1e-12),
    ] {
        assert!((norm(&inverse(&collocation(n).1)) - exact).abs() < tolerance);
    }
}

/// The 16 x 16 matrix of 4 x 4 points, and its inverse.
#[test]
fn surface_matrix_of_sixteen_points() {
    let (_, b) = collocation(4);
    let full = kronecker(&b, &b);
    let non_zeros = |a: &Matrix| a.iter().flatten().filter(|x| x.abs() > 1e-14).count();
    assert_eq!(non_zeros(&full), 100);
    let far = |k: usize| {
        (0..16)
            .filter(|&i| full[k][i] > 0.0)
            .map(|i| k.abs_diff(i))
            .max()
    };
    assert_eq!((0..16).filter_map(far).max(), Some(10));
    let smallest = (0..16).map(|k| full[k][k]).fold(f64::INFINITY, f64::min);
    assert!((smallest - 16.0 / 81.0).abs() < 1e-15);
    let scaled = |row: &[f64], factor: f64| row.iter().map(|x| x * factor).collect::<Vec<_>>();
    let row = "64 96 48 8 96 144 72 12 48 72 36 6 8 12 6 1";
    assert_close(&scaled(&full[5], 729.0), &rationals(row), 1e-12);
    let inverse = inverse(&full);
    assert_eq!(non_zeros(&inverse), 100);
    let row = "25 -90 45 -10 -90 324 -162 36 45 -162 81 -18 -10 36 -18 4";
    assert_close(&scaled(&inverse[5], 36.0), &rationals(row), 1e-11);
    let largest = inverse
        .iter()
        .flatten()
        .fold(0.0_f64, |a, x| a.max(x.abs()));
    assert!((largest - 9.0).abs() < 1e-13 && (norm(&inverse) - 289.0 / 9.0).abs() < 1e-12);
}

/// Ex 2.1 and eq. (2.8): without inner knots the basis functions are the Bernstein polynomials.
#[test]
fn bernstein_polynomials() {
    for p in 1..=25_usize {
        let knots = KnotVector::uniform(p, p + 1).unwrap();
        let mut basis = [0.0; 26];
        let t: f64 = 0.375;
        basis_functions(&knots, p, t, &mut basis);
        let mut binomial = 1.0;
        for (i, b) in basis[..=p].iter().enumerate() {
            let exact = binomial * t.powf(i as f64) * (1.0 - t).powf((p - i) as f64);
            assert!((b - exact).abs() < 1e-15);
            binomial *= (p - i) as f64 / (i + 1) as f64;
        }
    }
}

/// Eq. (2.7): the derivative by basis functions of the degree below.
#[test]
fn derivative_by_lower_degree() {
    let list = vec![0., 0., 0., 0., 1., 2., 2., 4., 5., 5., 5., 5.];
    let knots = KnotVector::new(3, list.clone()).unwrap();
    let lower = KnotVector::new(2, list[1..11].to_vec()).unwrap();
    for t in [0.0, 0.25, 1.0, 1.75, 2.0, 3.5, 5.0] {
        let span = knots.span(t);
        let (mut table, mut below) = ([0.0; 8], [0.0; 5]);
        basis_derivatives(&knots, span, t, 1, &mut table);
        basis_functions(&lower, lower.span(t), t, &mut below[1..4]);
        for j in 0..=3 {
            let i = span - 3 + j;
            // below[j] is N_{i,2}, below[j + 1] is N_{i+1,2}.
            let share = |value: f64, width: f64| {
                if width > 0.0 {
                    3.0 * value / width
                } else {
                    0.0
                }
            };
            let exact = share(below[j], list[i + 3] - list[i])
                - share(below[j + 1], list[i + 4] - list[i + 1]);
            assert!((table[4 + j] - exact).abs() < 1e-14);
        }
    }
}

/// Uniform cubic B-splines at their knots: 1/6, 4/6, 1/6.
#[test]
fn uniform_cubic() {
    let breaks: Vec<f64> = (0..=6).map(f64::from).collect();
    let knots = KnotVector::periodic(3, &breaks).unwrap();
    let mut table = [0.0; 12];
    basis_derivatives(&knots, knots.span(2.0), 2.0, 2, &mut table);
    let exact = "1/6 2/3 1/6 0 -1/2 0 1/2 0 1 -2 1 0";
    assert_close(&table, &rationals(exact), 1e-15);
}

/// Marsden's identity: `sum N_i(t) prod (x - u_{i+k}) = (x - t)^p`; its linear part is the Greville abscissae.
#[test]
fn marsden_identity() {
    let list = vec![-0.5, 0.0, 0.25, 1.0, 1.0, 2.0, 3.5, 4.0, 5.0];
    let knots = KnotVector::new(3, list.clone()).unwrap();
    let greville = knots.greville();
    for t in [1.0, 1.3, 2.0, 2.1] {
        let (span, mut basis) = (knots.span(t), [0.0; 4]);
        basis_functions(&knots, span, t, &mut basis);
        for x in [-1.0, 0.5, 3.0] {
            let term =
                |j: usize| basis[j] * (1..=3).map(|k| x - list[span - 3 + j + k]).product::<f64>();
            let sum: f64 = (0..=3).map(term).sum();
            assert!((sum - (x - t).powi(3)).abs() < 1e-13);
        }
        let linear: f64 = (0..=3).map(|j| basis[j] * greville[span - 3 + j]).sum();
        assert!((linear - t).abs() < 1e-14);
    }
}

fn cubic(list: Vec<f64>) -> NurbsCurve {
    let knots = KnotVector::new(3, list).unwrap();
    let point = |i: usize| DVec3::new(i as f64, (i * i % 7) as f64, (i % 3) as f64);
    let points = (0..knots.control_point_count()).map(point).collect();
    NurbsCurve::new(knots, points, None).unwrap()
}

/// Ex 5.1: the knot 5/2 inserted with the factors 5/6, 1/2, 1/6.
#[test]
fn knot_insertion_example() {
    let curve = cubic(vec![0., 0., 0., 0., 1., 2., 3., 4., 5., 5., 5., 5.]);
    let finer = curve.insert_knots(&[2.5]).unwrap();
    let (p, q) = (curve.control_points(), finer.control_points());
    assert_eq!(q[..3], p[..3]);
    for (i, factor) in [(3, 5.0 / 6.0), (4, 0.5), (5, 1.0 / 6.0)] {
        assert!(q[i].distance(factor * p[i] + (1.0 - factor) * p[i - 1]) < 1e-15);
    }
    assert_eq!(q[6..], p[5..]);
    let removal = finer.remove_knot(2.5, 3, 1e-12).unwrap();
    assert_eq!(removal.removed, [2.5]);
    assert!(
        removal
            .result
            .control_points()
            .iter()
            .zip(p)
            .all(|(a, b)| a.distance(*b) < 1e-14)
    );
}

/// A knot inserted p times cuts the curve: its control point is the curve point (p. 152).
#[test]
fn knot_of_full_multiplicity_is_on_the_curve() {
    let curve = cubic(vec![0., 0., 0., 0., 1., 2., 3., 4., 5., 5., 5., 5.]);
    let cut = curve.insert_knots(&[2.0, 2.0]).unwrap();
    assert_eq!(cut.knots().multiplicity(2.0), 3);
    assert!(cut.control_points()[4].distance(curve.point(2.0)) < 1e-15);
    assert!(curve.insert_knots(&[2.0, 2.0, 2.0]).is_err());
    assert!(curve.insert_knots(&[5.5]).is_err() && curve.insert_knots(&[f64::NAN]).is_err());
    assert!(curve.split(0.0).is_err() && curve.segment(3.0, 2.0).is_err());
    assert!(curve.elevate(22).is_ok() && curve.elevate(23).is_err());
}

/// Eq. (5.36): a quadratic Bezier curve raised to a cubic.
#[test]
fn degree_elevation_example() {
    let points = vec![
        DVec3::ZERO,
        DVec3::new(1.0, 2.0, 0.0),
        DVec3::new(3.0, 0.0, 1.0),
    ];
    let knots = KnotVector::uniform(2, 3).unwrap();
    let curve = NurbsCurve::new(knots, points.clone(), None).unwrap();
    let higher = curve.elevate(1).unwrap();
    let exact = [
        points[0],
        (points[0] + 2.0 * points[1]) / 3.0,
        (2.0 * points[1] + points[2]) / 3.0,
        points[2],
    ];
    assert!(
        higher
            .control_points()
            .iter()
            .zip(exact)
            .all(|(a, b)| a.distance(b) < 1e-15)
    );
}

/// Ex 4.2: the quarter circle with weights 1, 1, 2, its derivatives at the ends, and eq. (4.9).
#[test]
fn quarter_circle() {
    let points = vec![DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
    let knots = KnotVector::uniform(2, 3).unwrap();
    let curve = NurbsCurve::new(knots, points, Some(vec![1.0, 1.0, 2.0])).unwrap();
    for k in 0..=20 {
        let t = f64::from(k) / 20.0;
        let exact = DVec3::new(1.0 - t * t, 2.0 * t, 0.0) / (1.0 + t * t);
        assert!(curve.point(t).distance(exact) < 1e-15);
    }
    let [_, start, second] = curve.derivatives(0.0);
    assert!(start.distance(2.0 * DVec3::Y) < 1e-15 && second.distance(-4.0 * DVec3::X) < 1e-14);
    assert!(curve.derivatives(1.0)[1].distance(-DVec3::X) < 1e-15);
}

/// Ex 7.1: the nine-point circle.
#[test]
fn full_circle() {
    let circle = conic::arc(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0, std::f64::consts::TAU).unwrap();
    let exact = rationals("0 0 0 1/4 1/4 1/2 1/2 3/4 3/4 1 1 1");
    assert_eq!(circle.knots().knots(), exact);
    let corners = [
        (1, 0),
        (1, 1),
        (0, 1),
        (-1, 1),
        (-1, 0),
        (-1, -1),
        (0, -1),
        (1, -1),
        (1, 0),
    ];
    for (point, (x, y)) in circle.control_points().iter().zip(corners) {
        assert_eq!(*point, DVec3::new(f64::from(x), f64::from(y), 0.0));
    }
    let weights = circle.weights().unwrap();
    assert!(weights.iter().step_by(2).all(|w| (w - 1.0).abs() < 1e-16));
    assert!(
        weights
            .iter()
            .skip(1)
            .step_by(2)
            .all(|w| (w * w - 0.5).abs() < 1e-15)
    );
}
