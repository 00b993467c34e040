use super::system::Links;
use super::{CrossField, Principal, cross_field, field_of, principal_curvatures};
use glam::{DMat3, DQuat, DVec3};
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::progress::Silent;
use nurbskin_scan::mesh::Manifold;
use nurbskin_scan::mesh::repair::repair;
use nurbskin_scan::mesh::samples::Mesh;
use std::f64::consts::{PI, TAU};

fn manifold(mesh: &Mesh) -> Manifold {
    repair(&mesh.points, &mesh.triangles, &Silent)
        .unwrap()
        .manifold
}

fn field(mesh: &Manifold) -> CrossField {
    cross_field(mesh, &vec![false; 3 * mesh.triangles.len()])
}

fn centre(mesh: &Manifold, t: usize) -> DVec3 {
    mesh.corners(t).iter().sum::<DVec3>() / 3.0
}

/// Angle in degrees between the lines along two unit vectors.
fn between(a: DVec3, b: DVec3) -> f64 {
    a.dot(b).abs().min(1.0).acos().to_degrees()
}

/// Angle in degrees of the nearest arm of a cross to a direction.
fn off(field: &CrossField, t: usize, direction: DVec3) -> f64 {
    let angle = between(field.arms[t], direction);
    angle.min(90.0 - angle)
}

fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    quantile_in_place(&mut values, share)
}

#[test]
fn cylinder() {
    let radius = 2.0;
    let mesh = manifold(&Mesh::lattice([60, 24], [true, false], |u, v| {
        DVec3::new(radius * (TAU * u).cos(), radius * (TAU * u).sin(), 5.0 * v)
    }));
    let field = field(&mesh);
    for t in 0..mesh.triangles.len() {
        let c = centre(&mesh, t);
        let round = DVec3::new(-c.y, c.x, 0.0).normalize();
        let k = field.principal[t];
        assert!(between(k.direction, round) < 3.5, "triangle {t}");
        assert!(
            (k.k1 * radius - 1.0).abs() < 0.03 && (k.k2 * radius).abs() < 0.01,
            "{k:?}"
        );
        assert!(off(&field, t, DVec3::Z) < 0.5);
        assert!(field.strength[t] > 0.5);
        let [a, b] = field.curvature[t];
        assert!((a.max(b) * radius - 1.0).abs() < 0.03 && a.min(b) * radius < 0.01);
        // The larger of the two is along the arm that runs round.
        assert_eq!(a > b, between(field.arms[t], round) < 45.0);
    }
}

#[test]
fn torus() {
    let (large, small) = (1.0, 0.3);
    let mesh = manifold(&Mesh::torus([80, 32], large, small));
    let field = field(&mesh);
    for t in 0..mesh.triangles.len() {
        let c = centre(&mesh, t);
        let round = DVec3::new(-c.y, c.x, 0.0).normalize();
        let k = field.principal[t];
        let outer = (c.truncate().length() - large) / c.truncate().length() / small;
        assert!((k.k1 * small - 1.0).abs() < 0.08, "{k:?}");
        // The diffusion over 0.075 rounds the second curvature off, which varies from -1.4 to 0.77.
        assert!((k.k2 - outer).abs() < 0.25, "{} {outer}", k.k2);
        assert!(between(k.direction, round) > 85.0);
        assert!(off(&field, t, round) < 1.0);
    }
}

#[test]
fn sphere_determines_no_direction() {
    let mesh = manifold(&Mesh::sphere([64, 32], 0.0, PI));
    let field = field(&mesh);
    let k: Vec<f64> = field.principal.iter().flat_map(|k| [k.k1, k.k2]).collect();
    assert!(
        (quantile(k.clone(), 0.05) - 1.0).abs() < 0.05 && (quantile(k, 0.95) - 1.0).abs() < 0.08
    );
    assert!(quantile(field.strength, 0.9) < 0.2);
}

/// Principal direction of the larger curvature of an ellipsoid at a point of it, and both curvatures.
fn of_ellipsoid(axes: DVec3, p: DVec3) -> Principal {
    // The shape operator is the Hessian of Σ (x/a)² on the tangent plane, over the length of the gradient.
    let gradient = p / (axes * axes);
    let [n, scale] = [gradient.normalize(), DVec3::splat(gradient.length())];
    let (u, v) = n.any_orthonormal_pair();
    let form = |a: DVec3, b: DVec3| (a * b / (axes * axes) / scale).element_sum();
    let [a, b, c] = [form(u, u), form(u, v), form(v, v)];
    let angle = 0.5 * (2.0 * b).atan2(a - c);
    let half = (0.5 * (a - c)).hypot(b);
    Principal {
        direction: angle.cos() * u + angle.sin() * v,
        k1: 0.5 * (a + c) + half,
        k2: 0.5 * (a + c) - half,
    }
}

fn ellipsoid(axes: DVec3) -> Manifold {
    let mut mesh = Mesh::sphere([96, 64], 0.0, PI);
    mesh.points.iter_mut().for_each(|p| *p *= axes);
    manifold(&mesh)
}

