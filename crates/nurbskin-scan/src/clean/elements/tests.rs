//! Tests of local planes at thin walls and on dense scan lines.

use crate::cleaned;
use crate::simulate::Random;
use glam::DVec3;

/// Two bowls of radius 50 and 49, whose points are 1.25 apart: half of the neighbours are on the other one.
#[test]
fn walls_closer_than_neighbours() {
    let mut random = Random::new(5);
    let radii = [50.0, 49.0];
    let points: Vec<DVec3> = (0..20_000)
        .map(|k| {
            let z = random.uniform();
            let (s, c) = (std::f64::consts::TAU * random.uniform()).sin_cos();
            let across = (1.0 - z * z).sqrt();
            let radius = radii[k % 2] + 0.03 * random.normal();
            radius * DVec3::new(across * c, across * s, -z)
        })
        .collect();
    let result = cleaned(points).unwrap();
    assert!(result.rejected.len() <= 10, "{}", result.rejected.len());
    let steep = (0..result.points.len())
        .filter(|&k| result.normals[k].dot(result.points[k].normalize()).abs() < 0.97)
        .count();
    // Where chance put too few neighbours on one of them, both are taken for one.
    assert!(steep * 4 < result.points.len(), "{steep}");
    assert!((0.8..1.6).contains(&result.spacing));
}

/// Lines ten times as far apart as the points on them.
#[test]
fn dense_lines_far_apart() {
    let mut random = Random::new(6);
    let mut points = Vec::new();
    for line in 0..60 {
        for k in 0..700 {
            let (x, y) = (0.1 * (f64::from(k) + random.uniform()), f64::from(line));
            let z = 0.01 * (x - 35.0).powi(2) - 0.005 * y * y + 0.02 * random.normal();
            points.push(DVec3::new(x, y, z));
        }
    }
    let result = cleaned(points).unwrap();
    assert_eq!(result.parts.count(), 1);
    assert!(result.rejected.len() <= 20, "{}", result.rejected.len());
    let tilted = (0..result.points.len())
        .filter(|&k| {
            let p = result.points[k];
            let normal = DVec3::new(-0.02 * (p.x - 35.0), 0.01 * p.y, 1.0).normalize();
            result.normals[k].dot(normal).abs() < 0.99
        })
        .count();
    assert!(tilted * 200 < result.points.len(), "{tilted}");
    let facing = result.normals.iter().filter(|n| n.z > 0.0).count();
    assert!(facing == 0 || facing == result.normals.len(), "{facing}");
    assert!((result.noise / 0.02 - 1.0).abs() < 0.3, "{}", result.noise);
    // Thinned to lines three times as far apart as the points on them.
    assert!(
        (result.spacing * 3.0_f64.sqrt() - 1.0).abs() < 0.3,
        "{}",
        result.spacing
    );
}
