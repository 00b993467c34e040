use super::*;
use crate::mesh::repair::repair;
use crate::mesh::samples::{Mesh, check};
use glam::DVec3;
use nurbskin_geometry::progress::{Silent, Stopped};
use std::f64::consts::PI;

/// A sphere of about 10000 triangles with so many little tubes between triangles that lie near each other.
fn furred(count: usize) -> Mesh {
    let mut mesh = Mesh::sphere([100, 50], 0.0, PI);
    // In twos, three rows apart, away from the poles and from each other.
    let centre = |mesh: &Mesh, t: usize| -> DVec3 {
        mesh.triangles[t]
            .iter()
            .map(|&k| mesh.points[k as usize])
            .sum::<DVec3>()
            / 3.0
    };
    for k in 0..count {
        let around = std::f64::consts::TAU * (k % 16) as f64 / 16.0;
        let polar = PI * (0.25 + 0.1 * (k / 16) as f64);
        let near = |shift: f64| {
            let polar = polar + shift;
            let p = DVec3::new(
                polar.sin() * around.cos(),
                polar.sin() * around.sin(),
                polar.cos(),
            );
            let t = (0..mesh.triangles.len()).min_by(|&s, &t| {
                centre(&mesh, s)
                    .distance(p)
                    .total_cmp(&centre(&mesh, t).distance(p))
            });
            t.unwrap()
        };
        let (s, t) = (near(0.0), near(0.16));
        mesh.join(s, t);
    }
    mesh
}

#[test]
fn little_handles_are_cut() {
    for count in [1, 7, 90] {
        let mesh = furred(count).shuffled(count as u64, false);
        let repaired = repair(&mesh.points, &mesh.triangles, &Silent).unwrap();
        let m = &repaired.manifold;
        check(m);
        assert_eq!((m.genus(), m.loops.len()), (0, 0));
        assert!(
            repaired.notes[0].starts_with(&format!("{count} spurious handle")),
            "{:?}",
            repaired.notes
        );
        // The tubes' walls remain, flat on the sphere.
        assert!(
            (m.area() / (4.0 * PI) - 1.0).abs() < 0.005 * (1 + count) as f64,
            "{}",
            m.area()
        );
        assert!(repaired.left_out.is_empty());
    }
}

#[test]
fn handles_of_the_object_stay() {
    // A ring, a ring of wire whose loops are 6 % of the root of its area, and frames.
    let ring = Mesh::torus([40, 20], 1.0, 0.4);
    let wire = Mesh::torus([900, 8], 1.0, 0.004);
    for (mesh, genus) in [(ring, 1), (wire, 1), (Mesh::frame(3, 6), 3)] {
        let repaired = repair(&mesh.points, &mesh.triangles, &Silent).unwrap();
        check(&repaired.manifold);
        assert_eq!(repaired.manifold.genus(), genus);
        assert!(repaired.notes.is_empty());
    }
}

/// A round plate of radius 40 with a hole of radius 1 through its middle, `around` edges around.
fn drilled(around: u32, thickness: f64) -> Mesh {
    // Down the hole in 4 steps, out, up, and back.
    let rim = |v: f64| match 64.0 * v {
        t if t <= 4.0 => (1.0, thickness * (0.5 - t / 4.0)),
        t if t <= 32.0 => (1.0 + 39.0 * (t - 4.0) / 28.0, -0.5 * thickness),
        t if t <= 36.0 => (40.0, thickness * ((t - 32.0) / 4.0 - 0.5)),
        t => (40.0 - 39.0 * (t - 36.0) / 28.0, 0.5 * thickness),
    };
    Mesh::lattice([around, 64], [true, true], |u, v| {
        let (angle, (r, z)) = (2.0 * PI * u, rim(v));
        DVec3::new(r * angle.cos(), r * angle.sin(), z)
    })
}

#[test]
fn holes_for_bolts_stay() {
    // The loops around are about 6 % of the root of the area, with 8 to 24 edges.
    for (around, thickness) in [(8, 1.0), (12, 0.5), (12, 4.0), (24, 2.0)] {
        let mut mesh = drilled(around, thickness).shuffled(u64::from(around), false);
        for inward in [false, true] {
            let repaired = repair(&mesh.points, &mesh.triangles, &Silent).unwrap();
            assert_eq!(
                repaired.manifold.genus(),
                1,
                "{around} {thickness} {inward}"
            );
            assert!(repaired.notes.is_empty());
            // With a place at the outer wall that the scanner missed.
            let open = mesh
                .clone()
                .without(|p| p.x > 39.0 && p.z > 0.2 * thickness);
            let repaired = repair(&open.points, &open.triangles, &Silent).unwrap();
            let m = &repaired.manifold;
            assert_eq!((m.genus(), m.loops.len()), (1, 1), "{around} {inward}");
            mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        }
    }
}

#[test]
fn faults_go_and_the_real_handle_stays() {
    let mut mesh = Mesh::torus([120, 60], 1.0, 0.4);
    for k in 0..5 {
        let t = 1000 + 2000 * k;
        mesh.join(t, t + 10);
    }
    let repaired = repair(&mesh.points, &mesh.triangles, &Silent).unwrap();
    check(&repaired.manifold);
    assert_eq!(repaired.manifold.genus(), 1);
}

#[test]
fn a_loop_that_does_not_part_the_surface_is_found_shortest() {
    // Around the thin bar of a frame: 4 edges of 1 without diagonals, at any refinement.
    for d in [2, 5] {
        let mesh = Mesh::frame(2, d);
        let m = repair(&mesh.points, &mesh.triangles, &Silent)
            .unwrap()
            .manifold;
        let homology = Homology::new(&m);
        let mut search = loops::Search::new(&homology, &m);
        let shortest = homology
            .vertices_on_generators(&m)
            .into_iter()
            .filter_map(|v| search.shortest_through(v, 6.0))
            .map(|l| l.length)
            .fold(f64::INFINITY, f64::min);
        assert!((shortest - 4.0).abs() < 1e-9, "{shortest}");
        assert!((0..m.points.len() as u32).all(|v| search.shortest_through(v, 3.9).is_none()));
    }
}

#[test]
fn stops_when_asked() {
    let mesh = furred(3);
    let stopped = repair(&mesh.points, &mesh.triangles, &Stopped);
    assert!(matches!(stopped, Err(nurbskin_geometry::Error::Cancelled)));
}
