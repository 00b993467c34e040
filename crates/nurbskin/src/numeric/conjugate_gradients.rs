//! Sparse symmetric systems of graphs: conjugate gradients with an incomplete factorisation.

use glam::DVec2;

/// Part of the dropped fill-in that is put on the diagonal; all of it could leave nothing to divide by.
const RELAXED: f64 = 0.97;

/// Two systems over one weighted graph, one for x and one for y: symmetric, with non-positive entries off the diagonal
/// whose rows do not sum to less than zero. Each coordinate of each vertex is free or held.
#[derive(Clone, Debug)]
pub struct GraphMatrix {
    /// Vertex of each row: breadth first, so that neighbours lie together and the factors are good.
    vertex: Vec<u32>,
    /// Row k holds the entries `starts[k]..starts[k + 1]`, those of earlier rows before `middles[k]`.
    starts: Vec<usize>,
    middles: Vec<usize>,
    /// Columns of the entries, ascending in each row, without the diagonal.
    columns: Vec<u32>,
    /// Weights of the edges: the entries with their sign changed.
    weights: Vec<f64>,
    /// The two entries of each edge.
    entries: Vec<[u32; 2]>,
    diagonal: Vec<DVec2>,
    /// 1 for free coordinates, 0 for held ones.
    free: Vec<DVec2>,
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
        let mut middles = vec![0; count];
        let mut entries = vec![[u32::MAX; 2]; edges.len()];
        for (at, &(a, b, side)) in (0_u32..).zip(&sides) {
            starts[a as usize + 1] += 1;
            middles[a as usize] += usize::from(b < a);
            entries[side as usize / 2][side as usize % 2] = at;
        }
        for k in 0..count {
            starts[k + 1] += starts[k];
            middles[k] += starts[k];
        }
        Self {
            starts,
            middles,
            columns: sides.iter().map(|s| s.1).collect(),
            weights: vec![0.0; sides.len()],
            entries,
            diagonal: vec![DVec2::ZERO; count],
            free: vertex
                .iter()
                .map(|&v| DVec2::from(free[v as usize].map(|f| if f { 1.0 } else { 0.0 })))
                .collect(),
            vertex,
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
        for row in 0..self.vertex.len() {
            let sum: f64 = self.weights[self.starts[row]..self.starts[row + 1]]
                .iter()
                .sum();
            let tie = ties.get(self.vertex[row] as usize);
            self.diagonal[row] = DVec2::splat(sum) + tie.copied().unwrap_or_default();
        }
    }

    fn earlier(&self, row: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.starts[row]..self.middles[row];
        let columns = self.columns[range.clone()].iter();
        columns
            .zip(&self.weights[range])
            .map(|(&c, &w)| (c as usize, w))
    }

    fn later(&self, row: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.middles[row]..self.starts[row + 1];
        let columns = self.columns[range.clone()].iter();
        columns
            .zip(&self.weights[range])
            .map(|(&c, &w)| (c as usize, w))
    }

    /// The free rows of the product.
    fn multiply(&self, x: &[DVec2], out: &mut [DVec2]) {
        for (row, out) in out.iter_mut().enumerate() {
            let range = self.starts[row]..self.starts[row + 1];
            let mut sum = self.diagonal[row] * x[row];
            for (&column, w) in self.columns[range.clone()].iter().zip(&self.weights[range]) {
                sum -= *w * x[column as usize];
            }
            *out = sum * self.free[row];
        }
    }

