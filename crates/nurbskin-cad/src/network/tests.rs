//! Networks of known shape through the model, the checks, the files and the triangles.

use super::*;
use crate::io::{iges, step};
use crate::samples::{cube_network, glued, open_network, round_network, torus_network};
use crate::{check, mass, normal_jumps, tessellate};
use nurbskin_geometry::nurbs::ControlNet;
use nurbskin_geometry::nurbs::refine::Direction;
use std::f64::consts::PI;

fn invalid(network: &FaceNetwork, words: &str) {
    let error = network.validate().unwrap_err().to_string();
    assert!(error.contains(words), "{error}");
    assert!(network.to_model("").is_err());
}

#[test]
fn a_cube_has_its_volume_and_its_edges() {
    let network = cube_network();
    assert!(network.validate().unwrap() < 1e-15);
    assert_eq!(network.kind_counts(), [0, 12, 0]);
    let model = network.to_model("cube").unwrap();
    assert_eq!([model.vertices().len(), model.edges().len()], [8, 12]);
    assert_eq!(model.shells()[0].kind, ShellKind::Solid);
    let mass = mass(&model).unwrap();
    assert!((mass.volume.unwrap() - 8.0).abs() < 1e-12);
    assert!((mass.area - 24.0).abs() < 1e-12);
    let report = check(&model);
    assert!(report.pass(), "{report:?}");
    // Mirrored faces look inwards, and are turned over.
    let mut turned = network;
    for face in &mut turned.faces {
        face.surface = face.surface.transposed();
        let [a, b, c, d] = face.sides;
        face.sides = [d, c, b, a];
    }
    let model = turned.to_model("turned").unwrap();
    assert!(model.faces().iter().all(|face| face.reversed));
    assert!(check(&model).pass());
    assert!((crate::mass(&model).unwrap().volume.unwrap() - 8.0).abs() < 1e-12);
}

#[test]
fn curved_networks_are_sound_models() {
    let torus = torus_network([4, 3], 4, [30.0, 10.0]);
    assert_eq!(torus.control_point_count(), 12 + 24 * 5 + 12 * 25);
    for (name, network, closed) in [
        ("torus", torus, true),
        ("ball", round_network(20.0, 9), true),
        ("open", open_network(), false),
    ] {
        let gap = network.validate().unwrap();
        assert!(gap < 1e-14 * network.diagonal(), "{name} {gap}");
        let model = network.to_model(name).unwrap();
        assert_eq!(network.is_closed(), closed);
        assert_eq!(model.is_closed(&model.shells()[0].faces), closed, "{name}");
        let report = check(&model);
        assert!(report.pass(), "{name} {report:?}");
        assert!(report.get("neighbour_gap").unwrap().measured < 1e-13);
        let mesh = tessellate(&model, 0.05, 1_000_000).unwrap();
        assert!(mesh.left_out.is_empty());
        let mut sides = std::collections::BTreeMap::new();
        for [a, b, c] in &mesh.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *sides.entry((from, to)).or_insert(0) += 1;
            }
        }
        assert!(sides.values().all(|&count| count == 1), "{name}");
        let free = sides.keys().filter(|(a, b)| !sides.contains_key(&(*b, *a)));
        assert_eq!(free.count() == 0, closed, "{name}");
    }
    let torus = torus_network([4, 3], 16, [30.0, 10.0])
        .to_model("")
        .unwrap();
    let volume = mass(&torus).unwrap().volume.unwrap();
    // Control points on the torus: the surface is a little inside.
    assert!((volume / (2.0 * PI * PI * 3000.0) - 1.0).abs() < 0.01);
}

/// Two faces on the same four sides: a pillow, whose upper face is lower than the other in places where `dip` is large.
fn pillow(height: f64, dip: f64) -> FaceNetwork {
    let knots = KnotVector::uniform(3, 8).unwrap();
    let at = knots.greville();
    let patch = |upper: bool| {
        let net = ControlNet::from_fn(8, 8, |i, j| {
            let (x, y) = if upper {
                (at[i], at[j])
            } else {
                (at[j], at[i])
            };
            let bump = 16.0 * x * (1.0 - x) * y * (1.0 - y);
            let up = height * if upper { 1.0 - dip * bump } else { -1.0 };
            let sides = 0.1 * ((4.0 * x).sin() + (5.0 * y).cos());
            100.0 * DVec3::new(x, y, up * bump + sides)
        });
        NurbsSurface::new(knots.clone(), knots.clone(), net.unwrap(), None).unwrap()
    };
    glued(vec![patch(true), patch(false)], 1e-6)
}

