//! Sheets with an outline of their own: a rectangle for a base, trimmed.

use nurbskin::cad::mass::mass;
use nurbskin::deviation::verdict::Verdict;
use nurbskin::pipeline::{Length, Options, SurfacingOptions, fit_scan};
use nurbskin::progress::Silent;
use nurbskin::scan::Scan;
use nurbskin::scan::simulate::Random;
use nurbskin::{DVec2, DVec3};

const SIZE: f64 = 60.0;
const POINTS: usize = 12_000;

fn height(p: DVec2) -> f64 {
    8.0 * (p.x / 25.0).sin() * (p.y / 30.0).cos()
}

/// Area of the sheet over a square of the plane, per area of that.
fn steepness(p: DVec2) -> f64 {
    let along_x = 8.0 / 25.0 * (p.x / 25.0).cos() * (p.y / 30.0).cos();
    let along_y = -8.0 / 30.0 * (p.x / 25.0).sin() * (p.y / 30.0).sin();
    (1.0 + along_x * along_x + along_y * along_y).sqrt()
}

type Outline = fn(DVec2) -> bool;

/// Random points of the sheet inside an outline, and its area by a Riemann sum over a million squares.
fn sheet(inside: Outline) -> (Scan, f64) {
    let mut random = Random::new(5);
    let mut points = Vec::new();
    while points.len() < POINTS {
        let p = DVec2::new(random.uniform(), random.uniform()) * 2.0 * SIZE - SIZE;
        if inside(p) {
            points.push(DVec3::new(p.x, p.y, height(p)));
        }
    }
    let step = 2.0 * SIZE / 1000.0;
    let middle = |k: u32| (f64::from(k) + 0.5) * step - SIZE;
    let squares = (0..1_000_000).map(|k| DVec2::new(middle(k % 1000), middle(k / 1000)));
    let area = squares.filter(|&p| inside(p)).map(steepness).sum::<f64>() * step * step;
    let scan = Scan {
        points,
        ..Scan::default()
    };
    (scan, area)
}

/// A tolerance of 0.05 % of the diagonal.
fn options() -> Options {
    Options {
        surfacing: SurfacingOptions {
            tolerance: Some(Length::OfDiagonal(5e-4)),
            ..SurfacingOptions::default()
        },
        ..Options::default()
    }
}

#[test]
fn outlines_are_trims_and_cost_no_control_points() {
    let outlines: [(&str, Outline); 4] = [
        ("disc", |p| p.length() < SIZE),
        ("L", |p| p.x < 0.0 || p.y < 0.0),
        ("triangle", |p| p.y < SIZE - 2.0 * p.x.abs()),
        ("ring", |p| p.length() < SIZE && p.length() > 30.0),
    ];
    for (name, inside) in outlines {
        let (scan, area) = sheet(inside);
        let found = fit_scan(scan, name, &options(), &Silent).unwrap();
        let [m, n] = found.surface.control_points[..] else {
            panic!()
        };
        let share = found.deviation.scan_to_surface.within_tolerance.unwrap();
        let trimmed = mass(&found.model).unwrap().area;
        println!(
            "{name}: {m} x {n}, {share}, area {trimmed} of {area}, {:?}",
            found.reasons
        );
        assert_eq!(found.verdict, Verdict::Pass, "{name}");
        assert!(m * n <= 200 && share > 0.999, "{name}: {m} x {n}, {share}");
        // The rim of random points is known to a part of their spacing, 1 mm, along a length of some ten areas per metre.
        assert!(
            (trimmed / area - 1.0).abs() < 0.02,
            "{name}: {trimmed} of {area}"
        );
        // A height over a plane: beyond the outline it goes on, but not far.
        let [low, high] = found.geometry[0].bounding_box();
        assert!(high.z < 25.0 && low.z > -25.0, "{name}: {low} {high}");
    }
}

/// The section of a sheet by arc length, an S whose ends are bent over by 140 degrees: no direction sees all of it.
fn section(length: f64) -> DVec2 {
    const STEPS: u32 = 400;
    let step = length / f64::from(STEPS);
    (0..STEPS).fold(DVec2::ZERO, |at, k| {
        let s = step * (f64::from(k) + 0.5);
        let angle = 1.36 * (1.0 - (s / 19.0).cos());
        at + step * DVec2::new(angle.cos(), angle.sin())
    })
}

#[test]
fn outlines_of_sheets_that_bend_over_are_trims_as_well() {
    use std::f64::consts::PI;
    let outlines: [(&str, Outline, f64); 3] = [
        ("disc", |p| p.length() < SIZE, PI * SIZE * SIZE),
        ("L", |p| p.x < 0.0 || p.y < 0.0, 3.0 * SIZE * SIZE),
        (
            "ring",
            |p| p.length() < SIZE && p.length() > 30.0,
            PI * (SIZE * SIZE - 900.0),
        ),
    ];
    for (name, inside, area) in outlines {
        let mut random = Random::new(6);
        let mut points = Vec::new();
        while points.len() < POINTS {
            let p = DVec2::new(random.uniform(), random.uniform()) * 2.0 * SIZE - SIZE;
            if inside(p) {
                let at = section(p.x);
                points.push(DVec3::new(at.x, p.y, at.y));
            }
        }
        let scan = Scan {
            points,
            ..Scan::default()
        };
        let found = fit_scan(scan, name, &options(), &Silent).unwrap();
        let [m, n] = found.surface.control_points[..] else {
            panic!("{name}: a network")
        };
        let trimmed = mass(&found.model).unwrap().area;
        println!(
            "{name}: {m} x {n}, area {trimmed} of {area}, {:?}",
            found.reasons
        );
        assert_eq!(found.verdict, Verdict::Pass, "{name}");
        assert!(m * n <= 200, "{name}: {m} x {n}");
        // As above: the rim is known to a part of the spacing of the points.
        assert!(
            (trimmed / area - 1.0).abs() < 0.02,
            "{name}: {trimmed} of {area}"
        );
    }
}
