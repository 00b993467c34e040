//! Tests of cleaning: rejected and kept points, and independence of order, pose and unit.

use super::*;
use crate::cleaned;
use crate::simulate::{Order, Random, ScanOptions, Shape, scan};
use crate::{GridLayout, Organisation};
use glam::{DMat3, DQuat};
use nurbskin_geometry::progress::Silent;

fn noisy(shape: Shape, points: usize, outliers: f64, seed: u64) -> crate::simulate::Simulated {
    let options = ScanOptions {
        points: Some(points),
        noise: 0.05,
        outliers,
        order: Order::Scattered,
        seed,
        ..ScanOptions::default()
    };
    scan(shape, &options).unwrap()
}

/// Adds up what it is told.
#[derive(Default)]
struct Counter {
    calls: AtomicU64,
    steps: AtomicU64,
}

impl Progress for Counter {
    fn stage(&self, _: &'static str, _: Option<u64>) {}
    fn advance(&self, steps: u64) {
        self.calls.fetch_add(1, Ordering::Relaxed);
        self.steps.fetch_add(steps, Ordering::Relaxed);
    }
    fn warn(&self, _: &str) {}
}

#[test]
fn progress_advances_by_the_points_of_the_scan() {
    let mut points = noisy(Shape::Saddle, 30_000, 0.01, 5).scan.points;
    points.extend([points[7], points[7], DVec3::NAN]);
    let total = points.len() as u64;
    let scan = Scan {
        points,
        ..Scan::default()
    };
    for outliers in [true, false] {
        let counter = Counter::default();
        clean(&scan, &CleanOptions { outliers }, &counter).unwrap();
        assert_eq!(counter.steps.into_inner(), total);
        // More than once for each block of the longest loop.
        assert!(counter.calls.into_inner() > total / 2048);
    }
}

#[test]
fn outliers_are_found_and_others_kept() {
    for shape in [
        Shape::Pot,
        Shape::Face,
        Shape::Handle,
        Shape::Torus,
        Shape::Blade,
    ] {
        let simulated = noisy(shape, 8000, 0.02, 1);
        let result = clean(&simulated.scan, &CleanOptions::default(), &Silent).unwrap();
        let far = |k: usize| simulated.truth.distance(simulated.scan.points[k]);
        let rejected: Vec<usize> = result.rejected.iter().map(|r| r.index).collect();
        let missed = (0..8000)
            .filter(|k| rejected.binary_search(k).is_err() && far(*k) > 2.0 * result.spacing)
            .count();
        let wrong = rejected.iter().filter(|&&k| far(k) < 0.3).count();
        assert!(missed <= 3 && wrong <= 2, "{shape:?} {missed} {wrong}");
        assert!((result.noise / 0.05 - 1.0).abs() < 0.1);
        let [lu, lv] = simulated.truth.size();
        assert!(result.spacing < 2.0 * (lu * lv / 8000.0).sqrt());
    }
}

#[test]
fn clean_scans_lose_nothing() {
    for shape in Shape::ALL {
        for order in [Order::Ordered, Order::Scattered] {
            let options = ScanOptions {
                order,
                points: Some(if shape == Shape::Patch { 16 } else { 4000 }),
                ..ScanOptions::default()
            };
            let simulated = scan(shape, &options).unwrap();
            let result = clean(&simulated.scan, &CleanOptions::default(), &Silent).unwrap();
            assert!(
                result.rejected.len() <= 1,
                "{shape:?} {order:?} {:?}",
                result.rejected.len()
            );
            assert_eq!(result.parts.count(), 1, "{shape:?} {order:?}");
            assert!(result.noise < 2e-3, "{shape:?} {order:?} {}", result.noise);
        }
    }
}

#[test]
fn normals_point_outward() {
    for shape in [
        Shape::Pot,
        Shape::Handle,
        Shape::Torus,
        Shape::Ellipsoid,
        Shape::Face,
    ] {
        let simulated = noisy(shape, 6000, 0.0, 2);
        let result = clean(&simulated.scan, &CleanOptions::default(), &Silent).unwrap();
        let off = (0..result.points.len())
            .filter(|&k| {
                let at = simulated.parameters[result.used[k] as usize];
                simulated.truth.normal(at.x, at.y).dot(result.normals[k]) < 0.8
            })
            .count();
        assert!(off * 50 < result.points.len(), "{shape:?} {off}");
    }
}

/// Everything that is said of the points, by their coordinates.
fn told(result: &CleanScan) -> Vec<([u64; 3], [u64; 3], u32)> {
    let bits = |p: DVec3| p.to_array().map(f64::to_bits);
    let mut told: Vec<_> = (0..result.points.len())
        .map(|k| {
            (
                bits(result.points[k]),
                bits(result.normals[k]),
                result.parts.of[k],
            )
        })
        .collect();
    told.sort_unstable();
    told
}

#[test]
fn order_duplicates_and_nan_change_nothing() {
    let simulated = noisy(Shape::Handle, 3000, 0.01, 5);
    let points = simulated.scan.points;
    let plain = cleaned(points.clone()).unwrap();
    let mut random = Random::new(8);
    let mut mixed = points.clone();
    random.shuffle(&mut mixed);
    for k in 0..50 {
        mixed.insert(random.index(mixed.len()), points[k * 13]);
        mixed.insert(
            random.index(mixed.len()),
            DVec3::new(1.0, f64::NAN, f64::INFINITY),
        );
    }
    let other = cleaned(mixed).unwrap();
    assert_eq!(other.rejected_for(Reason::NonFinite), 50);
    assert_eq!(
        other.rejected_for(Reason::Duplicate)
            + other.rejected_for(Reason::Outlier)
            + other.used.len(),
        3050
    );
    assert_eq!(told(&plain), told(&other));
    assert_eq!(plain.noise.to_bits(), other.noise.to_bits());
    assert_eq!(plain.spacing.to_bits(), other.spacing.to_bits());
}

#[test]
fn progress_ends_at_the_points_of_a_sampled_scan() {
    let options = ScanOptions {
        points: Some(60_000),
        noise: 0.4,
        order: Order::Shuffled,
        ..ScanOptions::default()
    };
    let scan = scan(Shape::Tube, &options).unwrap().scan;
    let counter = Counter::default();
    let result = clean(&scan, &CleanOptions::default(), &counter).unwrap();
    assert!(!result.sample.is_empty());
    assert_eq!(counter.steps.load(Ordering::Relaxed), 60_000);
}

#[test]
fn pose_and_unit_change_little() {
    let simulated = noisy(Shape::Pot, 4000, 0.01, 6);
    let plain = cleaned(simulated.scan.points.clone()).unwrap();
    let turn = DMat3::from_quat(DQuat::from_xyzw(0.3, -0.5, 0.2, 0.7).normalize());
    for scale in [1e-3, 1.0, 1e3] {
        let moved = simulated
            .scan
            .points
            .iter()
            .map(|&p| scale * (turn * (p - DVec3::splat(300.0))));
        let other = cleaned(moved.collect()).unwrap();
        assert_eq!(plain.used, other.used);
        let noise = other.noise / (scale * plain.noise) - 1.0;
        assert!(noise.abs() < 1e-9, "{noise}");
        assert!((other.spacing / (scale * plain.spacing) - 1.0).abs() < 1e-9);
        let worst = (0..plain.points.len())
            .map(|k| (turn * plain.normals[k]).dot(other.normals[k]))
            .fold(1.0, f64::min);
        assert!(worst > 1.0 - 1e-6, "{worst}");
    }
}

#[test]
fn what_is_no_surface() {
    let says = |points: Vec<DVec3>, what: &str| {
        let error = cleaned(points).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    };
    says(Vec::new(), "check that the file is a complete scan");
    says(
        (0..9)
            .map(|k| DVec3::splat(1e200 * f64::from(k + 1)))
            .collect(),
        "9 of 9 points have coordinates beyond 1e90",
    );
    says(
        (0..99)
            .map(|k| DVec3::new(f64::from(k % 10), f64::from(k / 10), 0.0) * 1e-200)
            .collect(),
        "e-200 across",
    );
    says(vec![DVec3::NAN; 9], "only 0 different usable points of 9");
    says(vec![DVec3::ONE; 900], "same spot");
    says(vec![DVec3::X, DVec3::Y, DVec3::Z], "only 3");
    let step = DVec3::new(0.3, -0.2, 0.7);
    let single = |p: DVec3| p.as_vec3().as_dvec3();
    says(
        (0..200).map(|k| single(step * f64::from(k))).collect(),
        "one line",
    );
    let mut far = vec![DVec3::splat(1e80)];
    far.extend((0..200).map(|k| step * f64::from(k)));
    says(far, "one line");
    // A flat scan is a surface, and a single absurd point does no harm.
    let flat = |k: i32| DVec3::new(f64::from(k % 20), f64::from(k / 20), 0.0);
    let mut points: Vec<DVec3> = (0..400).map(flat).collect();
    points.push(DVec3::splat(1e80));
    points.push(DVec3::splat(1e120));
    let result = cleaned(points).unwrap();
    assert_eq!(result.points.len(), 400);
    assert_eq!(result.rejected.len(), 2);
    assert!(result.noise < 1e-9);
}

#[test]
fn parts_of_clouds_and_meshes() {
    let mut points: Vec<DVec3> = (0..400)
        .map(|k| DVec3::new(f64::from(k % 20), f64::from(k / 20), 0.0))
        .collect();
    points.extend((0..100).map(|k| DVec3::new(f64::from(k % 10), f64::from(k / 10), 30.0)));
    let cloud = cleaned(points.clone()).unwrap();
    assert_eq!(cloud.parts.sizes, [400, 100]);
    assert_eq!((cloud.parts.of[0], cloud.parts.of[450]), (0, 1));
    assert_eq!(
        (cloud.parts.count_above(0.2), cloud.parts.count_above(0.3)),
        (2, 1)
    );
    let mut triangles = Vec::new();
    for (start, side) in [(0_u32, 20_u32), (400, 10)] {
        for j in 0..side - 1 {
            for i in 0..side - 1 {
                let k = start + j * side + i;
                triangles.push([k, k + 1, k + side]);
                triangles.push([k + 1, k + side + 1, k + side]);
            }
        }
    }
    // A corner that is missing, repeated or not a number takes its triangles with it.
    points[7] = DVec3::NAN;
    points.push(points[0]);
    triangles.push([500, 2, 2]);
    let scan = Scan {
        points,
        organisation: Organisation::Mesh(triangles.clone()),
        ..Scan::default()
    };
    let mesh = clean(&scan, &CleanOptions::default(), &Silent).unwrap();
    assert_eq!(mesh.parts.sizes, [399, 100]);
    assert_eq!(mesh.triangles.len(), triangles.len() - 1 - 3);
    assert!(mesh.normals.iter().all(|n| n.z > 0.99));
}

#[test]
fn pieces_of_their_own() {
    let mut points: Vec<DVec3> = Vec::new();
    let mut random = Random::new(2);
    for (count, z, noise) in [(4000, 0.0, 0.1), (3000, 90.0, 0.02), (300, 180.0, 0.1)] {
        points.extend((0..count).map(|_| {
            let (x, y) = (50.0 * random.uniform(), 50.0 * random.uniform());
            DVec3::new(x, y, z + 0.02 * x * y / 5.0 + noise * random.normal())
        }));
    }
    random.shuffle(&mut points);
    let whole = cleaned(points.clone()).unwrap();
    let used = whole.used.len();
    let (pieces, scraps) = whole.split(0.1);
    assert_eq!(pieces.len(), 2);
    assert_eq!(scraps.len(), 1);
    let scrap = &scraps[0].indices;
    assert!(scrap.len() > 290 && scrap.iter().all(|&k| points[k as usize].z > 150.0));
    for (piece, noise) in pieces.iter().zip([0.1, 0.02]) {
        assert!((piece.noise / noise - 1.0).abs() < 0.1, "{}", piece.noise);
        assert_eq!(piece.parts.sizes, [piece.points.len()]);
        let same = |(&k, p): (&u32, &DVec3)| points[k as usize] == *p;
        assert!(piece.used.iter().zip(&piece.points).all(same));
    }
    let counted: usize = pieces.iter().map(|p| p.used.len()).sum();
    assert_eq!(counted + scrap.len(), used);
}

#[test]
fn many_small_parts_are_no_scraps() {
    let square = |count: u32, side: u32, z: f64| {
        (0..count).map(move |k| DVec3::new(f64::from(k % side), f64::from(k / side), z))
    };
    let mut points: Vec<DVec3> = square(10_000, 100, 0.0).collect();
    for part in 1..=3 {
        points.extend(square(400, 20, 90.0 * f64::from(part)));
    }
    // The first two leave 400 of 11 200 points, less than a twentieth.
    let (pieces, scraps) = cleaned(points).unwrap().split(0.1);
    let sizes: Vec<usize> = pieces.iter().map(|piece| piece.points.len()).collect();
    assert_eq!(sizes, [10_000, 400, 400]);
    assert_eq!(scraps.len(), 1);
}

#[test]
fn tiny_parts_make_no_others_large() {
    let square = |count: u32, side: u32, z: f64| {
        (0..count).map(move |k| DVec3::new(f64::from(k % side), f64::from(k / side), z))
    };
    let mut points: Vec<DVec3> = square(10_000, 100, 0.0).collect();
    points.extend(square(400, 20, 90.0));
    for part in 2..=9 {
        points.extend(square(144, 12, 90.0 * f64::from(part)));
    }
    // The tiny ones have a tenth of all points; the part of 400 has less than a twentieth.
    let (pieces, scraps) = cleaned(points).unwrap().split(0.1);
    assert_eq!(pieces.len(), 1);
    assert_eq!(scraps.len(), 9);
}

#[test]
fn swarms_and_lone_points_are_outliers() {
    let options = ScanOptions {
        points: Some(20_000),
        noise: 0.02,
        order: Order::Scattered,
        ..ScanOptions::default()
    };
    for shape in [Shape::Torus, Shape::Face] {
        let simulated = scan(shape, &options).unwrap();
        let mut points = simulated.scan.points;
        let spacing = cleaned(points.clone()).unwrap().spacing;
        let mut random = Random::new(4);
        for swarm in 0..30 {
            let at = simulated.parameters[random.index(20_000)];
            let off = spacing * (12.0 + f64::from(swarm));
            let centre =
                simulated.truth.point(at.x, at.y) + off * simulated.truth.normal(at.x, at.y);
            for _ in 0..=(swarm % 3) * 4 {
                let mut offset = || spacing * random.normal();
                points.push(centre + DVec3::new(offset(), offset(), offset()));
            }
        }
        let result = cleaned(points.clone()).unwrap();
        let wrong = result.rejected.iter().filter(|r| r.index < 20_000).count();
        let missed = points.len() - 20_000 - (result.rejected.len() - wrong);
        assert!(
            wrong <= 10 && missed <= 9,
            "{shape:?}: {wrong} wrong, {missed} missed"
        );
    }
}

/// Normals turned at random say nothing of the side; normals of the file that agree settle it.
#[test]
fn normals_of_the_file() {
    let simulated = noisy(Shape::Tube, 5000, 0.0, 3);
    let truth = |k: usize| {
        let at = simulated.parameters[k];
        simulated.truth.normal(at.x, at.y)
    };
    for (turn, inward) in [(1, true), (2, false)] {
        let sign = |k: usize| if k.is_multiple_of(turn) { -1.0 } else { 1.0 };
        let scan = Scan {
            normals: Some((0..5000).map(|k| sign(k) * truth(k)).collect()),
            ..simulated.scan.clone()
        };
        let result = clean(&scan, &CleanOptions::default(), &Silent).unwrap();
        let inside = (0..result.used.len())
            .filter(|&k| result.normals[k].dot(truth(result.used[k] as usize)) < 0.0)
            .count();
        assert_eq!(inside * 2 > result.used.len(), inward);
        assert!(inside.min(result.used.len() - inside) <= 5);
    }
}

#[test]
fn pole_lines_are_no_duplicates() {
    let simulated = scan(Shape::Sphere, &ScanOptions::default()).unwrap();
    let result = clean(&simulated.scan, &CleanOptions::default(), &Silent).unwrap();
    assert_eq!(result.used.len(), 10_000);
    assert!(result.rejected.is_empty());
    assert!(result.normals[0].dot(-DVec3::Z) > 0.99);
    assert!(result.normals[9_999].dot(DVec3::Z) > 0.99);
}

mod hostile {
    use super::*;
    use proptest::prelude::*;