#[test]
fn neighbours_cross_only_where_they_do() {
    for height in [0.5, 0.05, 0.005, 0.0005] {
        let report = check(&pillow(height, 0.0).to_model("").unwrap());
        assert!(report.pass(), "{height} {report:?}");
    }
    let report = check(&pillow(0.05, 3.0).to_model("").unwrap());
    assert!(report.get("self_intersections").unwrap().measured > 0.0);
    for radii in [[10.0, 1.0], [10.0, 9.9]] {
        for counts in [[9, 2], [2, 3]] {
            let report = check(&torus_network(counts, 4, radii).to_model("").unwrap());
            assert!(report.pass(), "{radii:?} {report:?}");
        }
    }
}

#[test]
fn files_keep_what_a_network_is() {
    for (name, network) in [
        ("torus", torus_network([4, 3], 4, [30.0, 10.0])),
        ("ball", round_network(20.0, 9)),
        ("cube", cube_network()),
        ("open", open_network()),
    ] {
        let model = network.to_model(name).unwrap();
        let mut bytes = Vec::new();
        step::write(&mut bytes, &model, &step::WriteOptions::default()).unwrap();
        let text = String::from_utf8(bytes.clone()).unwrap();
        let solid = network.is_closed();
        assert_eq!(text.contains("MANIFOLD_SOLID_BREP"), solid);
        assert_eq!(text.contains("OPEN_SHELL"), !solid);
        assert_eq!(text.matches("EDGE_CURVE(").count(), network.edges.len());
        assert_eq!(
            text.matches("VERTEX_POINT(").count(),
            network.vertices.len()
        );
        let file = step::read(&bytes, "part.step").unwrap();
        assert_eq!(file.warnings, Vec::<String>::new(), "{name}");
        let back = file.model;
        assert_eq!(back.shells()[0].kind, model.shells()[0].kind);
        assert_eq!(back.edges().len(), model.edges().len());
        assert_eq!(back.vertices().len(), model.vertices().len());
        assert!(check(&back).pass());
        for (face, again) in model.faces().iter().zip(back.faces()) {
            assert_eq!(face.surface, again.surface);
        }
        // The certificate is the same from the file alone.
        let kinds = network.kinds();
        let [one, two] = [&model, &back].map(|m| normal_jumps(m, crate::Meant::default()).summary);
        assert!((one.max - two.max).abs() < 1e-9, "{one:?} {two:?}");
        assert_eq!(one.bound.is_some(), two.bound.is_some());
        assert_eq!(one.smooth + one.sharp + one.open, kinds.len());
        let mut bytes = Vec::new();
        let content = iges::IgesContent {
            model: Some(&model),
            ..Default::default()
        };
        iges::write(&mut bytes, &content, &iges::WriteOptions::default()).unwrap();
        let file = iges::read_cad(&bytes, "part.igs").unwrap();
        assert_eq!(file.warnings, Vec::<String>::new(), "{name}");
        assert!(file.unread.is_empty());
        assert_eq!(file.entities.contains_key("186"), solid);
        let back = file.model;
        assert_eq!(back.shells()[0].kind, model.shells()[0].kind);
        assert_eq!(back.edges().len(), model.edges().len());
        assert_eq!(back.vertices().len(), model.vertices().len());
        assert!(check(&back).pass());
        let two = normal_jumps(&back, crate::Meant::default()).summary;
        assert!((one.max - two.max).abs() < 1e-9 && two.bound.is_some());
        let volume = |m: &Model| mass(m).unwrap().volume.unwrap_or(1.0);
        assert!((volume(&back) / volume(&model) - 1.0).abs() < 1e-9);
    }
}

