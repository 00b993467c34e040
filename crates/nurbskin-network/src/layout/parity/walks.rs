//! Closed walks from cell to cell, by Dijkstra's method over arcs and the side on which they were crossed.

use super::super::NONE;
use super::super::grow::Front;
use super::super::surface::index;
use super::Search;
use std::collections::{BTreeMap, BinaryHeap};

/// Least cost of a step of a walk. Guard: walks stay short and without negative loops.
const LEAST_STEP: f64 = 0.05;
/// Most cost of a walk by its estimate. Trial: six scans; 20 gives the same layouts but for one face, 4 up to
/// 5 % more faces.
const MAX_WALK: f64 = 8.0;

impl Search {
    /// The sides of a cell or of the outside.
    fn arcs_of(&self, cell: u32) -> impl Iterator<Item = u32> + '_ {
        let own = self.sides.get(cell as usize);
        let inner = own.into_iter().flatten().map(|(arc, _)| *arc);
        let outer = if own.is_none() { &self.open[..] } else { &[] };
        inner.chain(outer.iter().copied())
    }

    /// Forgets the estimates for these cells and for all cells that share a corner with them.
    pub(super) fn forget(&mut self, cells: &[usize]) {
        for corner in cells.iter().flat_map(|&c| &self.corners[c]) {
            for &cell in self.around.get(corner).into_iter().flatten() {
                self.known[cell as usize].clear();
            }
        }
    }

    /// The estimated cost of flipping two sides of a cell; infinite if that is impossible.
    fn passing(&mut self, cell: u32, [a, b]: [u32; 2]) -> f64 {
        let cell = cell as usize;
        if cell >= self.sides.len() {
            return LEAST_STEP;
        }
        let pair = [a.min(b), a.max(b)];
        if let Some((_, cost)) = self.known[cell].iter().find(|(p, _)| *p == pair) {
            return *cost;
        }
        self.count(cell, false);
        let now = self.cost_of_own(cell);
        for arc in pair {
            self.split[arc as usize] ^= true;
        }
        let best = self.best_pattern(cell);
        for arc in pair {
            self.split[arc as usize] ^= true;
        }
        self.count(cell, true);
        let cost = best.map_or(f64::INFINITY, |(_, cost)| (cost - now).max(LEAST_STEP));
        self.known[cell].push((pair, cost));
        cost
    }

    /// The cost of the pattern of a cell whose faces are not counted at present.
    pub(super) fn cost_of_own(&self, cell: usize) -> f64 {
        let mut cost = self.pattern_cost(cell, &self.patterns[cell]);
        for (k, v) in self.rim(cell).into_iter().enumerate() {
            let others = self.faces[v];
            let own = self.patterns[cell].faces_at(k);
            cost += self.vertex_cost(v, others + own) - self.vertex_cost(v, others);
        }
        cost
    }

    /// The cheapest closed walk through an arc: the arcs crossed.
    pub(super) fn walk(&mut self, first: u32) -> Option<Vec<u32>> {
        // State 2 arc + side: the arc was crossed into the cell on that side.
        let start = 2 * first as usize;
        let mut reached: BTreeMap<usize, (f64, u32)> = BTreeMap::new();
        let mut heap = BinaryHeap::new();
        reached.insert(start, (0.0, NONE));
        heap.push(Front(0.0, index(start)));
        let mut closed = false;
        while let Some(Front(so_far, state)) = heap.pop() {
            let at = state as usize;
            if reached.get(&at).is_some_and(|r| so_far > r.0) {
                continue;
            }
            if at == start && so_far > 0.0 {
                closed = true;
                break;
            }
            let arc = state / 2;
            let cell = self.beside[arc as usize][at % 2];
            let next: Vec<u32> = self.arcs_of(cell).filter(|&n| n != arc).collect();
            for n in next {
                if self.fixed[n as usize] {
                    continue;
                }
                let step = self.passing(cell, [arc, n]);
                let beyond = usize::from(self.beside[n as usize][0] == cell);
                let to = 2 * n as usize + beyond;
                let total = so_far + step;
                // The start itself counts as reached once a walk has come back to it.
                let known = match reached.get(&to) {
                    Some(r) if to != start || r.0 > 0.0 => r.0,
                    _ => f64::INFINITY,
                };
                if total < known && total < MAX_WALK {
                    reached.insert(to, (total, state));
                    heap.push(Front(total, index(to)));
                }
            }
        }
        if !closed {
            return None;
        }
        let mut walk = vec![first];
        let before = |at: usize| reached.get(&at).map_or(NONE, |r| r.1);
        let mut at = before(start);
        while at != NONE && at as usize != start {
            walk.push(at / 2);
            at = before(at as usize);
        }
        Some(walk)
    }
}
