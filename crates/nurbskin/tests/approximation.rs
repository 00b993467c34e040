//! Penalised least squares against surfaces that are known exactly.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test may stop, and says what it measured"
)]

use nurbskin::chart::{Chart, Topology};
use nurbskin::fit::approximate::adapt::Criterion;
use nurbskin::fit::approximate::{ApproximateOptions, Approximation, Status, approximate};
use nurbskin::progress::Silent;
use nurbskin::{ControlNet, DVec2, DVec3, KnotVector, NurbsSurface};
use std::f64::consts::TAU;

/// A small generator of repeatable noise (xorshift64*, Vigna 2016).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

fn disk(parameters: Vec<DVec2>, size: [f64; 2]) -> Chart {
    Chart {
        topology: Topology::Disk,
        parameters,
        size,
        reason: String::new(),
    }
}

/// Height of a face of 150 x 200 mm: forehead, nose, eye sockets, lips, chin.
fn face(x: f64, y: f64) -> f64 {
    let g = |cx: f64, cy: f64, sx: f64, sy: f64, a: f64| {
        a * (-((x - cx) / sx).powi(2) - ((y - cy) / sy).powi(2)).exp()
    };
    70.0 * (1.0 - (x / 95.0).powi(2) - (y / 130.0).powi(2))
        + g(0., 0., 9., 22., 24.)
        + g(0., -14., 13., 9., 9.)
        - g(-30., 24., 15., 11., 10.)
        - g(30., 24., 15., 11., 10.)
        + g(0., -45., 22., 6., 6.)
        - g(0., -53., 24., 3.5, 3.)
        + g(0., -62., 20., 6., 5.)
        + g(0., -88., 25., 12., 8.)
}

fn slope(f: impl Fn(f64, f64) -> f64, x: f64, y: f64) -> DVec2 {
    let h = 1e-4;
    DVec2::new(f(x + h, y) - f(x - h, y), f(x, y + h) - f(x, y - h)) / (2.0 * h)
}

/// Points of a height field over `size`, with normal noise along the normal and a share of outliers.
fn scan(
    f: impl Fn(f64, f64) -> f64 + Copy,
    size: [f64; 2],
    n: usize,
    sigma: f64,
    outliers: f64,
    seed: u64,
) -> (Vec<DVec3>, Chart) {
    let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
    let half = DVec2::from(size) / 2.0;
    let mut points = Vec::new();
    let mut parameters = Vec::new();
    for _ in 0..n {
        let (x, y) = (
            half.x * (2.0 * random.uniform() - 1.0),
            half.y * (2.0 * random.uniform() - 1.0),
        );
        let normal = (-slope(f, x, y)).extend(1.0).normalize();
        let mut p = DVec3::new(x, y, f(x, y)) + sigma * random.normal() * normal;
        if random.uniform() < outliers {
            p += 8.0 * DVec3::new(random.normal(), random.normal(), random.normal());
        }
        points.push(p);
        parameters.push(((p.truncate() + half) / (2.0 * half)).clamp(DVec2::ZERO, DVec2::ONE));
    }
    (points, disk(parameters, size))
}

/// Largest and root mean square distance of a surface to a height field, on 200 x 200 places.
fn errors(surface: &NurbsSurface, f: impl Fn(f64, f64) -> f64 + Copy) -> (f64, f64) {
    let (mut largest, mut squares) = (0.0_f64, 0.0);
    for j in 0..200 {
        for i in 0..200 {
            let p = surface.point(f64::from(i) / 199.0, f64::from(j) / 199.0);
            let e = (p.z - f(p.x, p.y)) / (1.0 + slope(f, p.x, p.y).length_squared()).sqrt();
            largest = largest.max(e.abs());
            squares += e * e;
        }
    }
    (largest, (squares / 40_000.0_f64).sqrt())
}

fn count(fit: &Approximation) -> usize {
    let [m, n] = fit.surface.distinct_counts();
    m * n
}

