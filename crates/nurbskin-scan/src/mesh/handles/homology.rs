//! First homology of a surface over the field of two elements: which loops separate it.
//!
//! A tree-cotree decomposition: a tree of shortest paths over the vertices, and a spanning tree of the faces that
//! crosses none of its edges. The 2g edges in neither tree are the generators. Each generator closes a loop of faces,
//! which marks the edges that it crosses with one bit; a closed path separates the surface if and only if the bits of
//! its edges add to zero modulo 2. Borders count as closed with one face each.
//!
//! Source: J. Erickson, S. Har-Peled 2004 (greedy homotopy generators); D. Eppstein, *Dynamic generators of
//! topologically embedded graphs*, SODA 2003, for the decomposition.

use crate::mesh::manifold::{Adjacency, Manifold, NONE, after, before};
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A spanning tree of the vertices, a spanning tree of the faces that crosses none of its edges, and the 2 g edges in
/// neither. Borders count as closed with one face each.
#[derive(Debug)]
pub(super) struct Homology {
    pub(super) adjacency: Adjacency,
    /// The predecessor of each vertex on its shortest path from the first one; [`NONE`] at the root.
    parent: Vec<u32>,
    /// Edges in neither tree, by one side each.
    generators: Vec<u32>,
    /// Words per class.
    words: usize,
    /// For each side one bit per generator: whether the generator's dual loop crosses it. A closed path separates the
    /// surface if and only if the classes of its edges add to zero modulo 2.
    classes: Vec<u64>,
}

/// A vertex with its distance, ordered so that a heap yields the nearest first.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Near(pub(super) f64, pub(super) u32);

impl Eq for Near {}
impl PartialOrd for Near {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Near {
    fn cmp(&self, other: &Self) -> Ordering {
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}

impl Homology {
    /// O(n log n + g n).
    pub(super) fn new(manifold: &Manifold) -> Self {
        let adjacency = manifold.adjacency();
        // 1. Shortest paths from the first vertex.
        let (distance, parent) = shortest_paths(manifold, &adjacency);
        // 2. Faces joined across the edges with the longest loops through the root first; the remaining edges close
        //    short loops.
        let start = |side: u32| manifold.triangles[side as usize / 3][side as usize % 3];
        let in_tree = |side: u32| {
            let (a, b) = (start(side), start(after(side)));
            parent[a as usize] == b || parent[b as usize] == a
        };
        let mut crossings: Vec<(f64, u32)> = (0_u32..)
            .zip(&adjacency.opposite)
            .filter(|&(side, &other)| (other == NONE || side < other) && !in_tree(side))
            .map(|(side, _)| {
                let (a, b) = (start(side) as usize, start(after(side)) as usize);
                let edge = manifold.points[a].distance(manifold.points[b]);
                (distance[a] + distance[b] + edge, side)
            })
            .collect();
        crossings.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
        let face_beyond = faces_beyond(manifold, &adjacency);
        let faces = manifold.triangles.len() + manifold.loops.len();
        let mut joined = DisjointSets::new(faces);
        let mut branches: Vec<Vec<(u32, u32)>> = vec![Vec::new(); faces];
        let mut generators = Vec::new();
        for &(_, side) in &crossings {
            let (f, g) = (side as usize / 3, face_beyond[side as usize] as usize);
            if joined.root(f) == joined.root(g) {
                generators.push(side);
            } else {
                joined.join(f, g);
                branches[f].push((face_beyond[side as usize], side));
                branches[g].push((side / 3, side));
            }
        }
        // 3. The dual loop of each generator marks the edges that it crosses.
        let mut this = Self {
            words: generators.len().div_ceil(64),
            classes: Vec::new(),
            adjacency,
            parent,
            generators,
        };
        this.mark(&branches, &face_beyond);
        this
    }

    fn mark(&mut self, branches: &[Vec<(u32, u32)>], face_beyond: &[u32]) {
        // The path of each face to the root of its tree.
        let mut up: Vec<Option<(u32, u32)>> = vec![None; branches.len()];
        let mut seen = vec![false; branches.len()];
        for root in 0..branches.len() {
            if seen[root] {
                continue;
            }
            seen[root] = true;
            let mut stack = vec![root];
            while let Some(f) = stack.pop() {
                for &(g, side) in &branches[f] {
                    if !seen[g as usize] {
                        seen[g as usize] = true;
                        up[g as usize] = Some((u32::try_from(f).unwrap_or(NONE), side));
                        stack.push(g as usize);
                    }
                }
            }
        }
        self.classes = vec![0; self.adjacency.opposite.len() * self.words];
        for (k, &generator) in self.generators.clone().iter().enumerate() {
            self.flip(generator, k);
            for from in [generator / 3, face_beyond[generator as usize]] {
                let mut at = from as usize;
                // Both paths lead to the root: their common part is flipped twice.
                while let Some((next, side)) = up[at] {
                    self.flip(side, k);
                    at = next as usize;
                }
            }
        }
    }

