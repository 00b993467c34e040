use super::*;
use crate::samples::{block, bowl, disk_with_hole, solid_cylinder};
use nurbskin_geometry::nurbs::conic;
use nurbskin_geometry::progress::Silent;

/// Points of a model on a grid of its faces and along its edges, and how far apart they are at most.
fn samples(model: &Model, count: usize) -> Vec<DVec3> {
    let mut all = Vec::new();
    for face in model.faces() {
        let region = Region::new(face).unwrap();
        let [(a, b), (c, d)] = face.surface.domain();
        for j in 0..=count {
            for i in 0..=count {
                let [s, t] = [i, j].map(|k| k as f64 / count as f64);
                let place = DVec2::new(a + s * (b - a), c + t * (d - c));
                if region.contains(place) {
                    all.push(face.surface.point(place.x, place.y));
                }
            }
        }
    }
    for curve in model.edges().iter().filter_map(|e| e.curve.as_ref()) {
        let (a, b) = curve.domain();
        all.extend((0..=count).map(|k| curve.point(a + (b - a) * k as f64 / count as f64)));
    }
    all
}

/// A point of a spiral that fills a cube of this half width.
fn spread(k: usize, half: f64) -> DVec3 {
    let k = k as f64;
    half * DVec3::new((1.7 * k).sin(), (2.9 * k).cos(), (0.9 * k).sin())
}

#[test]
fn brackets_hold_the_distance_to_trimmed_faces() {
    for (model, half) in [
        (bowl(), 1.3),
        (disk_with_hole([4.0, 1.0], [0.0, 1.0]), 5.0),
        (solid_cylinder(), 3.0),
        (block(DVec3::new(1.0, 2.0, 3.0)), 4.0),
    ] {
        let count = 300;
        let samples = samples(&model, count);
        let target = ClosestOnModel::new(&model).unwrap();
        for k in 0..120 {
            let p = spread(k, half);
            let brute = samples
                .iter()
                .map(|s| s.distance(p))
                .fold(f64::INFINITY, f64::min);
            let found = target.closest(p).unwrap().foot;
            // A sample is within the diagonal of a cell of the grid.
            let cell = 4.0 * half / count as f64;
            assert!(
                found.distance <= brute + 1e-9,
                "{p}: {} {brute}",
                found.distance
            );
            assert!(
                found.distance >= brute - cell,
                "{p}: {} {brute}",
                found.distance
            );
            assert!(found.distance - found.lower < 1e-8, "{p}");
            assert!((found.point.distance(p) - found.distance).abs() < 1e-9);
        }
    }
}

#[test]
fn distances_to_a_disk_with_a_hole_are_exact() {
    let model = disk_with_hole([4.0, 1.0], [0.0, 1.5]);
    let target = ClosestOnModel::new(&model).unwrap();
    let points: Vec<DVec3> = (0..2000).map(|k| spread(k, 5.0)).collect();
    let found = target.closest_all(&points, None, &Silent).unwrap();
    for (p, found) in points.iter().zip(&found) {
        let r = p.truncate().length();
        let hole = (p.truncate() - DVec2::new(1.5, 0.0)).length();
        let outside = (r - 4.0).max(1.0 - hole).max(0.0);
        let expected = outside.hypot(p.z);
        let foot = &found.foot;
        assert!((foot.distance - expected).abs() < 1e-10, "{p}");
        assert!(foot.lower <= expected + 1e-10 && foot.distance - foot.lower < 1e-8);
        let edge = outside > 0.0;
        assert_eq!(found.place == Place::FreeEdge, edge, "{p}");
        let on = foot.point.truncate();
        let there = (on + 5.0) / 10.0;
        assert!((there - DVec2::new(foot.u, foot.v)).length() < 1e-9);
    }
}

#[test]
fn the_sign_is_right_beside_faces_edges_and_corners() {
    let size = DVec3::new(1.0, 2.0, 3.0);
    let model = block(size);
    let target = ClosestOnModel::new(&model).unwrap();
    for k in 0..500 {
        let p = size / 2.0 + spread(k, 2.5);
        let found = target.closest(p).unwrap();
        let inside = p.cmpgt(DVec3::ZERO).all() && p.cmplt(size).all();
        let along = found.foot.normal.dot(p - found.foot.point);
        assert_eq!(along < 0.0, inside, "{p}");
        assert_eq!(found.place, Place::Interior);
    }
}

#[test]
fn starts_change_nothing() {
    let model = bowl();
    let target = ClosestOnModel::new(&model).unwrap();
    let points: Vec<DVec3> = (0..300).map(|k| spread(k, 1.2)).collect();
    let free = target.closest_all(&points, None, &Silent).unwrap();
    let starts: Vec<(usize, DVec2)> = (0..points.len())
        .map(|k| (k % 2, DVec2::splat(0.1 + 0.002 * k as f64)))
        .collect();
    let led = target.closest_all(&points, Some(&starts), &Silent).unwrap();
    for (a, b) in free.iter().zip(&led) {
        assert!((a.foot.distance - b.foot.distance).abs() < 1e-9);
    }
}

