//! Openings and holes of meshes with known topology.

use super::*;
use nurbskin_geometry::progress::Silent;
use nurbskin_scan::mesh::holes::fill;
use nurbskin_scan::mesh::repair::repair;
use nurbskin_scan::mesh::samples::{Mesh, check};
use std::f64::consts::{PI, TAU};

fn shape(mesh: &Mesh, asked: Option<Topology>) -> Result<MeshShape> {
    let manifold = repair(&mesh.points, &mesh.triangles, &Silent)?.manifold;
    let shape = shape_of(&manifold, asked)?;
    // Filling leaves the openings, and gives the Euler characteristic of the domain.
    let (filled, _) = fill(manifold, &shape.holes);
    check(&filled);
    assert_eq!(filled.loops.len(), shape.openings.len());
    let chi = match shape.topology {
        Topology::Disk => 1,
        Topology::Tube | Topology::Torus => 0,
        Topology::Sphere => 2,
    };
    assert_eq!(filled.euler_characteristic(), chi);
    Ok(shape)
}

fn is(mesh: &Mesh, topology: Topology, holes: usize) {
    let shape = shape(mesh, None).unwrap();
    assert_eq!(
        (shape.topology, shape.holes.len()),
        (topology, holes),
        "{}",
        shape.reason
    );
}

fn tube(radius: impl Fn(f64) -> f64) -> Mesh {
    Mesh::lattice([60, 60], [true, false], |u, v| {
        let r = radius(v);
        DVec3::new(r * (TAU * u).cos(), r * (TAU * u).sin(), 4.0 * v)
    })
}

#[test]
fn sheets_and_their_windows() {
    let flat = Mesh::lattice([60, 40], [false, false], |u, v| {
        DVec3::new(3.0 * u, 2.0 * v, 0.2 * u * u)
    });
    is(&flat, Topology::Disk, 0);
    // Windows that take most of the sheet.
    let window =
        |x: f64, y: f64, a: f64, b: f64| move |p: DVec3| (p.x - x).abs() < a && (p.y - y).abs() < b;
    let panel = flat
        .without(window(0.8, 1.0, 0.55, 0.7))
        .without(window(2.2, 1.0, 0.55, 0.6))
        .without(window(1.5, 0.15, 0.09, 0.06));
    is(&panel, Topology::Disk, 3);
    let washer = Mesh::lattice([60, 6], [true, false], |u, v| {
        DVec3::new(
            (1.0 + v) * (TAU * u).cos(),
            (1.0 + v) * (TAU * u).sin(),
            0.0,
        )
    });
    is(&washer, Topology::Disk, 1);
    assert_eq!(
        shape(&washer, Some(Topology::Tube)).unwrap().openings,
        [0, 1]
    );
    assert_eq!(
        shape(&washer, Some(Topology::Sphere)).unwrap().holes,
        [0, 1]
    );
}

#[test]
fn caps_from_shallow_to_closed() {
    for polar in [0.4, 0.5 * PI, 2.0 * PI / 3.0, 0.85 * PI] {
        is(&Mesh::sphere([60, 60], 0.0, polar), Topology::Disk, 0);
    }
    is(&Mesh::sphere([60, 60], 0.0, 0.97 * PI), Topology::Sphere, 1);
    is(&Mesh::sphere([60, 60], 0.0, PI), Topology::Sphere, 0);
    // A mask with an eye, and a ball with patches without data.
    let eye = |p: DVec3| p.distance(DVec3::new(0.6, 0.0, 0.8)) < 0.2;
    is(
        &Mesh::sphere([80, 60], 0.0, 0.7 * PI).without(eye),
        Topology::Disk,
        1,
    );
    let other = |p: DVec3| p.distance(DVec3::new(-0.6, 0.0, 0.8)) < 0.15;
    is(
        &Mesh::sphere([80, 60], 0.0, PI).without(eye).without(other),
        Topology::Sphere,
        2,
    );
    // A gap around 3 to 4 % of the area; and as large a mouth of a bottle, and a slit in a pipe.
    let large = |p: DVec3| p.distance(DVec3::new(0.6, 0.0, 0.8)) < 0.35;
    let ball = Mesh::sphere([80, 60], 0.0, PI).without(large);
    is(&ball, Topology::Sphere, 1);
    let bottle = Mesh::lattice([60, 80], [true, false], |u, v| {
        let place = |r: f64, z: f64| DVec3::new(r * (TAU * u).cos(), r * (TAU * u).sin(), z);
        match (0.89 * PI).min(PI * v) {
            polar if polar < PI * v => place((0.89 * PI).sin(), -1.0 - (v - 0.89)),
            polar => place(polar.sin().max(1e-3), polar.cos()),
        }
    });
    is(&bottle, Topology::Disk, 1);
    let slit = Mesh::lattice([60, 60], [false, false], |u, v| {
        let (sin, cos) = (0.97 * TAU * u).sin_cos();
        DVec3::new(cos, sin, 8.0 * v)
    });
    is(&slit, Topology::Disk, 0);
}

