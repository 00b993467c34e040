//! Surfaces of revolution: what is one is recognised and exact, what is not is refused.

use glam::DQuat;
use nurbskin::chart::Topology;
use nurbskin::fit::revolution::{Outcome, RevolutionFit, fit};
use nurbskin::progress::Silent;
use nurbskin::scan::clean::{CleanOptions, CleanScan, clean};
use nurbskin::scan::simulate::{Order, Random, ScanOptions, Shape, TrueSurface, scan};
use nurbskin::scan::{Organisation, Scan};
use nurbskin::{DVec3, DVec3 as V};
use std::f64::consts::{PI, TAU};

fn pose(random: &mut Random) -> (DQuat, V) {
    let mut n = || random.normal();
    let turn = DQuat::from_xyzw(n(), n(), n(), n()).normalize();
    (turn, 200.0 * V::new(n(), n(), n()))
}

/// Points of S(u, v) on the unit square at random, evenly over the area, with noise, in a random pose.
fn sample(count: usize, noise: f64, seed: u64, f: impl Fn(f64, f64) -> V) -> Vec<V> {
    let mut random = Random::new(seed);
    let (turn, shift) = pose(&mut random);
    let h = 1e-5;
    let normal = |u: f64, v: f64| {
        let along = f((u + h).min(1.0), v) - f((u - h).max(0.0), v);
        along.cross(f(u, (v + h).min(1.0)) - f(u, (v - h).max(0.0)))
    };
    let mut most = 0.0_f64;
    for _ in 0..2000 {
        most = most.max(normal(random.uniform(), random.uniform()).length());
    }
    let mut points = Vec::new();
    while points.len() < count {
        let (u, v) = (random.uniform(), random.uniform());
        let n = normal(u, v);
        if random.uniform() * most <= n.length() {
            let p = f(u, v) + noise * random.normal() * n.normalize_or_zero();
            points.push(turn * p + shift);
        }
    }
    points
}

fn cleaned(points: Vec<V>) -> CleanScan {
    let scan = Scan {
        points,
        organisation: Organisation::Unordered,
        ..Scan::default()
    };
    clean(&scan, &CleanOptions::default(), &Silent).unwrap()
}

fn outcome(c: &CleanScan, tolerance: f64) -> Outcome {
    fit(
        &c.points, &c.normals, tolerance, c.noise, c.spacing, &Silent,
    )
    .unwrap()
}

fn accepted(name: &str, points: Vec<V>, tolerance: f64) -> (Box<RevolutionFit>, CleanScan) {
    let c = cleaned(points);
    match outcome(&c, tolerance) {
        Outcome::Fitted(fit) => (fit, c),
        Outcome::Refused(why) => panic!("{name}: {why}"),
    }
}

fn refused(name: &str, points: Vec<V>, tolerance: f64) -> String {
    match outcome(&cleaned(points), tolerance) {
        Outcome::Fitted(fit) => panic!("{name}: {}", fit.reason),
        Outcome::Refused(why) => why,
    }
}

fn ring(radius: f64, height: f64, turns: f64) -> V {
    let angle = -TAU * turns;
    V::new(radius * angle.cos(), radius * angle.sin(), height)
}

fn pot(s: f64) -> f64 {
    38.0 + 14.0 * (2.4 * PI * s.powf(1.2)).sin() + 6.0 * (-((s - 0.93) / 0.05).powi(2)).exp()
}

