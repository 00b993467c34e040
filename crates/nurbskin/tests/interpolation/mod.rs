//! Interpolation of grids: Pal & Ballav 2007, section 3, against the paper's own full-matrix route and against laws.

#![expect(clippy::unwrap_used, reason = "a test may stop")]

mod full_matrix;

use nurbskin::chart::Topology;
use nurbskin::fit::interpolate::parameters::Parameterization::{
    self, Centripetal, ChordLength, Uniform,
};
use nurbskin::fit::interpolate::parameters::{line_parameters, parameters_u};
use nurbskin::fit::interpolate::{
    choose_parameterization, interpolate, interpolate_at, interpolate_curve, interpolate_curve_at,
};
use nurbskin::{DVec3, NurbsSurface, PointGrid};
use std::f64::consts::{PI, TAU};

/// A bumpy sheet with uneven, curved grid lines.
fn sheet(m: usize, n: usize) -> PointGrid {
    PointGrid::from_fn(m, n, |i, j| {
        let (i, j) = (i as f64 / (m - 1) as f64, j as f64 / (n - 1) as f64);
        let s = i + 0.10 * (TAU * i).sin() / PI;
        let t = j - 0.12 * (TAU * j).sin() / PI;
        let x = 100.0 * s + 0.8 * (TAU * t).sin();
        let y = 80.0 * t + 0.6 * (TAU * s).sin();
        let z = 8.0 * (TAU * x / 50.0).sin() * (TAU * y / 40.0).cos()
            + 3.0 * (TAU * (x + y) / 90.0).sin()
            + 0.004 * (x - 50.0).powi(2);
        DVec3::new(x, y, z)
    })
    .unwrap()
}

fn grid_of(topology: Topology, m: usize, n: usize) -> PointGrid {
    let flat = sheet(m, n);
    PointGrid::from_fn(m, n, |i, j| {
        let (s, t) = (
            i as f64,
            TAU * (j as f64 + 0.3 * (j as f64).sin()) / n as f64,
        );
        match topology {
            Topology::Disk => flat.point(i, j),
            Topology::Tube => DVec3::new((3.0 + (0.3 * s).sin()) * t.cos(), 2.0 * t.sin(), s),
            Topology::Sphere => {
                let a = PI * s / (m - 1) as f64;
                let r = if i == m - 1 { 0.0 } else { a.sin() };
                DVec3::new(r * t.cos(), r * t.sin(), 1.5 * a.cos())
            }
            Topology::Torus => {
                let a = TAU * s / m as f64;
                let r = 5.0 + a.cos();
                DVec3::new(r * t.cos(), r * t.sin(), 2.0 * a.sin())
            }
        }
    })
    .unwrap()
}

/// Largest distance at the grid's points, relative to the bounding box.
fn residual(grid: &PointGrid, surface: &NurbsSurface, [u, v]: [&[f64]; 2]) -> f64 {
    let [lo, hi] = grid.bounding_box();
    let mut worst = 0.0_f64;
    for (j, &v) in v.iter().enumerate() {
        for (i, &u) in u.iter().enumerate() {
            worst = worst.max(surface.point(u, v).distance(grid.point(i, j)));
        }
    }
    worst / lo.distance(hi)
}

const ALL: [Topology; 4] = [
    Topology::Disk,
    Topology::Tube,
    Topology::Sphere,
    Topology::Torus,
];
const KINDS: [Parameterization; 3] = [Uniform, ChordLength, Centripetal];

#[test]
fn every_point_is_met() {
    for topology in ALL {
        for kind in KINDS {
            for degree in [[1, 1], [2, 2], [3, 3], [4, 3], [5, 2], [3, 6]] {
                for (m, n) in [(3, 3), (4, 5), (7, 4), (12, 15), (30, 21)] {
                    let grid = grid_of(topology, m, n);
                    let fit = interpolate(&grid, topology, degree, kind).unwrap();
                    let [u, v] = &fit.parameters;
                    let r = residual(&grid, &fit.surface, [u, v]);
                    assert!(
                        r <= 1e-12,
                        "{topology:?} {kind:?} {degree:?} {m} x {n}: {r:e}"
                    );
                }
            }
        }
    }
}