/// Nostrils end upright, and the border around a face that is all nose is as level as any gap: to bridge that one would
/// add more than a tenth to the area.
#[test]
fn the_border_of_a_face_is_no_hole() {
    let nostrils = [0.5_f64, -0.5].map(|x| DVec3::new(x, 0.0, 1.0).normalize());
    let mut face = Mesh::sphere([160, 120], 0.0, 0.75 * PI);
    let steep = |p: DVec3, at: DVec3| 0.6 / (1.0 + (p.distance(at) / 0.15).powi(6));
    for p in &mut face.points {
        *p *= 1.0 + nostrils.map(|at| steep(*p, at)).iter().sum::<f64>();
    }
    let open = |p: DVec3| nostrils.iter().any(|at| p.normalize().distance(*at) < 0.15);
    is(&face.without(open), Topology::Disk, 2);
}

#[test]
fn gaps_of_different_sizes() {
    let gap = |at: DVec3, size: f64| move |p: DVec3| p.distance(at) < size;
    let [a, b, c] = [
        DVec3::new(0.6, 0.0, 0.8),
        DVec3::new(-0.6, 0.0, 0.8),
        DVec3::new(0.0, -1.0, 0.0),
    ];
    let ball = Mesh::sphere([80, 60], 0.0, PI);
    let ball = ball
        .without(gap(a, 0.3))
        .without(gap(b, 0.2))
        .without(gap(c, 0.12));
    is(&ball, Topology::Sphere, 3);
    // Two holes near each other, or one at a third, of a bumpy sheet.
    let bumpy = Mesh::lattice([80, 80], [false, false], |u, v| {
        DVec3::new(u, v, 0.1 * (9.0 * u).sin() * (8.0 * v).cos())
    });
    let hole = |x: f64, y: f64| move |p: DVec3| (p.x - x).hypot(p.y - y) < 0.05;
    let pair = bumpy
        .clone()
        .without(hole(0.43, 0.5))
        .without(hole(0.57, 0.5));
    is(&pair, Topology::Disk, 2);
    is(&bumpy.without(hole(0.33, 0.33)), Topology::Disk, 1);
}

#[test]
fn tubes() {
    let window = |p: DVec3| p.distance(DVec3::new(1.0, 0.0, 2.0)) < 0.3;
    is(&tube(|_| 1.0), Topology::Tube, 0);
    is(&tube(|_| 0.1), Topology::Tube, 0);
    is(&tube(|v| 1.0 + v), Topology::Tube, 0);
    is(&tube(|_| 1.0).without(window), Topology::Tube, 1);
    // A barrel whose ends lean inward.
    is(
        &Mesh::sphere([60, 60], 0.15 * PI, 0.85 * PI),
        Topology::Tube,
        0,
    );
    let capped = shape(&tube(|_| 1.0), Some(Topology::Disk)).unwrap();
    assert_eq!((capped.openings.len(), capped.holes.len()), (1, 1));
    assert!(capped.reason.contains("as asked"));
}

#[test]
fn rings_and_what_one_surface_cannot_be() {
    is(&Mesh::torus([60, 30], 1.0, 0.4), Topology::Torus, 0);
    let refusal = |mesh: &Mesh, asked| match shape(mesh, asked) {
        Err(Error::Unsupported(text)) => text,
        other => panic!("{other:?}"),
    };
    let text = refusal(&Mesh::frame(2, 4), None);
    assert!(text.contains("2 handles (genus 2)"), "{text}");
    // Three arms, open at their ends.
    let arms = Mesh::cubes(4, |x, y, z| {
        z == 0 && ((y == 0 && x < 7) || (x == 3 && y < 4))
    })
    .without(|p| p.x < 0.1 || p.x > 6.9 || p.y > 3.9);
    let text = refusal(&arms, None);
    assert!(text.contains("branches: it has 3 openings"), "{text}");
    // A jug: a handle and a mouth.
    let jug = Mesh::cubes(4, |x, y, z| {
        (x < 3 && y < 3 && z < 4)
            || (x < 5 && y == 1 && (z == 0 || z == 2))
            || (x == 4 && y == 1 && z < 3)
    })
    .without(|p| p.z > 3.9);
    let text = refusal(&jug, None);
    assert!(text.contains("1 handle (genus 1) and 1 opening"), "{text}");
    for (mesh, asked) in [
        (Mesh::sphere([30, 20], 0.0, PI), Topology::Disk),
        (Mesh::sphere([30, 20], 0.0, PI), Topology::Torus),
        (Mesh::sphere([30, 20], 0.0, 1.0), Topology::Tube),
        (Mesh::torus([60, 30], 1.0, 0.4), Topology::Sphere),
    ] {
        let text = refusal(&mesh, Some(asked));
        assert!(
            text.contains(asked.name()) || text.contains("genus 1"),
            "{text}"
        );
    }
}
