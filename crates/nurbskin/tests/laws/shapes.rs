//! Analytic shapes: implicit equations, curvatures, finite differences, closure, triangles.

#![expect(clippy::unwrap_used, reason = "a panic is how a test fails")]

use nurbskin::nurbs::Direction;
use nurbskin::nurbs::conic::{arc, circle, cone, cylinder, ellipse, revolve, sphere, torus};
use nurbskin::nurbs::shape::Edge;
use nurbskin::nurbs::tessellate::{Tessellation, tessellate};
use nurbskin::{ControlNet, DVec3, KnotVector, NurbsCurve, NurbsSurface};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// Parameters over the domain, knots and ends among them.
fn places(surface: &NurbsSurface, count: usize) -> Vec<(f64, f64)> {
    let [(a, b), (c, d)] = surface.domain();
    let at = |k: usize, a: f64, b: f64| a + (b - a) * k as f64 / count as f64;
    (0..=count)
        .flat_map(|l| (0..=count).map(move |k| (at(k, a, b), at(l, c, d))))
        .collect()
}

/// Largest |f| over the surface.
fn worst(surface: &NurbsSurface, f: impl Fn(DVec3) -> f64) -> f64 {
    let places = places(surface, 24);
    places
        .iter()
        .map(|&(u, v)| f(surface.point(u, v)).abs())
        .fold(0.0, f64::max)
}

#[test]
fn conics_fulfil_their_equations() {
    let (centre, axis) = (DVec3::new(3.0, -2.0, 1.0), DVec3::new(1.0, 2.0, -2.0) / 3.0);
    let ball = sphere(centre, 2.5).unwrap();
    assert_eq!(ball.control_points().counts(), [9, 5]);
    assert!(worst(&ball, |p| p.distance(centre) - 2.5) < 1e-13 * 5.0);
    let from_axis = |p: DVec3| (p - centre).reject_from_normalized(axis).length();
    let along = |p: DVec3| (p - centre).dot(axis);
    let pipe = cylinder(centre, 4.0 * axis, 1.5).unwrap();
    assert!(worst(&pipe, |p| from_axis(p) - 1.5) < 1e-13 * 4.0);
    let tip = cone(centre, 4.0 * axis, 1.5, 0.0).unwrap();
    assert!(worst(&tip, |p| from_axis(p) - 1.5 * (1.0 - along(p) / 4.0)) < 1e-13 * 4.0);
    let ring = torus(centre, 7.0 * axis, 3.0, 1.0).unwrap();
    let equation = |p: DVec3| (from_axis(p) - 3.0).hypot(along(p)) - 1.0;
    assert!(worst(&ring, equation) < 1e-13 * 8.0);
    let oval = ellipse(centre, 3.0 * DVec3::X, 0.5 * DVec3::Y).unwrap();
    for k in 0..=100 {
        let p = oval.point(f64::from(k) / 100.0) - centre;
        assert!(((p.x / 3.0).powi(2) + (p.y / 0.5).powi(2) - 1.0).abs() < 1e-13);
    }
    let round = circle(centre, axis, 2.0).unwrap();
    assert_eq!(round.point(0.0), round.point(1.0));
    let [_, velocity, _] = round.derivatives(0.1);
    let outwards = round.point(0.1) - centre;
    assert!(
        outwards.cross(velocity).dot(axis) > 0.0,
        "counter-clockwise"
    );
}

#[test]
fn bad_conics_are_refused() {
    let (o, x, y) = (DVec3::ZERO, DVec3::X, DVec3::Y);
    assert!(arc(o, x, y, 0.0, 0.0).is_err());
    assert!(arc(o, x, y, 1.0, 0.5).is_err());
    assert!(arc(o, x, y, 0.0, 6.3).is_err());
    assert!(arc(o, x, y, 0.0, f64::NAN).is_err());
    assert!(arc(o, x * f64::INFINITY, y, 0.0, 1.0).is_err());
    assert!(circle(o, o, 1.0).is_err());
    assert!(sphere(o, -1.0).is_err());
    assert!(torus(o, x, 1.0, 2.0).is_err());
    assert!(cone(o, x, 0.0, 0.0).is_err());
    assert!(cylinder(o, x, f64::NAN).is_err());
}