#[test]
fn a_noisy_face_with_outliers() {
    for (sigma, tolerance, points, largest, rms) in [
        (0.1, 0.3, 714, 0.23, 0.024),
        (0.02, 0.1, 1092, 0.105, 0.0087),
    ] {
        let (cloud, chart) = scan(face, [150.0, 200.0], 20_000, sigma, 0.005, 3);
        let fit =
            approximate(&cloud, &chart, &ApproximateOptions::new(tolerance), &Silent).unwrap();
        let (e, r) = errors(&fit.surface, face);
        println!(
            "sigma {sigma}: {} control points, max {e:.4}, rms {r:.4}",
            count(&fit)
        );
        assert_eq!(fit.status, Status::Met);
        assert_eq!(fit.criterion, Criterion::Bias);
        assert!(count(&fit) <= points && e <= largest && r <= rms);
        assert!((fit.sigma / sigma - 1.0).abs() < 0.06, "{}", fit.sigma);
        assert!(fit.equation_residual < 1e-10);
    }
}

#[test]
fn exact_points_of_a_face() {
    let n = 100;
    let parameters: Vec<DVec2> = (0..n * n)
        .map(|k| DVec2::new((k % n) as f64, (k / n) as f64) / (n - 1) as f64)
        .collect();
    let points: Vec<DVec3> = parameters
        .iter()
        .map(|t| {
            let (x, y) = (150.0 * t.x - 75.0, 200.0 * t.y - 100.0);
            DVec3::new(x, y, face(x, y))
        })
        .collect();
    let chart = disk(parameters, [150.0, 200.0]);
    let fit = approximate(&points, &chart, &ApproximateOptions::new(0.1), &Silent).unwrap();
    assert_eq!(fit.status, Status::Met);
    assert_eq!(fit.criterion, Criterion::Maximum);
    assert!(count(&fit) <= 700, "{}", count(&fit));
    assert!(fit.residuals.iter().all(|r| r.abs() <= 0.1));
    assert!(fit.weights.iter().all(|&w| w > 0.0));
}

/// A smooth hill that a few bicubic spans follow.
fn hill(x: f64, y: f64) -> f64 {
    8.0 * (x / 20.0).cos() * (y / 25.0).sin()
}

#[test]
fn error_follows_the_noise_law() {
    // rms^2 = bias^2 + sigma^2 N / M; on 12 x 12 control points the bias of this hill is negligible.
    let (sigma, n) = (0.05, 6000);
    let options = ApproximateOptions {
        refine: false,
        spans: Some([9, 9]),
        noise: Some(sigma),
        ..ApproximateOptions::new(0.2)
    };
    let mut squares = 0.0;
    let seeds = 8;
    for seed in 0..seeds {
        let (cloud, chart) = scan(hill, [100.0, 100.0], n, sigma, 0.0, 100 + seed);
        let fit = approximate(&cloud, &chart, &options, &Silent).unwrap();
        squares += errors(&fit.surface, hill).1.powi(2) / seeds as f64;
    }
    let law = sigma * (144.0 / n as f64).sqrt();
    let rms = squares.sqrt();
    println!("rms {rms:.5}, law {law:.5}");
    assert!((rms / law - 1.0).abs() < 0.2, "{rms} {law}");
}

#[test]
fn up_to_a_tenth_of_outliers() {
    let options = ApproximateOptions::new(0.15);
    let mut before = 0.0;
    for share in [0.0, 0.01, 0.05, 0.1] {
        let (cloud, chart) = scan(hill, [100.0, 100.0], 8000, 0.05, share, 11);
        let fit = approximate(&cloud, &chart, &options, &Silent).unwrap();
        let (e, r) = errors(&fit.surface, hill);
        println!(
            "{share}: {} control points, max {e:.4}, rms {r:.4}, sigma {:.4}",
            count(&fit),
            fit.sigma
        );
        assert!(r < 0.02 && e < 0.15, "{share}: {e} {r}");
        assert!((fit.sigma / 0.05 - 1.0).abs() < 0.1);
        let lost = fit.weights.iter().filter(|&&w| w == 0.0).count() as f64 / 8000.0;
        assert!(lost >= before && lost <= share);
        before = lost;
    }
}

