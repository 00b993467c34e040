//! Networks of four-sided faces of known shape.

use crate::network::{FaceNetwork, NetworkEdge, NetworkFace};
use crate::normal_jump::JoinKind;
use glam::DVec3;
use nurbskin_geometry::math;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::shape::Edge as Rim;
use nurbskin_geometry::nurbs::{ControlNet, KnotVector, NurbsSurface};
use std::f64::consts::TAU;

/// The network of patches over the unit square whose rims coincide within `near`, as curves run one way or the other.
/// Edges are open where they have one face, else smooth.
pub fn glued(patches: Vec<NurbsSurface>, near: f64) -> FaceNetwork {
    let mut network = FaceNetwork::default();
    let mut used: Vec<usize> = Vec::new();
    for surface in patches {
        let sides = [Rim::VMin, Rim::UMax, Rim::VMax, Rim::UMin].map(|rim| {
            let curve = surface.edge_curve(rim).unwrap();
            let at = [0.0, 0.5, 1.0].map(|t| curve.point(t));
            let same = |edge: &NetworkEdge, turned: bool| {
                let ts = if turned {
                    [1.0, 0.5, 0.0]
                } else {
                    [0.0, 0.5, 1.0]
                };
                ts.iter()
                    .zip(at)
                    .all(|(&t, p)| edge.curve.point(t).distance(p) <= near)
            };
            for reversed in [false, true] {
                if let Some(k) = network.edges.iter().position(|e| same(e, reversed)) {
                    used[k] += 1;
                    return (u32::try_from(k).unwrap(), reversed);
                }
            }
            let ends = [at[0], at[2]].map(|p| {
                let found = network.vertices.iter().position(|v| v.distance(p) <= near);
                let k = found.unwrap_or_else(|| {
                    network.vertices.push(p);
                    network.vertices.len() - 1
                });
                u32::try_from(k).unwrap()
            });
            let kind = JoinKind::Smooth;
            network.edges.push(NetworkEdge { curve, ends, kind });
            used.push(1);
            (u32::try_from(network.edges.len() - 1).unwrap(), false)
        });
        network.faces.push(NetworkFace { surface, sides });
    }
    for (edge, count) in network.edges.iter_mut().zip(used) {
        if count == 1 {
            edge.kind = JoinKind::Open;
        }
    }
    network
}

/// The point of the cube -1..1 at (x, y), from -1 to 1, of a side; x, y and the outward normal are right-handed.
fn on_cube(side: usize, x: f64, y: f64) -> DVec3 {
    match side {
        0 => DVec3::new(x, y, 1.0),
        1 => DVec3::new(y, x, -1.0),
        2 => DVec3::new(1.0, x, y),
        3 => DVec3::new(-1.0, y, x),
        4 => DVec3::new(y, 1.0, x),
        _ => DVec3::new(x, -1.0, y),
    }
}

/// Six bicubic patches over the sides of a cube, with `count` control points along each side that `f` moves.
fn cubed(count: usize, f: impl Fn(DVec3) -> DVec3) -> Vec<NurbsSurface> {
    let knots = KnotVector::uniform(3, count).unwrap();
    let at: Vec<f64> = knots.greville().iter().map(|t| 2.0 * t - 1.0).collect();
    let patch = |side: usize| {
        // Symmetric, so that rims are the same bits from either side.
        let place = |i: usize| 0.5 * (at[i] - at[count - 1 - i]);
        let net = ControlNet::from_fn(count, count, |i, j| f(on_cube(side, place(i), place(j))));
        NurbsSurface::new(knots.clone(), knots.clone(), net.unwrap(), None).unwrap()
    };
    (0..6).map(patch).collect()
}

/// A cube of side 2 around the origin, of six bicubic faces with sharp edges. Its faces have inner knots that their
/// edges do not have.
pub fn cube_network() -> FaceNetwork {
    let mut network = glued(cubed(4, |p| p), 1e-9);
    for (k, face) in network.faces.iter_mut().enumerate() {
        let knot = 0.125 * (k + 1) as f64;
        let finer = face.surface.insert_knots(Direction::U, &[knot, 0.25]);
        face.surface = finer
            .and_then(|s| s.insert_knots(Direction::V, &[0.5]))
            .unwrap();
    }
    for edge in &mut network.edges {
        edge.kind = JoinKind::Sharp;
    }
    network
}

/// About a ball of this radius: six bicubic faces whose control points are those of a cube, pushed out to a sphere. The
/// normals jump across its edges by some degrees, less the more control points there are.
pub fn round_network(radius: f64, count: usize) -> FaceNetwork {
    glued(cubed(count, |p| radius * p.normalize()), 1e-9 * radius)
}

/// A torus as one periodic bicubic surface, cut at its knots into m x n faces of `spans` spans along either side: normals
/// are the same on both sides of each edge, to rounding.
pub fn torus_network([m, n]: [usize; 2], spans: usize, radii: [f64; 2]) -> FaceNetwork {
    let [major, minor] = radii;
    let [p, q] = [m * spans, n * spans];
    let breaks = |count: usize, parts: usize| -> Vec<f64> {
        (0..=count)
            .map(|k| k as f64 / count as f64 * parts as f64)
            .collect()
    };
    let [knots_u, knots_v] =
        [breaks(p, m), breaks(q, n)].map(|b| KnotVector::periodic(3, &b).unwrap());
    let net = ControlNet::from_fn(p + 3, q + 3, |i, j| {
        let turn = |k: usize, count: usize| TAU * (k % count) as f64 / count as f64;
        let (a, b) = (turn(i, p), turn(j, q));
        let r = major + minor * math::cos(b);
        DVec3::new(r * math::cos(a), r * math::sin(a), minor * math::sin(b))
    });
    let surface = NurbsSurface::new(knots_u, knots_v, net.unwrap(), None).unwrap();
    let unit = |knots: &KnotVector| knots.with_domain(0.0, 1.0).unwrap();
    let mut patches = Vec::new();
    for i in 0..m {
        for j in 0..n {
            let patch = surface
                .segment(Direction::U, i as f64, i as f64 + 1.0)
                .and_then(|s| s.segment(Direction::V, j as f64, j as f64 + 1.0))
                .unwrap();
            let [u, v] = [unit(patch.knots_u()), unit(patch.knots_v())];
            let net = patch.control_points().clone();
            patches.push(NurbsSurface::new(u, v, net, None).unwrap());
        }
    }
    glued(patches, 1e-9 * (major + minor))
}

/// The torus network of 4 x 3 faces without its first face: an open shell.
pub fn open_network() -> FaceNetwork {
    let whole = torus_network([4, 3], 3, [30.0, 10.0]);
    let patches = whole.faces.into_iter().skip(1).map(|face| face.surface);
    glued(patches.collect(), 1e-7)
}