#[test]
fn every_point_is_met_at_every_size() {
    for (m, n) in [
        (2, 2),
        (4, 4),
        (18, 18),
        (29, 13),
        (25, 32),
        (100, 100),
        (400, 300),
        (2000, 5),
    ] {
        let grid = sheet(m, n);
        let fit = interpolate(&grid, Topology::Disk, [3, 3], ChordLength).unwrap();
        let [u, v] = &fit.parameters;
        let r = residual(&grid, &fit.surface, [u, v]);
        assert!(r <= 1e-12, "{m} x {n}: {r:e}");
        let _ = interpolate_at(&grid, Topology::Disk, [3, 3], [u, v]).unwrap();
    }
}

fn uniform(n: usize) -> Vec<f64> {
    (0..n).map(|k| k as f64 / (n - 1) as f64).collect()
}

fn close(values: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(values.len(), expected.len());
    for (k, (a, b)) in values.iter().zip(expected).enumerate() {
        assert!((a - b).abs() <= tolerance, "place {k}: {a} is not {b}");
    }
}

/// Largest distance between the control points of two surfaces, relative to the box of the first.
fn difference(a: &NurbsSurface, b: &NurbsSurface) -> f64 {
    assert_eq!(a.control_points().counts(), b.control_points().counts());
    let [lo, hi] = a.bounding_box();
    a.control_points()
        .points()
        .iter()
        .zip(b.control_points().points())
        .fold(0.0_f64, |m, (p, q)| m.max(p.distance(*q)))
        / lo.distance(hi)
}

#[test]
fn exchanging_u_and_v_transposes() {
    let grid = sheet(23, 14);
    for degree in [[3, 3], [2, 5]] {
        let fit = interpolate(&grid, Topology::Disk, degree, ChordLength).unwrap();
        let turned = [degree[1], degree[0]];
        let other = interpolate(&grid.transposed(), Topology::Disk, turned, ChordLength).unwrap();
        close(&fit.parameters[0], &other.parameters[1], 1e-14);
        assert!(difference(&fit.surface.transposed(), &other.surface) < 1e-13);
    }
}

#[test]
fn reversing_the_lines_reverses_the_control_points() {
    let (grid, m) = (sheet(23, 14), 23);
    let fit = interpolate(&grid, Topology::Disk, [3, 3], ChordLength).unwrap();
    let reversed = PointGrid::from_fn(m, 14, |i, j| grid.point(m - 1 - i, j)).unwrap();
    let other = interpolate(&reversed, Topology::Disk, [3, 3], ChordLength).unwrap();
    let net = other.surface.control_points();
    let net = PointGrid::from_fn(m, 14, |i, j| net.point(m - 1 - i, j)).unwrap();
    let [knots_u, knots_v] = [fit.surface.knots_u(), fit.surface.knots_v()];
    let back = NurbsSurface::new(knots_u.clone(), knots_v.clone(), net, None).unwrap();
    assert!(difference(&fit.surface, &back) < 1e-12);
}

#[test]
fn affine_maps_commute_at_fixed_parameters() {
    let map = |p: DVec3| {
        DVec3::new(
            2.0 * p.x - p.y + 5.0,
            p.x + 0.5 * p.y - 3.0 * p.z,
            0.3 * p.y + p.z - 40.0,
        )
    };
    for topology in ALL {
        let grid = grid_of(topology, 13, 17);
        let fit = interpolate(&grid, topology, [3, 3], ChordLength).unwrap();
        let [u, v] = &fit.parameters;
        let mapped = interpolate_at(&grid.map(map).unwrap(), topology, [3, 3], [u, v]).unwrap();
        let expected = fit.surface.map_points(map).unwrap();
        assert!(difference(&expected, &mapped) < 1e-13, "{topology:?}");
    }
}

