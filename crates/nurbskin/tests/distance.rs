//! Distances to surfaces against exact distances, brute force and symmetry.
#![allow(
    clippy::unwrap_used,
    reason = "what cannot be built here fails its test"
)]

use nurbskin::nurbs::closest::{ClosestPoint, Foot};
use nurbskin::progress::Silent;
use nurbskin::{ControlNet, DVec2, DVec3, KnotVector, NurbsCurve, NurbsSurface};
use proptest::prelude::*;

/// A full circle of radius 1 as a rational quadratic of four arcs: points, weights, knots (The NURBS Book, Ex 7.1).
fn circle() -> (Vec<DVec2>, Vec<f64>, KnotVector) {
    let h = std::f64::consts::FRAC_1_SQRT_2;
    let points = [
        (1, 0),
        (1, 1),
        (0, 1),
        (-1, 1),
        (-1, 0),
        (-1, -1),
        (0, -1),
        (1, -1),
        (1, 0),
    ]
    .map(|(x, y)| DVec2::new(f64::from(x), f64::from(y)));
    let weights = (0..9).map(|i| if i % 2 == 0 { 1.0 } else { h }).collect();
    let breaks = [0., 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1.];
    (
        points.to_vec(),
        weights,
        KnotVector::clamped(2, &breaks).unwrap(),
    )
}

/// The surface that a profile (radius, height, weight) sweeps around the z axis; u goes around.
fn revolve(profile: &[(f64, f64, f64)], knots: KnotVector) -> NurbsSurface {
    let (points, weights, around) = circle();
    let net = ControlNet::from_fn(9, profile.len(), |i, j| {
        let (r, z, _) = profile[j];
        (points[i] * r).extend(z)
    })
    .unwrap();
    let weights = profile
        .iter()
        .flat_map(|&(_, _, w)| weights.iter().map(move |&a| a * w))
        .collect();
    NurbsSurface::new(around, knots, net, Some(weights)).unwrap()
}

fn sphere(radius: f64) -> NurbsSurface {
    let h = std::f64::consts::FRAC_1_SQRT_2;
    let r = radius;
    let profile = [
        (0., -r, 1.),
        (r, -r, h),
        (r, 0., 1.),
        (r, r, h),
        (0., r, 1.),
    ];
    revolve(
        &profile,
        KnotVector::clamped(2, &[0., 0.5, 0.5, 1.]).unwrap(),
    )
}

fn cylinder(radius: f64, height: f64) -> NurbsSurface {
    revolve(
        &[(radius, 0., 1.), (radius, height, 1.)],
        KnotVector::uniform(1, 2).unwrap(),
    )
}

fn torus(large: f64, small: f64) -> NurbsSurface {
    let (points, weights, knots) = circle();
    let profile: Vec<_> = points
        .iter()
        .zip(weights)
        .map(|(p, w)| (large + small * p.x, small * p.y, w))
        .collect();
    revolve(&profile, knots)
}

/// A wavy bicubic surface with `n x n` control points over 100 x 80, as hilly as the benchmark's.
fn wavy(n: usize) -> NurbsSurface {
    let knots = KnotVector::uniform(3, n).unwrap();
    let at = knots.greville();
    let net = ControlNet::from_fn(n, n, |i, j| {
        let (x, y) = (100.0 * at[i], 80.0 * at[j]);
        let tau = std::f64::consts::TAU;
        let z = 8.0 * (tau * x / 50.0).sin() * (tau * y / 40.0).cos()
            + 3.0 * (tau * (x + y) / 90.0).sin()
            + 0.004 * (x - 50.0) * (x - 50.0);
        DVec3::new(
            x + 0.8 * (tau * at[j]).sin(),
            y + 0.6 * (tau * at[i]).sin(),
            z,
        )
    })
    .unwrap();
    NurbsSurface::new(knots.clone(), knots, net, None).unwrap()
}

/// A reproducible sequence of numbers in `[-1, 1)`.
fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(2).wrapping_add(1);
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

fn size(surface: &NurbsSurface) -> f64 {
    let [low, high] = surface.bounding_box();
    (high - low).length()
}

/// The smallest distance to a dense sampling.
struct Samples(Vec<DVec3>);