#[test]
fn faces_that_are_turned_over_are_solids_in_iges_too() {
    let mut network = round_network(20.0, 6);
    for face in &mut network.faces {
        face.surface = face.surface.transposed();
        let [a, b, c, d] = face.sides;
        face.sides = [d, c, b, a];
    }
    let mut model = network.to_model("turned").unwrap();
    model.colour = Some([10, 20, 30]);
    assert!(model.faces().iter().all(|face| face.reversed));
    let mut bytes = Vec::new();
    let content = iges::IgesContent {
        model: Some(&model),
        ..Default::default()
    };
    iges::write(&mut bytes, &content, &iges::WriteOptions::default()).unwrap();
    let back = iges::read_cad(&bytes, "part.igs").unwrap().model;
    assert!(back.faces().iter().all(|face| !face.reversed));
    assert_eq!(back.colour, model.colour);
    let volumes = [&model, &back].map(|m| mass(m).unwrap().volume.unwrap());
    assert!((volumes[0] / volumes[1] - 1.0).abs() < 1e-9 && volumes[1] > 0.0);
    assert!(check(&back).pass());
}

#[test]
fn what_is_wrong_is_said() {
    let sound = torus_network([4, 3], 3, [30.0, 10.0]);
    let broken = |edit: &dyn Fn(&mut FaceNetwork)| {
        let mut network = sound.clone();
        edit(&mut network);
        network
    };
    invalid(&FaceNetwork::default(), "without faces");
    invalid(&broken(&|n| n.faces[0].sides[0].0 = 99), "is edge 99 of 24");
    invalid(&broken(&|n| n.edges[3].ends[0] = 77), "vertex 77 of 12");
    invalid(
        &broken(&|n| n.edges[3].kind = JoinKind::Open),
        "edge 3 is open and has 2 faces",
    );
    invalid(
        &broken(&|n| n.vertices[5] += 1e-3 * DVec3::X),
        "from vertex 5",
    );
    invalid(
        &broken(&|n| n.faces[0].sides[0].1 ^= true),
        "do not meet at one vertex",
    );
    let bent = broken(&|n| {
        let face = &mut n.faces[2].surface;
        *face = face.map_points(|p| p + 1e-5 * DVec3::Z * p.x).unwrap();
    });
    invalid(&bent, "from edge");
    let coarse = broken(&|n| {
        let edge = &mut n.edges[0];
        edge.curve = edge.curve.insert_knots(&[0.3]).unwrap();
    });
    invalid(&coarse, "a knot that its side");
    let two = broken(&|n| {
        let other = sound.clone();
        let [v, e] = [n.vertices.len(), n.edges.len()].map(|k| u32::try_from(k).unwrap());
        n.vertices.extend(other.vertices);
        n.edges.extend(other.edges.into_iter().map(|mut edge| {
            edge.ends = edge.ends.map(|k| k + v);
            edge
        }));
        n.faces.extend(other.faces.into_iter().map(|mut face| {
            face.sides = face.sides.map(|(k, r)| (k + e, r));
            face
        }));
    });
    invalid(&two, "not connected");
    let turned = broken(&|n| {
        let face = &mut n.faces[0];
        face.surface = face.surface.transposed();
        let [a, b, c, d] = face.sides;
        face.sides = [d, c, b, a];
    });
    invalid(&turned, "opposite sides");
    let beyond = broken(&|n| {
        let surface = &n.faces[0].surface;
        let knots = surface.knots_u().with_domain(0.0, 2.0).unwrap();
        let net = surface.control_points().clone();
        let moved = NurbsSurface::new(knots, surface.knots_v().clone(), net, None);
        n.faces[0].surface = moved.unwrap();
    });
    invalid(&beyond, "not clamped over the unit square");
}

#[test]
fn edges_may_have_fewer_knots_and_a_lower_degree() {
    // A flat sheet of degree 3 with straight edges of degree 1.
    let network = cube_network();
    let mut flat = network.clone();
    for edge in &mut flat.edges {
        let ends = [0.0, 1.0].map(|t| edge.curve.point(t));
        let knots = KnotVector::uniform(1, 2).unwrap();
        edge.curve = NurbsCurve::new(knots, ends.to_vec(), None).unwrap();
    }
    assert!(flat.validate().unwrap() < 1e-15);
    // Knots at thirds, which 1 - t rounds.
    let mut thirds = torus_network([4, 3], 3, [30.0, 10.0]);
    for edge in &mut thirds.edges {
        edge.curve = edge.curve.reversed().unwrap();
        edge.ends.reverse();
    }
    for face in &mut thirds.faces {
        face.sides = face.sides.map(|(k, reversed)| (k, !reversed));
        face.surface = face.surface.insert_knots(Direction::U, &[0.1]).unwrap();
    }
    assert!(thirds.validate().unwrap() < 1e-12);
    assert!(check(&thirds.to_model("").unwrap()).pass());
}