/// A bicubic surface with given knots.
fn known_surface() -> NurbsSurface {
    let knots = KnotVector::clamped(3, &[0.0, 0.25, 0.5, 0.75, 1.0]).unwrap();
    let net = ControlNet::from_fn(7, 7, |i, j| {
        let (x, y) = (i as f64, j as f64);
        DVec3::new(
            10.0 * x + (y * 0.7).sin(),
            12.0 * y + (x * 1.1).cos(),
            5.0 * (x * 0.9 + y).sin(),
        )
    })
    .unwrap();
    NurbsSurface::new(knots.clone(), knots, net, None).unwrap()
}

#[test]
fn a_bicubic_surface_is_reproduced() {
    let surface = known_surface();
    let mut random = Random(5);
    let parameters: Vec<DVec2> = (0..1500)
        .map(|_| DVec2::new(random.uniform(), random.uniform()))
        .collect();
    let points: Vec<DVec3> = parameters.iter().map(|t| surface.point(t.x, t.y)).collect();
    let options = ApproximateOptions {
        refine: false,
        spans: Some([4, 4]),
        fairness: 0.0,
        ..ApproximateOptions::new(0.1)
    };
    let fit = approximate(&points, &disk(parameters, [60.0, 72.0]), &options, &Silent).unwrap();
    assert!(fit.equation_residual < 1e-12, "{}", fit.equation_residual);
    let net = fit.surface.control_points().points();
    let worst = surface
        .control_points()
        .points()
        .iter()
        .zip(net)
        .map(|(a, b)| (*a - *b).length())
        .fold(0.0, f64::max);
    assert!(worst < 1e-9, "{worst}");
}

#[test]
fn much_fairness_leaves_a_plane() {
    // The thin plate forgets everything but affine maps of the domain.
    let (cloud, chart) = scan(hill, [100.0, 100.0], 4000, 0.0, 0.0, 2);
    let options = ApproximateOptions {
        refine: false,
        spans: Some([6, 5]),
        fairness: 1e7,
        noise: Some(1.0),
        ..ApproximateOptions::new(10.0)
    };
    let fit = approximate(&cloud, &chart, &options, &Silent).unwrap();
    let p = |u: f64, v: f64| fit.surface.point(u, v);
    let (o, a, b) = (p(0.0, 0.0), p(1.0, 0.0), p(0.0, 1.0));
    for (u, v) in [(0.5, 0.5), (0.3, 0.9), (1.0, 1.0)] {
        let plane = o + u * (a - o) + v * (b - o);
        assert!(
            (p(u, v) - plane).length() < 1e-3,
            "{}",
            (p(u, v) - plane).length()
        );
    }
}

#[test]
fn the_order_of_points_does_not_matter() {
    let (mut cloud, mut chart) = scan(hill, [100.0, 80.0], 3000, 0.05, 0.01, 4);
    let options = ApproximateOptions::new(0.15);
    let fit = approximate(&cloud, &chart, &options, &Silent).unwrap();
    let mut random = Random(99);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an index"
    )]
    for k in (1..cloud.len()).rev() {
        let other = (random.uniform() * (k + 1) as f64) as usize;
        cloud.swap(k, other);
        chart.parameters.swap(k, other);
    }
    let shuffled = approximate(&cloud, &chart, &options, &Silent).unwrap();
    assert_eq!(fit.surface, shuffled.surface);
}

