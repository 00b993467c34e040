//! A common winding of the triangles of a surface.
//!
//! The winding spreads from triangle to triangle across paired sides. On a one-sided surface, or where sheets are
//! joined that only touch, some pairs contradict it and must be cut. Three candidates are compared, and the one with
//! the shortest cut is used: breadth-first from one triangle, flat edges first (a spanning tree by the bend, so that
//! the cut follows the sharpest edges), and the winding of the file. Source: ours.

use super::surface::{Surface, sides_of};
use crate::mesh::manifold::{NONE, after};
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use std::collections::{BTreeMap, VecDeque};

/// Cosine at an edge between two triangles (-1 where they lie in one plane) below which the edge is flat, to 37°.
/// Trial: not recorded.
const FLAT_EDGE_COSINE: f64 = -0.8;

/// The cuts that a common winding required.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Torn {
    pub(super) edges: usize,
    pub(super) length: f64,
    /// Length of the edges of the longest connected cut at which the surface is flat. The cut of a one-sided surface
    /// runs on, over flat edges; cuts at faults of the mesh are short.
    pub(super) longest: f64,
}

/// A winding of all triangles: the turned ones, and the sides that contradict it.
struct Winding {
    turned: Vec<bool>,
    /// The piece of each triangle, named by one of its triangles.
    piece: Vec<u32>,
    against: Vec<u32>,
    length: f64,
}

/// Disjoint sets of triangles with one bit per member: whether it is turned against its parent.
struct Signed {
    parent: Vec<u32>,
    turned: Vec<bool>,
}

impl Signed {
    fn new(count: usize) -> Self {
        Self {
            parent: (0..).take(count).collect(),
            turned: vec![false; count],
        }
    }

    /// The root of a triangle, and whether the triangle is turned against it. Near O(1) by path halving.
    fn root(&mut self, triangle: u32) -> (u32, bool) {
        let (mut k, mut turned) = (triangle as usize, false);
        loop {
            let up = self.parent[k] as usize;
            if up == k {
                return (self.parent[k], turned);
            }
            let to = self.turned[k] ^ (self.turned[up] && self.parent[up] as usize != up);
            self.parent[k] = self.parent[up];
            self.turned[k] = to;
            turned ^= to;
            k = self.parent[k] as usize;
        }
    }
}

impl Surface {
    /// Winds the triangles of each piece alike, as most of its area was if the winding is `trusted`.
    ///
    /// Where that is impossible, the surface is cut along the shortest of three cuts: where rings around a first
    /// triangle meet; where the surface bends most, as it does where sheets touch that do not belong together; or where
    /// the given triangles face opposite ways, as those between points with normals may along a sharp edge. O(n log n).
    pub(super) fn wind(&mut self, trusted: bool) -> Torn {
        let mut winding = self.wound_in_rings();
        if !winding.against.is_empty() {
            let as_given = self.wound_as_given(winding.piece.clone());
            for other in [self.wound_flat_first(), as_given] {
                if other.length < winding.length {
                    winding = other;
                }
            }
        }
        let longest = self.longest_flat(&winding.against);
        for &side in &winding.against {
            self.cut(side);
        }
        let mut votes = vec![0.0; self.triangles.len()];
        for (t, (&turned, &piece)) in winding.turned.iter().zip(&winding.piece).enumerate() {
            votes[piece as usize] += self.area_of(t) * if turned { 1.0 } else { -1.0 };
        }
        let pairs = winding.turned.iter().zip(&winding.piece);
        let turned: Vec<bool> = pairs
            .map(|(&turned, &piece)| turned ^ (trusted && votes[piece as usize] > 0.0))
            .collect();
        self.turn(&turned);
        Torn {
            edges: winding.against.len(),
            length: winding.length,
            longest,
        }
    }

    /// The largest length of the flat edges among connected ones of the given sides. O(n) for n vertices.
    fn longest_flat(&self, sides: &[u32]) -> f64 {
        if sides.is_empty() {
            return 0.0;
        }
        let mut sets = DisjointSets::new(self.points.len());
        for &side in sides {
            let [a, b] = self.ends(side);
            sets.join(a as usize, b as usize);
        }
        let mut lengths: BTreeMap<usize, f64> = BTreeMap::new();
        for &side in sides {
            if self.bend(side, self.opposite[side as usize]) < FLAT_EDGE_COSINE {
                let chain = sets.root(self.ends(side)[0] as usize);
                *lengths.entry(chain).or_default() += self.edge_length(side);
            }
        }
        lengths.into_values().fold(0.0, f64::max)
    }

    /// Whether the triangles across a side are wound against each other.
    fn is_against(&self, side: u32, other: u32) -> bool {
        self.start(side) == self.start(other)
    }