#[test]
fn bicubic_polynomials_and_planes_are_returned() {
    let cubic = |u: f64, v: f64| {
        DVec3::new(
            u + 0.2 * v * v * v,
            v - 0.1 * u * u * v,
            u * u * u * v * v * v - 2.0 * u * v + 0.5 * u * u,
        )
    };
    // Uneven parameters as well: the space of splines holds the polynomials whatever the knots.
    let uneven = |n: usize| -> Vec<f64> {
        (0..n)
            .map(|k| (k as f64 / (n - 1) as f64).powf(1.3))
            .collect()
    };
    let (u, v) = (uneven(11), uneven(8));
    let grid = PointGrid::from_fn(11, 8, |i, j| cubic(u[i], v[j])).unwrap();
    let surface = interpolate_at(&grid, Topology::Disk, [3, 3], [&u, &v]).unwrap();
    for i in 0..=40 {
        for j in 0..=40 {
            let (a, b) = (f64::from(i) / 40.0, f64::from(j) / 40.0);
            assert!(surface.point(a, b).distance(cubic(a, b)) < 1e-13);
        }
    }
    let flat = sheet(15, 12)
        .map(|p| DVec3::new(p.x, p.y, 0.3 * p.x - 0.2 * p.y + 7.0))
        .unwrap();
    let fit = interpolate(&flat, Topology::Disk, [3, 3], ChordLength).unwrap();
    for p in fit.surface.control_points().points() {
        assert!((p.z - (0.3 * p.x - 0.2 * p.y + 7.0)).abs() < 1e-11);
    }
}

#[test]
fn error_falls_with_the_fourth_power() {
    let f = |x: f64, y: f64| (2.0 * x).sin() * (1.5 * y).cos() + 0.3 * x * y;
    let at = |s: f64, t: f64| {
        let x = 3.0 * (s + 0.03 * (TAU * s).sin());
        let y = 3.0 * (t - 0.02 * (TAU * t).sin());
        DVec3::new(x, y, f(x, y))
    };
    // Largest distances: height over (x, y) with chord-length parameters, and at the true parameters.
    let errors = |n: usize| {
        let t = uniform(n);
        let grid = PointGrid::from_fn(n, n, |i, j| at(t[i], t[j])).unwrap();
        let chord = interpolate(&grid, Topology::Disk, [3, 3], ChordLength).unwrap();
        let exact = interpolate_at(&grid, Topology::Disk, [3, 3], [&t, &t]).unwrap();
        let mut worst = [0.0_f64; 2];
        for i in 0..400 {
            for j in 0..400 {
                let (u, v) = ((f64::from(i) + 0.5) / 400.0, (f64::from(j) + 0.5) / 400.0);
                let s = chord.surface.point(u, v);
                worst[0] = worst[0].max((s.z - f(s.x, s.y)).abs());
                worst[1] = worst[1].max(exact.point(u, v).distance(at(u, v)));
            }
        }
        worst
    };
    let (coarse, fine) = (errors(121), errors(361));
    for (kind, (a, b)) in ["chord", "true"].iter().zip(coarse.iter().zip(&fine)) {
        // 120 and 360 spans: a factor of 3. (With fewer, the ends, where no condition is imposed, fall faster.)
        let slope = (a / b).ln() / 3.0_f64.ln();
        assert!(
            (slope - 4.0).abs() < 0.3,
            "{kind}: {slope}, {coarse:?} {fine:?}"
        );
    }
}

#[test]
fn seams_are_smooth() {
    for topology in [Topology::Tube, Topology::Sphere, Topology::Torus] {
        for degree in 3..=6 {
            let grid = grid_of(topology, 14, 17);
            let surface = interpolate(&grid, topology, [degree; 2], ChordLength)
                .unwrap()
                .surface;
            for k in 0..=50 {
                let u = surface.knots_u().wrap(f64::from(k) / 50.0);
                let (a, b) = surface.knots_v().domain();
                let (one, other) = (surface.derivatives(u, a), surface.derivatives(u, b));
                assert!(one.point.distance(other.point) < 1e-12);
                assert!(one.dv.distance(other.dv) < 1e-11 * (1.0 + one.dv.length()));
                assert!(one.dvv.distance(other.dvv) < 1e-10 * (1.0 + one.dvv.length()));
            }
        }
    }
}