impl Samples {
    fn new(surface: &NurbsSurface, n: usize) -> Self {
        let [(a, b), (c, d)] = surface.domain();
        let at = |a: f64, b: f64, i: usize| a + (b - a) * i as f64 / n as f64;
        Self(
            (0..=n)
                .flat_map(|j| (0..=n).map(move |i| (i, j)))
                .map(|(i, j)| surface.point(at(a, b, i), at(c, d, j)))
                .collect(),
        )
    }
    fn distance(&self, point: DVec3) -> f64 {
        self.0
            .iter()
            .map(|s| s.distance_squared(point))
            .fold(f64::INFINITY, f64::min)
            .sqrt()
    }
}

/// What must hold of every foot: it is on the surface where it says, the bracket is narrow, and it holds `truth`.
fn check(surface: &NurbsSurface, solver: &ClosestPoint, point: DVec3, foot: &Foot) {
    let size = size(surface) + point.length();
    let there = surface.point(foot.u, foot.v);
    assert!(
        (there - foot.point).length() < 1e-12 * size,
        "foot {foot:?} is not at {there}"
    );
    assert!((foot.point.distance(point) - foot.distance).abs() < 1e-13 * size);
    assert!(foot.lower >= 0.0 && foot.lower <= foot.distance);
    let width = foot.distance - foot.lower;
    assert!(
        width <= solver.tolerance() + 4e-12 * size,
        "bracket {width:.3e} of {foot:?} at {point}"
    );
}

fn check_exact(surface: &NurbsSurface, exact: impl Fn(DVec3) -> f64, points: &[DVec3]) {
    let solver = ClosestPoint::new(surface).unwrap();
    let tolerance = 1e-12 * size(surface);
    for &point in points {
        let foot = solver.closest(point);
        check(surface, &solver, point, &foot);
        let truth = exact(point);
        assert!(
            foot.lower <= truth + tolerance && truth <= foot.distance + tolerance,
            "{truth} is not in {foot:?} at {point}"
        );
    }
}

/// Random points in and around a box of this half width, and the special ones: axes, centre, poles.
fn points(half: f64, count: usize) -> Vec<DVec3> {
    let mut next = numbers(7);
    let mut out: Vec<DVec3> = (0..count)
        .map(|_| half * DVec3::new(next(), next(), next()))
        .collect();
    for f in [-1.0, -0.5, -1e-3, 0.0, 1e-9, 0.3, 0.7, 1.0] {
        out.extend([DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * half * f));
        out.push(DVec3::new(f * half, 0.25 * half, 0.0));
    }
    out
}

#[test]
fn sphere_distances_are_exact() {
    check_exact(
        &sphere(3.0),
        |p| (p.length() - 3.0).abs(),
        &points(6.0, 300),
    );
}

#[test]
fn cylinder_distances_are_exact() {
    let exact = |p: DVec3| {
        let beyond = (p.z - 4.0).max(-p.z).max(0.0);
        (p.truncate().length() - 2.0).hypot(beyond)
    };
    check_exact(&cylinder(2.0, 4.0), exact, &points(6.0, 300));
}

#[test]
fn torus_distances_are_exact() {
    let exact = |p: DVec3| ((p.truncate().length() - 5.0).hypot(p.z) - 1.5).abs();
    let mut all = points(8.0, 300);
    // The circle inside the tube is equally far from a circle of points each.
    all.extend((0..8).map(|k| {
        let angle = f64::from(k);
        5.0 * DVec3::new(angle.cos(), angle.sin(), 0.0)
    }));
    check_exact(&torus(5.0, 1.5), exact, &all);
}

#[test]
fn plane_distances_are_exact() {
    for degree in [1, 2, 3, 5] {
        let knots = KnotVector::uniform(degree, degree + 3).unwrap();
        let at = knots.greville();
        let net = ControlNet::from_fn(degree + 3, degree + 3, |i, j| {
            DVec3::new(4.0 * at[i] - 2.0, 2.0 * at[j] - 1.0, 0.0)
        })
        .unwrap();
        let plane = NurbsSurface::new(knots.clone(), knots, net, None).unwrap();
        let exact = |p: DVec3| {
            let outside = (p.abs() - DVec3::new(2.0, 1.0, 0.0)).max(DVec3::ZERO);
            outside.length()
        };
        check_exact(&plane, exact, &points(4.0, 100));
    }
}

