//! Shortest ways over triangles from many seeds at once.
//!
//! Source: E. W. Dijkstra, *A note on two problems in connexion with graphs*, Numerische Mathematik 1, 1959. A seed that
//! is added later only improves the triangles nearer to it than to all earlier seeds, so that n seeds one after the
//! other cost about log n runs.

use super::NONE;
use super::surface::{Surface, index};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A distance and the triangle, or a cost and what it is of. The least is the greatest, for a heap; equals go by the index.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Front(pub(crate) f64, pub(crate) u32);

impl Ord for Front {
    fn cmp(&self, other: &Self) -> Ordering {
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}
impl PartialOrd for Front {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Front {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Front {}

/// Distances from seeds, and the number of the nearest seed.
#[derive(Debug)]
pub(crate) struct Grower {
    pub(crate) distance: Vec<f64>,
    pub(crate) owner: Vec<u32>,
    heap: BinaryHeap<Front>,
}

impl Grower {
    /// For this number of triangles; nothing is reached.
    pub(crate) fn new(count: usize) -> Self {
        Self {
            distance: vec![f64::INFINITY; count],
            owner: vec![NONE; count],
            heap: BinaryHeap::new(),
        }
    }

    /// Forgets all distances.
    pub(crate) fn clear(&mut self) {
        self.distance.fill(f64::INFINITY);
        self.owner.fill(NONE);
    }

    /// Forgets the distances of some triangles.
    pub(crate) fn clear_some(&mut self, triangles: &[u32]) {
        for &t in triangles {
            self.distance[t as usize] = f64::INFINITY;
            self.owner[t as usize] = NONE;
        }
    }

    /// Sets a triangle as seed.
    pub(crate) fn seed(&mut self, triangle: u32, number: u32) {
        self.distance[triangle as usize] = 0.0;
        self.owner[triangle as usize] = number;
        self.heap.push(Front(0.0, triangle));
    }

    /// Spreads from the seeds set since the last call, within the triangles that `within` accepts.
    pub(crate) fn run(&mut self, surface: &Surface<'_>, within: impl Fn(usize) -> bool) {
        while let Some(Front(distance, triangle)) = self.heap.pop() {
            let t = triangle as usize;
            if distance > self.distance[t] {
                continue;
            }
            for side in 3 * t..3 * t + 3 {
                let next = distance + surface.steps[side];
                if next.is_infinite() {
                    continue;
                }
                let o = surface.table.opposite[side] as usize / 3;
                if next < self.distance[o] && within(o) {
                    self.distance[o] = next;
                    self.owner[o] = self.owner[t];
                    self.heap.push(Front(next, index(o)));
                }
            }
        }
    }

    /// The reached triangle that is farthest away, among these; the first of equals.
    pub(crate) fn farthest(&self, among: impl Iterator<Item = u32>) -> Option<(u32, f64)> {
        let mut best: Option<(u32, f64)> = None;
        for t in among {
            let d = self.distance[t as usize];
            if d.is_finite() && best.is_none_or(|b| d > b.1) {
                best = Some((t, d));
            }
        }
        best
    }
}