#[test]
fn another_first_column_permutes_the_control_points() {
    let n = 17;
    for degree in [1, 2, 3, 4, 5] {
        let grid = grid_of(Topology::Tube, 9, n);
        let fit = interpolate(&grid, Topology::Tube, [3, degree], ChordLength).unwrap();
        for start in [1, 6, 16] {
            let rotated = PointGrid::from_fn(9, n, |i, j| grid.point(i, (j + start) % n)).unwrap();
            let other = interpolate(&rotated, Topology::Tube, [3, degree], ChordLength).unwrap();
            for j in 0..n {
                for i in 0..9 {
                    let a = other.surface.control_points().point(i, j);
                    let b = fit.surface.control_points().point(i, (j + start) % n);
                    assert!(a.distance(b) < 1e-12, "degree {degree}, start {start}");
                }
            }
        }
    }
}

/// The leading error of a cubic spline through a circle is `r phi^4 / 384`.
#[test]
fn circles_are_as_round_as_theory_says() {
    for (n, tolerance) in [(8, 0.17), (24, 0.02)] {
        let grid = PointGrid::from_fn(4, n, |i, j| {
            let t = TAU * j as f64 / n as f64;
            DVec3::new(7.0 * t.cos(), 7.0 * t.sin(), i as f64)
        })
        .unwrap();
        let surface = interpolate(&grid, Topology::Tube, [3, 3], ChordLength)
            .unwrap()
            .surface;
        let error = (0..2000)
            .map(|k| surface.point(0.4, f64::from(k) / 2000.0))
            .map(|s| (s.truncate().length() - 7.0).abs())
            .fold(0.0, f64::max);
        let theory = 7.0 * (TAU / n as f64).powi(4) / 384.0;
        assert!(
            (error / theory - 1.0).abs() < tolerance,
            "{n}: {error:e}, {theory:e}"
        );
    }
}

#[test]
fn poles_are_one_control_point() {
    let grid = grid_of(Topology::Sphere, 9, 12);
    let fit = interpolate(&grid, Topology::Sphere, [3, 3], ChordLength).unwrap();
    let net = fit.surface.control_points();
    for i in [0, 8] {
        assert!(net.column(i).all(|p| p == net.point(i, 0)));
    }
    let torn = PointGrid::from_fn(9, 12, |i, j| {
        grid.point(i, j)
            + if i == 8 {
                DVec3::X * j as f64
            } else {
                DVec3::ZERO
            }
    });
    let error = interpolate(&torn.unwrap(), Topology::Sphere, [3, 3], ChordLength).unwrap_err();
    assert!(error.to_string().contains("last column"), "{error}");
}

#[test]
fn few_lines_lower_the_degree() {
    for (topology, m, n, expected) in [
        (Topology::Disk, 2, 3, [1, 2]),
        (Topology::Disk, 4, 9, [3, 4]),
        (Topology::Tube, 2, 3, [1, 2]),
        (Topology::Torus, 3, 5, [2, 4]),
    ] {
        let grid = grid_of(topology, m, n);
        let fit = interpolate(&grid, topology, [5, 4], ChordLength).unwrap();
        assert_eq!(fit.surface.degree(), expected);
        let [u, v] = &fit.parameters;
        assert!(residual(&grid, &fit.surface, [u, v]) < 1e-12);
    }
}