/// The case of the benchmark: points near, far and beyond an edge.
fn queries(surface: &NurbsSurface, count: usize) -> Vec<DVec3> {
    let mut next = numbers(5);
    (0..count)
        .map(|k| {
            let foot = surface.point(0.5 + 0.5 * next(), 0.5 + 0.5 * next());
            let reach = if k % 10 == 3 { 14.0 } else { 0.9 };
            let mut point = foot + reach * DVec3::new(next(), next(), next());
            if k % 10 == 7 {
                point.x = if next() < 0.0 { -1.5 } else { 101.5 } + 1.5 * next();
            }
            point
        })
        .collect()
}

#[test]
fn wavy_surface_against_brute_force() {
    let surface = wavy(30);
    let solver = ClosestPoint::new(&surface).unwrap();
    let samples = Samples::new(&surface, 250);
    let points = queries(&surface, 300);
    let all = solver.closest_all(&points, None);
    for (&point, foot) in points.iter().zip(&all) {
        check(&surface, &solver, point, foot);
        assert!(foot.lower <= samples.distance(point));
        // One by one or many at once: the very same.
        assert_eq!(solver.closest(point), *foot);
        for start in [DVec2::new(foot.u, foot.v), DVec2::new(0.1, 0.9)] {
            let again = solver.closest_from(point, start);
            check(&surface, &solver, point, &again);
            assert!((again.distance - foot.distance).abs() <= 4.0 * solver.tolerance());
        }
        let d = foot.distance;
        assert!(solver.within(point, 0.99 * d).is_none());
        let within = solver.within(point, 1.01 * d + 1e-9).unwrap();
        assert!((within.distance - d).abs() <= 4.0 * solver.tolerance());
    }
}

#[test]
fn swapped_and_translated_surfaces_give_the_same() {
    let surface = wavy(12);
    let shift = DVec3::new(1e3, -2e3, 5e2);
    let moved = surface.map_points(|p| p + shift).unwrap();
    let solver = ClosestPoint::new(&surface).unwrap();
    let swapped = ClosestPoint::new(&surface.transposed()).unwrap();
    let moved = ClosestPoint::new(&moved).unwrap();
    for point in queries(&surface, 100) {
        let a = solver.closest(point);
        let b = swapped.closest(point);
        let c = moved.closest(point + shift);
        assert!((a.distance - b.distance).abs() < 1e-8 && (a.distance - c.distance).abs() < 1e-8);
        assert!(a.point.distance(b.point) < 1e-6 || (a.distance - b.distance).abs() < 1e-8);
    }
}

#[test]
fn the_middle_of_an_almost_round_surface_ends() {
    // A bicubic periodic tube that is round to about 1e-5 only: a hundred minima of nearly the same depth.
    let count = 24;
    let breaks: Vec<f64> = (0..=count).map(f64::from).collect();
    let u = KnotVector::periodic(3, &breaks).unwrap();
    let v = KnotVector::uniform(3, 8).unwrap();
    let at = v.greville();
    let net = ControlNet::from_fn(27, 8, |i, j| {
        let angle = (i % 24) as f64 * std::f64::consts::TAU / 24.0;
        DVec3::new(10.0 * angle.cos(), 10.0 * angle.sin(), 20.0 * at[j])
    })
    .unwrap();
    let tube = NurbsSurface::new(u, v, net, None).unwrap();
    let solver = ClosestPoint::new(&tube).unwrap();
    let samples = Samples::new(&tube, 300);
    for z in [0.0, 3.3, 10.0, 20.0, 25.0] {
        let point = DVec3::new(0.0, 0.0, z);
        let foot = solver.closest(point);
        check(&tube, &solver, point, &foot);
        assert!(foot.lower <= samples.distance(point));
    }
}

