//! Tests of sampling: clouds with noise wider than their spacing, and clouds of dense scan lines.

use crate::Scan;
use crate::clean::{CleanOptions, clean};
use crate::cleaned;
use crate::simulate::{Order, Random, ScanOptions, Shape, scan};
use glam::DVec3;
use nurbskin_geometry::progress::Silent;

/// Nine of ten points in a tenth of the area, and noise only too wide for them.
#[test]
fn the_spacing_of_a_sample_is_that_of_its_places() {
    let mut random = Random::new(4);
    let mut points: Vec<DVec3> = Vec::new();
    for (count, side, at) in [(60_000, 20.0, 0.0), (8_000, 70.0, 20.0)] {
        points.extend((0..count).map(|_| {
            let (x, y) = (side * random.uniform(), side * random.uniform());
            DVec3::new(at + x, y, 0.15 * random.normal())
        }));
    }
    let result = cleaned(points).unwrap();
    assert!(!result.sample.is_empty());
    let spacing = result.spacing / (400.0_f64 / 60_000.0).sqrt();
    assert!((0.7..1.5).contains(&spacing), "{spacing}");
    assert!((result.noise / 0.15 - 1.0).abs() < 0.1, "{}", result.noise);
}

/// Points up to six times closer than the noise is wide, of which a sample is examined; the others follow it.
#[test]
fn noise_wider_than_the_spacing() {
    for (shape, points, noise) in [
        (Shape::Tube, 60_000, 0.4),
        (Shape::Torus, 60_000, 0.5),
        (Shape::Ellipsoid, 300_000, 0.3),
    ] {
        let options = ScanOptions {
            points: Some(points),
            noise,
            outliers: 0.01,
            order: Order::Shuffled,
            seed: 4,
            ..ScanOptions::default()
        };
        let simulated = scan(shape, &options).unwrap();
        let result = clean(&simulated.scan, &CleanOptions::default(), &Silent).unwrap();
        let what = format!("{shape:?} {} of {points}", result.sample.len());
        assert!(!result.sample.is_empty(), "{what}");
        assert!(result.sample.is_sorted_by(|a, b| a < b), "{what}");
        let found = result.noise / noise;
        assert!((found - 1.0).abs() < 0.1, "{what}: noise {found}");
        let [lu, lv] = simulated.truth.size();
        let spacing = result.spacing / (lu * lv / points as f64).sqrt();
        assert!((0.6..1.4).contains(&spacing), "{what}: spacing {spacing}");
        let astray = (0..result.points.len()).filter(|&k| {
            let at = simulated.parameters[result.used[k] as usize];
            simulated.truth.normal(at.x, at.y).dot(result.normals[k]) < 0.8
        });
        let astray = astray.count();
        assert!(astray * 30 < points, "{what}: normals {astray}");
        assert_eq!(result.parts.count_above(0.1), 1, "{what}");
        let far = |k: usize| simulated.truth.distance(simulated.scan.points[k]);
        let used = result.used.iter().map(|&k| k as usize);
        let missed = used.filter(|&k| far(k) > 8.0 * noise).count();
        let wrong = result
            .rejected
            .iter()
            .filter(|r| far(r.index) < 4.0 * noise);
        let wrong = wrong.count();
        assert!(
            missed * 2000 < points && wrong * 2000 < points,
            "{what}: outliers missed {missed}, others taken {wrong}"
        );
    }
}

/// Lines 2.5 apart of a waved sheet of 100 x 100, so many times as dense.
fn lines(dense: f64, noise: f64) -> Scan {
    let mut random = Random::new(7);
    let step = 2.5 / dense;
    let mut points = Vec::new();
    for j in 0..=40_u32 {
        let (mut x, y) = (step * random.uniform(), 2.5 * f64::from(j));
        while x < 100.0 {
            let at = DVec3::new(x, y, 3.0 * (x / 9.0).sin() * (y / 7.0).cos());
            points.push(at + noise * DVec3::from_array([(); 3].map(|()| random.normal())));
            x += step;
        }
    }
    Scan {
        points,
        ..Scan::default()
    }
}

#[test]
fn points_on_dense_lines_are_one_sheet() {
    for (dense, noise) in [
        (3.0, 0.02),
        (10.0, 0.02),
        (20.0, 0.02),
        (60.0, 0.05),
        (10.0, 0.1),
        (40.0, 0.12),
    ] {
        let scan = lines(dense, noise);
        let result = clean(&scan, &CleanOptions::default(), &Silent).unwrap();
        let all = scan.points.len();
        assert_eq!(result.parts.count(), 1);
        // Noise takes one point of ten thousand far off.
        assert!(
            result.rejected.len() * 2000 <= all,
            "{}",
            result.rejected.len()
        );
        assert!(
            (result.noise / noise - 1.0).abs() < 0.1,
            "{dense}: {}",
            result.noise
        );
        // Where lines are not dense one point stands for step times distance.
        let spacing = if dense > 6.0 {
            2.5 / 2.0
        } else {
            2.5 / dense.sqrt()
        };
        assert!(
            result.spacing > 0.9 * spacing && result.spacing < 2.5,
            "{}",
            result.spacing
        );
        assert_eq!(result.squares < all / 2, dense > 6.0);
        let area = result.squares as f64 * result.spacing * result.spacing;
        assert!((area / 1.1e4).ln().abs() < 0.4, "{dense}: {area}");
        let upright = result.normals.iter().map(|n| n.z.abs());
        assert!(upright.fold(1.0, f64::min) > 0.7, "{dense}");
    }
}

#[test]
fn rings_that_run_together_belong_to_the_rest() {
    // Rings about a sphere, all with the same number of points: those at the poles are very dense. The rings of the
    // second sphere lie as close to each other as their points, and only at the poles is the noise wider than that.
    for (rings, count, noise) in [(41_u32, 800_u32, 0.02), (195, 307, 0.114)] {
        let mut random = Random::new(8);
        let place = |k: u32| {
            let polar = std::f64::consts::PI * (f64::from(k / count) + 0.5) / f64::from(rings);
            let angle = f64::from(k % count) * std::f64::consts::TAU / f64::from(count);
            let (out, up) = polar.sin_cos();
            30.0 * DVec3::new(out * angle.cos(), out * angle.sin(), up)
        };
        // Along the normal, as scanners err.
        let points = (0..rings * count).map(|k| place(k) * (1.0 + noise / 30.0 * random.normal()));
        let result = cleaned(points.collect()).unwrap();
        assert_eq!(result.parts.count(), 1, "{rings}: {:?}", result.parts.sizes);
        // Noise throws some of the points at the poles off the few that are left of them.
        let rejected = result.rejected.len();
        assert!(rejected * 200 < result.points.len(), "{rings}: {rejected}");
        let found = result.noise / noise;
        assert!((found - 1.0).abs() < 0.1, "{rings}: noise {found}");
    }
}