#[test]
fn impossible_grids_are_refused_by_name() {
    let text = |grid: &PointGrid, topology, degree| {
        interpolate(grid, topology, degree, ChordLength)
            .unwrap_err()
            .to_string()
    };
    let grid = sheet(6, 7);
    let twice_u = grid.select(&[0, 1, 2, 2, 3, 4], &[0, 1, 2, 3]).unwrap();
    assert!(text(&twice_u, Topology::Disk, [3, 3]).contains("columns 2 and 3 coincide"));
    let twice_v = grid.select(&[0, 1, 2, 3], &[0, 1, 2, 3, 3]).unwrap();
    assert!(text(&twice_v, Topology::Disk, [3, 3]).contains("rows 3 and 4 coincide"));
    let again = grid_of(Topology::Tube, 5, 6)
        .select(&[0, 1, 2], &[0, 1, 2, 3, 4, 5, 0])
        .unwrap();
    assert!(text(&again, Topology::Tube, [3, 3]).contains("rows 6 and 0 coincide"));
    let point = PointGrid::from_fn(5, 5, |_, _| DVec3::new(0.1, 0.2, 0.3)).unwrap();
    assert!(text(&point, Topology::Disk, [3, 3]).contains("all columns"));
    assert!(text(&grid, Topology::Disk, [0, 3]).contains("degree 0"));
    assert!(text(&grid, Topology::Disk, [3, 26]).contains("degree 26"));
    let line = grid.select(&[0], &[0, 1, 2]).unwrap();
    assert!(text(&line, Topology::Disk, [3, 3]).contains("at least 2 columns"));
    let strip = grid.select(&[0, 1], &[0, 1]).unwrap();
    assert!(text(&strip, Topology::Tube, [3, 3]).contains("at least 3 rows"));
    let huge = sheet(5, 5).map(|p| p * 1e306).unwrap();
    assert!(interpolate(&huge, Topology::Disk, [3, 3], ChordLength).is_err());
    let (u, v) = (uniform(6), uniform(7));
    for bad in [
        vec![0.0; 6],
        uniform(5),
        vec![0.0, 0.2, f64::NAN, 0.5, 0.6, 1.0],
        vec![0.0, 0.3, 0.2, 0.5, 0.6, 1.0],
    ] {
        assert!(interpolate_at(&grid, Topology::Disk, [3, 3], [&bad, &v]).is_err());
    }
    assert!(interpolate_at(&grid, Topology::Torus, [3, 3], [&u, &v]).is_err());
}

#[test]
fn zero_length_rows_do_not_count() {
    // The first row is a pole: the others alone give the parameters.
    let fan = PointGrid::from_fn(5, 4, |i, j| {
        let x = [0.0, 1.0, 3.0, 4.0, 8.0][i];
        DVec3::new(x * j as f64 + 1e6, 5.0 * j as f64, 0.0)
    })
    .unwrap();
    let u = parameters_u(&fan, false, ChordLength).unwrap();
    close(&u, &[0.0, 0.125, 0.375, 0.5, 1.0], 1e-12);
}

#[test]
fn parameters_of_one_row_are_its_arc() {
    let points: Vec<DVec3> = [0.0, 1.0, 5.0, 14.0]
        .map(|x| DVec3::new(0.0, x, 0.0))
        .to_vec();
    let of = |closed, kind| line_parameters(&points, closed, kind).unwrap();
    close(&of(false, Uniform), &[0.0, 1. / 3., 2. / 3., 1.0], 1e-15);
    close(
        &of(false, ChordLength),
        &[0.0, 1. / 14., 5. / 14., 1.0],
        1e-15,
    );
    close(&of(false, Centripetal), &[0.0, 1. / 6., 0.5, 1.0], 1e-15);
    close(
        &of(true, ChordLength),
        &[0.0, 1. / 28., 5. / 28., 0.5],
        1e-15,
    );
    close(&of(true, Uniform), &[0.0, 0.25, 0.5, 0.75], 1e-15);
}

#[test]
fn choice_of_parameters() {
    // Equal steps of a smooth motion along a 10:1 half ellipse: uniform. Uneven steps: chord length.
    let ellipse = |angle: &dyn Fn(f64) -> f64| {
        PointGrid::from_fn(25, 13, |i, j| {
            let a = PI * angle(i as f64 / 24.0);
            DVec3::new(-10.0 * a.cos(), a.sin(), j as f64)
        })
        .unwrap()
    };
    let even = ellipse(&|s| s);
    let choice = choose_parameterization(&even, Topology::Disk, [3, 3]).unwrap();
    assert_eq!(choice.kind, Uniform, "{choice:?}");
    let uneven = PointGrid::from_fn(25, 13, |i, j| {
        let s = i as f64 + if i % 3 == 0 { 0.0 } else { 0.45 };
        DVec3::new(s, (0.3 * s).sin(), j as f64)
    })
    .unwrap();
    let choice = choose_parameterization(&uneven, Topology::Disk, [3, 3]).unwrap();
    assert_eq!(choice.kind, ChordLength, "{choice:?}");
    assert!(choice.chord_length < choice.uniform);
    // Too small to leave anything out.
    let choice = choose_parameterization(&sheet(2, 2), Topology::Disk, [3, 3]).unwrap();
    assert_eq!(choice.kind, ChordLength);
    for topology in ALL {
        choose_parameterization(&grid_of(topology, 12, 11), topology, [3, 3]).unwrap();
    }
}

