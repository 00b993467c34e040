//! Sheets that project are charted; other shapes are refused, with their likely shape.

use super::super::Topology;
use super::*;
use glam::{DMat3, DQuat};
use nurbskin_geometry::progress::Silent;
use nurbskin_scan::simulate::{Order, ScanOptions, Shape, scan};
use nurbskin_scan::{CleanOptions, CleanScan, Scan, clean};
use std::f64::consts::{PI, TAU};

fn charted(scan: &CleanScan) -> Result<Chart> {
    chart_on_plane(scan)
}

fn simulated(shape: Shape, order: Order, opening: bool) -> Scan {
    let options = ScanOptions {
        points: Some(2500),
        noise: 0.05,
        outliers: 0.01,
        seed: 3,
        order,
        opening,
        ..ScanOptions::default()
    };
    scan(shape, &options).unwrap().scan
}

fn cleaned(scan: &Scan) -> CleanScan {
    clean(scan, &CleanOptions::default(), &Silent).unwrap()
}

#[test]
fn sheets_are_charted_and_others_named() {
    for shape in Shape::ALL {
        for order in [Order::Ordered, Order::Scattered] {
            let result = charted(&cleaned(&simulated(shape, order, false)));
            if shape.closed() == [false, false] {
                let chart = result.unwrap();
                assert_eq!(chart.topology, Topology::Disk);
                continue;
            }
            let error = result.map(|_| shape).unwrap_err();
            assert!(matches!(error, Error::Unsupported(_)));
            let text = error.to_string();
            assert!(
                text.contains("tube") || text.contains("closed"),
                "{shape:?}: {text}"
            );
        }
    }
    assert!(charted(&cleaned(&simulated(Shape::Handle, Order::Shuffled, true))).is_err());
}

#[test]
fn the_plane_is_found_in_any_pose_and_unit() {
    let options = ScanOptions {
        order: Order::Shuffled,
        ..ScanOptions::default()
    };
    let plane = scan(Shape::Plane, &options).unwrap();
    let turn = DMat3::from_quat(DQuat::from_xyzw(0.1, 0.7, -0.3, 0.4).normalize());
    for scale in [1e-3, 1.0, 25.4] {
        let mut moved = plane.scan.clone();
        for p in &mut moved.points {
            *p = scale * (turn * *p);
        }
        let chart = charted(&cleaned(&moved)).unwrap();
        assert!((chart.size[0] / scale - 120.0).abs() < 1e-6);
        assert!((chart.size[1] / scale - 80.0).abs() < 1e-6);
        // The true parameters, up to the directions of u and v.
        for (at, truth) in chart.parameters.iter().zip(&plane.parameters) {
            let same = |a: f64, b: f64| (a - b).abs() < 1e-9 || (a - 1.0 + b).abs() < 1e-9;
            assert!(same(at.x, truth.x) && same(at.y, truth.y));
        }
    }
}

#[test]
fn the_side_of_the_normals_is_kept() {
    let scan = cleaned(&simulated(Shape::Face, Order::Shuffled, false));
    let chart = charted(&scan).unwrap();
    // Least squares of position against (u, v) gives the directions of u and v.
    let n = scan.points.len() as f64;
    let middle = scan.points.iter().sum::<DVec3>() / n;
    let centre = chart.parameters.iter().sum::<DVec2>() / n;
    let (mut along_u, mut along_v) = (DVec3::ZERO, DVec3::ZERO);
    for (p, at) in scan.points.iter().zip(&chart.parameters) {
        along_u += (*p - middle) * (at.x - centre.x);
        along_v += (*p - middle) * (at.y - centre.y);
    }
    assert!(along_u.cross(along_v).normalize().z > 0.98);
    let near = |x: f64| chart.parameters.iter().any(|at| (at.x - x).abs() < 1e-12);
    assert!(near(0.0) && near(1.0));
}

#[test]
fn several_parts_are_counted() {
    let grid = |k: i32, z: f64| DVec3::new(f64::from(k % 30), f64::from(k / 30), z);
    let mut points: Vec<DVec3> = (0..900).map(|k| grid(k, 0.0)).collect();
    points.extend((0..300).map(|k| grid(k, 40.0)));
    let scan = Scan {
        points,
        ..Scan::default()
    };
    let error = charted(&cleaned(&scan)).unwrap_err().to_string();
    assert!(error.contains("2 separate parts"), "{error}");
    // A scrap is charted as well, on the border of the chart.
    let mut points: Vec<DVec3> = (0..900).map(|k| grid(k, 0.0)).collect();
    points.extend((0..80).map(|k| grid(k, 0.0) + DVec3::new(70.0, 0.0, 3.0)));
    let scan = Scan {
        points,
        ..Scan::default()
    };
    let cleaned = cleaned(&scan);
    let chart = charted(&cleaned).unwrap();
    assert!(
        (chart.size[0] - 29.0).abs() < 1e-9,
        "{:?}, {:?}",
        chart.size,
        chart.reason
    );
    assert_eq!(chart.parameters.len(), cleaned.points.len());
}

#[test]
fn hull_and_rectangle() {
    let points: Vec<DVec2> = (0..200)
        .map(|k| DVec2::new(f64::from(k % 20), 0.4 * f64::from(k / 20)))
        .map(|p| DVec2::from_angle(0.7).rotate(p))
        .collect();
    let hull = convex_hull(&points);
    for usual in [DVec2::X, DVec2::from_angle(0.69)] {
        let long = smallest_rectangle(&hull, usual);
        assert!(long.perp_dot(DVec2::from_angle(0.7)).abs() < 1e-12);
    }
    // A slightly ragged circle has no sides; an ellipse, a square and an octagon have a direction.
    let around = |n: u32, of: &dyn Fn(f64) -> DVec2| -> Vec<DVec2> {
        (0..n)
            .map(|k| DVec2::from_angle(0.2).rotate(of(TAU * f64::from(k) / f64::from(n))))
            .collect()
    };
    let ragged = |a: f64| (1.0 + 0.003 * (37.0 * a).sin()) * DVec2::from_angle(a);
    let usual = DVec2::from_angle(0.5);
    let found = |points: &[DVec2]| smallest_rectangle(&convex_hull(points), usual);
    let circle = found(&around(360, &ragged));
    assert!(circle.dot(usual).abs().max(circle.perp_dot(usual).abs()) > 1.0 - 1e-12);
    let ellipse = found(&around(3600, &|a| DVec2::new(1.3 * a.cos(), a.sin())));
    assert!(ellipse.perp_dot(DVec2::from_angle(0.2)).abs() < 0.01);
    for corners in [4, 8] {
        let polygon = found(&around(corners, &DVec2::from_angle));
        let turns = (polygon.to_angle() - 0.2) / (PI / f64::from(corners));
        assert!((turns - turns.round()).abs() < 1e-9 && turns.round() % 2.0 != 0.0);
    }
    assert_eq!(convex_hull(&[DVec2::ONE; 5]).len(), 1);
    let ends = robust_ends((0..2000).map(f64::from).chain([9e3]).collect());
    assert!((ends[0], ends[1]) == (0.0, 1999.0));
}