#[test]
fn a_noisy_pot_beats_the_ceiling_whatever_pose_unit_and_order() {
    let truth = TrueSurface::new(Shape::Pot);
    let mut all = Vec::new();
    for (seed, unit) in [(0, 1.0), (1, 1.0 / 25.4), (2, 1e-3)] {
        let options = ScanOptions {
            noise: 0.05,
            outliers: 0.01,
            order: Order::Scattered,
            seed,
            ..ScanOptions::default()
        };
        let simulated = scan(Shape::Pot, &options).unwrap();
        let (turn, shift) = pose(&mut Random::new(100 + seed));
        let place = |&p: &V| (turn * p + shift) * unit;
        let points: Vec<V> = simulated.scan.points.iter().map(place).collect();
        let (fit, mut c) = accepted("pot", points, 0.1 * unit);
        assert_eq!(fit.topology, Topology::Tube);
        let back = |p: V| turn.inverse() * (p / unit - shift);
        let (mut worst, mut squares, mut count) = (0.0_f64, 0.0, 0.0);
        for k in 0..2000 {
            let p = back(
                fit.surface
                    .point(f64::from(k) / 1999.0, f64::from(k * 7 % 97) / 97.0),
            );
            if p.z > 300.0 && p.z < 420.0 {
                let off = truth.distance(p);
                worst = worst.max(off);
                squares += off * off;
                count += 1.0;
            }
        }
        let [m, n] = fit.surface.distinct_counts();
        assert!(m * n <= 198, "{m} x {n}");
        all.push((worst, (squares / count).sqrt()));
        let axis = turn.inverse() * fit.axis.direction;
        assert!(axis.x.hypot(axis.y) < 5e-5, "{axis}");
        // Any order of the points gives the same surface.
        if seed == 0 {
            let mut order: Vec<usize> = (0..c.points.len()).collect();
            Random::new(9).shuffle(&mut order);
            c.points = order.iter().map(|&k| c.points[k]).collect();
            c.normals = order.iter().map(|&k| c.normals[k]).collect();
            let Outcome::Fitted(again) = outcome(&c, 0.1 * unit) else {
                panic!("refused in another order")
            };
            assert_eq!(again.surface, fit.surface);
        }
    }
    println!("{all:?}");
    assert!(
        all.iter().all(|&(worst, rms)| worst < 0.1 && rms < 0.012),
        "{all:?}"
    );
}

#[test]
fn what_only_looks_like_one_is_refused() {
    distorted_ones_are_refused(0.0);
}

#[test]
fn what_only_looks_like_one_is_refused_in_spite_of_noise() {
    distorted_ones_are_refused(0.05);
}

fn distorted_ones_are_refused(noise: f64) {
    let n = 6_000;
    refused(
        "oval",
        sample(n, noise, 1, |u, v| {
            ring(pot(u), 120.0 * u, v) * V::new(1.01, 1.0, 1.0)
        }),
        0.1,
    );
    let flutes = |v: f64| 0.5 * (12.0 * TAU * v).cos();
    refused(
        "fluted",
        sample(n, noise, 2, |u, v| ring(pot(u) + flutes(v), 120.0 * u, v)),
        0.1,
    );
    refused(
        "bent",
        sample(n, noise, 3, |u, v| ring(20.0, 120.0 * u, v) + u * u * V::X),
        0.1,
    );
    let dent =
        |u: f64, v: f64| 2.0 * (-((u - 0.5) / 0.08).powi(2) - ((v - 0.5) / 0.06).powi(2)).exp();
    let why = refused(
        "dent",
        sample(n, noise, 4, |u, v| ring(30.0 - dent(u, v), 100.0 * u, v)),
        0.1,
    );
    assert!(why.starts_with("not a surface of revolution: "), "{why}");
    let section = |u: f64| (45.0 + 16.0 * (TAU * u).cos(), 16.0 * (TAU * u).sin());
    refused(
        "oval torus",
        sample(n, noise, 5, |u, v| {
            ring(section(u).0, section(u).1, v) * V::new(1.02, 1.0, 1.0)
        }),
        0.1,
    );
}

#[test]
fn other_shapes_are_refused() {
    for shape in [
        Shape::Handle,
        Shape::Face,
        Shape::Tube,
        Shape::Ellipsoid,
        Shape::Blade,
        Shape::Plane,
    ] {
        let options = ScanOptions {
            points: Some(6000),
            noise: 0.05,
            order: Order::Scattered,
            ..ScanOptions::default()
        };
        refused(
            shape.name(),
            scan(shape, &options).unwrap().scan.points,
            0.1,
        );
    }
}

#[test]
fn shapes_of_every_topology_are_recognised() {
    every_topology_is_recognised(0.0);
}

#[test]
fn shapes_of_every_topology_are_recognised_in_spite_of_noise() {
    every_topology_is_recognised(0.05);
}

