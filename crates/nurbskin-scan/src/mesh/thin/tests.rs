use super::*;
use crate::simulate::{Order, Random, ScanOptions, Shape, scan};
use nurbskin_geometry::progress::Silent;

fn sphere(noise: f64) -> (Vec<DVec3>, crate::simulate::TrueSurface) {
    let options = ScanOptions {
        points: Some(20_000),
        noise,
        order: Order::Scattered,
        ..ScanOptions::default()
    };
    let simulated = scan(Shape::Sphere, &options).unwrap();
    (simulated.scan.points, simulated.truth)
}

#[test]
fn no_two_close_and_none_far() {
    let points: Vec<DVec3> = sphere(0.2).0.into_iter().take(5000).collect();
    let radius = 4.0;
    let kept = thin(&points, None, radius, 0.0);
    let at = |&k: &u32| points[k as usize];
    for (n, a) in kept.iter().enumerate() {
        assert!(kept[..n].iter().all(|b| at(a).distance(at(b)) >= radius));
    }
    assert!(
        points
            .iter()
            .all(|p| kept.iter().any(|k| p.distance(at(k)) < radius))
    );
}

#[test]
fn the_same_points_in_any_order() {
    let points = sphere(0.1).0;
    let mut order: Vec<u32> = (0..20_000).collect();
    Random::new(4).shuffle(&mut order);
    let shuffled: Vec<DVec3> = order.iter().map(|&k| points[k as usize]).collect();
    let normals: Vec<DVec3> = points
        .iter()
        .map(|p| (*p - DVec3::splat(300.0)).normalize())
        .collect();
    let turned: Vec<DVec3> = order.iter().map(|&k| normals[k as usize]).collect();
    let one = thin(&points, Some(&normals), 2.0, 0.0);
    let mut other: Vec<u32> = thin(&shuffled, Some(&turned), 2.0, 0.0)
        .iter()
        .map(|&k| order[k as usize])
        .collect();
    other.sort_unstable();
    assert_eq!(one, other);
    let place: Vec<u32> = {
        let mut place = vec![0; order.len()];
        for (k, &from) in (0..).zip(&order) {
            place[from as usize] = k;
        }
        one.iter().map(|&k| place[k as usize]).collect()
    };
    let a = smooth(&points, &normals, &one, 2.0, 0.0, &Silent).unwrap();
    let b = smooth(&shuffled, &turned, &place, 2.0, 0.0, &Silent).unwrap();
    assert_eq!(a, b);
}

#[test]
fn the_count_is_about_what_was_wanted() {
    let points = sphere(0.0).0;
    let spacing = (4.0 * std::f64::consts::PI * 2500.0 / 20_000.0_f64).sqrt();
    let count = thin(&points, None, radius_for(2000, points.len(), spacing), 0.0).len();
    assert!((1600..2500).contains(&count), "{count}");
}

#[test]
fn both_walls_keep_points() {
    let wall =
        |z: f64| (0..10_000).map(move |k| DVec3::new(f64::from(k % 100), f64::from(k / 100), z));
    let points: Vec<DVec3> = wall(0.0).chain(wall(4.0)).collect();
    let normals = vec![DVec3::Z; points.len()];
    let per_wall = |kept: Vec<u32>| kept.iter().filter(|&&k| k < 10_000).count();
    let alone = thin(&points[..10_000], None, 6.0, 0.0).len();
    assert_eq!(per_wall(thin(&points, Some(&normals), 6.0, 0.0)), alone);
    assert_eq!(thin(&points, Some(&normals), 6.0, 0.0).len(), 2 * alone);
    assert!(thin(&points, None, 6.0, 0.0).len() < 3 * alone / 2);
}

#[test]
fn smoothing_finds_the_surface() {
    let (points, truth) = sphere(0.3);
    let normals: Vec<DVec3> = points
        .iter()
        .map(|p| (*p - DVec3::splat(300.0)).normalize())
        .collect();
    let kept = thin(&points, Some(&normals), 3.0, 0.0);
    let smoothed = smooth(&points, &normals, &kept, 3.0, 0.0, &Silent).unwrap();
    let rms = |points: &mut dyn Iterator<Item = DVec3>| {
        let sum: f64 = points.map(|p| truth.distance(p).powi(2)).sum();
        (sum / kept.len() as f64).sqrt()
    };
    let before = rms(&mut kept.iter().map(|&k| points[k as usize]));
    let after = rms(&mut smoothed.points.iter().copied());
    assert!(before > 0.28 && after < 0.16, "{before} {after}");
}

/// Noise of 0.15 radii puts the points of one sheet up to half a radius apart, and still they are one.
#[test]
fn noise_makes_no_second_sheet() {
    let (noisy, truth) = sphere(1.0);
    let normals: Vec<DVec3> = noisy
        .iter()
        .map(|p| (*p - DVec3::splat(300.0)).normalize())
        .collect();
    let radius = 1.0 / 0.15;
    let told = thin(&noisy, Some(&normals), radius, 1.0);
    let alone = thin(&noisy, None, radius, 0.0);
    let close = told.len() as f64 / alone.len() as f64;
    assert!((0.95..1.08).contains(&close), "{close}");
    assert!(thin(&noisy, Some(&normals), radius, 0.0).len() * 20 > 21 * told.len());
    let smoothed = smooth(&noisy, &normals, &told, radius, 1.0, &Silent).unwrap();
    let off = smoothed.points.iter().map(|p| truth.distance(*p).powi(2));
    let rms = (off.sum::<f64>() / told.len() as f64).sqrt();
    assert!(rms < 0.5, "{rms}");
}

#[test]
fn nothing_from_nothing() {
    assert!(thin(&[], None, 1.0, 0.0).is_empty());
    assert!(thin(&[DVec3::ONE], None, 0.0, 0.0).is_empty());
    assert_eq!(
        thin(
            &[DVec3::INFINITY, DVec3::ONE, DVec3::NAN, DVec3::ONE],
            None,
            1.0,
            0.0
        ),
        [1]
    );
    assert!(smooth(&[DVec3::ONE], &[], &[0], 1.0, 0.0, &Silent).is_err());
}