/// A surface of arbitrary degrees, knots and weights, open or periodic.
fn arbitrary_surface(
    degree: [usize; 2],
    spans: [usize; 2],
    periodic: [bool; 2],
    rational: bool,
    seed: u64,
) -> NurbsSurface {
    let mut next = numbers(seed);
    let mut knots = |p: usize, spans: usize, periodic: bool| {
        let mut at = 0.0;
        let breaks: Vec<f64> = (0..=spans)
            .map(|_| {
                at += 1.2 + next();
                at
            })
            .collect();
        if periodic {
            KnotVector::periodic(p, &breaks).unwrap()
        } else {
            KnotVector::clamped(p, &breaks).unwrap()
        }
    };
    let u = knots(degree[0], spans[0], periodic[0]);
    let v = knots(degree[1], spans[1], periodic[1]);
    let [du, dv] = [u.distinct_count(), v.distinct_count()];
    let distinct: Vec<(DVec3, f64)> = (0..du * dv)
        .map(|k| {
            let (i, j) = ((k % du) as f64, (k / du) as f64);
            let noise = DVec3::new(next(), next(), 2.0 * next());
            (DVec3::new(i, j, 0.0) + noise, 2.0f64.powf(1.5 * next()))
        })
        .collect();
    let [m, n] = [u.control_point_count(), v.control_point_count()];
    let of = |i: usize, j: usize| distinct[(j % dv) * du + i % du];
    let net = ControlNet::from_fn(m, n, |i, j| of(i, j).0).unwrap();
    let weights = rational.then(|| (0..m * n).map(|k| of(k % m, k / m).1).collect());
    NurbsSurface::new(u, v, net, weights).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn brackets_hold_brute_force(
        degree in [1usize..6, 1usize..6],
        spans in [1usize..5, 1usize..5],
        periodic in [any::<bool>(), any::<bool>()],
        rational in any::<bool>(),
        seed in any::<u64>(),
    ) {
        let surface = arbitrary_surface(degree, spans, periodic, rational, seed);
        let solver = ClosestPoint::new(&surface).unwrap();
        let samples = Samples::new(&surface, 60);
        let mut next = numbers(seed ^ 99);
        let [low, high] = surface.bounding_box();
        for k in 0..8 {
            let mut point = 0.5 * (low + high) + (high - low) * DVec3::new(next(), next(), next());
            if k > 5 {
                point = surface.point(10.0 * next(), 10.0 * next());
            }
            let foot = solver.closest(point);
            check(&surface, &solver, point, &foot);
            prop_assert!(foot.lower <= samples.distance(point) + 1e-12 * size(&surface));
            if k > 5 {
                prop_assert!(foot.distance <= 1e-9 * (size(&surface) + point.length()));
            }
        }
    }
}

#[test]
fn brackets_are_as_narrow_in_any_unit() {
    // Half a slender cone seen from its hollow side, from farther away than it is wide.
    let line = KnotVector::uniform(1, 2).unwrap();
    let profile = vec![DVec3::new(1.3, 0.0, 0.0), DVec3::new(0.9, 0.0, 22.0)];
    let profile = NurbsCurve::new(line, profile, None).unwrap();
    let turn = std::f64::consts::PI;
    let cone = nurbskin::nurbs::conic::revolve(&profile, DVec3::ZERO, DVec3::Z, turn).unwrap();
    for unit in [1e-3, 1.0, 1e3, 1e6] {
        let surface = cone.map_points(|p| unit * p).unwrap();
        let solver = ClosestPoint::new(&surface).unwrap();
        for k in 0..60 {
            let k = f64::from(k);
            let (x, z) = (3.0 * (1.7 * k).sin(), 11.0 + 10.0 * (0.9 * k).cos());
            let point = unit * DVec3::new(x, -8.0, z);
            let foot = solver.closest(point);
            assert!(
                foot.distance - foot.lower < 1e-9 * size(&surface),
                "{unit} {point}"
            );
        }
    }
}

#[test]
fn sides_and_free_edges() {
    use nurbskin::deviation::measure::{Outside, Place, measure};
    let surface = sphere(3.0);
    let solver = ClosestPoint::new(&surface).unwrap();
    let all: Vec<DVec3> = points(6.0, 200)
        .into_iter()
        .filter(|p| (p.length() - 3.0).abs() > 1e-9)
        .collect();
    let deviation = measure(&solver, &all, None, 0.5, Outside::Normal, &Silent).unwrap();
    assert_eq!(deviation.free_edges.count, 0);
    for (point, found) in all.iter().zip(&deviation.points) {
        let exact = point.length() - 3.0;
        assert!((found.signed() - exact).abs() < 1e-9, "{point} {found:?}");
    }
    let turned = measure(&solver, &all, None, 0.5, Outside::Opposite, &Silent).unwrap();
    assert!((turned.statistics.signed_max + deviation.statistics.signed_min).abs() < 1e-12);

    let surface = cylinder(2.0, 4.0);
    let solver = ClosestPoint::new(&surface).unwrap();
    let around = [
        (DVec3::new(2.5, 0.0, 1.0), 0.5, Place::Interior),
        (DVec3::new(-1.0, 0.0, 1.0), -1.0, Place::Interior),
        (DVec3::new(0.0, 2.3, 4.4), 0.5, Place::FreeEdge),
        (DVec3::new(0.0, -1.7, -0.4), -0.5, Place::FreeEdge),
    ];
    let deviation = measure(
        &solver,
        &around.map(|a| a.0),
        None,
        0.5,
        Outside::Normal,
        &Silent,
    )
    .unwrap();
    for ((_, signed, place), found) in around.iter().zip(&deviation.points) {
        assert!((found.signed() - signed).abs() < 1e-9 && found.place == *place);
    }
    assert_eq!(deviation.free_edges.count, 2);
}

