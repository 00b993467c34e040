use super::*;
use crate::mass;
use crate::region::Region;
use crate::samples::{block, bowl, disk_with_hole, paraboloid, solid_cylinder};
use nurbskin_geometry::nurbs::{ControlNet, KnotVector, NurbsSurface, conic};
use std::collections::BTreeMap;

fn whole(surface: &NurbsSurface) -> Model {
    let mut model = Model::new("");
    let face = model.add_whole_surface(surface, 1e-9).unwrap();
    model.add_shell_of(face).unwrap();
    model
}

/// V - E + F and whether every side is used once in each direction.
fn topology(mesh: &ModelTessellation) -> (i64, bool) {
    let mut sides: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    for t in &mesh.triangles {
        for k in 0..3 {
            *sides.entry([t[k], t[(k + 1) % 3]]).or_default() += 1;
        }
    }
    let closed = sides
        .iter()
        .all(|(&[a, b], &n)| n == 1 && sides.contains_key(&[b, a]));
    let single = sides.values().all(|&n| n == 1);
    assert!(single, "a side used twice in one direction");
    let free = sides
        .keys()
        .filter(|&&[a, b]| !sides.contains_key(&[b, a]))
        .count();
    let edges = (sides.len() + free) / 2;
    let count = |n: usize| i64::try_from(n).unwrap();
    (
        count(mesh.points.len()) - count(edges) + count(mesh.triangles.len()),
        closed,
    )
}

/// Points lie on their surface, chords within the bound, triangles in the region.
fn sound(model: &Model, mesh: &ModelTessellation, tolerance: f64) {
    assert!(mesh.left_out.is_empty(), "{:?}", mesh.left_out);
    assert!(mesh.bound <= tolerance, "{} {tolerance}", mesh.bound);
    let regions: Vec<Region> = model
        .faces()
        .iter()
        .map(|f| Region::new(f).unwrap())
        .collect();
    for ((t, corners), &face) in mesh.triangles.iter().zip(&mesh.corners).zip(&mesh.faces) {
        let surface = &model.faces()[face as usize].surface;
        let places = corners.map(|k| mesh.parameters[k as usize]);
        let points = t.map(|k| mesh.points[k as usize]);
        for (place, point) in places.iter().zip(points) {
            assert!(surface.point(place.x, place.y).distance(point) < 1e-9);
        }
        for [a, b, c] in [
            [1., 1., 1.],
            [2., 1., 0.],
            [0., 2., 1.],
            [1., 0., 2.],
            [4., 1., 1.],
        ] {
            let sum = a + b + c;
            let place = (a * places[0] + b * places[1] + c * places[2]) / sum;
            let point = (a * points[0] + b * points[1] + c * points[2]) / sum;
            let miss = surface.point(place.x, place.y).distance(point);
            assert!(
                miss <= mesh.bound * (1.0 + 1e-9) + 1e-12,
                "{miss} {}",
                mesh.bound
            );
            // The chords of the border may be a little outside.
            let region = &regions[face as usize];
            assert!(region.contains(place) || region.nearest(place).distance < 2.0 * tolerance);
        }
        let [a, b, c] = points;
        let normal = mesh.normals[corners[0] as usize];
        let area = (b - a).cross(c - a);
        assert!(
            area.dot(normal) >= -1e-3 * area.length(),
            "a triangle that looks inwards"
        );
    }
}

#[test]
fn closed_surfaces_are_manifold_and_converge() {
    let axis = DVec3::new(1.0, 2.0, 2.0);
    let shapes = [
        (whole(&conic::sphere(axis, 2.0).unwrap()), 2),
        (whole(&conic::torus(axis, axis, 3.0, 1.0).unwrap()), 0),
        (solid_cylinder(), 2),
        (block(axis), 2),
    ];
    for (model, euler) in shapes {
        let exact = mass(&model).unwrap();
        let mut before = f64::INFINITY;
        for tolerance in [0.3, 0.1, 0.01] {
            let mesh = tessellate(&model, tolerance, 1_000_000).unwrap();
            sound(&model, &mesh, tolerance);
            assert_eq!(topology(&mesh), (euler, true), "{} {tolerance}", model.name);
            let (area, volume) = (
                mesh.area() / exact.area,
                mesh.volume() / exact.volume.unwrap(),
            );
            let miss = (area - 1.0).abs().max((volume - 1.0).abs());
            assert!(
                miss <= tolerance.max(1e-12) && miss <= before,
                "{miss} {tolerance}"
            );
            before = miss.max(1e-12);
        }
    }
}

