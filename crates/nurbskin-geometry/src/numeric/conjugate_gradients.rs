//! Sparse symmetric systems of graphs: conjugate gradients with multigrid.

use super::multigrid::{Graph, Multigrid, dot, ratio};
use glam::DVec2;

/// Two systems over one weighted graph, one for x and one for y: symmetric, with non-positive entries off the diagonal
/// whose rows do not sum to less than zero. Each coordinate of each vertex is free or held.
#[derive(Clone, Debug)]
pub struct GraphMatrix {
    /// Vertex of each row: breadth first, so that neighbours lie together.
    vertex: Vec<u32>,
    /// Row k of the whole matrix holds the entries `starts[k]..starts[k + 1]`.
    starts: Vec<usize>,
    /// Columns of the entries, ascending in each row, without the diagonal.
    columns: Vec<u32>,
    /// Weights of the edges: the entries with their sign changed.
    weights: Vec<f64>,
    /// The two entries of each edge.
    entries: Vec<[u32; 2]>,
    /// 1 for free coordinates, 0 for held ones.
    free: Vec<DVec2>,
    /// The equations of what is free; empty before there are weights.
    multigrid: Option<Multigrid>,
}

impl GraphMatrix {
    /// The graph of `free.len()` vertices with these edges, each given once, and which coordinates of each vertex are
    /// free. No weights yet. Edges to vertices that do not exist are left out. O(n log n).
    #[must_use]
    pub fn new(edges: &[[u32; 2]], free: &[[bool; 2]]) -> Self {
        let count = free.len();
        let exists = |e: &[u32; 2]| e.iter().all(|&k| (k as usize) < count) && e[0] != e[1];
        let mut starts = vec![0; count + 1];
        for e in edges.iter().filter(|e| exists(e)) {
            starts[e[0] as usize + 1] += 1;
            starts[e[1] as usize + 1] += 1;
        }
        for k in 0..count {
            starts[k + 1] += starts[k];
        }
        let mut neighbours = vec![0_u32; starts[count]];
        let mut next = starts.clone();
        for e in edges.iter().filter(|e| exists(e)) {
            for [a, b] in [[e[0], e[1]], [e[1], e[0]]] {
                neighbours[next[a as usize]] = b;
                next[a as usize] += 1;
            }
        }
        let (vertex, row) = breadth_first(&starts, &neighbours);
        // The same again in rows.
        let mut sides: Vec<(u32, u32, u32)> = Vec::with_capacity(2 * edges.len());
        for (k, e) in (0_u32..).zip(edges) {
            if exists(e) {
                let [a, b] = e.map(|v| row[v as usize]);
                sides.extend([(a, b, 2 * k), (b, a, 2 * k + 1)]);
            }
        }
        sides.sort_unstable();
        let mut starts = vec![0; count + 1];
        let mut entries = vec![[u32::MAX; 2]; edges.len()];
        for (at, &(a, _, side)) in (0_u32..).zip(&sides) {
            starts[a as usize + 1] += 1;
            entries[side as usize / 2][side as usize % 2] = at;
        }
        for k in 0..count {
            starts[k + 1] += starts[k];
        }
        Self {
            starts,
            columns: sides.iter().map(|s| s.1).collect(),
            weights: vec![0.0; sides.len()],
            entries,
            free: vertex
                .iter()
                .map(|&v| DVec2::from(free[v as usize].map(|f| if f { 1.0 } else { 0.0 })))
                .collect(),
            vertex,
            multigrid: None,
        }
    }

    /// Gives each edge a positive weight, and each vertex `ties`: the sums of the weights of its edges to what is held
    /// outside the graph. O(n).
    pub fn weigh(&mut self, weights: &[f64], ties: &[DVec2]) {
        for (entry, &w) in self.entries.iter().zip(weights) {
            for &e in entry.iter().filter(|&&e| e != u32::MAX) {
                self.weights[e as usize] = w;
            }
        }
        let mut multigrid = self.multigrid.take();
        let set = |graph: &mut Graph| {
            for row in 0..self.vertex.len() {
                let range = self.starts[row]..self.starts[row + 1];
                let sum: f64 = self.weights[range.clone()].iter().sum();
                let tie = ties.get(self.vertex[row] as usize);
                let whole = DVec2::splat(sum) + tie.copied().unwrap_or_default();
                graph.diagonal[row] = whole * self.free[row];
                for e in range {
                    let other = self.free[self.columns[e] as usize];
                    graph.weights[e] = self.weights[e] * self.free[row] * other;
                }
            }
        };
        match &mut multigrid {
            Some(multigrid) => multigrid.reweigh(set),
            None => {
                let mut graph = Graph {
                    starts: self.starts.clone(),
                    columns: self.columns.clone(),
                    weights: vec![DVec2::ZERO; self.columns.len()],
                    diagonal: vec![DVec2::ZERO; self.vertex.len()],
                };
                set(&mut graph);
                multigrid = Some(Multigrid::new(graph));
            }
        }
        self.multigrid = multigrid;
    }