    fn flip(&mut self, side: u32, bit: usize) {
        let other = self.adjacency.opposite[side as usize];
        for side in [side, other] {
            if side != NONE {
                self.classes[side as usize * self.words + bit / 64] ^= 1 << (bit % 64);
            }
        }
    }

    /// Words per class.
    pub(super) fn words(&self) -> usize {
        self.words
    }

    /// The class of a side.
    pub(super) fn class(&self, side: u32) -> &[u64] {
        &self.classes[side as usize * self.words..(side as usize + 1) * self.words]
    }

    /// The vertices of the loops that the generators close in the tree, ascending. Every loop that does not separate
    /// the surface meets one of them.
    pub(super) fn vertices_on_generators(&self, manifold: &Manifold) -> Vec<u32> {
        let start = |side: u32| manifold.triangles[side as usize / 3][side as usize % 3];
        let mut parity = vec![false; self.parent.len()];
        let mut on = vec![false; self.parent.len()];
        for &generator in &self.generators {
            let mut way = Vec::new();
            for end in [generator, after(generator)] {
                let mut at = start(end);
                way.push(at);
                while self.parent[at as usize] != NONE {
                    parity[at as usize] ^= true;
                    at = self.parent[at as usize];
                    way.push(at);
                }
            }
            // Vertices whose edge towards the root occurs once, and the ends of those edges.
            for at in way {
                if std::mem::take(&mut parity[at as usize]) {
                    on[at as usize] = true;
                    on[self.parent[at as usize] as usize] = true;
                }
            }
        }
        (0_u32..).zip(on).filter(|v| v.1).map(|v| v.0).collect()
    }
}

/// Distance of each vertex from the first along edges, and its predecessor on the path.
fn shortest_paths(manifold: &Manifold, adjacency: &Adjacency) -> (Vec<f64>, Vec<u32>) {
    let mut distance = vec![f64::INFINITY; manifold.points.len()];
    let mut parent = vec![NONE; manifold.points.len()];
    let mut heap = BinaryHeap::from([Near(0.0, 0)]);
    if let Some(d) = distance.first_mut() {
        *d = 0.0;
    }
    while let Some(Near(d, v)) = heap.pop() {
        if d > distance[v as usize] {
            continue;
        }
        for (_, w) in spokes(manifold, adjacency, v) {
            let there = d + manifold.points[v as usize].distance(manifold.points[w as usize]);
            if there < distance[w as usize] {
                distance[w as usize] = there;
                parent[w as usize] = v;
                heap.push(Near(there, w));
            }
        }
    }
    (distance, parent)
}

/// The edges at a vertex: a side of each, which starts or ends there, and the vertex at the other end.
pub(super) fn spokes<'a>(
    manifold: &'a Manifold,
    adjacency: &'a Adjacency,
    vertex: u32,
) -> impl Iterator<Item = (u32, u32)> + 'a {
    let start = |side: u32| manifold.triangles[side as usize / 3][side as usize % 3];
    adjacency.fan(vertex).flat_map(move |side| {
        let out = (side, start(after(side)));
        // The last side into a border vertex has no opposite side that starts there.
        let back = before(side);
        let last = adjacency.opposite[back as usize] == NONE;
        [Some(out), last.then(|| (back, start(back)))]
            .into_iter()
            .flatten()
    })
}

/// The face across each side: a triangle, or for border sides the face of their border.
fn faces_beyond(manifold: &Manifold, adjacency: &Adjacency) -> Vec<u32> {
    let mut border = vec![NONE; manifold.points.len()];
    let count = u32::try_from(manifold.triangles.len()).unwrap_or(NONE);
    for (k, vertices) in (count..).zip(&manifold.loops) {
        for &v in vertices {
            border[v as usize] = k;
        }
    }
    let sides = (0_u32..).zip(&adjacency.opposite);
    sides
        .map(|(side, &other)| match other {
            NONE => border[manifold.triangles[side as usize / 3][side as usize % 3] as usize],
            other => other / 3,
        })
        .collect()
}

/// Adds a class to a basis in echelon form if it is linearly independent. Returns whether it is.
pub(super) fn independent(basis: &mut Vec<Vec<u64>>, mut class: Vec<u64>) -> bool {
    let lead = |class: &[u64]| {
        let word = class.iter().position(|w| *w != 0)?;
        Some((word, class[word].trailing_zeros()))
    };
    for row in basis.iter() {
        let Some((word, bit)) = lead(row) else {
            continue;
        };
        if class[word] >> bit & 1 == 1 {
            for (c, r) in class.iter_mut().zip(row) {
                *c ^= r;
            }
        }
    }
    if lead(&class).is_none() {
        return false;
    }
    basis.push(class);
    true
}
