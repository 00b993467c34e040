//! Sound models, and models broken on purpose: each fails exactly its check.

use super::*;
use crate::samples::{block, disk_with_hole, glued, solid_cylinder, square};
use crate::{Edge, Shell, ShellKind};
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::{ControlNet, KnotVector, NurbsCurve, NurbsSurface, conic};

/// What a model is made of, open to be broken.
struct Parts {
    vertices: Vec<DVec3>,
    edges: Vec<Edge>,
    faces: Vec<Face>,
    shells: Vec<Shell>,
}

fn broken(model: &Model, edit: impl FnOnce(&mut Parts)) -> Model {
    let mut parts = Parts {
        vertices: model.vertices().to_vec(),
        edges: model.edges().to_vec(),
        faces: model.faces().to_vec(),
        shells: model.shells().to_vec(),
    };
    edit(&mut parts);
    let mut model = Model::new("broken");
    for vertex in parts.vertices {
        model.add_vertex(vertex).unwrap();
    }
    for edge in parts.edges {
        match edge.curve {
            Some(curve) => model.add_edge(&curve, edge.start, edge.end).unwrap(),
            None => model.add_degenerate_edge(edge.start).unwrap(),
        };
    }
    for face in parts.faces {
        model.add_face(face).unwrap();
    }
    for shell in parts.shells {
        model.add_shell(shell).unwrap();
    }
    model
}

fn whole(surface: &NurbsSurface) -> Model {
    let mut model = Model::new("");
    let face = model.add_whole_surface(surface, 1e-9).unwrap();
    model.add_shell_of(face).unwrap();
    model
}

/// A sheet over 6 x 6 control points at these heights.
fn sheet(degree: usize, height: impl Fn(f64, f64) -> f64) -> NurbsSurface {
    square(degree, 6)
        .map_points(|p| p + height(p.x, p.y) * DVec3::Z)
        .unwrap()
}

/// The checks that are over their limit but those that are always in such a model.
fn over(model: &Model, but: &[&str]) -> Vec<String> {
    let report = check(model);
    let over = report.checks.iter().filter(|c| !c.within);
    let others = over.filter(|c| !but.contains(&c.name.as_ref()));
    let names = others.map(|c| c.name.to_string()).collect();
    for check in &report.checks {
        assert!(check.measured.is_finite() || check.within, "{check:?}");
    }
    names
}

fn fails(model: &Model, name: &str, but: &[&str]) {
    assert_eq!(over(model, but), [name]);
    let report = check(model);
    let found = report.get(name).unwrap();
    assert_eq!(found.pass, found.severity == Severity::Information);
    assert!(found.where_.is_some() || name == "faces", "{found:?}");
}

const OPEN: &[&str] = &["open_edges"];
const SHARP: &[&str] = &["edge_tangency"];

#[test]
fn sound_models_pass() {
    let axis = DVec3::new(1.0, 2.0, 2.0);
    let wavy = sheet(3, |x, y| (x / 2.0).sin() + (y / 3.0).cos());
    let none: &[&str] = &[];
    for (model, but) in [
        (whole(&conic::sphere(axis, 20.0).unwrap()), none),
        (whole(&conic::torus(axis, axis, 30.0, 10.0).unwrap()), none),
        (whole(&conic::cone(axis, axis, 3.0, 0.0).unwrap()), OPEN),
        (whole(&wavy), OPEN),
        (disk_with_hole([2.0, 1.0], [0.0, 0.5]), OPEN),
        (solid_cylinder(), SHARP),
        (block(axis), SHARP),
    ] {
        assert_eq!(over(&model, but), [""; 0], "{}", model.name);
        let report = check(&model);
        assert!(report.pass(), "{report:?}");
    }
    let angle = check(&block(axis)).get("edge_tangency").unwrap().measured;
    assert!((angle - 90.0).abs() < 1e-9);
    fails(&Model::new("nothing"), "faces", &[]);
}