#[test]
fn a_whole_ball_has_no_free_edge() {
    let mut model = Model::new("ball");
    model
        .add_whole_surface(&conic::sphere(DVec3::ZERO, 2.0).unwrap(), 1e-9)
        .unwrap();
    let target = ClosestOnModel::new(&model).unwrap();
    for k in 0..200 {
        let mut p = spread(k, 3.0);
        if k % 10 == 0 {
            p = DVec3::new(0.0, 0.0, p.z);
        }
        let found = target.closest(p).unwrap();
        // Brackets are 1e-11 of the diagonal wide.
        assert!((found.foot.distance - (p.length() - 2.0).abs()).abs() < 1e-10);
        assert_eq!(found.place, Place::Interior);
        let outwards = found.foot.normal.dot(p - found.foot.point) > 0.0;
        assert_eq!(outwards, p.length() > 2.0, "{p}");
    }
}

#[test]
fn one_search_after_the_other_on_faces_of_different_degrees() {
    // Bilinear, biquadratic, rational: what one search leaves must not reach into the next.
    let mut model = bowl();
    for part in [solid_cylinder(), block(DVec3::new(1.0, 2.0, 3.0))] {
        model.append(part).unwrap();
    }
    let points: Vec<DVec3> = (0..400).map(|k| spread(k, 4.0)).collect();
    let target = ClosestOnModel::new(&model).unwrap();
    let together = target.closest_all(&points, None, &Silent).unwrap();
    for (p, found) in points.iter().zip(&together) {
        let alone = target.closest(*p).unwrap().foot;
        assert!((found.foot.distance - alone.distance).abs() < 1e-9, "{p}");
        assert!(found.foot.distance - found.foot.lower < 1e-8, "{p}");
    }
}

/// The same faces, none of which shares an edge with another.
fn apart(model: &Model) -> Model {
    let mut all = Model::new("apart");
    for face in model.faces() {
        let mut one = Model::new("face");
        let mut face = face.clone();
        for used in face.loops.iter_mut().flat_map(|l| &mut l.uses) {
            let edge = &model.edges()[used.edge];
            let [start, end] = [edge.start, edge.end].map(|v| {
                let point = model.vertices()[v];
                let known = one.vertices().iter().position(|p| *p == point);
                known.unwrap_or_else(|| one.add_vertex(point).unwrap())
            });
            let curve = edge.curve.as_ref().unwrap();
            used.edge = one.add_edge(curve, start, end).unwrap();
        }
        one.add_face(face).unwrap();
        all.append(one).unwrap();
    }
    all
}

#[test]
fn neighbours_that_share_no_edge_are_neighbours() {
    let size = DVec3::new(1.0, 2.0, 3.0);
    // Sheared until its edges are 14 degrees sharp: at most of them the nearest face alone would tell the wrong side.
    let sheared = |p: DVec3| p + 4.0 * p.y * DVec3::X;
    let back = |p: DVec3| p - 4.0 * p.y * DVec3::X;
    let whole = block(size).map_points(sheared).unwrap();
    let model = apart(&whole);
    let target = ClosestOnModel::new(&model).unwrap();
    let (shared, mut sharp) = (ClosestOnModel::new(&whole).unwrap(), 0);
    for k in 0..2000 {
        let p = sheared(size / 2.0) + spread(k, 6.0);
        let found = target.closest(p).unwrap();
        let inside = back(p).cmpgt(DVec3::ZERO).all() && back(p).cmplt(size).all();
        let side = |found: &ModelFoot| found.foot.normal.dot(p - found.foot.point) < 0.0;
        assert_eq!(side(&found), inside, "{p}");
        assert_eq!(found.place, Place::Interior);
        assert!((found.foot.distance - shared.closest(p).unwrap().foot.distance).abs() < 1e-9);
        sharp += u32::from(found.foot.normal.abs().max_element() < 0.999);
    }
    assert!(sharp > 500);
    // Without a lid the rim is free, and nothing else is.
    let lid: Vec<usize> = (1..model.faces().len()).collect();
    let open = ClosestOnModel::of_faces(&model, &lid).unwrap();
    let (mut free, mut joined) = (0, 0);
    for k in 0..2000 {
        let found = open.closest(sheared(size / 2.0) + spread(k, 6.0)).unwrap();
        let on_rim = model.faces()[0].loops[0].uses.iter().any(|used| {
            let edge = &model.edges()[used.edge];
            let [a, b] = [edge.start, edge.end].map(|v| model.vertices()[v]);
            let way = (b - a).normalize();
            (found.foot.point - a).reject_from(way).length() < 1e-6
        });
        assert_eq!(found.place == Place::FreeEdge, on_rim);
        *(if on_rim { &mut free } else { &mut joined }) += 1;
    }
    assert!(free > 20 && joined > 500, "{free} {joined}");
}

#[test]
fn a_face_twice_over_is_no_neighbour_of_itself() {
    let one = disk_with_hole([4.0, 1.0], [0.0, 1.5]);
    let mut both = apart(&one);
    both.append(apart(&one)).unwrap();
    let target = ClosestOnModel::new(&both).unwrap();
    for k in 0..500 {
        let p = spread(k, 5.0);
        let alone = ClosestOnModel::new(&one).unwrap().closest(p).unwrap();
        assert_eq!(target.closest(p).unwrap().place, alone.place, "{p}");
    }
}
