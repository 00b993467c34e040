//! Models for the tests of this stage.

use super::natural::line;
use super::{EdgeUse, Face, Loop, Model, Shell, ShellKind, SurfaceKind};
use glam::{DVec2, DVec3};
use nurbskin_geometry::nurbs::{ControlNet, KnotVector, NurbsCurve, NurbsSurface, conic};
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

mod networks;

pub use networks::{cube_network, glued, open_network, round_network, torus_network};

/// The square -5..5 of the plane z = 0 with (u, v) = (x + 5, y + 5) / 10, of these degrees and spans.
pub fn square(degree: usize, count: usize) -> NurbsSurface {
    let knots = KnotVector::uniform(degree, count).unwrap();
    let at = knots.greville();
    let net = ControlNet::from_fn(count, count, |i, j| {
        DVec3::new(10.0 * at[i] - 5.0, 10.0 * at[j] - 5.0, 0.0)
    });
    NurbsSurface::new(knots.clone(), knots, net.unwrap(), None).unwrap()
}

/// An arc around (x, 0) in the plane as an edge, with its p-curve on [`square`].
fn arc(
    model: &mut Model,
    x: f64,
    radius: f64,
    angles: [f64; 2],
    vertices: [usize; 2],
) -> (usize, NurbsCurve) {
    let centre = DVec3::new(x, 0.0, 0.0);
    let [from, to] = angles;
    let curve = conic::arc(centre, radius * DVec3::X, radius * DVec3::Y, from, to).unwrap();
    let pcurve = curve
        .map_points(|p| DVec3::new((p.x + 5.0) / 10.0, (p.y + 5.0) / 10.0, 0.0))
        .unwrap();
    let edge = model.add_edge(&curve, vertices[0], vertices[1]).unwrap();
    (edge, pcurve)
}

/// A disk around the origin with a round hole around (x, 0): two half circles outside, one whole circle inside, radii
/// given; the surface has 6 x 6 cubic control points. `hole` is [anything, x of the hole's centre].
pub fn disk_with_hole(radii: [f64; 2], hole: [f64; 2]) -> Model {
    let mut model = Model::new("disk");
    let [outer, inner] = radii;
    let right = model.add_vertex(DVec3::new(outer, 0.0, 0.0)).unwrap();
    let left = model.add_vertex(DVec3::new(-outer, 0.0, 0.0)).unwrap();
    let (upper, upper_p) = arc(&mut model, 0.0, outer, [0.0, PI], [right, left]);
    let (lower, lower_p) = arc(&mut model, 0.0, outer, [PI, TAU], [left, right]);
    let x = hole[1];
    let start = model.add_vertex(DVec3::new(x + inner, 0.0, 0.0)).unwrap();
    let (ring, ring_p) = arc(&mut model, x, inner, [0.0, TAU], [start, start]);
    let used = |edge, reversed, pcurve| EdgeUse {
        edge,
        reversed,
        pcurve,
    };
    let loops = vec![
        Loop {
            uses: vec![used(upper, false, upper_p), used(lower, false, lower_p)],
        },
        Loop {
            uses: vec![used(ring, true, ring_p)],
        },
    ];
    let face = Face {
        surface: square(3, 6),
        kind: SurfaceKind::BSpline,
        reversed: false,
        loops,
        trimmed: true,
        name: String::new(),
    };
    model.add_face(face).unwrap();
    model
        .add_shell(Shell {
            faces: vec![0],
            kind: ShellKind::Open,
        })
        .unwrap();
    model
}

/// A solid cylinder of radius 1 and height 2 on z = 0: its side, and two disks trimmed out of larger planes.
pub fn solid_cylinder() -> Model {
    let mut model = Model::new("cylinder");
    let side = conic::cylinder(DVec3::ZERO, 2.0 * DVec3::Z, 1.0).unwrap();
    let side_face = model.add_whole_surface(&side, 1e-9).unwrap();
    let rings: Vec<(usize, NurbsCurve)> = model.faces()[side_face].loops[0]
        .uses
        .iter()
        .map(|used| used.edge)
        .filter(|&edge| model.edges()[edge].start == model.edges()[edge].end)
        .map(|edge| (edge, model.edges()[edge].curve.clone().unwrap()))
        .collect();
    for (edge, curve) in rings {
        let height = curve.point(0.0).z;
        let top = height > 1.0;
        let surface = square(1, 2).map_points(|p| p + height * DVec3::Z).unwrap();
        let pcurve = curve
            .map_points(|p| DVec3::new((p.x + 5.0) / 10.0, (p.y + 5.0) / 10.0, 0.0))
            .unwrap();
        // The ring must run with the face on its left in (u, v): counter-clockwise.
        let uses = vec![EdgeUse {
            edge,
            reversed: false,
            pcurve,
        }];
        let face = Face {
            surface,
            kind: SurfaceKind::Plane,
            reversed: !top,
            loops: vec![Loop { uses }],
            trimmed: true,
            name: String::new(),
        };
        model.add_face(face).unwrap();
    }
    model
        .add_shell(Shell {
            faces: vec![0, 1, 2],
            kind: ShellKind::Solid,
        })
        .unwrap();
    model
}