#[test]
fn shapes_close_and_have_poles() {
    let ball = sphere(DVec3::new(1e3, -2e3, 5e3), 2.0).unwrap();
    assert!(ball.is_closed(Direction::U, 1e-11) && !ball.is_closed(Direction::V, 1.0));
    assert_eq!(
        Edge::ALL.map(|edge| ball.is_pole(edge, 1e-11)),
        [false, false, true, true]
    );
    let ring = torus(DVec3::ZERO, DVec3::Z, 3.0, 1.0).unwrap();
    assert!(
        Direction::BOTH
            .iter()
            .all(|&direction| ring.is_closed(direction, 1e-14))
    );
    assert!(!Edge::ALL.iter().any(|&edge| ring.is_pole(edge, 0.9)));
    let tip = cone(DVec3::ZERO, DVec3::Z, 1.0, 0.0).unwrap();
    assert!(tip.is_pole(Edge::VMax, 1e-15) && !tip.is_pole(Edge::VMin, 0.9));
    // Smooth across the seam although the parameters are not: a circle of double knots.
    let jumps = ring.seam_jumps(Direction::U);
    assert!(jumps.position < 1e-14 && jumps.normal_angle < 1e-14 && jumps.curvature < 1e-13);
    let jumps = ring.knot_jumps(Direction::V, 0.25).unwrap();
    assert!(jumps.position < 1e-14 && jumps.normal_angle < 1e-14 && jumps.curvature < 1e-12);
    assert!(ring.knot_jumps(Direction::V, 0.0).is_err());
}

#[test]
fn jumps_see_creases_and_smooth_seams() {
    // |x| as a piecewise linear surface: the first derivative jumps from -2 to 2 per unit of u.
    let knots = KnotVector::uniform(1, 3).unwrap();
    let roof = ControlNet::from_fn(3, 2, |i, j| {
        let x = i as f64 - 1.0;
        DVec3::new(x, j as f64, x.abs())
    });
    let across = KnotVector::uniform(1, 2).unwrap();
    let roof = NurbsSurface::new(knots, across, roof.unwrap(), None).unwrap();
    let jumps = roof.knot_jumps(Direction::U, 0.5).unwrap();
    assert!((jumps.first - 4.0).abs() < 1e-14 && jumps.position == 0.0);
    assert!((jumps.normal_angle - PI / 2.0).abs() < 1e-14 && jumps.curvature == 0.0);
    assert!(roof.seam_jumps(Direction::U).position > 1.9);
    // A periodic cubic tube: C2 across the seam, exactly as across any knot, also when clamped.
    let around = KnotVector::periodic(3, &[0.0, 1.0, 2.5, 3.0, 4.0, 5.5, 6.0]).unwrap();
    let along = KnotVector::uniform(2, 4).unwrap();
    let net = ControlNet::from_fn(9, 4, |i, j| {
        let a = (i % 6) as f64;
        DVec3::new(a.cos() * 2.0, a.sin(), j as f64 + 0.1 * a.sin())
    });
    let tube = NurbsSurface::new(around, along, net.unwrap(), None).unwrap();
    for surface in [tube.clone(), tube.clamped().unwrap()] {
        let jumps = surface.seam_jumps(Direction::U);
        let largest = jumps.position.max(jumps.first).max(jumps.second);
        assert!(largest < 1e-13 && jumps.curvature < 1e-13, "{jumps:?}");
        assert!(surface.is_closed(Direction::U, 1e-14));
    }
}

