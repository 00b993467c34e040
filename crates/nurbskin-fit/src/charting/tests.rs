//! Charts of whole scans over their meshes.

use super::*;
use nurbskin_geometry::progress::Silent;
use nurbskin_scan::clean::{CleanOptions, clean};
use nurbskin_scan::mesh::samples::Mesh;
use nurbskin_scan::{Organisation, Scan};
use std::f64::consts::TAU;

const MESH: ChartOptions = ChartOptions {
    topology: None,
    vertices: true,
};

/// A scan of a mesh.
fn cleaned(mesh: Mesh) -> CleanScan {
    let scan = Scan {
        points: mesh.points,
        organisation: Organisation::Mesh(mesh.triangles),
        ..Scan::default()
    };
    clean(&scan, &CleanOptions::default(), &Silent).unwrap()
}

/// A pipe of radius 1 and length 3 with a wall, closed at its ends by rims: a ring by its topology.
fn pipe([around, along]: [u32; 2], wall: f64) -> Mesh {
    // Once around the section of the wall: up outside, over the rim, down inside, and back.
    let lengths = [3.0, wall, 3.0, wall];
    let whole: f64 = lengths.iter().sum();
    Mesh::lattice([around, along], [true, true], |u, v| {
        let s = v * whole;
        let (r, z) = if s < 3.0 {
            (1.0, s)
        } else if s < 3.0 + wall {
            (1.0 - (s - 3.0), 3.0)
        } else if s < 6.0 + wall {
            (1.0 - wall, 6.0 + wall - s)
        } else {
            (1.0 - (whole - s), 0.0)
        };
        DVec3::new(r * (TAU * u).cos(), r * (TAU * u).sin(), z)
    })
}

#[test]
fn a_thin_wall_is_what_its_mesh_says() {
    // 20,000 points on the 37 square units of both walls are .043 apart: twice the wall.
    let mesh = pipe([300, 280], 0.02);
    assert!(mesh.points.len() > 60_000);
    let scan = cleaned(mesh);
    let charted = chart(&scan, &MESH, &Silent).unwrap();
    assert_eq!(charted.chart.topology, Topology::Torus);
    assert_eq!(charted.chart.parameters.len(), scan.points.len());
    assert!(charted.support.is_empty());
    assert!(
        charted
            .states
            .iter()
            .all(|&state| state == PointState::Charted)
    );
    // Points across the wall from each other lie on two walls of the chart, too: half of its short way round apart.
    let at = |r: f64, k: usize| {
        let p = DVec3::new(
            r * (TAU * k as f64 / 10.0).cos(),
            r * (TAU * k as f64 / 10.0).sin(),
            1.5,
        );
        let nearest = (0..scan.points.len()).min_by(|&i, &j| {
            let [i, j] = [i, j].map(|i| scan.points[i].distance_squared(p));
            i.total_cmp(&j)
        });
        charted.chart.parameters[nearest.unwrap()]
    };
    for k in 0..10 {
        let apart = (at(1.0, k) - at(0.98, k)).abs();
        let apart = apart.min(1.0 - apart);
        assert!(apart.max_element() > 0.25, "{apart}");
    }
}

#[test]
fn bits_of_a_large_mesh_are_loose_as_those_of_a_small_one() {
    // A sheet and another one that touches it in a point.
    let sheets = |n: u32| {
        let mut mesh = Mesh::lattice([n, n], [false, false], |u, v| DVec3::new(u, v, 0.1 * u * u));
        let other = Mesh::lattice([n / 2, n / 2], [false, false], |u, v| {
            DVec3::new(1.0 + 0.5 * u, 1.0 + 0.5 * v, 0.1)
        });
        let first = mesh.points.len() as u32;
        let corner = first - 1;
        mesh.points.extend(other.points);
        let moved = |k: u32| if k == 0 { corner } else { k + first };
        let triangles = other.triangles.iter().map(|t| t.map(moved));
        mesh.triangles.extend(triangles);
        mesh
    };
    for n in [100, 300] {
        let scan = cleaned(sheets(n));
        let charted = chart(&scan, &MESH, &Silent).unwrap();
        assert_eq!(charted.chart.topology, Topology::Disk);
        let is_other = |p: &DVec3| p.x > 1.0 + 1e-9 || p.y > 1.0 + 1e-9;
        for (k, p) in scan.points.iter().enumerate() {
            let detached = charted.states[k] == PointState::Detached;
            assert_eq!(detached, is_other(p), "{n}: {p}");
        }
    }
}

#[test]
fn long_triangles_of_a_large_mesh_have_places_inside() {
    // A dense square beside a strip of few triangles, and a hole in the dense part.
    let n = 260_u32;
    let at = |k: u32| match k <= n {
        true => f64::from(k) / f64::from(n),
        false => 1.0 + 0.25 * f64::from(k - n),
    };
    let m = n + 4;
    let mesh = Mesh::lattice([m, n], [false, false], |u, v| {
        let k = (u * f64::from(m)).round() as u32;
        DVec3::new(at(k), v, 0.1 * (3.0 * v).sin())
    })
    .without(|p| p.distance(DVec3::new(0.5, 0.5, 0.1 * 1.5_f64.sin())) < 0.1);
    let scan = cleaned(mesh);
    assert!(scan.points.len() > 60_000);
    let charted = chart(&scan, &MESH, &Silent).unwrap();
    assert!(!charted.inside.is_empty() && charted.inside.len() <= scan.points.len());
    assert!(charted.inside.iter().all(|(p, _)| p.x > 1.0));
    // The hole was bridged: only its patch shows where the surface may be.
    assert!(!charted.support.is_empty());
    let off = |p: &DVec3| (p.truncate() - DVec2::splat(0.5)).length();
    assert!(charted.support.iter().all(|(p, _)| off(p) < 0.12));
}