#[test]
fn units_do_not_matter() {
    let (cloud, chart) = scan(hill, [100.0, 80.0], 3000, 0.05, 0.01, 4);
    let fit = approximate(&cloud, &chart, &ApproximateOptions::new(0.15), &Silent).unwrap();
    for unit in [1e-3, 1e3] {
        let scaled: Vec<DVec3> = cloud.iter().map(|&p| unit * p).collect();
        let chart = disk(chart.parameters.clone(), chart.size.map(|s| unit * s));
        let other = approximate(
            &scaled,
            &chart,
            &ApproximateOptions::new(0.15 * unit),
            &Silent,
        )
        .unwrap();
        assert_eq!(
            fit.surface.distinct_counts(),
            other.surface.distinct_counts()
        );
        let apart = (other.surface.point(0.3, 0.6) / unit - fit.surface.point(0.3, 0.6)).length();
        assert!(apart < 1e-9, "{apart}");
    }
}

#[test]
fn a_tube_is_smooth_across_its_seam() {
    let parameters: Vec<DVec2> = (0..100 * 80)
        .map(|k| DVec2::new((k / 80) as f64 / 99.0, (k % 80) as f64 / 80.0))
        .collect();
    let points: Vec<DVec3> = parameters
        .iter()
        .map(|t| {
            let (radius, angle) = (30.0 + 6.0 * (5.0 * t.x).sin(), TAU * t.y);
            DVec3::new(
                radius * angle.cos(),
                radius * (angle + 0.1 * angle.sin()).sin(),
                120.0 * t.x,
            )
        })
        .collect();
    let chart = Chart {
        topology: Topology::Tube,
        parameters,
        size: [120.0, 190.0],
        reason: String::new(),
    };
    let fit = approximate(&points, &chart, &ApproximateOptions::new(0.05), &Silent).unwrap();
    assert_eq!(fit.status, Status::Met);
    assert_eq!(fit.surface.periodic(), [false, true]);
    assert!(count(&fit) <= 150, "{}", count(&fit));
    for u in [0.0, 0.31, 0.77, 1.0] {
        let (a, b) = (
            fit.surface.derivatives(u, 0.0),
            fit.surface.derivatives(u, 1.0),
        );
        for (x, y) in [
            (a.point, b.point),
            (a.dv, b.dv),
            (a.dvv, b.dvv),
            (a.duv, b.duv),
        ] {
            assert!(
                (x - y).length() <= 1e-8 * (1.0 + x.length()),
                "{u}: {x} {y}"
            );
        }
    }
}

#[test]
fn a_sphere_closes_at_its_poles() {
    let n = 80;
    let parameters: Vec<DVec2> = (0..n * n)
        .map(|k| DVec2::new((k / n) as f64 / (n - 1) as f64, (k % n) as f64 / n as f64))
        .collect();
    let points: Vec<DVec3> = parameters
        .iter()
        .map(|t| {
            let (s, a) = (0.5 * TAU * t.x, TAU * t.y);
            50.0 * DVec3::new(s.sin() * a.cos(), s.sin() * a.sin(), s.cos())
        })
        .collect();
    let chart = Chart {
        topology: Topology::Sphere,
        parameters,
        size: [157.0, 200.0],
        reason: String::new(),
    };
    let fit = approximate(&points, &chart, &ApproximateOptions::new(0.1), &Silent).unwrap();
    assert_eq!(fit.status, Status::Met);
    assert!(count(&fit) <= 56, "{}", count(&fit));
    let net = fit.surface.control_points();
    for i in [0, net.count_u() - 1] {
        assert!(net.column(i).all(|p| p == net.point(i, 0)));
    }
}

#[test]
fn the_budget_is_hard() {
    let (cloud, chart) = scan(face, [150.0, 200.0], 8000, 0.02, 0.0, 6);
    for budget in [16, 30, 200] {
        let options = ApproximateOptions {
            max_control_points: Some(budget),
            ..ApproximateOptions::new(0.1)
        };
        let fit = approximate(&cloud, &chart, &options, &Silent).unwrap();
        assert!(count(&fit) <= budget);
        assert!(matches!(fit.status, Status::NotMet(_)));
    }
    let options = ApproximateOptions {
        max_control_points: Some(15),
        ..ApproximateOptions::new(0.1)
    };
    assert!(approximate(&cloud, &chart, &options, &Silent).is_err());
}

