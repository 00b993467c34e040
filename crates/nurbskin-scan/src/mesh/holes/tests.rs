use super::*;
use crate::mesh::repair::repair;
use crate::mesh::samples::{Mesh, check};
use glam::DVec3;
use nurbskin_geometry::progress::Silent;
use std::f64::consts::{PI, TAU};

fn surface(mesh: &Mesh) -> Manifold {
    repair(&mesh.points, &mesh.triangles, &Silent)
        .unwrap()
        .manifold
}

#[test]
fn windows_in_a_plane_are_filled_in_the_plane() {
    // A ring around a star of 120 corners in a tilted plane.
    let radius = |a: f64| 0.5 + 0.1 * (5.0 * a).cos();
    let place = |u: f64, v: f64| {
        let a = TAU * u;
        let r = radius(a) + (1.2 - radius(a)) * v;
        DVec3::new(r * a.cos(), r * a.sin(), 100.0 + 0.3 * r * a.cos())
    };
    let ring = surface(&Mesh::lattice([120, 8], [true, false], place));
    assert_eq!(ring.loops.len(), 2);
    let before = ring.area();
    let (disk, filled) = fill(ring.clone(), &[1]);
    check(&disk);
    assert_eq!((disk.loops.len(), disk.genus()), (1, 0));
    assert_eq!(disk.loops[0], ring.loops[0]);
    assert_eq!(disk.triangles[..ring.triangles.len()], ring.triangles);
    for (p, source) in disk.points.iter().zip(&disk.source).skip(ring.points.len()) {
        assert!((p.z - 100.0 - 0.3 * p.x).abs() < 1e-6 && source.is_none());
    }
    // Exactly the star, laid out without folds.
    let rim: Vec<DVec3> = ring.loops[1]
        .iter()
        .map(|&k| ring.points[k as usize])
        .collect();
    let star: DVec3 = (0..rim.len())
        .map(|k| 0.5 * (rim[k] - rim[0]).cross(rim[(k + 1) % rim.len()] - rim[0]))
        .sum();
    assert!(
        (filled[0].area - star.length()).abs() < 1e-6,
        "{filled:?} {}",
        star.length()
    );
    assert!((disk.area() - before - star.length()).abs() < 1e-6);
    assert!(filled[0].added > 50, "{filled:?}");
    // Even: few slivers.
    let poor = (ring.triangles.len()..disk.triangles.len()).filter(|&t| {
        let [a, b, c] = disk.corners(t);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        disk.vector_area(t).length() < 0.1 * longest * longest
    });
    assert!(poor.count() * 20 < disk.triangles.len() - ring.triangles.len());
}

#[test]
fn caps_of_a_tube_close_it() {
    let tube = surface(&Mesh::lattice([300, 40], [true, false], |u, v| {
        DVec3::new((TAU * u).cos(), (TAU * u).sin(), 3.0 * v)
    }));
    let (closed, filled) = fill(tube, &[0, 1, 1, 7]);
    check(&closed);
    assert_eq!((closed.euler_characteristic(), filled.len()), (2, 2));
    for cap in filled {
        assert!(
            (cap.area / PI - 1.0).abs() < 1e-3 && cap.edges == 300,
            "{cap:?}"
        );
    }
}

#[test]
fn the_last_triangles_of_small_solids() {
    // A tetrahedron without one side, and an octahedron without four: corners there are joined already.
    let points: Vec<DVec3> = [
        [1., 0., 0.],
        [-1., 0., 0.],
        [0., 1., 0.],
        [0., -1., 0.],
        [0., 0., 1.],
        [0., 0., -1.],
    ]
    .map(DVec3::from)
    .to_vec();
    let open = surface(&Mesh {
        points: points.clone(),
        triangles: vec![[0, 2, 4], [2, 3, 4], [3, 0, 4]],
    });
    let (closed, _) = fill(open, &[0]);
    check(&closed);
    assert_eq!((closed.triangles.len(), closed.loops.len()), (4, 0));
    let half = surface(&Mesh {
        points,
        triangles: vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5]],
    });
    let (closed, _) = fill(half, &[0]);
    check(&closed);
    assert_eq!(closed.euler_characteristic(), 2);
}