#[test]
fn gaps() {
    let disk = disk_with_hole([2.0, 1.0], [0.0, 0.5]);
    let limit = check(&disk).get("edge_surface_gap").unwrap().limit;
    assert!((limit - 1e-4 * 32_f64.sqrt()).abs() < 1e-9);
    let moved = broken(&disk, |parts| parts.vertices[2].x += 0.01);
    fails(&moved, "edge_vertex_gap", OPEN);
    let lifted = broken(&disk, |parts| {
        parts.vertices[2].z += 0.01;
        let ring = parts.edges[2].curve.take().unwrap();
        parts.edges[2].curve = Some(ring.map_points(|p| p + 0.01 * DVec3::Z).unwrap());
    });
    fails(&lifted, "edge_surface_gap", OPEN);
    assert!((check(&lifted).get("edge_surface_gap").unwrap().measured - 0.01).abs() < 1e-9);
    let apart = broken(&disk, |parts| {
        for (used, sign) in parts.faces[0].loops[0].uses.iter_mut().zip([1.0, -1.0]) {
            let shift = 0.08 * sign * limit * DVec3::X;
            used.pcurve = used.pcurve.map_points(|p| p + shift).unwrap();
        }
    });
    fails(&apart, "loop_gap", OPEN);
    let size = DVec3::new(10.0, 20.0, 30.0);
    let limit = check(&block(size)).get("neighbour_gap").unwrap().limit;
    // Face 0 is the bottom, face 2 the front: they share an edge along x.
    let slid = broken(&block(size), |parts| {
        for (face, sign) in [(0, 0.8), (2, -0.8)] {
            let surface = &mut parts.faces[face].surface;
            *surface = surface.map_points(|p| p + sign * limit * DVec3::X).unwrap();
        }
    });
    fails(&slid, "neighbour_gap", SHARP);
    let bulged = broken(&whole(&square(3, 6)), |parts| {
        let used = &mut parts.faces[0].loops[0].uses[0];
        let knots = KnotVector::uniform(2, 3).unwrap();
        let points = vec![DVec3::ZERO, DVec3::new(0.5, -0.02, 0.0), DVec3::X];
        used.pcurve = NurbsCurve::new(knots, points, None).unwrap();
    });
    fails(&bulged, "boundary_off_surface", OPEN);
}

#[test]
fn smoothness() {
    // A closed profile whose ends have one tangent but not one curvature.
    let knots = KnotVector::uniform(3, 7).unwrap();
    let profile = [
        [0., 0.],
        [1., 0.],
        [4., 2.],
        [2., 6.],
        [-3., 6.],
        [-2., 0.],
        [0., 0.],
    ];
    let net = ControlNet::from_fn(7, 2, |i, j| {
        DVec3::new(profile[i][0], profile[i][1], 5.0 * j as f64)
    });
    let along = KnotVector::uniform(1, 2).unwrap();
    let tube = NurbsSurface::new(knots, along, net.unwrap(), None).unwrap();
    fails(&whole(&tube), "edge_curvature", OPEN);
    let crease = KnotVector::new(2, vec![0., 0., 0., 0.5, 0.5, 1., 1., 1.]).unwrap();
    let net = ControlNet::from_fn(5, 3, |i, j| {
        let x = i as f64 - 2.0;
        DVec3::new(x, j as f64, 0.3 * x.abs())
    });
    let roof = NurbsSurface::new(
        crease,
        KnotVector::uniform(2, 3).unwrap(),
        net.unwrap(),
        None,
    );
    fails(&whole(&roof.unwrap()), "knot_tangency", OPEN);
    let quadratic = sheet(2, |x, _| x.sin());
    fails(&whole(&quadratic), "knot_curvature", OPEN);
}

#[test]
fn sizes() {
    fails(&whole(&square(12, 13)), "degree", OPEN);
    let close = square(3, 6)
        .insert_knots(Direction::U, &[0.5, 0.500_001])
        .unwrap();
    fails(&whole(&close), "knot_distance", OPEN);
    let disk = disk_with_hole([2.0, 1.0], [0.0, 0.5]);
    let chipped = broken(&disk, |parts| {
        let curve = parts.edges[0].curve.clone().unwrap();
        let cut = 1.0 - 1e-5;
        let [long, short] = curve.split(cut).unwrap();
        let middle = parts.vertices.len();
        parts.vertices.push(curve.point(cut));
        let left = parts.edges[0].end;
        parts.edges[0].curve = Some(long);
        parts.edges[0].end = middle;
        parts.edges.push(Edge {
            curve: Some(short),
            start: middle,
            end: left,
        });
        let uses = &mut parts.faces[0].loops[0].uses;
        let [long, short] = uses[0].pcurve.split(cut).unwrap();
        let mut second = uses[0].clone();
        uses[0].pcurve = long;
        second.pcurve = short;
        second.edge = 3;
        uses.insert(1, second);
    });
    fails(&chipped, "edge_length", OPEN);
    fails(
        &disk_with_hole([2.0, 1.9999], [0.0, 0.0]),
        "face_width",
        OPEN,
    );
}