#[test]
fn curvatures_of_analytic_shapes() {
    let ball = sphere(DVec3::ONE, 2.0).unwrap();
    let ring = torus(DVec3::ZERO, DVec3::Z, 3.0, 1.0).unwrap();
    let pipe = cylinder(DVec3::ZERO, DVec3::Z, 0.5).unwrap();
    for (u, v) in places(&ball, 11) {
        let normal = ball.normal(u, v).unwrap();
        assert!(normal.distance((ball.point(u, v) - DVec3::ONE) / 2.0) < 1e-13);
        let pole = v * (1.0 - v) <= 0.0;
        assert_eq!(ball.curvature(u, v).is_none(), pole);
        if let Some(c) = ball.curvature(u, v) {
            assert!(c.principal.iter().all(|k| (k + 0.5).abs() < 1e-11));
            assert!((c.gaussian - 0.25).abs() < 1e-11 && (c.mean + 0.5).abs() < 1e-11);
        }
    }
    for (u, v) in places(&ring, 11) {
        let c = ring.curvature(u, v).unwrap();
        let p = ring.point(u, v);
        let cosine = p.x.hypot(p.y) - 3.0;
        let around = -cosine / (3.0 + cosine);
        let expected = [around.max(-1.0), around.min(-1.0)];
        assert!((c.principal[0] - expected[0]).abs() < 1e-12);
        assert!((c.principal[1] - expected[1]).abs() < 1e-12);
        assert!((c.gaussian + around).abs() < 1e-12);
        // The larger curvature runs around the axis.
        let tangent = DVec3::Z.cross(p).normalize();
        assert!((c.directions[0].dot(tangent).abs() - 1.0).abs() < 1e-12);
        assert!(c.directions[0].cross(c.directions[1]).distance(c.normal) < 1e-14);
        let area = c.first[0] * c.first[2] - c.first[1] * c.first[1];
        let second = c.second[0] * c.second[2] - c.second[1] * c.second[1];
        assert!((second / area - c.gaussian).abs() < 1e-11);
    }
    let c = pipe.curvature(0.3, 0.4).unwrap();
    assert!(c.principal[0].abs() < 1e-14 && (c.principal[1] + 2.0).abs() < 1e-13);
    assert!((c.directions[0].dot(DVec3::Z).abs() - 1.0).abs() < 1e-14);
}

#[test]
fn normals_where_tangents_vanish() {
    let tip = cone(DVec3::ZERO, DVec3::Z, 1.0, 0.0).unwrap();
    // At the tip the normal is that of the line that leads there.
    for u in [0.0, 0.2, 0.77] {
        let (near, at) = (tip.normal(u, 0.5).unwrap(), tip.normal(u, 1.0).unwrap());
        assert!(near.distance(at) < 1e-13);
        assert!(at.z > 0.0);
    }
    // A surface squeezed into a line has no normal.
    let knots = KnotVector::uniform(1, 2).unwrap();
    let line = ControlNet::from_fn(2, 2, |i, _| DVec3::new(i as f64, 0.1, 0.3)).unwrap();
    let line = NurbsSurface::new(knots.clone(), knots.clone(), line, None).unwrap();
    assert_eq!(line.normal(0.4, 0.4), None);
    assert_eq!(line.curvature(0.4, 0.4), None);
    let point = ControlNet::from_fn(2, 2, |_, _| DVec3::new(0.7, 0.1, 0.3)).unwrap();
    let point = NurbsSurface::new(knots.clone(), knots, point, None).unwrap();
    assert_eq!(point.normal(0.4, 0.4), None);
}

/// Number of triangles at each edge, and whether neighbours run it in opposite directions.
fn edge_counts(mesh: &Tessellation) -> (usize, usize) {
    let mut edges: BTreeMap<(u32, u32), (usize, usize)> = BTreeMap::new();
    for t in &mesh.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            let count = edges.entry((a.min(b), a.max(b))).or_default();
            if a < b {
                count.0 += 1;
            } else {
                count.1 += 1;
            }
        }
    }
    assert!(
        edges.values().all(|&(x, y)| x <= 1 && y <= 1),
        "not a manifold"
    );
    let open = edges.values().filter(|&&(x, y)| x + y == 1).count();
    (edges.len(), open)
}

fn euler(mesh: &Tessellation) -> isize {
    let (edges, _) = edge_counts(mesh);
    let signed = |n: usize| isize::try_from(n).unwrap();
    signed(mesh.points.len()) - signed(edges) + signed(mesh.triangles.len())
}