/// Root mean square and 95 % quantile of the distances of a scan without noise.
fn levels(fit: &Approximation) -> (f64, f64) {
    let mut distances: Vec<f64> = fit.residuals.iter().map(|r| r.abs()).collect();
    distances.sort_by(f64::total_cmp);
    let squares: f64 = distances.iter().map(|d| d * d).sum();
    let n = distances.len();
    ((squares / n as f64).sqrt(), distances[n * 95 / 100])
}

#[test]
fn a_budget_is_spent_better_than_on_even_knots() {
    let (cloud, chart) = scan(face, [150.0, 200.0], 10_000, 0.005, 0.0, 21);
    for n in [10, 15, 20] {
        let even = ApproximateOptions {
            refine: false,
            spans: Some([n, n]),
            ..ApproximateOptions::new(0.03)
        };
        let budgeted = ApproximateOptions {
            max_control_points: Some((n + 3) * (n + 3)),
            ..ApproximateOptions::new(0.03)
        };
        let even = approximate(&cloud, &chart, &even, &Silent).unwrap();
        let fit = approximate(&cloud, &chart, &budgeted, &Silent).unwrap();
        let (even, here) = (levels(&even), levels(&fit));
        println!(
            "{n}: {} control points, {here:?} instead of {even:?}",
            count(&fit)
        );
        assert!(count(&fit) <= (n + 3) * (n + 3));
        assert!(here.0 < even.0 && here.1 < even.1);
    }
}

#[test]
fn a_distorted_chart_is_corrected() {
    // The hill with parameters that swing about the true ones: no few knots follow x(u), y(u) then.
    let (cloud, chart) = scan(hill, [100.0, 100.0], 6000, 0.0, 0.0, 13);
    let swing = |t: DVec2| {
        let s = 0.01 * (TAU * 4.0 * t.y).sin() * (TAU * 3.0 * t.x).cos();
        (t + DVec2::new(s, -s)).clamp(DVec2::ZERO, DVec2::ONE)
    };
    let chart = disk(
        chart.parameters.iter().map(|&t| swing(t)).collect(),
        chart.size,
    );
    let fit = |correct: bool| {
        let options = ApproximateOptions {
            max_control_points: Some(225),
            correct,
            ..ApproximateOptions::new(0.001)
        };
        approximate(&cloud, &chart, &options, &Silent).unwrap()
    };
    let (without, with) = (fit(false), fit(true));
    println!("{:?} without, {:?} with", levels(&without), levels(&with));
    assert_eq!(without.parameters, chart.parameters);
    assert!(levels(&with).0 < 0.5 * levels(&without).0);
    // Nothing folds: the surface keeps its side.
    for k in 0..2500 {
        let (u, v) = (f64::from(k % 50) / 49.0, f64::from(k / 50) / 49.0);
        let d = with.surface.derivatives(u, v);
        assert!(d.du.cross(d.dv).z > 0.0, "{u} {v}");
    }
}

#[test]
fn a_good_chart_of_noisy_points_is_left_alone() {
    let (cloud, chart) = scan(face, [150.0, 200.0], 10_000, 0.1, 0.005, 17);
    let options = ApproximateOptions {
        max_control_points: Some(300),
        ..ApproximateOptions::new(0.05)
    };
    let fit = approximate(&cloud, &chart, &options, &Silent).unwrap();
    assert!(matches!(fit.status, Status::NotMet(_)));
    assert_eq!(fit.parameters, chart.parameters);
}

#[test]
fn met_is_met_by_every_point() {
    for (seed, n) in [(1, 2000), (2, 3000), (3, 2000)] {
        let (cloud, chart) = scan(face, [150.0, 200.0], n, 0.0, 0.0, 30 + seed);
        let fit = approximate(&cloud, &chart, &ApproximateOptions::new(0.137), &Silent).unwrap();
        let worst = fit.residuals.iter().fold(0.0_f64, |m, r| m.max(r.abs()));
        println!("{seed}: {} control points, max {worst:.4}", count(&fit));
        assert_eq!(fit.status == Status::Met, worst <= 0.137);
    }
}