#[test]
fn loops_that_are_wrong() {
    fails(
        &disk_with_hole([2.0, 1.0], [0.0, -1.5]),
        "loop_crossings",
        OPEN,
    );
    let crossings = check(&disk_with_hole([2.0, 1.0], [0.0, -1.5]));
    assert!((crossings.get("loop_crossings").unwrap().measured - 2.0).abs() < 0.5);
    let disk = disk_with_hole([2.0, 1.0], [0.0, 0.5]);
    let turned = broken(&disk, |parts| {
        parts.faces[0].loops[1].uses[0].reversed = false;
    });
    fails(&turned, "loop_orientation", OPEN);
    fails(
        &disk_with_hole([2.0, 1.0], [0.0, 3.5]),
        "loop_nesting",
        OPEN,
    );
    // A p-curve with a loop in itself.
    let knotted = broken(&whole(&square(3, 6)), |parts| {
        let knots = KnotVector::uniform(3, 4).unwrap();
        let p = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        let points = vec![p(0.0, 0.0), p(2.0, 0.7), p(-1.0, 0.7), p(1.0, 0.0)];
        let pcurve = NurbsCurve::new(knots.clone(), points, None).unwrap();
        let curve = pcurve.map_points(|p| DVec3::new(10.0 * p.x - 5.0, 10.0 * p.y - 5.0, 0.0));
        let used = &mut parts.faces[0].loops[0].uses[0];
        used.pcurve = pcurve;
        parts.edges[used.edge].curve = Some(curve.unwrap());
    });
    fails(&knotted, "loop_crossings", OPEN);
}

#[test]
fn folds_and_crossings() {
    // Flat, and folded over: x goes there, back and on.
    let at = [0.0, 4.0, 6.0, 2.0, 4.0, 8.0];
    let knots = KnotVector::uniform(3, 6).unwrap();
    let net = ControlNet::from_fn(6, 6, |i, j| DVec3::new(at[i], j as f64, 0.0));
    let folded = NurbsSurface::new(knots.clone(), knots, net.unwrap(), None).unwrap();
    fails(&whole(&folded), "folds", OPEN);
    let mut crossed = Model::new("");
    for turned in [false, true] {
        let surface = square(3, 6)
            .map_points(|p| if turned { DVec3::new(0.3, p.x, p.y) } else { p })
            .unwrap();
        crossed.add_whole_surface(&surface, 1e-9).unwrap();
    }
    fails(&crossed, "self_intersections", OPEN);
    // The same places, by face: the pairs lie where x = 0.3 on the flat one.
    let folds = shell_defects(&whole(&folded)).unwrap();
    assert!(!folds.is_empty() && folds.parts().all(|part| part.0 == 0));
    let parts: Vec<FaceCell> = shell_defects(&crossed).unwrap().parts().collect();
    let count = check(&crossed).get("self_intersections").unwrap().measured;
    assert!((parts.len() as f64 - 2.0 * count).abs() < 0.5);
    for (face, [low, high]) in parts {
        let surface = &crossed.faces()[face].surface;
        let [a, b] = [low, high].map(|p| surface.point(p.x, p.y));
        assert!(face == 1 || (a.x <= 0.3 && b.x >= 0.3), "{a} {b}");
    }
    assert!(shell_defects(&whole(&square(3, 6))).unwrap().is_empty());
}

#[test]
fn a_smooth_edge_where_the_surface_turns_back() {
    let one = square(3, 6);
    let net = ControlNet::from_fn(6, 6, |i, j| {
        let p = one.control_points().point(i, j);
        // At one corner the second sheet begins backwards, above the first.
        if (i, j) == (1, 0) {
            DVec3::new(5.0 - 0.5 * (p.x + 5.0), p.y, 0.3)
        } else {
            DVec3::new(10.0 + p.x, p.y, p.z)
        }
    });
    let knots = one.knots_u().clone();
    let two = NurbsSurface::new(knots.clone(), knots, net.unwrap(), None).unwrap();
    let model = glued(vec![one, two], 1e-9).to_model("").unwrap();
    let report = check(&model);
    let fold = report.get("folds").unwrap();
    assert!(!fold.pass && fold.edge.is_some(), "{fold:?}");
    assert!(report.get("self_intersections").unwrap().pass);
}

#[test]
fn shells_that_are_wrong() {
    let size = DVec3::new(10.0, 20.0, 30.0);
    let turned = broken(&block(size), |parts| {
        parts.faces[2].reversed = true;
        parts.shells[0].kind = ShellKind::Open;
    });
    fails(&turned, "shell_orientation", SHARP);
    let count = check(&turned).get("shell_orientation").unwrap().measured;
    assert!((count - 4.0).abs() < 0.5);
    let doubled = broken(&block(size), |parts| {
        parts.faces.push(parts.faces[0].clone());
        parts.shells[0].kind = ShellKind::Open;
        parts.shells[0].faces.push(6);
    });
    fails(&doubled, "non_manifold_edges", SHARP);
    let inward = broken(&block(size), |parts| {
        parts.faces.iter_mut().for_each(|face| face.reversed = true);
    });
    fails(&inward, "solid_volume", SHARP);
    let lidless = broken(&block(size), |parts| {
        parts.faces.truncate(5);
        parts.shells[0].faces.truncate(5);
        parts.shells[0].kind = ShellKind::Open;
    });
    fails(&lidless, "open_edges", SHARP);
    let wide = broken(&disk_with_hole([2.0, 1.0], [0.0, 0.5]), |parts| {
        parts.faces[0].surface = square(3, 23);
    });
    fails(&wide, "unoccupied_rows", OPEN);
}