    fn coordinate() -> impl Strategy<Value = f64> {
        prop_oneof![
            20 => (-4..5_i32).prop_map(f64::from),
            4 => -1.0..1.0_f64,
            1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(1e200), Just(-1e89), Just(1e-300)],
        ]
    }

    fn organisation(count: usize, which: u8, corners: &[u32]) -> Organisation {
        match which {
            0 => Organisation::Unordered,
            1 => Organisation::Rows(vec![count / 3, 0, count - count / 3]),
            2 => Organisation::Mesh(
                corners
                    .chunks_exact(3)
                    .map(|c| [c[0], c[1], c[2]])
                    .collect(),
            ),
            // Lists that do not fit the points are a caller's mistake, but no reason to panic.
            3 => Organisation::Rows(vec![7; count]),
            _ => Organisation::Grid(GridLayout {
                count_u: 5,
                count_v: count / 5,
                cells: corners
                    .iter()
                    .cycle()
                    .take(count / 5 * 5)
                    .map(|&c| (c % 7 > 0).then_some(c))
                    .collect(),
            }),
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]
        #[test]
        fn any_points_give_a_result_or_a_sentence(
            cells in prop::collection::vec((coordinate(), coordinate(), coordinate()), 0..120),
            which in 0..5_u8,
            corners in prop::collection::vec(0..130_u32, 1..60),
        ) {
            let points: Vec<DVec3> = cells.iter().map(|&(x, y, z)| DVec3::new(x, y, z)).collect();
            let count = points.len();
            let scan = Scan {
                organisation: organisation(count, which, &corners),
                points,
                ..Scan::default()
            };
            if let Ok(result) = clean(&scan, &CleanOptions::default(), &Silent) {
                prop_assert_eq!(result.used.len() + result.rejected.len(), count);
                prop_assert!(result.used.windows(2).all(|w| w[0] < w[1]));
                prop_assert!(result.noise >= 0.0 && result.spacing > 0.0);
                prop_assert!(result.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-6));
                prop_assert_eq!(result.parts.sizes.iter().sum::<usize>(), result.parts.of.len());
            }
        }
    }
}
