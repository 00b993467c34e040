//! Scans whose points lie on lines: laser stripes, sections of a coordinate measuring machine.

use nurbskin::chart::Topology;
use nurbskin::deviation::verdict::Verdict;
use nurbskin::pipeline::{Options, Outcome, fit_scan};
use nurbskin::progress::Silent;
use nurbskin::scan::simulate::Random;
use nurbskin::scan::{Organisation, Scan};
use nurbskin::{DVec3, NurbsSurface};
use std::f64::consts::{PI, TAU};

const NOISE: f64 = 0.02;

/// A gently waved sheet.
fn sheet(x: f64, y: f64) -> DVec3 {
    DVec3::new(x, y, 3.0 * (x / 9.0).sin() * (y / 7.0).cos())
}

/// A quarter of a ring of oval section, bent out of its plane.
fn elbow(turn: f64, angle: f64) -> DVec3 {
    let reach = 100.0 + 14.0 * angle.cos();
    let z = 12.0 * angle.sin() + 10.0 * (2.0 * turn).sin();
    DVec3::new(reach * turn.cos(), reach * turn.sin(), z)
}

/// A closed shape with three lobes, bent; z from -1 to 1.
fn body(z: f64, angle: f64) -> DVec3 {
    let wide = (1.0 - z * z).max(0.0).sqrt();
    let lobe = wide * (1.0 + 0.15 * wide * (3.0 * angle).cos());
    DVec3::new(
        25.0 * lobe * angle.cos() + 6.0 * z * z,
        18.0 * lobe * angle.sin(),
        40.0 * z,
    )
}

/// Rings of `count` points each, that start anywhere.
fn rings(
    rings: u32,
    count: u32,
    random: &mut Random,
    at: impl Fn(f64, f64) -> DVec3,
) -> Vec<Vec<DVec3>> {
    let ring = |j: u32| {
        let (s, start) = (
            (f64::from(j) + 0.5) / f64::from(rings),
            TAU * random.uniform(),
        );
        let angle = |i: u32| start + TAU * f64::from(i) / f64::from(count);
        (0..count).map(|i| at(s, angle(i))).collect()
    };
    (0..rings).map(ring).collect()
}

fn fitted(lines: Vec<Vec<DVec3>>, rows: bool, random: &mut Random) -> Outcome {
    let mut moved = |p: DVec3| p + NOISE * DVec3::from_array([(); 3].map(|()| random.normal()));
    let lengths = lines.iter().map(Vec::len).collect();
    let mut points: Vec<DVec3> = lines.concat().into_iter().map(&mut moved).collect();
    if !rows {
        random.shuffle(&mut points);
    }
    let scan = Scan {
        points,
        organisation: if rows {
            Organisation::Rows(lengths)
        } else {
            Organisation::Unordered
        },
        ..Scan::default()
    };
    fit_scan(scan, "lines", &Options::default(), &Silent).unwrap()
}

/// The largest distance of some places of the true shape from the surface.
fn off(surface: &NurbsSurface, truth: impl Iterator<Item = DVec3>) -> f64 {
    let closest = nurbskin::nurbs::closest::ClosestPoint::new(surface).unwrap();
    let feet = closest.closest_all(&truth.collect::<Vec<_>>(), None);
    feet.iter().map(|foot| foot.distance).fold(0.0, f64::max)
}

/// Nothing is amiss, and the points are as far as their noise.
fn follows(found: &Outcome) {
    assert_eq!(found.verdict, Verdict::NotAsked, "{}", found.reason);
    assert!(found.deviation.scan_to_surface.p99 < 3.0 * NOISE);
}

#[test]
fn stripes_of_a_sheet() {
    let mut random = Random::new(1);
    let step = 100.0 / 59.0;
    for dense in [10_u32, 40] {
        let line = |j: u32| {
            let first = random.uniform();
            let x = move |i: u32| (f64::from(i) + first) * step / f64::from(dense);
            (0..59 * dense)
                .map(|i| sheet(x(i), step * f64::from(j)))
                .collect()
        };
        let lines = (0..60).map(line).collect();
        let found = fitted(lines, false, &mut random);
        assert_eq!(found.surface.topology, Some(Topology::Disk));
        follows(&found);
        let coverage = found.deviation.surface_to_scan;
        assert!(coverage.unsupported_area < 1e-3);
        let truth = (0..900).map(|k| {
            let (i, j) = (f64::from(k % 30), f64::from(k / 30));
            sheet(2.0 + 3.3 * i, 2.0 + 3.3 * j)
        });
        let off = off(&found.geometry[0], truth);
        assert!(off < 2.0 * NOISE, "{dense}: {off}");
    }
}

#[test]
fn sections_that_start_anywhere_are_no_grid() {
    let mut random = Random::new(2);
    for rows in [true, false] {
        let lines = rings(40, 400, &mut random, |s, angle| elbow(s * PI / 2.0, angle));
        let found = fitted(lines, rows, &mut random);
        assert_eq!(found.surface.topology, Some(Topology::Tube));
        follows(&found);
        // Away from the ends, which are half a section farther on.
        let truth = (0..900).map(|k| {
            let (i, j) = (f64::from(k % 30), f64::from(k / 30));
            elbow((0.1 + 0.8 * i / 29.0) * PI / 2.0, TAU * j / 30.0)
        });
        let off = off(&found.geometry[0], truth);
        assert!(off < 3.0 * NOISE, "{rows}: {off}");
    }
}

#[test]
fn slices_of_a_closed_shape() {
    let mut random = Random::new(3);
    let lines = rings(50, 900, &mut random, |s, angle| body(2.0 * s - 1.0, angle));
    let found = fitted(lines, false, &mut random);
    assert_eq!(found.surface.topology, Some(Topology::Sphere));
    follows(&found);
    let truth = (0..900).map(|k| {
        let (i, j) = (f64::from(k % 30), f64::from(k / 30));
        body(-0.9 + 1.8 * i / 29.0, TAU * j / 30.0)
    });
    let off = off(&found.geometry[0], truth);
    assert!(off < 6.0 * NOISE, "{off}");
}