/// A box from the origin to `size`, of six bilinear faces that share their edges.
pub fn block(size: DVec3) -> Model {
    let mut model = Model::new("box");
    let corner =
        |k: usize| DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2 & 1) as f64) * size;
    for k in 0..8 {
        model.add_vertex(corner(k)).unwrap();
    }
    let knots = KnotVector::uniform(1, 2).unwrap();
    let mut edges = std::collections::BTreeMap::new();
    // Corners (0, 0), (1, 0), (1, 1), (0, 1) of each face, counter-clockwise seen from outside.
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let places = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    for side in sides {
        let net = vec![
            corner(side[0]),
            corner(side[1]),
            corner(side[3]),
            corner(side[2]),
        ];
        let net = ControlNet::new(2, 2, net).unwrap();
        let surface = NurbsSurface::new(knots.clone(), knots.clone(), net, None).unwrap();
        let mut uses = Vec::new();
        for k in 0..4 {
            let (from, to) = (side[k], side[(k + 1) % 4]);
            let reversed = from > to;
            let (low, high) = (from.min(to), from.max(to));
            let edge = *edges.entry((low, high)).or_insert_with(|| {
                let points = vec![corner(low), corner(high)];
                let curve = NurbsCurve::new(knots.clone(), points, None).unwrap();
                model.add_edge(&curve, low, high).unwrap()
            });
            let mut ends = [places[k], places[(k + 1) % 4]];
            if reversed {
                ends.swap(0, 1);
            }
            uses.push(EdgeUse {
                edge,
                reversed,
                pcurve: line(ends[0], ends[1], (0.0, 1.0)).unwrap(),
            });
        }
        let face = Face {
            surface,
            kind: SurfaceKind::Plane,
            reversed: false,
            loops: vec![Loop { uses }],
            trimmed: false,
            name: String::new(),
        };
        model.add_face(face).unwrap();
    }
    model
        .add_shell(Shell {
            faces: (0..6).collect(),
            kind: ShellKind::Solid,
        })
        .unwrap();
    model
}

/// z = x^2 + y^2 over the square -1..1 with (u, v) = (x + 1, y + 1) / 2, exactly: its control points are blossoms.
pub fn paraboloid(spans: usize) -> NurbsSurface {
    let knots = KnotVector::uniform(2, spans + 2).unwrap();
    let at = |i: usize| [1, 2].map(|k| 2.0 * knots.knots()[i + k] - 1.0);
    let net = ControlNet::from_fn(spans + 2, spans + 2, |i, j| {
        let ([a, b], [c, d]) = (at(i), at(j));
        DVec3::new(f64::midpoint(a, b), f64::midpoint(c, d), a * b + c * d)
    });
    NurbsSurface::new(knots.clone(), knots, net.unwrap(), None).unwrap()
}

/// Two faces on paraboloids of different spans, with a common edge across the square; the left one has a hole.
pub fn bowl() -> Model {
    let mut model = Model::new("bowl");
    let corners = [
        [-0.9, -0.7],
        [-0.2, -0.95],
        [0.8, -0.9],
        [0.95, 0.6],
        [0.3, 0.9],
        [-0.8, 0.85],
        [-0.5, -0.3],
        [-0.4, 0.2],
        [-0.1, -0.1],
    ];
    for [x, y] in corners {
        model.add_vertex(DVec3::new(x, y, x * x + y * y)).unwrap();
    }
    let mut edges: BTreeMap<[usize; 2], usize> = BTreeMap::new();
    let mut chain = |model: &mut Model, ring: &[usize]| {
        let mut uses = Vec::new();
        for (k, &from) in ring.iter().enumerate() {
            let to = ring[(k + 1) % ring.len()];
            let (low, high) = (from.min(to), from.max(to));
            let [p, q] = [low, high].map(|v| DVec2::from(corners[v]));
            let edge = *edges.entry([low, high]).or_insert_with(|| {
                let knots = KnotVector::uniform(2, 3).unwrap();
                let middle = p.midpoint(q).extend(p.dot(q));
                let points = vec![p.extend(p.dot(p)), middle, q.extend(q.dot(q))];
                let curve = NurbsCurve::new(knots, points, None).unwrap();
                model.add_edge(&curve, low, high).unwrap()
            });
            let place = |p: DVec2| ((p + 1.0) / 2.0).to_array();
            uses.push(EdgeUse {
                edge,
                reversed: from > to,
                pcurve: line(place(p), place(q), (0.0, 1.0)).unwrap(),
            });
        }
        Loop { uses }
    };
    let left = vec![
        chain(&mut model, &[0, 1, 4, 5]),
        chain(&mut model, &[6, 7, 8]),
    ];
    let right = vec![chain(&mut model, &[1, 2, 3, 4])];
    for (loops, spans) in [(left, 1), (right, 5)] {
        let face = Face {
            surface: paraboloid(spans),
            kind: SurfaceKind::BSpline,
            reversed: false,
            loops,
            trimmed: true,
            name: String::new(),
        };
        model.add_face(face).unwrap();
    }
    model
}