#[test]
fn ellipsoid_follows_its_lines_of_curvature() {
    let axes = DVec3::new(3.0, 2.0, 1.0);
    let mesh = ellipsoid(axes);
    let field = field(&mesh);
    let mut angles = Vec::new();
    let mut relative = Vec::new();
    for t in 0..mesh.triangles.len() {
        let c = centre(&mesh, t);
        let place = c / (c / axes).length();
        let exact = of_ellipsoid(axes, place);
        let k = field.principal[t];
        if exact.k1 > 1.5 * exact.k2 {
            angles.push(off(&field, t, exact.direction));
            relative.push((k.k1 / exact.k1 - 1.0).abs());
        }
    }
    assert!(angles.len() > mesh.triangles.len() / 2);
    let figures = [0.5, 0.95].map(|q| [quantile(angles.clone(), q), quantile(relative.clone(), q)]);
    assert!(figures[0][0] < 1.0 && figures[1][0] < 5.0, "{figures:?}");
    assert!(figures[0][1] < 0.05 && figures[1][1] < 0.15, "{figures:?}");
}

#[test]
fn turned_mesh_turned_field() {
    let mesh = ellipsoid(DVec3::new(3.0, 2.0, 1.0));
    let turn = DMat3::from_quat(DQuat::from_axis_angle(
        DVec3::new(1.0, 2.0, -0.5).normalize(),
        1.1,
    ));
    let mut turned = mesh.clone();
    turned
        .points
        .iter_mut()
        .for_each(|p| *p = turn * *p + DVec3::new(5.0, -3.0, 2.0));
    // The box is along the axes, so its diagonal changes: compared at the same one.
    let mut links = Links::new(&turned, &[]);
    links.diagonal = Links::new(&mesh, &[]).diagonal;
    let [a, b] = [field(&mesh), field_of(&links)];
    for t in 0..mesh.triangles.len() {
        assert!((a.strength[t] - b.strength[t]).abs() < 1e-6);
        if a.strength[t] > 0.05 {
            assert!(off(&b, t, turn * a.arms[t]) < 1e-3);
        }
        assert!((a.principal[t].k1 - b.principal[t].k1).abs() < 1e-8);
    }
}

#[test]
fn order_of_triangles_does_not_matter() {
    let mesh = ellipsoid(DVec3::new(3.0, 2.0, 1.0));
    let count = mesh.triangles.len();
    // 7919 is a prime and does not divide the count.
    let order: Vec<usize> = (0..count).map(|t| t * 7919 % count).collect();
    let mut other = mesh.clone();
    other.triangles = order
        .iter()
        .map(|&t| {
            let mut corners = mesh.triangles[t];
            corners.rotate_left(t % 3);
            corners
        })
        .collect();
    let [a, b] = [field(&mesh), field(&other)];
    for (place, &t) in order.iter().enumerate() {
        assert!((a.strength[t] - b.strength[place]).abs() < 1e-6);
        if a.strength[t] > 0.05 {
            assert!(off(&b, place, a.arms[t]) < 1e-3);
        }
        assert!((a.principal[t].k2 - b.principal[place].k2).abs() < 1e-8);
    }
    assert_eq!(field(&mesh), a);
}

#[test]
fn hard_edges_align_and_cut() {
    // A box: without hard edges the diffusion rounds its edges off; with them its sides are flat.
    let mesh = manifold(&Mesh::cubes(8, |x, y, z| x < 2 && y < 1 && z < 1));
    let adjacency = mesh.adjacency();
    let normal = |side: usize| mesh.vector_area(side / 3).normalize();
    let sides = adjacency.opposite.iter().enumerate();
    let hard: Vec<bool> = sides
        .map(|(side, &other)| normal(side).dot(normal(other as usize)) < 0.5)
        .collect();
    let cut = cross_field(&mesh, &hard);
    for t in 0..mesh.triangles.len() {
        assert!(cut.principal[t].k1.abs() < 1e-9);
        let axis = [DVec3::X, DVec3::Y, DVec3::Z];
        let n = normal(3 * t);
        let along = axis.into_iter().find(|a| a.dot(n).abs() < 0.5).unwrap();
        assert!(off(&cut, t, along) < 1e-4);
    }
    let round = principal_curvatures(&mesh, &[], 0.1);
    assert!(round.iter().any(|k| k.k1 > 1.0));
}

#[test]
fn needles_and_points_without_extent() {
    assert_eq!(
        cross_field(&Manifold::default(), &[]),
        CrossField::default()
    );
    let mesh = Manifold {
        points: vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0, DVec3::X * 3.0],
        source: vec![None; 4],
        triangles: vec![[0, 1, 2], [2, 1, 3]],
        loops: vec![],
    };
    let field = field(&mesh);
    assert!(field.arms.iter().all(|a| (a.length() - 1.0).abs() < 1e-12));
    assert!(field.strength.iter().all(|s| s.is_finite()));
    let mut broken = mesh;
    broken.points[1] = DVec3::NAN;
    assert_eq!(cross_field(&broken, &[]).arms.len(), 2);
}
