//! Readings of meshes with several possible topologies.

use super::*;
use nurbskin_geometry::progress::Silent;
use nurbskin_scan::mesh::repair::repair;
use nurbskin_scan::mesh::samples::Mesh;
use std::f64::consts::{PI, TAU};

/// The topology found for a mesh, the number of its holes, and the notes.
fn found(mesh: &Mesh) -> (Topology, usize, Vec<String>) {
    let manifold = repair(&mesh.points, &mesh.triangles, &Silent)
        .unwrap()
        .manifold;
    let borders = manifold.loops.len();
    let laid = best(&manifold, None, Unit::Millimetre, &Silent).unwrap();
    let open = laid.mesh.loops.len();
    assert!(
        !is_poor_chart(laid.chart.quality),
        "{:?}",
        laid.chart.quality
    );
    (laid.chart.topology, borders - open, laid.notes.details)
}

fn weighed(details: &[String]) -> bool {
    details
        .iter()
        .any(|line| line.contains("readings were weighed"))
}

/// A face: part of a sphere, up to a polar angle, with a nose whose nostrils end upright, or with eyes.
fn face(polar: f64, holes: &[(f64, f64, f64)], upright: f64) -> Mesh {
    let places: Vec<(DVec3, f64)> = holes
        .iter()
        .map(|&(x, y, size)| (DVec3::new(x, y, 1.0).normalize(), size))
        .collect();
    let mut mesh = Mesh::sphere([160, 120], 0.0, polar);
    for p in &mut mesh.points {
        let steep = |&(at, size): &(DVec3, f64)| upright / (1.0 + (p.distance(at) / size).powi(6));
        *p *= 1.0 + places.iter().map(steep).sum::<f64>();
    }
    let open = |p: DVec3| {
        let p = p.normalize();
        places.iter().any(|&(at, size)| p.distance(at) < size)
    };
    mesh.without(open)
}

#[test]
fn a_patch_of_a_face_is_a_disk_with_holes() {
    // Two nostrils close together, of different sizes, one large; of a shallow patch and of one that is bent far round.
    let pairs: [&[(f64, f64, f64)]; 3] = [
        &[(0.16, 0.0, 0.1), (-0.16, 0.0, 0.1)],
        &[(0.25, 0.1, 0.16), (-0.2, 0.0, 0.08)],
        &[(0.1, 0.0, 0.25)],
    ];
    for polar in [0.3 * PI, 0.5 * PI, 0.72 * PI] {
        for holes in pairs {
            // A collar around a wide hole may well be the end of a tube.
            let steep: &[f64] = if holes.len() == 1 {
                &[0.0]
            } else {
                &[0.0, 0.3]
            };
            for &upright in steep {
                let (topology, count, details) = found(&face(polar, holes, upright));
                let name = format!("{polar:.2} {holes:?} {upright}: {details:?}");
                assert_eq!((topology, count), (Topology::Disk, holes.len()), "{name}");
                // A clear case needs no second reading: most of it faces one side.
                let plain = upright <= 0.0 && polar < 0.6 * PI;
                assert!(!plain || !weighed(&details), "{name}");
            }
        }
    }
}

#[test]
fn tubes_with_windows_and_slanted_ends() {
    let tube = |radius: f64, slant: f64| {
        Mesh::lattice([80, 80], [true, false], move |u, v| {
            let (sin, cos) = (TAU * u).sin_cos();
            DVec3::new(
                radius * cos,
                radius * sin,
                4.0 * v + slant * v * radius * cos,
            )
        })
    };
    let window = |p: DVec3| p.distance(DVec3::new(1.0, 0.0, 2.0)) < 0.4;
    for (mesh, holes) in [
        (tube(1.0, 0.0).without(window), 1),
        (tube(1.0, 1.7), 0),
        (tube(0.1, 1.7), 0),
        (tube(0.05, 3.0), 0),
    ] {
        let (topology, count, details) = found(&mesh);
        assert_eq!((topology, count), (Topology::Tube, holes), "{details:?}");
    }
}

#[test]
fn balls_with_gaps_and_bottles_with_mouths() {
    let gap = |at: DVec3, size: f64| move |p: DVec3| p.distance(at.normalize()) < size;
    let ball = Mesh::sphere([80, 60], 0.0, PI);
    let gaps = ball
        .clone()
        .without(gap(DVec3::new(0.6, 0.0, 0.8), 0.3))
        .without(gap(DVec3::new(-1.0, 0.2, 0.0), 0.2));
    let (topology, count, _) = found(&gaps);
    assert_eq!((topology, count), (Topology::Sphere, 2));
    let bottle = Mesh::lattice([60, 80], [true, false], |u, v| {
        let place = |r: f64, z: f64| DVec3::new(r * (TAU * u).cos(), r * (TAU * u).sin(), z);
        match (0.89 * PI).min(PI * v) {
            polar if polar < PI * v => place((0.89 * PI).sin(), -1.0 - 4.0 * (v - 0.89)),
            polar => place(polar.sin().max(1e-3), polar.cos()),
        }
    });
    let (topology, ..) = found(&bottle);
    assert_eq!(topology, Topology::Disk);
}
