//! A corner table from which edges are collapsed.
//!
//! An edge ab may collapse if the common neighbours of a and b are exactly the vertices across the edge (the link
//! condition), with each border as a cone over one more vertex. A collapse moves the corners of b to a and removes the
//! one or two triangles at the edge, in O(1) for a bounded valence.
//!
//! Source: T. K. Dey, H. Edelsbrunner, S. Guha, D. V. Nekhayev, *Topology preserving edge contraction*, Publications
//! de l'Institut Mathematique 66, 1999.

use crate::mesh::manifold::{NONE, after, before, opposite_sides};

/// Most edges of a vertex that takes part in a collapse or results from one. Guard: bounds the time per collapse;
/// vertices have 6 edges on average.
pub(super) const MAX_VALENCE: usize = 24;
/// Fewest triangles of the mesh. Derived: the smallest closed surface is a tetrahedron.
const MIN_TRIANGLES: usize = 4;

/// Triangles by their corners, and the opposite side of each side. Side s runs from corner s to the next one of its
/// triangle.
pub(super) struct Corners {
    /// The vertex at each corner; [`NONE`] for the corners of a triangle that is gone.
    pub(super) vertex: Vec<u32>,
    /// As in [`Adjacency`](crate::mesh::manifold::Adjacency).
    pub(super) opposite: Vec<u32>,
    /// A side that starts at each vertex, at a border the border's; [`NONE`] for a removed vertex.
    pub(super) first: Vec<u32>,
    /// Number of remaining triangles.
    pub(super) triangles: usize,
    /// Number of remaining vertices.
    pub(super) vertices: usize,
}

/// The neighbourhoods of the two ends of an edge.
#[derive(Default)]
pub(super) struct Around {
    /// The sides that start at each end.
    pub(super) fans: [Vec<u32>; 2],
    /// The vertices around each end.
    rings: [Vec<u32>; 2],
}

impl Corners {
    /// `None` if the triangles are no oriented manifold. O(n log n).
    pub(super) fn new(triangles: &[[u32; 3]], points: usize) -> Option<Self> {
        let opposite = opposite_sides(triangles);
        let mut first = vec![NONE; points];
        for ((side, &other), &start) in (0_u32..).zip(&opposite).zip(triangles.as_flattened()) {
            let first = &mut first[start as usize];
            if other == NONE || *first == NONE {
                *first = side;
            }
        }
        let this = Self {
            vertex: triangles.as_flattened().to_vec(),
            opposite,
            triangles: triangles.len(),
            vertices: first.iter().filter(|side| **side != NONE).count(),
            first,
        };
        this.is_manifold().then_some(this)
    }

    /// Whether adjacent triangles are wound alike, no side is degenerate or has three triangles, and the fan of each
    /// vertex contains all of its corners.
    fn is_manifold(&self) -> bool {
        let agree = |(side, &other): (u32, &u32)| {
            let [a, b] = self.ends(side);
            a != b && (other == NONE || self.ends(other) == [b, a])
        };
        if !(0_u32..).zip(&self.opposite).all(agree) {
            return false;
        }
        let mut met = 0;
        for &first in self.first.iter().filter(|side| **side != NONE) {
            let mut side = first;
            loop {
                met += 1;
                side = self.other(before(side));
                if side == first || side == NONE {
                    break;
                }
            }
        }
        // Sides of edges with three triangles have no opposite: a vertex there has several fans.
        met == self.vertex.len()
    }

    pub(super) fn start(&self, side: u32) -> u32 {
        self.vertex[side as usize]
    }

    /// The ends of a side.
    pub(super) fn ends(&self, side: u32) -> [u32; 2] {
        [self.start(side), self.start(after(side))]
    }

    pub(super) fn other(&self, side: u32) -> u32 {
        self.opposite[side as usize]
    }

    /// Whether a vertex lies on a border.
    pub(super) fn on_border(&self, vertex: u32) -> bool {
        match self.first[vertex as usize] {
            NONE => false,
            side => self.other(side) == NONE,
        }
    }

    /// Whether a side represents its edge: the smaller of the two sides does.
    pub(super) fn is_edge(&self, side: u32) -> bool {
        self.start(side) != NONE && side < self.other(side)
    }