#[test]
fn no_points_no_wild_surface() {
    // A disk of points in the square, with a hole: corners and hole stay near.
    let (cloud, chart) = scan(hill, [100.0, 100.0], 20_000, 0.05, 0.0, 8);
    let keep = |p: DVec3| {
        let r = p.truncate().length();
        let hole = (p.truncate() - DVec2::new(15.0, 10.0)).length();
        r < 45.0 && hole > 8.0
    };
    let kept: Vec<usize> = (0..cloud.len()).filter(|&k| keep(cloud[k])).collect();
    let points: Vec<DVec3> = kept.iter().map(|&k| cloud[k]).collect();
    let chart = disk(
        kept.iter().map(|&k| chart.parameters[k]).collect(),
        chart.size,
    );
    let fit = approximate(&points, &chart, &ApproximateOptions::new(0.15), &Silent).unwrap();
    for j in 0..=40 {
        for i in 0..=40 {
            let p = fit.surface.point(f64::from(i) / 40.0, f64::from(j) / 40.0);
            assert!(p.z.abs() < 25.0, "{p}");
            assert!(p.truncate().length() < 1.5 * 75.0, "{p}");
        }
    }
    let hole = fit.surface.point(0.65, 0.6);
    assert!((hole.z - hill(15.0, 10.0)).abs() < 1.0, "{}", hole.z);
}

#[test]
fn every_degree_fits() {
    let (cloud, chart) = scan(hill, [100.0, 100.0], 4000, 0.05, 0.01, 9);
    for degree in [[1, 1], [2, 4], [5, 3], [7, 7]] {
        let options = ApproximateOptions {
            degree,
            ..ApproximateOptions::new(0.3)
        };
        let fit = approximate(&cloud, &chart, &options, &Silent).unwrap();
        assert_eq!(fit.surface.degree(), degree);
        let (e, r) = errors(&fit.surface, hill);
        assert!(e < 0.45 && r < 0.1, "{degree:?}: {e} {r}");
    }
}

#[test]
fn nonsense_is_refused() {
    let (cloud, chart) = scan(hill, [100.0, 100.0], 100, 0.05, 0.0, 1);
    let run = |points: &[DVec3], chart: &Chart, options: &ApproximateOptions| {
        approximate(points, chart, options, &Silent)
    };
    let good = ApproximateOptions::new(0.1);
    assert!(run(&cloud, &chart, &good).is_ok());
    assert!(run(&cloud[..99], &chart, &good).is_err());
    assert!(
        run(
            &cloud[..5],
            &disk(chart.parameters[..5].to_vec(), chart.size),
            &good
        )
        .is_err()
    );
    assert!(run(&cloud, &disk(chart.parameters.clone(), [0.0, 1.0]), &good).is_err());
    assert!(run(&cloud, &chart, &ApproximateOptions::new(0.0)).is_err());
    assert!(run(&cloud, &chart, &ApproximateOptions::new(f64::NAN)).is_err());
    let mut broken = cloud.clone();
    broken[7].y = f64::NAN;
    assert!(run(&broken, &chart, &good).is_err());
    let mut outside = chart.clone();
    outside.parameters[3].x = 1.5;
    assert!(run(&cloud, &outside, &good).is_err());
    // All points in one place, or on one line: an answer or a sentence, no panic.
    let _ = run(&[DVec3::ONE; 100], &chart, &good);
    let _ = run(
        &cloud,
        &disk(vec![DVec2::splat(0.5); 100], chart.size),
        &good,
    );
    let line = (0..100)
        .map(|k| DVec2::splat(f64::from(k) / 99.0))
        .collect();
    let _ = run(&cloud, &disk(line, chart.size), &good);
}