#[test]
fn a_disk_with_a_hole_has_one() {
    let model = disk_with_hole([2.0, 1.0], [0.0, 0.5]);
    for tolerance in [0.1, 0.001] {
        let mesh = tessellate(&model, tolerance, 100_000).unwrap();
        sound(&model, &mesh, tolerance);
        assert_eq!(topology(&mesh), (0, false));
        let exact = 3.0 * std::f64::consts::PI;
        assert!((mesh.area() - exact).abs() < 2.0 * tolerance * 6.0 * std::f64::consts::PI);
    }
    // One ring turned inside out, as by a reversed face.
    let mut face = model.faces()[0].clone();
    face.reversed = true;
    let mut turned = Model::new("");
    model
        .vertices()
        .iter()
        .for_each(|&p| _ = turned.add_vertex(p).unwrap());
    for edge in model.edges() {
        turned
            .add_edge(edge.curve.as_ref().unwrap(), edge.start, edge.end)
            .unwrap();
    }
    turned.add_face(face).unwrap();
    let mesh = tessellate(&turned, 0.01, 100_000).unwrap();
    sound(&turned, &mesh, 0.01);
    assert!(mesh.normals.iter().all(|n| n.z < -0.99));
}

#[test]
fn creases_are_kept_and_limits_hold() {
    // A bilinear zigzag: every knot line is a crease, and the trimming circles cross them.
    let knots = KnotVector::uniform(1, 9).unwrap();
    let net = ControlNet::from_fn(9, 9, |i, j| {
        let z = f64::from(u8::from(i % 2 == 0)) * 0.5;
        DVec3::new(1.25 * i as f64 - 5.0, 1.25 * j as f64 - 5.0, z)
    });
    let surface = NurbsSurface::new(knots.clone(), knots, net.unwrap(), None).unwrap();
    let model = whole(&surface);
    let mesh = tessellate(&model, 0.01, 10_000).unwrap();
    sound(&model, &mesh, 0.01);
    assert!((mesh.area() - mass(&model).unwrap().area).abs() < 1e-9);
    let sphere = whole(&conic::sphere(DVec3::ZERO, 1.0).unwrap());
    assert!(tessellate(&sphere, 1e-5, 1000).is_err());
    assert!(tessellate(&sphere, 0.0, 1000).is_err());
    assert!(tessellate(&sphere, f64::NAN, 1000).is_err());
}

#[test]
fn cells_and_bands_fit_together() {
    let model = bowl();
    let exact = mass(&model).unwrap().area;
    for tolerance in [0.1, 0.01, 4e-4] {
        let mesh = tessellate(&model, tolerance, 100_000).unwrap();
        sound(&model, &mesh, tolerance);
        // One hole: the common edge is closed.
        assert_eq!(topology(&mesh), (0, false));
        let miss = (mesh.area() / exact - 1.0).abs();
        assert!(miss < 3.0 * tolerance, "{miss} {tolerance}");
        if tolerance < 1e-3 {
            // Not many more triangles than the area needs with cells of the whole surface.
            let whole = nurbskin_geometry::nurbs::tessellate::tessellate(
                &paraboloid(1),
                tolerance,
                1_000_000,
            );
            let share = 0.9 * whole.unwrap().triangles.len() as f64;
            let count = mesh.triangles.len() as f64;
            assert!(count < 1.3 * share, "{count} {share}");
        }
    }
    // The same, whatever was computed at once.
    let again = tessellate(&model, 0.01, 100_000).unwrap();
    assert_eq!(again, tessellate(&model, 0.01, 100_000).unwrap());
}

#[test]
fn knots_that_differ_by_rounding_are_one() {
    // A parabolic arch whose first knots stand for 0 twice: the span between them is a point.
    let noisy = vec![-1e-15, -1e-15, -1e-15, 0.0, 0.0, 1.0, 1.0, 1.0];
    let line = KnotVector::uniform(1, 2).unwrap();
    let net = ControlNet::from_fn(5, 2, |i, j| {
        let k = i.saturating_sub(2) as f64;
        DVec3::new(k, 3.0 * j as f64, k * (2.0 - k))
    });
    let knots = KnotVector::new(2, noisy).unwrap();
    let model = whole(&NurbsSurface::new(knots, line, net.unwrap(), None).unwrap());
    let mesh = tessellate(&model, 0.01, 10_000).unwrap();
    assert!(
        mesh.left_out.is_empty() && mesh.bound <= 0.01,
        "{}",
        mesh.bound
    );
    assert!(mesh.triangles.len() < 50, "{}", mesh.triangles.len());
    assert_eq!(topology(&mesh), (1, false));
}