#[test]
fn closed_shapes_become_closed_meshes() {
    let ball = tessellate(&sphere(DVec3::ONE, 2.0).unwrap(), 0.01, 100_000).unwrap();
    assert_eq!((euler(&ball), edge_counts(&ball).1), (2, 0));
    let ring = torus(DVec3::ZERO, DVec3::Z, 3.0, 1.0).unwrap();
    let ring = tessellate(&ring, 0.01, 100_000).unwrap();
    assert_eq!((euler(&ring), edge_counts(&ring).1), (0, 0));
    let pipe = tessellate(
        &cylinder(DVec3::ZERO, DVec3::Z, 1.0).unwrap(),
        0.01,
        100_000,
    )
    .unwrap();
    assert_eq!(euler(&pipe), 0);
    let coarse = tessellate(
        &cylinder(DVec3::ZERO, DVec3::Z, 1.0).unwrap(),
        10.0,
        100_000,
    )
    .unwrap();
    assert_eq!(euler(&coarse), 0);
    for (mesh, centre) in [
        (&ball, DVec3::ONE),
        (&ring, DVec3::ZERO),
        (&pipe, DVec3::ZERO),
    ] {
        let mut volume = 0.0;
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.points[i as usize] - centre);
            volume += a.dot(b.cross(c)) / 6.0;
            let normal = (b - a).cross(c - a).normalize();
            assert!(
                t.iter()
                    .all(|&i| normal.dot(mesh.normals[i as usize]) > 0.9)
            );
        }
        assert!(volume > 0.0, "outwards");
    }
    // The tolerance is used: 23 equal chords would do, and the parameter of a rational circle is uneven.
    let columns = pipe.points.len() / 2;
    assert!((23..=40).contains(&columns), "{columns}");
}

#[test]
fn too_many_triangles_are_an_error() {
    let ball = sphere(DVec3::ZERO, 1.0).unwrap();
    let message = tessellate(&ball, 1e-9, 10_000).unwrap_err().to_string();
    assert!(message.contains("10000"), "{message}");
    assert!(tessellate(&ball, 1e-300, usize::MAX).is_err());
    assert!(tessellate(&ball, 0.0, 10_000).is_err());
    assert!(tessellate(&ball, f64::NAN, 10_000).is_err());
}

/// Largest distance of the surface from the triangles at equal parameters, where the mesh is a plain grid.
fn chordal_error(surface: &NurbsSurface, mesh: &Tessellation) -> f64 {
    let mut worst = 0.0_f64;
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| i as usize);
        for (x, y) in [
            (0.5, 0.5),
            (0.5, 0.0),
            (0.0, 0.5),
            (1.0 / 3.0, 1.0 / 3.0),
            (0.1, 0.2),
        ] {
            let z = 1.0 - x - y;
            let point = x * mesh.points[a] + y * mesh.points[b] + z * mesh.points[c];
            let uv = x * mesh.parameters[a] + y * mesh.parameters[b] + z * mesh.parameters[c];
            worst = worst.max(surface.point(uv.x, uv.y).distance(point));
        }
    }
    worst
}