    /// Inverse pivots of the incomplete factorisation without fill-in, what is dropped being put on the diagonal, so
    /// that the factors act on smooth vectors as the matrix does (Gustafsson 1978, DOI 10.1007/BF01931691).
    fn inverse_pivots(&self) -> Vec<DVec2> {
        let mut inverse = vec![DVec2::ZERO; self.vertex.len()];
        // Sums of the weights to free later vertices.
        let later: Vec<DVec2> = (0..inverse.len())
            .map(|row| self.later(row).map(|(c, w)| w * self.free[c]).sum())
            .collect();
        for row in 0..inverse.len() {
            let free = self.free[row];
            // What earlier rows take from this one: w^2 / pivot on the diagonal, w w' / pivot dropped.
            let mut taken = DVec2::ZERO;
            for (c, w) in self.earlier(row) {
                let dropped = (later[c] - w * free).max(DVec2::ZERO);
                taken += w * (w + RELAXED * dropped) * inverse[c];
            }
            let pivot = (self.diagonal[row] - taken).max(1e-3 * self.diagonal[row]);
            let one = |f: f64, p: f64| if f > 0.0 && p > 0.0 { 1.0 / p } else { 0.0 };
            inverse[row] = DVec2::new(one(free.x, pivot.x), one(free.y, pivot.y));
        }
        inverse
    }

    /// Held coordinates have an inverse pivot of zero, which keeps them out.
    fn precondition(&self, inverse: &[DVec2], r: &[DVec2], z: &mut [DVec2]) {
        for row in 0..r.len() {
            let mut sum = r[row];
            for (column, w) in self.earlier(row) {
                sum += w * z[column];
            }
            z[row] = sum * inverse[row];
        }
        for row in (0..r.len()).rev() {
            let mut sum = DVec2::ZERO;
            for (column, w) in self.later(row) {
                sum += w * z[column];
            }
            z[row] += sum * inverse[row];
        }
    }

    /// Improves the free coordinates of `x` until the residuals of both systems have fallen to `relative` times those of
    /// zero, or `most` steps were taken; returns the steps. Held coordinates stay, and take part. Each step is O(n).
    pub fn solve(&self, right: &[DVec2], x: &mut [DVec2], relative: f64, most: usize) -> usize {
        let n = self.vertex.len();
        if right.len() != n || x.len() != n {
            return 0;
        }
        let inverse = self.inverse_pivots();
        let dot = |a: &[DVec2], b: &[DVec2]| -> DVec2 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let ratio = |a: DVec2, b: DVec2| {
            let one = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
            DVec2::new(one(a.x, b.x), one(a.y, b.y))
        };
        let mut own: Vec<DVec2> = self.vertex.iter().map(|&v| x[v as usize]).collect();
        let held: Vec<DVec2> = own
            .iter()
            .zip(&self.free)
            .map(|(x, f)| x * (DVec2::ONE - f))
            .collect();
        let right: Vec<DVec2> = self.vertex.iter().map(|&v| right[v as usize]).collect();
        let mut q = vec![DVec2::ZERO; n];
        self.multiply(&held, &mut q);
        let of_zero: DVec2 = (0..n)
            .map(|k| (right[k] * self.free[k] - q[k]).powf(2.0))
            .sum();
        let enough = relative * relative * of_zero;
        let mut r = vec![DVec2::ZERO; n];
        self.multiply(&own, &mut r);
        for k in 0..n {
            r[k] = right[k] * self.free[k] - r[k];
        }
        let mut z = vec![DVec2::ZERO; n];
        self.precondition(&inverse, &r, &mut z);
        let mut p = z.clone();
        let mut rz = dot(&r, &z);
        let mut steps = 0;
        while steps < most && !dot(&r, &r).cmple(enough).all() {
            self.multiply(&p, &mut q);
            let alpha = ratio(rz, dot(&p, &q));
            for k in 0..n {
                own[k] += alpha * p[k];
                r[k] -= alpha * q[k];
            }
            self.precondition(&inverse, &r, &mut z);
            let next = dot(&r, &z);
            let beta = ratio(next, rz);
            rz = next;
            for (p, z) in p.iter_mut().zip(&z) {
                *p = z + beta * *p;
            }
            steps += 1;
        }
        for (&v, own) in self.vertex.iter().zip(&own) {
            x[v as usize] = *own;
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