#[test]
fn a_network_without_faces_is_open_there() {
    let cube = cube_network();
    let without = |gone: &[usize]| {
        let gone: Vec<bool> = (0..6).map(|face| gone.contains(&face)).collect();
        cube.without(&gone, &[1; 6]).unwrap()
    };
    assert_eq!(cube.genus_and_borders(), [0, 0]);
    let (same, kept) = without(&[]);
    assert_eq!(kept, [0, 1, 2, 3, 4, 5]);
    assert_eq!(same.kind_counts(), cube.kind_counts());
    assert_eq!(same.vertices.len(), 8);
    // Two opposite faces leave a band, all but one face a sheet.
    let opposite = (1..6)
        .find(|&k| without(&[0, k]).0.genus_and_borders() == [0, 2])
        .unwrap();
    let (band, kept) = without(&[0, opposite]);
    assert_eq!(kept.len(), 4);
    assert_eq!(band.kind_counts(), [0, 4, 8]);
    assert!(check(&band.to_model("").unwrap()).pass());
    let (sheet, kept) = without(&[0, 1, 2, 3, 4]);
    assert_eq!(kept, [5]);
    assert_eq!([sheet.vertices.len(), sheet.edges.len()], [4, 4]);
    assert_eq!(sheet.genus_and_borders(), [0, 1]);
    assert!(cube.without(&[true; 6], &[]).is_none());
    let torus = torus_network([4, 3], 4, [30.0, 10.0]);
    assert_eq!(torus.genus_and_borders(), [1, 0]);
    assert_eq!(open_network().genus_and_borders(), [1, 1]);
}

#[test]
fn pieces_of_an_opened_network_are_told_apart() {
    let torus = torus_network([4, 3], 4, [30.0, 10.0]);
    let count = torus.faces.len();
    let neighbours = |a: usize, b: usize| {
        let edges = torus.faces[a].sides.map(|side| side.0);
        torus.faces[b]
            .sides
            .iter()
            .any(|side| edges.contains(&side.0))
    };
    // A face whose four neighbours are gone is a piece of its own: it stays only if it weighs most.
    let gone: Vec<bool> = (0..count).map(|k| k != 0 && neighbours(0, k)).collect();
    let mut weights = vec![1; count];
    let (rest, kept) = torus.without(&gone, &weights).unwrap();
    assert!(!kept.contains(&0) && kept.len() == count - 5);
    rest.validate().unwrap();
    assert!(check(&rest.to_model("").unwrap()).pass());
    weights[0] = count;
    let (alone, kept) = torus.without(&gone, &weights).unwrap();
    assert_eq!((kept, alone.vertices.len()), (vec![0], 4));
    // Two holes that meet at a vertex only: the faces between them share no edge there, and get a vertex each.
    let corner = torus.edges[torus.faces[0].sides[0].0 as usize].ends[0];
    let at_corner = |k: usize| {
        let edges = torus.faces[k].sides.iter();
        let mut ends = edges.flat_map(|side| torus.edges[side.0 as usize].ends);
        ends.any(|end| end == corner)
    };
    let other = (1..count)
        .find(|&k| at_corner(k) && !neighbours(0, k))
        .unwrap();
    let gone: Vec<bool> = (0..count).map(|k| k == 0 || k == other).collect();
    let (pinched, _) = torus.without(&gone, &[1; 12]).unwrap();
    assert_eq!(pinched.vertices.len(), torus.vertices.len() + 1);
    assert_eq!(pinched.genus_and_borders(), [1, 1]);
    pinched.validate().unwrap();
    assert!(check(&pinched.to_model("").unwrap()).pass());
}