fn random_surface(p: usize, q: usize, rational: bool, values: &[f64]) -> NurbsSurface {
    let mut values = values.iter().copied().cycle();
    let mut next = || values.next().unwrap();
    let knots = |p: usize| KnotVector::clamped(p, &[0.0, 0.3, 1.0, 1.2]).unwrap();
    let [m, n] = [p + 3, q + 3];
    let points = (0..m * n)
        .map(|k| {
            DVec3::new(
                (k % m) as f64 + next(),
                (k / m) as f64 + next(),
                2.0 * next(),
            )
        })
        .collect();
    let weights = rational.then(|| (0..m * n).map(|_| 0.5 + next()).collect());
    let net = ControlNet::new(m, n, points).unwrap();
    NurbsSurface::new(knots(p), knots(q), net, weights).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn triangles_stay_within_their_bound(
        p in 1_usize..=4,
        q in 1_usize..=4,
        rational: bool,
        values in prop::collection::vec(0.0..1.0_f64, 37),
        log in -2.0..0.0_f64,
    ) {
        let surface = random_surface(p, q, rational, &values);
        let tolerance = 10.0_f64.powf(log);
        let mesh = tessellate(&surface, tolerance, 10_000_000).unwrap();
        let error = chordal_error(&surface, &mesh);
        prop_assert!(mesh.bound <= tolerance);
        prop_assert!(error <= mesh.bound + 1e-13, "{error} > {}", mesh.bound);
        prop_assert_eq!(euler(&mesh), 1);
    }

    #[test]
    fn arcs_keep_their_radius(start in -10.0..10.0_f64, sweep in 1e-3..TAU) {
        let arc = arc(DVec3::ZERO, DVec3::X, DVec3::Y, start, start + sweep).unwrap();
        for k in 0..=40 {
            prop_assert!((arc.point(f64::from(k) / 40.0).length() - 1.0).abs() < 1e-14);
        }
        let end = DVec3::new((start + sweep).cos(), (start + sweep).sin(), 0.0);
        prop_assert!(arc.point(1.0).distance(end) < 1e-14);
    }

    #[test]
    fn revolved_profiles_keep_their_distance_from_the_axis(
        values in prop::collection::vec(0.1..1.0_f64, 23),
        sweep in 0.1..TAU,
    ) {
        let at = |k: usize| values[k % values.len()];
        let axis = DVec3::new(at(0), at(1), at(2)).normalize();
        let origin = DVec3::new(at(3), at(4), at(5));
        let points = (0..5).map(|k| DVec3::new(at(3 * k + 6), at(3 * k + 7), at(3 * k + 8)) * 3.0);
        let weights = (0..5).map(|k| at(k + 11)).collect();
        let knots = KnotVector::clamped(3, &[0.0, 0.4, 1.0]).unwrap();
        let profile = NurbsCurve::new(knots, points.collect(), Some(weights)).unwrap();
        let surface = revolve(&profile, origin, axis, sweep).unwrap();
        for (u, v) in places(&surface, 9) {
            let (p, c) = (surface.point(u, v) - origin, profile.point(v) - origin);
            prop_assert!((p.dot(axis) - c.dot(axis)).abs() < 1e-13 * 5.0);
            prop_assert!((p.length() - c.length()).abs() < 1e-13 * 5.0);
        }
        prop_assert!(surface.point(0.0, 0.3).distance(profile.point(0.3)) < 1e-13 * 5.0);
    }

    #[test]
    fn derivatives_are_limits_of_differences(
        p in 1_usize..=6,
        q in 1_usize..=6,
        rational: bool,
        values in prop::collection::vec(0.0..1.0_f64, 31),
        u in 0.32..0.98_f64,
        v in 0.32..0.98_f64,
    ) {
        let surface = random_surface(p, q, rational, &values);
        let d = surface.derivatives(u, v);
        let h = 1e-4;
        let s = |du: f64, dv: f64| surface.point(u + du * h, v + dv * h);
        let size = [d.du, d.dv, d.duu, d.duv, d.dvv].map(DVec3::length).into_iter().fold(1.0, f64::max);
        let close = |exact: DVec3, difference: DVec3| exact.distance(difference) < 1e-4 * size;
        prop_assert!(close(d.du, (s(1., 0.) - s(-1., 0.)) / (2.0 * h)));
        prop_assert!(close(d.dv, (s(0., 1.) - s(0., -1.)) / (2.0 * h)));
        prop_assert!(close(d.duu, (s(1., 0.) - 2.0 * d.point + s(-1., 0.)) / (h * h)));
        prop_assert!(close(d.dvv, (s(0., 1.) - 2.0 * d.point + s(0., -1.)) / (h * h)));
        let mixed = s(1., 1.) - s(1., -1.) - s(-1., 1.) + s(-1., -1.);
        prop_assert!(close(d.duv, mixed / (4.0 * h * h)));
        // The normal turns by the shape operator: dn = -k dx along a principal direction.
        if let Some(c) = surface.curvature(u, v) {
            let (e, f, g) = (c.first[0], c.first[1], c.first[2]);
            let x = c.directions[0];
            let (a, b) = (x.dot(d.du), x.dot(d.dv));
            let area = e * g - f * f;
            let (step_u, step_v) = ((a * g - b * f) / area, (b * e - a * f) / area);
            let long = step_u.abs().max(step_v.abs());
            let n = |k: f64| surface.normal(u + k * h * step_u / long, v + k * h * step_v / long);
            if let (Some(after), Some(before)) = (n(1.0), n(-1.0)) {
                let turn = (after - before) * long / (2.0 * h);
                let scale = 1.0 + c.principal[0].abs().max(c.principal[1].abs());
                prop_assert!(turn.distance(-c.principal[0] * x) < 1e-3 * scale.powi(3) * (1.0 + size));
            }
        }
    }
}
