//! Shortest loops that do not separate a surface.
//!
//! The shortest such loop through a vertex consists of two shortest paths from it and one edge between their ends.
//! Dijkstra's algorithm finds the paths within half of the length limit, together with the homology class of each; the
//! edge must make the sum of the three classes non-zero.
//!
//! Source: Erickson and Har-Peled 2004.

use super::homology::{Homology, Near, spokes};
use crate::mesh::manifold::{Manifold, NONE};
use std::collections::BinaryHeap;

/// A simple closed path along edges.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Loop {
    pub(super) length: f64,
    /// Ascending.
    pub(super) vertices: Vec<u32>,
    /// One side of each edge.
    pub(super) sides: Vec<u32>,
    /// See [`Homology::class`].
    pub(super) class: Vec<u64>,
}

/// Shortest paths from one vertex after another.
#[derive(Debug)]
pub(super) struct Search<'a> {
    homology: &'a Homology,
    manifold: &'a Manifold,
    distance: Vec<f64>,
    /// The side by which each vertex was reached, and its predecessor.
    by: Vec<(u32, u32)>,
    /// Class of the path to each vertex.
    classes: Vec<u64>,
    reached: Vec<u32>,
}

impl<'a> Search<'a> {
    pub(super) fn new(homology: &'a Homology, manifold: &'a Manifold) -> Self {
        let n = manifold.points.len();
        Self {
            homology,
            manifold,
            distance: vec![f64::INFINITY; n],
            by: vec![(NONE, NONE); n],
            classes: vec![0; n * homology.words()],
            reached: Vec::new(),
        }
    }

    /// The shortest loop through a vertex that does not separate the surface, if it is no longer than `limit`: two
    /// shortest paths and an edge between their ends. Only vertices within half of the limit are visited.
    pub(super) fn shortest_through(&mut self, vertex: u32, limit: f64) -> Option<Loop> {
        self.spread(&[vertex], 0.5 * limit);
        let words = self.homology.words();
        let mut best: Option<(f64, u32, u32, u32)> = None;
        for &a in &self.reached {
            for (side, b) in spokes(self.manifold, &self.homology.adjacency, a) {
                if b <= a || self.distance[b as usize].is_infinite() {
                    continue;
                }
                let edge = self.edge(a, b);
                let length = self.distance[a as usize] + self.distance[b as usize] + edge;
                if length > limit || best.is_some_and(|best| (length, side) >= (best.0, best.1)) {
                    continue;
                }
                let of = |v: u32| &self.classes[v as usize * words..(v as usize + 1) * words];
                let all = of(a).iter().zip(of(b)).zip(self.homology.class(side));
                if all.into_iter().any(|((x, y), z)| x ^ y ^ z != 0) {
                    best = Some((length, side, a, b));
                }
            }
        }
        let found = best.map(|(_, side, a, b)| self.close(side, a, b));
        self.forget();
        found
    }

    /// Area of the triangles within a distance along edges of any of these vertices.
    pub(super) fn area_within(&mut self, vertices: &[u32], radius: f64) -> f64 {
        self.spread(vertices, radius);
        let adjacency = &self.homology.adjacency;
        let mut triangles: Vec<u32> = self
            .reached
            .iter()
            .flat_map(|&v| adjacency.fan(v).map(|side| side / 3))
            .collect();
        triangles.sort_unstable();
        // Triangles within the distance occur at all their corners.
        let within = triangles.chunk_by(|x, y| x == y).filter(|c| c.len() == 3);
        let area = within
            .map(|c| self.manifold.vector_area(c[0] as usize).length())
            .sum();
        self.forget();
        area
    }

    fn forget(&mut self) {
        for v in self.reached.drain(..) {
            self.distance[v as usize] = f64::INFINITY;
        }
    }

    fn edge(&self, a: u32, b: u32) -> f64 {
        self.manifold.points[a as usize].distance(self.manifold.points[b as usize])
    }

    /// Shortest paths from any of these vertices within `radius`.
    fn spread(&mut self, vertices: &[u32], radius: f64) {
        let words = self.homology.words();
        let mut heap = BinaryHeap::new();
        for &vertex in vertices {
            self.distance[vertex as usize] = 0.0;
            self.by[vertex as usize] = (NONE, NONE);
            self.classes[vertex as usize * words..(vertex as usize + 1) * words].fill(0);
            self.reached.push(vertex);
            heap.push(Near(0.0, vertex));
        }
        while let Some(Near(d, v)) = heap.pop() {
            if d > self.distance[v as usize] {
                continue;
            }
            for (side, w) in spokes(self.manifold, &self.homology.adjacency, v) {
                let there = d + self.edge(v, w);
                let known = self.distance[w as usize];
                if there > radius || there >= known {
                    continue;
                }
                if known.is_infinite() {
                    self.reached.push(w);
                }
                self.distance[w as usize] = there;
                self.by[w as usize] = (side, v);
                for word in 0..words {
                    self.classes[w as usize * words + word] =
                        self.classes[v as usize * words + word] ^ self.homology.class(side)[word];
                }
                heap.push(Near(there, w));
            }
        }
    }

    /// The loop of the paths to a and b and the edge between them, without their common part.
    fn close(&self, side: u32, a: u32, b: u32) -> Loop {
        let way = |mut v: u32| {
            let mut way = Vec::new();
            while self.by[v as usize].1 != NONE {
                way.push((v, self.by[v as usize].0));
                v = self.by[v as usize].1;
            }
            (way, v)
        };
        let ((mut to_a, root), (mut to_b, _)) = (way(a), way(b));
        let mut meet = root;
        while let (Some(x), Some(y)) = (to_a.last(), to_b.last())
            && x == y
        {
            meet = x.0;
            to_a.pop();
            to_b.pop();
        }
        let steps = || to_a.iter().chain(&to_b);
        let mut vertices: Vec<u32> = steps().map(|s| s.0).chain([meet]).collect();
        vertices.sort_unstable();
        let mut sides: Vec<u32> = steps().map(|s| s.1).chain([side]).collect();
        sides.sort_unstable();
        let mut class = vec![0; self.homology.words()];
        for &side in &sides {
            for (c, s) in class.iter_mut().zip(self.homology.class(side)) {
                *c ^= s;
            }
        }
        let length = self.edge(a, b) + self.distance[a as usize] + self.distance[b as usize]
            - 2.0 * self.distance[meet as usize];
        Loop {
            length,
            vertices,
            sides,
            class,
        }
    }
}