#[test]
fn curves_meet_their_points() {
    for closed in [false, true] {
        for degree in 1..=7 {
            for n in [3, 4, 9, 40] {
                let grid = grid_of(Topology::Tube, 2, n);
                let points: Vec<DVec3> = grid.column(0).collect();
                let curve = interpolate_curve(&points, closed, degree, ChordLength).unwrap();
                let t = line_parameters(&points, closed, ChordLength).unwrap();
                for (&t, &q) in t.iter().zip(&points) {
                    assert!(curve.point(t).distance(q) < 1e-12, "{closed} {degree} {n}");
                }
            }
        }
    }
}

/// Bit by bit the same with one thread and with three.
#[test]
fn threads_do_not_matter() {
    let with = |threads: usize, topology| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let grid = grid_of(topology, 260, 190);
        pool.install(|| interpolate(&grid, topology, [3, 3], ChordLength).unwrap())
    };
    for topology in [Topology::Disk, Topology::Torus] {
        let (one, three) = (with(1, topology), with(3, topology));
        assert_eq!(one.parameters, three.parameters);
        assert_eq!(one.surface, three.surface);
    }
}

/// The large tables, which are cut into blocks and strips, give what single lines give.
#[test]
fn blocks_and_strips_change_nothing() {
    for (m, n) in [(211, 173), (1031, 6), (5, 1031)] {
        let grid = sheet(m, n);
        let fit = interpolate(&grid, Topology::Disk, [3, 3], ChordLength).unwrap();
        let [u, v] = &fit.parameters;
        // Along u, row by row, then along v, column by column.
        let rows: Vec<_> = (0..n)
            .map(|j| interpolate_curve_at(grid.row(j), false, 3, u).unwrap())
            .collect();
        for i in (0..m).step_by(7) {
            let column: Vec<DVec3> = rows.iter().map(|c| c.control_points()[i]).collect();
            let column = interpolate_curve_at(&column, false, 3, v).unwrap();
            for (j, &p) in column.control_points().iter().enumerate() {
                assert_eq!(p, fit.surface.control_points().point(i, j));
            }
        }
    }
}

mod properties {
    use super::*;
    use proptest::prelude::*;

    fn topology() -> impl Strategy<Value = Topology> {
        prop::sample::select(ALL.to_vec())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Any degrees, any sizes, random displacements of a regular shape: every point is met.
        #[test]
        fn points_are_met(
            topology in topology(),
            m in 3..14_usize,
            n in 3..14_usize,
            p in 1..7_usize,
            q in 1..7_usize,
            noise in prop::collection::vec(-0.05..0.05_f64, 3 * 14 * 14),
        ) {
            let base = grid_of(topology, m, n);
            let grid = PointGrid::from_fn(m, n, |i, j| {
                let k = 3 * (j * 14 + i);
                let pole = topology == Topology::Sphere && (i == 0 || i == m - 1);
                let d = DVec3::from_slice(&noise[k..k + 3]);
                base.point(i, j) + if pole { DVec3::ZERO } else { d }
            })
            .unwrap();
            let fit = interpolate(&grid, topology, [p, q], ChordLength).unwrap();
            let [u, v] = &fit.parameters;
            prop_assert!(residual(&grid, &fit.surface, [u, v]) <= 1e-11);
        }

        /// Whatever the parameters, the result is a surface through the points or an error, never a panic.
        #[test]
        fn any_parameters_do(
            mut u in prop::collection::vec(0.0..1.0_f64, 2..12),
            mut v in prop::collection::vec(0.0..1.0_f64, 3..12),
            p in 0..30_usize,
            closed in any::<bool>(),
            sorted in any::<bool>(),
        ) {
            if sorted {
                u.sort_by(f64::total_cmp);
                v.sort_by(f64::total_cmp);
            }
            let topology = if closed { Topology::Tube } else { Topology::Disk };
            let grid = grid_of(Topology::Tube, u.len(), v.len());
            if let Ok(surface) = interpolate_at(&grid, topology, [p, 3], [&u, &v]) {
                prop_assert!(surface.control_points().points().iter().all(|p| p.is_finite()));
            }
        }
    }
}