#[test]
fn sides_beside_a_crease() {
    use nurbskin::deviation::measure::{Outside, measure};
    // A roof of degree 1: beside its ridge the normal of one side alone can be wrong.
    let net = ControlNet::from_fn(3, 2, |i, j| {
        DVec3::new(i as f64 - 1.0, j as f64, if i == 1 { 3.0 } else { 0.0 })
    })
    .unwrap();
    let u = KnotVector::uniform(1, 3).unwrap();
    let v = KnotVector::uniform(1, 2).unwrap();
    let roof = ClosestPoint::new(&NurbsSurface::new(u, v, net, None).unwrap()).unwrap();
    for x in [-0.3, -0.01, 0.0, 0.01, 0.3] {
        let above = [DVec3::new(x, 0.5, 3.5)];
        let found = measure(&roof, &above, None, 1.0, Outside::Normal, &Silent).unwrap();
        assert!(found.statistics.signed_min > 0.0, "{x}");
    }
}

#[test]
fn statistics_have_the_names_of_the_contract() {
    use nurbskin::deviation::coverage::Coverage;
    use nurbskin::deviation::measure::Statistics;
    use nurbskin::deviation::verdict::Verdict;
    let keys = |value: serde_json::Value| -> Vec<String> {
        value.as_object().unwrap().keys().cloned().collect()
    };
    let mut want = vec![
        "count",
        "max",
        "mean",
        "rms",
        "p50",
        "p95",
        "p99",
        "signed_min",
        "signed_max",
        "signed_mean",
        "signed_std",
        "within_tolerance",
        "above_tolerance",
        "below_tolerance",
    ];
    want.sort_unstable();
    let mut have = keys(serde_json::to_value(Statistics::default()).unwrap());
    have.sort_unstable();
    assert_eq!(have, want);
    let mut have = keys(serde_json::to_value(Coverage::default()).unwrap());
    have.sort_unstable();
    assert_eq!(have, ["max", "mean", "p95", "unsupported_area"]);
    assert_eq!(
        serde_json::to_value(Verdict::CannotTell).unwrap(),
        "cannot_tell"
    );
}

#[test]
fn odd_points_and_surfaces_do_not_panic() {
    let surface = wavy(6);
    let solver = ClosestPoint::new(&surface).unwrap();
    for x in [
        0.0,
        1e6,
        -1e9,
        1e30,
        1e200,
        f64::MAX,
        f64::NAN,
        f64::INFINITY,
    ] {
        let _ = solver.closest(DVec3::new(x, 1.0, -x));
        let _ = solver.closest_from(DVec3::ONE, DVec2::new(x, -x));
        let _ = solver.within(DVec3::ONE, x);
    }
    assert!(solver.closest_all(&[], None).is_empty());
    let far = solver.closest(DVec3::new(0.0, 0.0, 1e9));
    assert!((far.distance - 1e9).abs() < 100.0 && far.lower > 0.999_999 * far.distance);
    let spot = surface.map_points(|_| DVec3::ONE).unwrap();
    let foot = ClosestPoint::new(&spot).unwrap().closest(DVec3::ZERO);
    assert!((foot.distance - 3.0f64.sqrt()).abs() < 1e-12 && foot.lower > 1.732);
    assert!(ClosestPoint::with_tolerance(&surface, f64::NAN).is_err());
    // A segment: the surface has collapsed along v.
    let line = surface.map_points(|p| DVec3::X * p.x).unwrap();
    let foot = ClosestPoint::new(&line)
        .unwrap()
        .closest(DVec3::new(50.0, 3.0, 4.0));
    assert!((foot.distance - 5.0).abs() < 1e-9 && foot.lower > 5.0 - 1e-8);
}