    fn edge_length(&self, side: u32) -> f64 {
        let [a, b] = self.ends(side).map(|k| self.points[k as usize]);
        a.distance(b)
    }

    /// The given winding.
    fn wound_as_given(&self, piece: Vec<u32>) -> Winding {
        let sides = (0..self.triangles.len()).flat_map(sides_of);
        let across = |side: &u32| {
            let other = self.opposite[*side as usize];
            other != NONE && *side < other && self.is_against(*side, other)
        };
        let against: Vec<u32> = sides.filter(across).collect();
        Winding {
            turned: vec![false; self.triangles.len()],
            piece,
            length: against.iter().map(|&side| self.edge_length(side)).sum(),
            against,
        }
    }

    /// Breadth first from one triangle, so that a cut is short on an even surface.
    fn wound_in_rings(&self) -> Winding {
        let count = self.triangles.len();
        let mut turned: Vec<Option<bool>> = vec![None; count];
        let mut winding = Winding {
            turned: Vec::new(),
            piece: vec![0; count],
            against: Vec::new(),
            length: 0.0,
        };
        for first in 0..count {
            if turned[first].is_some() {
                continue;
            }
            turned[first] = Some(false);
            let name = sides_of(first)[0] / 3;
            let mut queue = VecDeque::from([first]);
            while let Some(t) = queue.pop_front() {
                winding.piece[t] = name;
                let own = turned[t] == Some(true);
                for side in sides_of(t) {
                    let other = self.opposite[side as usize];
                    if other == NONE {
                        continue;
                    }
                    let u = other as usize / 3;
                    let wanted = own ^ self.is_against(side, other);
                    match turned[u] {
                        None => {
                            turned[u] = Some(wanted);
                            queue.push_back(u);
                        }
                        Some(is) if is != wanted && side < other => {
                            winding.against.push(side);
                            winding.length += self.edge_length(side);
                        }
                        Some(_) => {}
                    }
                }
            }
        }
        winding.turned = turned.into_iter().map(|t| t == Some(true)).collect();
        winding
    }

    /// Across flat edges first, so that contradictions lie at the sharpest edges.
    fn wound_flat_first(&self) -> Winding {
        let mut edges: Vec<(f64, u32, u32)> = (0_u32..)
            .zip(&self.opposite)
            .filter(|&(side, &other)| other != NONE && side < other)
            .map(|(side, &other)| (self.bend(side, other), side, other))
            .collect();
        edges.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut sets = Signed::new(self.triangles.len());
        let mut winding = Winding {
            turned: Vec::new(),
            piece: Vec::new(),
            against: Vec::new(),
            length: 0.0,
        };
        for (_, side, other) in edges {
            let wanted = self.is_against(side, other);
            let ((a, own), (b, its)) = (sets.root(side / 3), sets.root(other / 3));
            if a != b {
                sets.parent[a.max(b) as usize] = a.min(b);
                sets.turned[a.max(b) as usize] = own ^ its ^ wanted;
            } else if own ^ its != wanted {
                winding.against.push(side);
                winding.length += self.edge_length(side);
            }
        }
        (winding.piece, winding.turned) = (0_u32..)
            .take(self.triangles.len())
            .map(|t| sets.root(t))
            .unzip();
        winding
    }

    /// Cosine of the angle between two triangles at their edge: -1 where they lie flat, 1 where one lies on the other.
    fn bend(&self, side: u32, other: u32) -> f64 {
        let [a, b] = self.ends(side).map(|k| self.points[k as usize]);
        let along = (b - a).normalize_or_zero();
        let into = |side: u32| {
            let d = self.points[self.start(after(after(side))) as usize] - a;
            (d - along * along.dot(d)).normalize_or_zero()
        };
        into(side).dot(into(other))
    }

    /// Reverses triangles and renumbers their sides.
    fn turn(&mut self, turned: &[bool]) {
        // [a, b, c] becomes [a, c, b]: side 0 (ab) is now side 2 (ba), 1 (bc) stays 1 (cb), 2 (ca) is 0 (ac).
        let moved = |side: u32| match turned[side as usize / 3] {
            true => side / 3 * 3 + (2 - side % 3),
            false => side,
        };
        let mut opposite = vec![NONE; self.opposite.len()];
        for (side, &other) in (0_u32..).zip(&self.opposite) {
            if other != NONE {
                opposite[moved(side) as usize] = moved(other);
            }
        }
        self.opposite = opposite;
        for (t, turned) in self.triangles.iter_mut().zip(turned) {
            if *turned {
                t.swap(1, 2);
            }
        }
    }
}