    /// All edges, by the sides that represent them.
    pub(super) fn edges(&self) -> impl Iterator<Item = u32> + '_ {
        let sides = (0_u32..).zip(&self.vertex);
        sides
            .map(|(side, _)| side)
            .filter(|&side| self.is_edge(side))
    }

    /// Fills in the sides that start at a vertex, in the direction of the winding. Returns whether they are few enough.
    pub(super) fn fan(&self, vertex: u32, fan: &mut Vec<u32>) -> bool {
        fan.clear();
        let first = self.first[vertex as usize];
        let mut side = first;
        while side != NONE {
            if fan.len() == MAX_VALENCE {
                return false;
            }
            fan.push(side);
            side = self.other(before(side));
            if side == first {
                break;
            }
        }
        true
    }

    /// The vertices at the other ends of the edges of a vertex, by the sides that start there.
    pub(super) fn ring(&self, fan: &[u32], ring: &mut Vec<u32>) {
        ring.clear();
        ring.extend(fan.iter().map(|&side| self.start(after(side))));
        if let Some(&last) = fan.last()
            && self.other(before(last)) == NONE
        {
            ring.push(self.start(before(last)));
        }
    }

    /// Whether an edge may collapse: the surface stays a manifold of the same genus with the same borders. That is so
    /// if the common neighbours of both ends are exactly the vertices across the edge, and a border loses vertices
    /// along itself only. Fills in the neighbourhoods.
    ///
    /// Source: T. K. Dey, H. Edelsbrunner, S. Guha, D. V. Nekhayev, *Topology preserving edge contraction*,
    /// Publications de l'Institut Mathematique 66, 1999: the link condition, with borders as cones over one more vertex
    /// each.
    pub(super) fn may_collapse(&self, side: u32, around: &mut Around) -> bool {
        let [a, b] = self.ends(side);
        let other = self.other(side);
        if other != NONE && self.on_border(a) && self.on_border(b) {
            return false;
        }
        // The vertex across the edge must keep a triangle, and a closed surface of four triangles cannot lose a vertex.
        let is_ear = |s: u32| self.other(after(s)) == NONE && self.other(before(s)) == NONE;
        if self.triangles <= MIN_TRIANGLES || is_ear(side) || (other != NONE && is_ear(other)) {
            return false;
        }
        let Around { fans, rings } = around;
        for ((vertex, fan), ring) in [a, b].into_iter().zip(fans).zip(&mut *rings) {
            if !self.fan(vertex, fan) {
                return false;
            }
            self.ring(fan, ring);
        }
        let [near_a, near_b] = rings;
        let across = if other == NONE { 1 } else { 2 };
        let common = near_a.iter().filter(|v| near_b.contains(v)).count();
        // The collapse removes the edge itself and one edge to each vertex across.
        common == across && near_a.len() + near_b.len() <= MAX_VALENCE + 2 + across
    }

    /// Collapses an edge that [may collapse](Self::may_collapse); the second end is removed. `around` is the result of
    /// that test. O(1).
    pub(super) fn collapse(&mut self, side: u32, around: &Around) {
        let [a, b] = self.ends(side);
        for &s in &around.fans[1] {
            self.vertex[s as usize] = a;
        }
        // A side that starts at a and remains.
        let keeps = match self.other(before(side)) {
            NONE => after(self.other(after(side))),
            beyond => beyond,
        };
        let other = self.other(side);
        self.take_out(side);
        if other != NONE {
            self.take_out(other);
        }
        self.first[b as usize] = NONE;
        self.first[a as usize] = self.turned_back(keeps);
        self.vertices -= 1;
    }

    /// Removes a triangle and joins the sides beyond its other two sides.
    fn take_out(&mut self, side: u32) {
        let (next, last) = (after(side), before(side));
        let [x, y] = [next, last].map(|s| self.other(s));
        for (one, two) in [(x, y), (y, x)] {
            if one != NONE {
                self.opposite[one as usize] = two;
            }
        }
        // The fan of the vertex across may have begun here; it then begins at the side beyond.
        let across = self.start(last) as usize;
        if self.first[across] == last {
            self.first[across] = x;
        }
        for s in [side, next, last] {
            self.vertex[s as usize] = NONE;
            self.opposite[s as usize] = NONE;
        }
        self.triangles -= 1;
    }

    /// The first side of the fan that contains this side.
    fn turned_back(&self, side: u32) -> u32 {
        let mut first = side;
        for _ in 0..2 * MAX_VALENCE {
            match self.other(first) {
                NONE => break,
                other => first = after(other),
            }
            if first == side {
                break;
            }
        }
        first
    }
}
