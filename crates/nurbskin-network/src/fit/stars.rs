//! Target directions of the edges at each vertex: evenly spread stars.
//!
//! Around a smooth vertex the k edges leave at 360/k degrees in the tangent plane, turned to agree best with where they
//! lead; between hard edges each sector is divided evenly. Each leaves as fast as its chord is long. The two pieces of a
//! line go straight on. The targets do not vanish, so that tangents cannot: gluing rows alone are satisfied by zero ones.
//!
//! Source: ours.

use super::network::{Network, number};
use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use std::collections::BTreeMap;

/// Parameter, from the vertex, of the point that tells where an edge leads.
/// Trial: not recorded.
const AHEAD: f64 = 0.3;
/// Weight of the row that only keeps the speed of a line's end.
/// Trial: not recorded; smaller than that of a direction.
const SPEED: f64 = 0.3;
/// (u, v) near the corners, where normals are taken.
/// Guard: at a corner itself they may vanish.
const NEAR_CORNERS: [[f64; 2]; 4] = [[0.05, 0.05], [0.95, 0.05], [0.95, 0.95], [0.05, 0.95]];

/// The edges around a vertex, or around a part of it between two hard edges, counter-clockwise.
#[derive(Clone, Debug)]
struct Sector {
    vertex: u32,
    /// The first one again at the end where a single hard edge leads in and out.
    edges: Vec<u32>,
    faces: Vec<u32>,
    /// Whether it goes all the way round without a hard edge.
    full: bool,
}

/// The stars of a network: its sectors and where lines pass. The same for all its knots.
#[derive(Clone, Debug)]
pub(crate) struct Stars {
    sectors: Vec<Sector>,
    /// A vertex and a hard edge, and the one that it continues.
    lines: Vec<(u32, u32, Option<u32>)>,
}

/// One target: the derivative of an edge at its end, seen from the vertex, as unknowns, weight and target.
pub(crate) struct StarRow {
    pub(crate) row: [(u32, f64); 2],
    pub(crate) weight: f64,
    pub(crate) target: DVec3,
}

/// For each corner of a face the side that leads into it counter-clockwise around the vertex, and the next.
const AROUND: [[usize; 2]; 4] = [[0, 3], [1, 0], [2, 1], [3, 2]];

impl Stars {
    /// The stars of a network. O(n log n).
    pub(crate) fn new(network: &Network) -> Self {
        // next[(vertex, edge)] = the next edge counter-clockwise, and the face between.
        let mut next: BTreeMap<(u32, u32), (u32, u32)> = BTreeMap::new();
        for (f, face) in network.faces.iter().enumerate() {
            for (c, [a, b]) in AROUND.iter().enumerate() {
                let [a, b] = [a, b].map(|&k| face.sides[k].edge);
                next.insert((face.corners[c], a), (b, number(f)));
            }
        }
        let hard = |e: u32| network.edges[e as usize].kind.is_hard();
        let mut stars = Self {
            sectors: Vec::new(),
            lines: Vec::new(),
        };
        for vertex in 0..number(network.vertices) {
            let around: Vec<(u32, (u32, u32))> = next
                .range((vertex, 0)..=(vertex, u32::MAX))
                .map(|(&(_, e), &to)| (e, to))
                .collect();
            let mut lines: Vec<u32> = around
                .iter()
                .flat_map(|&(e, (to, _))| [e, to])
                .filter(|&e| hard(e))
                .collect();
            lines.sort_unstable();
            lines.dedup();
            let Some(&(first, _)) = around.first() else {
                continue;
            };
            if lines.is_empty() {
                let sector = walk(&next, vertex, first, |e| e == first);
                let round = sector.edges.last() == Some(&first);
                let edges = sector.edges[..sector.edges.len() - 1].to_vec();
                if round && edges.len() == around.len() {
                    stars.sectors.push(Sector {
                        edges,
                        full: true,
                        ..sector
                    });
                }
                continue;
            }
            let line = |e: u32| network.edges[e as usize].line;
            match lines[..] {
                [a, b] if line(a).is_some() && line(a) == line(b) => {
                    stars.lines.push((vertex, a, Some(b)));
                }
                _ => stars.lines.extend(lines.iter().map(|&e| (vertex, e, None))),
            }
            for &e in &lines {
                let sector = walk(&next, vertex, e, hard);
                if sector.edges.len() > 2 {
                    stars.sectors.push(sector);
                }
            }
        }
        stars
    }