/// Around its poles the rings of such a scan are so dense that each point has all its neighbours on its own ring, and
/// rings err in the side of their normals together.
#[test]
fn a_sphere_scanned_in_rings_is_recognised() {
    let options = ScanOptions {
        points: Some(2500),
        noise: 0.05,
        order: Order::Shuffled,
        ..ScanOptions::default()
    };
    let simulated = scan(Shape::Sphere, &options).unwrap();
    let (fit, c) = accepted("sphere", simulated.scan.points, 0.15);
    assert_eq!(fit.topology, Topology::Sphere);
    let far = fit.residuals.iter().filter(|r| r.abs() > 0.15).count();
    assert!(far * 100 < c.points.len(), "{far}");
}

fn every_topology_is_recognised(noise: f64) {
    let n = 6_000;
    let check = |name: &str, points: Vec<DVec3>, topology: Topology| {
        let (fit, c) = accepted(name, points, 0.1);
        assert_eq!(fit.topology, topology, "{name}");
        // Parameters and residuals are those of the surface, whose normal looks as most do.
        let mut agree = 0;
        for ((&p, uv), r) in c.points.iter().zip(&fit.parameters).zip(&fit.residuals) {
            let off = fit.surface.point(uv.x, uv.y).distance(p);
            assert!((off - r.abs()).abs() < 0.5, "{name}: {off} {r}");
            // Without noise what is accepted has all its points within the tolerance: these have no outliers.
            assert!(noise > 0.0 || r.abs() <= 0.1, "{name}: {r}");
        }
        for (n, uv) in c.normals.iter().zip(&fit.parameters) {
            let own = fit.surface.normal(uv.x, uv.y).unwrap_or(*n);
            agree += usize::from(own.dot(*n) > 0.0);
        }
        assert!(
            agree as f64 > 0.98 * c.points.len() as f64,
            "{name}: {agree}"
        );
        fit
    };
    let round =
        |a: f64, b: f64| move |u: f64, v: f64| ring(a * (PI * u).sin(), b * (PI * u).cos(), -v);
    check(
        "cylinder",
        sample(n, noise, 11, |u, v| ring(20.0, 120.0 * u, v)),
        Topology::Tube,
    );
    check(
        "cone",
        sample(n, noise, 12, |u, v| ring(10.0 + 30.0 * u, 80.0 * u, v)),
        Topology::Tube,
    );
    let sphere = check(
        "sphere",
        sample(n, noise, 14, round(50.0, 50.0)),
        Topology::Sphere,
    );
    let poles = [
        sphere.surface.point(0.0, 0.0),
        sphere.surface.point(0.0, 0.4),
    ];
    assert!(poles[0].distance(poles[1]) < 1e-10, "a pole is one point");
    check(
        "ellipsoid",
        sample(n, noise, 16, round(40.0, 60.0)),
        Topology::Sphere,
    );
    let section = |u: f64| (45.0 + 16.0 * (TAU * u).cos(), 16.0 * (TAU * u).sin());
    check(
        "torus",
        sample(n, noise, 18, |u, v| ring(section(u).0, section(u).1, v)),
        Topology::Torus,
    );
    let sector = check(
        "sector",
        sample(n, noise, 19, |u, v| ring(pot(u), 120.0 * u, v / 3.0)),
        Topology::Disk,
    );
    assert!((sector.sector.sweep.to_degrees() - 120.0).abs() < 0.5);
}

/// The flutes of a real vase and the handle of a real jug.
#[test]
fn real_vases_are_refused() {
    let Some(data) = std::env::var_os("NURBSKIN_DATA") else {
        println!("skipped: NURBSKIN_DATA does not name a folder of real scans");
        return;
    };
    for name in ["pots/plastic_vase.ply", "pots/sea_vase.ply"] {
        let path = std::path::Path::new(&data).join(name);
        let scan = nurbskin::io::read_scan(&path).unwrap();
        let c = clean(&scan, &CleanOptions::default(), &Silent).unwrap();
        for tolerance in [0.3, 2.0] {
            let Outcome::Refused(why) = outcome(&c, tolerance) else {
                panic!("{name} is not a surface of revolution")
            };
            println!("{name}: {why}");
        }
    }
}