    /// Improves the free coordinates of `x` until the residuals of both systems have fallen to `relative` times those of
    /// zero, or `most` steps were taken; returns the steps. Held coordinates stay, and take part. Each step is O(n), and
    /// their number hardly grows with n.
    pub fn solve(&self, right: &[DVec2], x: &mut [DVec2], relative: f64, most: usize) -> usize {
        let n = self.vertex.len();
        let Some(multigrid) = &self.multigrid else {
            return 0;
        };
        if right.len() != n || x.len() != n {
            return 0;
        }
        let graph = multigrid.finest();
        let all: Vec<DVec2> = self.vertex.iter().map(|&v| x[v as usize]).collect();
        // What is held goes to the right-hand side.
        let right: Vec<DVec2> = (0..n)
            .map(|row| {
                let mut sum = right[self.vertex[row] as usize];
                for e in self.starts[row]..self.starts[row + 1] {
                    let column = self.columns[e] as usize;
                    sum += self.weights[e] * (DVec2::ONE - self.free[column]) * all[column];
                }
                sum * self.free[row]
            })
            .collect();
        let mut own: Vec<DVec2> = all.iter().zip(&self.free).map(|(x, f)| x * f).collect();
        let enough = relative * relative * dot(&right, &right);
        let mut q = vec![DVec2::ZERO; n];
        graph.multiply(&own, &mut q);
        let mut r: Vec<DVec2> = right.iter().zip(&q).map(|(b, a)| b - a).collect();
        let mut z = vec![DVec2::ZERO; n];
        let mut p = vec![DVec2::ZERO; n];
        // z.r of the step before, and z.(A p), which the flexible update needs.
        let mut rz = DVec2::ZERO;
        let mut alpha = DVec2::ZERO;
        let mut steps = 0;
        while steps < most && !dot(&r, &r).cmple(enough).all() {
            multigrid.precondition(&r, &mut z);
            // The preconditioner varies a little: z.(r - r before) instead of z.r.
            let change = -alpha * dot(&z, &q);
            let beta = ratio(change, rz);
            for (p, z) in p.iter_mut().zip(&z) {
                *p = z + beta * *p;
            }
            rz = dot(&z, &r);
            graph.multiply(&p, &mut q);
            alpha = ratio(dot(&p, &r), dot(&p, &q));
            for k in 0..n {
                own[k] += alpha * p[k];
                r[k] -= alpha * q[k];
            }
            steps += 1;
        }
        for row in 0..n {
            let place = &mut x[self.vertex[row] as usize];
            *place = self.free[row] * own[row] + (DVec2::ONE - self.free[row]) * *place;
        }
        steps
    }
}

/// The vertices breadth first from one far out in each component, and the place of each vertex among them.
fn breadth_first(starts: &[usize], neighbours: &[u32]) -> (Vec<u32>, Vec<u32>) {
    const UNSEEN: u32 = u32::MAX;
    let count = starts.len() - 1;
    let mut place = vec![UNSEEN; count];
    let mut order: Vec<u32> = Vec::with_capacity(count);
    let walk = |from: u32, place: &mut [u32], order: &mut Vec<u32>| {
        let mut at = order.len();
        place[from as usize] = u32::try_from(at).unwrap_or(UNSEEN);
        order.push(from);
        while at < order.len() {
            let v = order[at] as usize;
            for &w in &neighbours[starts[v]..starts[v + 1]] {
                if place[w as usize] == UNSEEN {
                    place[w as usize] = u32::try_from(order.len()).unwrap_or(UNSEEN);
                    order.push(w);
                }
            }
            at += 1;
        }
    };
    for first in 0..count {
        if place[first] != UNSEEN {
            continue;
        }
        let before = order.len();
        walk(u32::try_from(first).unwrap_or(0), &mut place, &mut order);
        // Once more from the last one found, so that the fronts run along the component.
        let last = order[order.len() - 1];
        for v in order.drain(before..) {
            place[v as usize] = UNSEEN;
        }
        walk(last, &mut place, &mut order);
    }
    (order, place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lattice_with_held_sides_gives_its_linear_function() {
        let n = 40_u32;
        let (mut edges, mut weights) = (Vec::new(), Vec::new());
        let mut ties = vec![DVec2::ZERO; (n * n) as usize];
        let mut right = vec![DVec2::ZERO; (n * n) as usize];
        let mut free = vec![[true; 2]; (n * n) as usize];
        let at = |i: u32, j: u32| DVec2::new(f64::from(i), f64::from(j));
        let mut start = vec![DVec2::ZERO; (n * n) as usize];
        for j in 0..n {
            for i in 0..n {
                let k = j * n + i;
                if i + 1 < n {
                    edges.push([k, k + 1]);
                    weights.push(2.0);
                }
                if j + 1 < n {
                    edges.push([k, k + n]);
                    weights.push(0.5);
                }
                // Held from outside at the ends of the rows; held itself, in one coordinate each, at the ends of columns.
                for (outer, next) in [(0, -1.0), (n - 1, 1.0)] {
                    if i == outer {
                        ties[k as usize] += DVec2::splat(2.0);
                        right[k as usize] += 2.0 * (at(i, j) + DVec2::new(next, 0.0));
                    }
                }
                if j == 0 || j == n - 1 {
                    free[k as usize] = [j == 0 && i % 2 == 1, false];
                    start[k as usize] = at(i, j);
                }
            }
        }
        // Where x is free at j = 0 the linear function still solves it: there is nothing below to pull.
        let mut matrix = GraphMatrix::new(&edges, &free);
        matrix.weigh(&weights, &ties);
        let mut x = start;
        for (x, f) in x.iter_mut().zip(&free) {
            if f[0] {
                x.x = 0.0;
            }
        }
        let steps = matrix.solve(&right, &mut x, 1e-12, 1000);
        assert!(steps < 80, "{steps} steps");
        for (k, x) in (0..n * n).zip(&x) {
            let expected = at(k % n, k / n);
            assert!(x.distance(expected) < 1e-8, "{x} {expected}");
        }
    }
}