    /// The targets for the network as it is. O(n).
    pub(crate) fn rows(&self, network: &Network, chords: &[f64]) -> Vec<StarRow> {
        let normals: Vec<[DVec3; 4]> = network
            .faces
            .iter()
            .map(|face| NEAR_CORNERS.map(|[u, v]| face.patch().tangents(u, v).normal()))
            .collect();
        let mut rows = Vec::new();
        let mut push = |vertex: u32, edge: u32, direction: DVec3, weight: f64| {
            let chord = chords[edge as usize];
            rows.push(StarRow {
                row: outward(network, vertex, edge, 1.0 / chord),
                weight,
                target: direction,
            });
        };
        for sector in &self.sectors {
            let normal: DVec3 = sector
                .faces
                .iter()
                .filter_map(|&f| {
                    let corners = network.faces[f as usize].corners;
                    let corner = corners.iter().position(|&c| c == sector.vertex)?;
                    Some(normals[f as usize][corner])
                })
                .sum();
            let normal = normal.normalize_or(DVec3::Z);
            let x = normal.any_orthonormal_vector();
            let y = normal.cross(x);
            let leads: Vec<DVec2> = sector
                .edges
                .iter()
                .map(|&e| {
                    let d = leads(network, sector.vertex, e);
                    DVec2::new(d.dot(x), d.dot(y)).normalize_or_zero()
                })
                .collect();
            let at = |angle: f64| math::cos(angle) * x + math::sin(angle) * y;
            let count = leads.len() as f64;
            if sector.full {
                let turn = std::f64::consts::TAU / count;
                let sum: DVec2 = leads
                    .iter()
                    .enumerate()
                    .map(|(k, z)| math::unit_vector(-turn * k as f64).rotate(*z))
                    .sum();
                for (k, &e) in sector.edges.iter().enumerate() {
                    push(
                        sector.vertex,
                        e,
                        at(math::direction_angle(sum) + turn * k as f64),
                        1.0,
                    );
                }
                continue;
            }
            let (first, last) = (
                math::direction_angle(leads[0]),
                math::direction_angle(leads[leads.len() - 1]),
            );
            // One hard edge that starts and ends the walk has all of the plane.
            let once = sector.edges.first() == sector.edges.last();
            let wide = if once {
                std::f64::consts::TAU
            } else {
                (last - first).rem_euclid(std::f64::consts::TAU)
            };
            for (k, &e) in sector
                .edges
                .iter()
                .enumerate()
                .skip(1)
                .take(leads.len() - 2)
            {
                push(
                    sector.vertex,
                    e,
                    at(first + wide * k as f64 / (count - 1.0)),
                    1.0,
                );
            }
        }
        for &(vertex, edge, other) in &self.lines {
            let lead = leads(network, vertex, edge);
            match other {
                None => push(vertex, edge, lead, SPEED),
                Some(other) => {
                    let straight = (lead - leads(network, vertex, other)).normalize_or_zero();
                    push(vertex, edge, straight, 1.0);
                    push(vertex, other, -straight, 1.0);
                }
            }
        }
        rows
    }
}

/// The edges from `first` counter-clockwise around a vertex, up to one for which `ends` holds, or a border.
fn walk(
    next: &BTreeMap<(u32, u32), (u32, u32)>,
    vertex: u32,
    first: u32,
    ends: impl Fn(u32) -> bool,
) -> Sector {
    let mut sector = Sector {
        vertex,
        edges: vec![first],
        faces: Vec::new(),
        full: false,
    };
    let mut edge = first;
    while let Some(&(to, face)) = next.get(&(vertex, edge)) {
        sector.edges.push(to);
        sector.faces.push(face);
        edge = to;
        if ends(to) || sector.faces.len() > next.len() {
            break;
        }
    }
    sector
}

/// Unit direction from a vertex to a point of an edge near it.
fn leads(network: &Network, vertex: u32, edge: u32) -> DVec3 {
    let e = &network.edges[edge as usize];
    let t = if e.ends[0] == vertex {
        AHEAD
    } else {
        1.0 - AHEAD
    };
    (network.on_edge(e, t)[0] - network.x[vertex as usize]).normalize_or_zero()
}

/// `scale` times the derivative of an edge at a vertex, outwards, as two unknowns.
fn outward(network: &Network, vertex: u32, edge: u32, scale: f64) -> [(u32, f64); 2] {
    let e = &network.edges[edge as usize];
    let (t, near, far) = if e.ends[0] == vertex {
        (0.0, 0, 1)
    } else {
        (1.0, 3, 2)
    };
    let basis = Network::edge_basis(e, t);
    let sign = if t == 0.0 { scale } else { -scale };
    [near, far].map(|k| (basis[k].0, sign * basis[k].1[1]))
}
