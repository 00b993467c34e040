//! A corner table from which edges are taken.

use crate::mesh::manifold::{NONE, after, before, opposite_sides};

/// Vertices with more edges than this are left as they are, and none comes to have more: what is done around a vertex then
/// takes a bounded time. Vertices have 6 on average.
pub(super) const MOST_EDGES: usize = 24;
/// A tetrahedron: the smallest closed surface.
const LEAST_TRIANGLES: usize = 4;

/// Triangles by their corners, and who lies beside whom. Side s runs from corner s to the next one of its triangle.
pub(super) struct Corners {
    /// The vertex at each corner; [`NONE`] for the corners of a triangle that is gone.
    pub(super) vertex: Vec<u32>,
    /// As in [`Adjacency`](crate::mesh::manifold::Adjacency).
    pub(super) opposite: Vec<u32>,
    /// A side that starts at each vertex, on a border the border's; [`NONE`] for a vertex that is gone.
    pub(super) first: Vec<u32>,
    /// How many triangles are left, ...
    pub(super) triangles: usize,
    /// ... and how many vertices.
    pub(super) vertices: usize,
}

/// What lies around the two ends of an edge.
#[derive(Default)]
pub(super) struct Around {
    /// The sides that start at each end.
    pub(super) fans: [Vec<u32>; 2],
    /// The vertices around each end.
    rings: [Vec<u32>; 2],
}

impl Corners {
    /// None for what is no oriented manifold. O(n log n).
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

    /// Whether triangles beside each other are wound alike, no side is a point or has three of them, and turning around each
    /// vertex meets all of its corners.
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
        // Sides of edges with three triangles have none across: a vertex there has several fans.
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

    /// Whether an edge is looked at from this side: each is once, from the smaller of its two.
    pub(super) fn is_edge(&self, side: u32) -> bool {
        self.start(side) != NONE && side < self.other(side)
    }

    /// All edges, by such sides.
    pub(super) fn edges(&self) -> impl Iterator<Item = u32> + '_ {
        let sides = (0_u32..).zip(&self.vertex);
        sides
            .map(|(side, _)| side)
            .filter(|&side| self.is_edge(side))
    }

    /// The sides that start at a vertex, turning with the winding; whether they are few enough.
    pub(super) fn fan(&self, vertex: u32, fan: &mut Vec<u32>) -> bool {
        fan.clear();
        let first = self.first[vertex as usize];
        let mut side = first;
        while side != NONE {
            if fan.len() == MOST_EDGES {
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

    /// Whether the ends of an edge may become one vertex: the surface stays a manifold of the same genus, with the same
    /// borders. That is so if the vertices around both ends are those across from the edge and no others, and a border
    /// loses vertices along itself only. Fills in what lies around.
    ///
    /// Source: T. K. Dey, H. Edelsbrunner, S. Guha, D. V. Nekhayev, *Topology preserving edge contraction*, Publications de
    /// l'Institut Mathematique 66, 1999: the link condition, borders being cones over one more vertex each.
    pub(super) fn may_collapse(&self, side: u32, around: &mut Around) -> bool {
        let [a, b] = self.ends(side);
        let other = self.other(side);
        if other != NONE && self.on_border(a) && self.on_border(b) {
            return false;
        }
        // The vertex across must have a triangle left. With four triangles a closed surface has no vertex to lose.
        let is_ear = |s: u32| self.other(after(s)) == NONE && self.other(before(s)) == NONE;
        if self.triangles <= LEAST_TRIANGLES || is_ear(side) || (other != NONE && is_ear(other)) {
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
        // The ends themselves and one edge to each vertex across are lost.
        common == across && near_a.len() + near_b.len() <= MOST_EDGES + 2 + across
    }

    /// Makes one vertex of the ends of an edge that [may collapse](Self::may_collapse): the second goes. `around` as that
    /// left it. O(1).
    pub(super) fn collapse(&mut self, side: u32, around: &Around) {
        let [a, b] = self.ends(side);
        for &s in &around.fans[1] {
            self.vertex[s as usize] = a;
        }
        // A side that starts at a and stays.
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

    /// Takes a triangle out and joins what lies beyond its other two sides.
    fn take_out(&mut self, side: u32) {
        let (next, last) = (after(side), before(side));
        let [x, y] = [next, last].map(|s| self.other(s));
        for (one, two) in [(x, y), (y, x)] {
            if one != NONE {
                self.opposite[one as usize] = two;
            }
        }
        // The vertex across may have begun its fan here; what is left beyond its side towards the edge's end begins it now.
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

    /// The side from which turning meets all sides that start where this one does.
    fn turned_back(&self, side: u32) -> u32 {
        let mut first = side;
        for _ in 0..2 * MOST_EDGES {
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
