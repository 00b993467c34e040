//! Sparse symmetric systems of graphs: conjugate gradients with an incomplete factorisation.

use glam::DVec2;

/// Part of the dropped fill-in that is put on the diagonal; all of it could leave nothing to divide by.
const RELAXED: f64 = 0.97;

/// A symmetric positive definite matrix with non-positive entries off the diagonal whose rows do not sum to less than
/// zero: the equations of a weighted graph, some of whose vertices are held.
#[derive(Clone, Debug)]
pub struct GraphMatrix {
    /// Row k holds the entries `starts[k]..starts[k + 1]`.
    starts: Vec<usize>,
    /// Columns of the entries, ascending in each row, without the diagonal.
    columns: Vec<u32>,
    /// Weights of the edges: the entries with their sign changed.
    weights: Vec<f64>,
    diagonal: Vec<f64>,
}

impl GraphMatrix {
    /// The equations of `count` free vertices: `edges` between two of them with positive weights, each given once, and
    /// `held`, the sum of the weights of each vertex's edges to held ones. O(n log n).
    #[must_use]
    pub fn new(count: usize, edges: &[(u32, u32, f64)], held: &[f64]) -> Self {
        let mut entries: Vec<(u32, u32, f64)> = Vec::with_capacity(2 * edges.len());
        for &(a, b, w) in edges {
            entries.extend([(a, b, w), (b, a, w)]);
        }
        entries.sort_unstable_by_key(|&(row, column, _)| (row, column));
        let mut starts = vec![0; count + 1];
        let mut diagonal = held.to_vec();
        for &(row, _, w) in &entries {
            starts[row as usize + 1] += 1;
            diagonal[row as usize] += w;
        }
        for k in 0..count {
            starts[k + 1] += starts[k];
        }
        Self {
            starts,
            columns: entries.iter().map(|e| e.1).collect(),
            weights: entries.iter().map(|e| e.2).collect(),
            diagonal,
        }
    }

    fn entries(&self, row: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        (self.starts[row]..self.starts[row + 1])
            .map(|e| (self.columns[e] as usize, self.weights[e]))
    }

    fn multiply(&self, x: &[DVec2], out: &mut [DVec2]) {
        for (row, out) in out.iter_mut().enumerate() {
            let mut sum = self.diagonal[row] * x[row];
            for (column, w) in self.entries(row) {
                sum -= w * x[column];
            }
            *out = sum;
        }
    }

    /// Pivots of the incomplete factorisation without fill-in, what is dropped being put on the diagonal, so that the
    /// factors act on smooth vectors as the matrix does (Gustafsson 1978, DOI 10.1007/BF01931691).
    fn pivots(&self) -> Vec<f64> {
        let mut pivots = self.diagonal.clone();
        for row in 0..pivots.len() {
            // What earlier rows take from this one: w^2 / pivot on the diagonal, w w' / pivot dropped.
            let mut taken = 0.0;
            for (earlier, w) in self.entries(row).take_while(|e| e.0 < row) {
                let later: f64 = self
                    .entries(earlier)
                    .filter(|e| e.0 > earlier && e.0 != row)
                    .map(|e| e.1)
                    .sum();
                taken += w * (w + RELAXED * later) / pivots[earlier];
            }
            pivots[row] = (self.diagonal[row] - taken).max(1e-3 * self.diagonal[row]);
        }
        pivots
    }

    fn precondition(&self, pivots: &[f64], r: &[DVec2], z: &mut [DVec2]) {
        for row in 0..r.len() {
            let mut sum = r[row];
            for (column, w) in self.entries(row).take_while(|e| e.0 < row) {
                sum += w * z[column];
            }
            z[row] = sum / pivots[row];
        }
        for row in (0..r.len()).rev() {
            let mut sum = DVec2::ZERO;
            for (column, w) in self.entries(row).filter(|e| e.0 > row) {
                sum += w * z[column];
            }
            z[row] += sum / pivots[row];
        }
    }

    /// Improves `x` until the residuals of both right-hand sides have fallen to `relative` times those of zero, or
    /// `most` steps were taken; returns the steps. Each step is O(entries).
    pub fn solve(&self, right: &[DVec2], x: &mut [DVec2], relative: f64, most: usize) -> usize {
        let n = right.len();
        let pivots = self.pivots();
        let dot = |a: &[DVec2], b: &[DVec2]| -> DVec2 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let ratio = |a: DVec2, b: DVec2| {
            let one = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
            DVec2::new(one(a.x, b.x), one(a.y, b.y))
        };
        let mut r = vec![DVec2::ZERO; n];
        self.multiply(x, &mut r);
        for (r, b) in r.iter_mut().zip(right) {
            *r = b - *r;
        }
        let enough = relative * relative * dot(right, right);
        let mut z = vec![DVec2::ZERO; n];
        self.precondition(&pivots, &r, &mut z);
        let mut p = z.clone();
        let mut q = vec![DVec2::ZERO; n];
        let mut rz = dot(&r, &z);
        for step in 0..most {
            if dot(&r, &r).cmple(enough).all() {
                return step;
            }
            self.multiply(&p, &mut q);
            let alpha = ratio(rz, dot(&p, &q));
            for k in 0..n {
                x[k] += alpha * p[k];
                r[k] -= alpha * q[k];
            }
            self.precondition(&pivots, &r, &mut z);
            let next = dot(&r, &z);
            let beta = ratio(next, rz);
            rz = next;
            for (p, z) in p.iter_mut().zip(&z) {
                *p = z + beta * *p;
            }
        }
        most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lattice_with_held_sides_gives_its_linear_function() {
        let n = 40_u32;
        let mut edges = Vec::new();
        let mut held = vec![0.0; (n * n) as usize];
        let mut right = vec![DVec2::ZERO; (n * n) as usize];
        for j in 0..n {
            for i in 0..n {
                let k = j * n + i;
                if i + 1 < n {
                    edges.push((k, k + 1, 2.0));
                }
                if j + 1 < n {
                    edges.push((k, k + n, 0.5));
                }
                for (di, dj, w) in [
                    (-1.0, 0.0, 2.0),
                    (1.0, 0.0, 2.0),
                    (0.0, -1.0, 0.5),
                    (0.0, 1.0, 0.5),
                ] {
                    let at = DVec2::new(f64::from(i) + di, f64::from(j) + dj);
                    let inside = |x: f64| x >= 0.0 && x < f64::from(n);
                    if !(inside(at.x) && inside(at.y)) {
                        held[k as usize] += w;
                        right[k as usize] += w * at;
                    }
                }
            }
        }
        let matrix = GraphMatrix::new((n * n) as usize, &edges, &held);
        let mut x = vec![DVec2::ZERO; (n * n) as usize];
        let steps = matrix.solve(&right, &mut x, 1e-12, 1000);
        assert!(steps < 60, "{steps} steps");
        for (k, x) in (0..n * n).zip(&x) {
            let expected = DVec2::new(f64::from(k % n), f64::from(k / n));
            assert!(x.distance(expected) < 1e-8, "{x} {expected}");
        }
    }
}
