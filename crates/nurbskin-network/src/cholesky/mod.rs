//! Sparse symmetric positive definite systems, with the same last digit on every machine.
//!
//! A = P^T L L^T P with a fill-reducing permutation P. Columns of L with nearly the same rows form a supernode, a dense
//! trapezoid of columns. The factorisation is left-looking: a supernode takes its entries of A, subtracts the products of
//! the earlier supernodes that reach its columns, and is factored as a dense matrix.
//!
//! `faer` finds the permutation (approximate minimum degree) and the supernodes. The numbers are computed here: each
//! entry is a sum in a fixed order of products that are rounded one by one, whatever vectors the processor has. General
//! libraries choose order and fused products by the processor, so their last digits differ between machines.
//!
//! Source: T. Davis, *Direct Methods for Sparse Linear Systems*, SIAM 2006, chapters 4 and 7; E. Ng, B. Peyton, *Block
//! sparse Cholesky algorithms on advanced uniprocessor computers*, SIAM J. Sci. Comput. 14 (1993) 1034-1056.

mod dense;

use faer::Side;
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};
use std::ops::Range;
use std::sync::Arc;

/// No supernode.
const NONE: u32 = u32::MAX;

/// The pattern of a matrix and of its factor: the same for all matrices with entries at the same places.
#[derive(Clone, Debug)]
pub(crate) struct Pattern(Arc<Places>);

#[derive(Debug)]
struct Places {
    /// The place of each row in the order of elimination.
    order: Vec<u32>,
    /// The place in the factor of each entry of the lower triangle of the matrix.
    entries: Vec<usize>,
    supernodes: Vec<Supernode>,
    /// Rows below the columns of the supernodes.
    rows: Vec<u32>,
    /// Numbers of the factor.
    count: usize,
}

/// Columns side by side with the same rows: a dense matrix of `width` columns with `width` + `below` rows.
#[derive(Clone, Copy, Debug)]
struct Supernode {
    /// The first column.
    first: usize,
    width: usize,
    /// Where its rows below begin in `Places::rows`, and their number.
    rows: usize,
    below: usize,
    /// Where its numbers begin.
    values: usize,
}

impl Supernode {
    fn height(&self) -> usize {
        self.width + self.below
    }
}

impl Places {
    /// Adds a supernode after the others.
    fn push(&mut self, columns: Range<usize>, below: &[u32]) -> Option<()> {
        let node = Supernode {
            first: columns.start,
            width: columns.len(),
            rows: self.rows.len(),
            below: below.len(),
            values: self.count,
        };
        self.rows.extend_from_slice(below);
        let count = node.width.checked_mul(node.height())?;
        self.count = self.count.checked_add(count)?;
        self.supernodes.push(node);
        Some(())
    }

    /// The supernode of each column.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "no more than columns, which are numbers of 32 bits"
    )]
    fn owners(&self) -> Vec<u32> {
        let mut owner = vec![0; self.order.len()];
        for (s, node) in self.supernodes.iter().enumerate() {
            owner[node.first..node.first + node.width].fill(s as u32);
        }
        owner
    }
}

/// The factor L of a matrix.
#[derive(Debug)]
pub(crate) struct Factor {
    pattern: Pattern,
    values: Vec<f64>,
}

impl Pattern {
    /// The pattern of a symmetric matrix: `columns` are the beginnings of the columns of its lower triangle in `rows`,
    /// and the end; each diagonal entry is one of them. None if there is no memory for the factor.
    pub(crate) fn new(columns: &[u32], rows: &[u32]) -> Option<Self> {
        let n = columns.len() - 1;
        let matrix = SymbolicSparseColMatRef::new_checked(n, n, columns, None, rows);
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..CholeskySymbolicParams::default()
        };
        let found =
            factorize_symbolic_cholesky(matrix, Side::Lower, SymmetricOrdering::Amd, params)
                .ok()?;
        let order = found.perm()?.arrays().1.to_vec();
        let mut places = Places {
            order,
            entries: Vec::with_capacity(rows.len()),
            supernodes: Vec::new(),
            rows: Vec::new(),
            count: 0,
        };
        match found.raw() {
            SymbolicCholeskyRaw::Supernodal(of) => {
                let ends = of.supernode_begin().iter().zip(of.supernode_end());
                for (s, (&first, &end)) in ends.enumerate() {
                    places.push(first as usize..end as usize, of.supernode(s).pattern())?;
                }
            }
            // A matrix with nothing to eliminate.
            SymbolicCholeskyRaw::Simplicial(of) => {
                for (j, ends) in of.col_ptr().windows(2).enumerate() {
                    let below = &of.row_idx()[ends[0] as usize..ends[1] as usize];
                    places.push(j..j + 1, below.get(1..).unwrap_or_default())?;
                }
            }
        }
        let owner = places.owners();
        for j in 0..n {
            for &i in &rows[columns[j] as usize..columns[j + 1] as usize] {
                let (a, b) = (places.order[i as usize], places.order[j]);
                let (row, column) = (a.max(b), a.min(b) as usize);
                let node = places.supernodes[owner[column] as usize];
                let at = if (row as usize) < node.first + node.width {
                    row as usize - node.first
                } else {
                    let below = &places.rows[node.rows..node.rows + node.below];
                    node.width + below.binary_search(&row).ok()?
                };
                let place = node.values + (column - node.first) * node.height() + at;
                places.entries.push(place);
            }
        }
        Some(Self(Arc::new(places)))
    }

    /// The factor of the matrix with these entries, in the order of the pattern. None if the matrix is not positive
    /// definite to rounding, or there is no memory.
    pub(crate) fn factor(&self, entries: &[f64]) -> Option<Factor> {
        let places = &*self.0;
        let mut values = Vec::new();
        values.try_reserve_exact(places.count).ok()?;
        values.resize(places.count, 0.0);
        for (&place, &entry) in places.entries.iter().zip(entries) {
            values[place] += entry;
        }
        let mut work = Work::new(places);
        for s in 0..places.supernodes.len() {
            work.subtract_earlier(places, &mut values, s);
            let node = places.supernodes[s];
            let own = &mut values[node.values..][..node.width * node.height()];
            if !dense::factor(own, node.height(), node.width) {
                return None;
            }
            work.hand_on(places, s, 0);
        }
        Some(Factor {
            pattern: self.clone(),
            values,
        })
    }
}

/// What the factorisation keeps between supernodes.
struct Work {
    /// For each supernode the first of the earlier ones that reach its columns next, and the next one after each.
    first: Vec<u32>,
    next: Vec<u32>,
    /// How many of the rows of each supernode lie before the columns that it reaches next.
    done: Vec<usize>,
    /// The supernode of each column.
    owner: Vec<u32>,
    /// Where a row lies in the supernode that is made now.
    local: Vec<u32>,
    product: Vec<f64>,
}

impl Work {
    fn new(places: &Places) -> Self {
        let (count, n) = (places.supernodes.len(), places.order.len());
        Self {
            first: vec![NONE; count],
            next: vec![NONE; count],
            done: vec![0; count],
            owner: places.owners(),
            local: vec![0; n],
            product: Vec::new(),
        }
    }

    /// Subtracts from supernode `s` the products of the earlier ones that reach its columns.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rows are numbers of 32 bits"
    )]
    fn subtract_earlier(&mut self, places: &Places, values: &mut [f64], s: usize) {
        let node = places.supernodes[s];
        let below = &places.rows[node.rows..node.rows + node.below];
        for (k, row) in (node.first..node.first + node.width).enumerate() {
            self.local[row] = k as u32;
        }
        for (k, &row) in below.iter().enumerate() {
            self.local[row as usize] = (node.width + k) as u32;
        }
        let (earlier, own) = values.split_at_mut(node.values);
        let mut d = std::mem::replace(&mut self.first[s], NONE);
        while d != NONE {
            let after = self.next[d as usize];
            let from = places.supernodes[d as usize];
            let done = self.done[d as usize];
            let rows = &places.rows[from.rows + done..from.rows + from.below];
            let end = (node.first + node.width) as u32;
            let reached = rows.partition_point(|row| *row < end);
            // The rows of `d` from the first that is a column here, times those that are.
            let panel = &earlier[from.values + from.width + done..]
                [..from.width * from.height() - from.width - done];
            self.product.clear();
            self.product.resize(rows.len() * reached, 0.0);
            dense::subtract_product(
                &mut self.product,
                rows.len(),
                panel,
                from.height(),
                [rows.len(), reached, from.width],
            );
            for (j, column) in self.product.chunks_exact(rows.len()).enumerate() {
                let to =
                    &mut own[(rows[j] as usize - node.first) * node.height()..][..node.height()];
                for (&row, part) in rows[j..].iter().zip(&column[j..]) {
                    to[self.local[row as usize] as usize] += part;
                }
            }
            self.hand_on(places, d as usize, done + reached);
            d = after;
        }
    }

    /// Enters supernode `d` at the next one that it reaches, after `done` of its rows.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "supernodes are numbers of 32 bits"
    )]
    fn hand_on(&mut self, places: &Places, d: usize, done: usize) {
        let node = places.supernodes[d];
        self.done[d] = done;
        if done < node.below {
            let to = self.owner[places.rows[node.rows + done] as usize] as usize;
            self.next[d] = self.first[to];
            self.first[to] = d as u32;
        }
    }
}

impl Factor {
    /// Solves A x = b: `x` is b before, and the solution after.
    pub(crate) fn solve(&self, x: &mut [f64]) {
        let places = &*self.pattern.0;
        let mut y = vec![0.0; x.len()];
        for (&to, &value) in places.order.iter().zip(&*x) {
            y[to as usize] = value;
        }
        for node in &places.supernodes {
            let (columns, below) = self.parts(node);
            for (j, column) in columns.enumerate() {
                let at = node.first + j;
                y[at] /= column[j];
                let pivot = y[at];
                for (i, l) in (at + 1..).zip(&column[j + 1..node.width]) {
                    y[i] -= l * pivot;
                }
                for (&i, l) in below.iter().zip(&column[node.width..]) {
                    y[i as usize] -= l * pivot;
                }
            }
        }
        for node in places.supernodes.iter().rev() {
            let (columns, below) = self.parts(node);
            for (j, column) in columns.enumerate().rev() {
                let at = node.first + j;
                let mut sum = y[at];
                for (&i, l) in below.iter().zip(&column[node.width..]) {
                    sum -= l * y[i as usize];
                }
                for (i, l) in (at + 1..).zip(&column[j + 1..node.width]) {
                    sum -= l * y[i];
                }
                y[at] = sum / column[j];
            }
        }
        for (&from, value) in places.order.iter().zip(x) {
            *value = y[from as usize];
        }
    }

    /// The columns of a supernode, and its rows below.
    fn parts(
        &self,
        node: &Supernode,
    ) -> (
        impl DoubleEndedIterator<Item = &[f64]> + ExactSizeIterator,
        &[u32],
    ) {
        let values = &self.values[node.values..][..node.width * node.height()];
        (
            values.chunks_exact(node.height()),
            &self.pattern.0.rows[node.rows..][..node.below],
        )
    }
}

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "small systems")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A matrix in columns of its lower triangle, from entries (row, column, value) off the diagonal; dominant diagonal.
    fn matrix(n: usize, entries: &[(usize, usize, f64)]) -> (Vec<u32>, Vec<u32>, Vec<f64>) {
        let mut dense = vec![0.0; n * n];
        for &(i, j, value) in entries {
            let (i, j) = (i % n, j % n);
            if i != j {
                dense[i.max(j) * n + i.min(j)] = value;
                dense[i * n + i] += value.abs();
                dense[j * n + j] += value.abs();
            }
        }
        let (mut columns, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        for j in 0..n {
            for i in j..n {
                if i == j || dense[i * n + j] != 0.0 {
                    rows.push(i as u32);
                    values.push(dense[i * n + j] + if i == j { 0.1 } else { 0.0 });
                }
            }
            columns.push(rows.len() as u32);
        }
        (columns, rows, values)
    }

    /// The largest entry of A x - b over that of b.
    fn residual(columns: &[u32], rows: &[u32], values: &[f64], x: &[f64], b: &[f64]) -> f64 {
        let mut r: Vec<f64> = b.iter().map(|b| -b).collect();
        for j in 0..x.len() {
            for k in columns[j] as usize..columns[j + 1] as usize {
                let i = rows[k] as usize;
                r[i] += values[k] * x[j];
                if i != j {
                    r[j] += values[k] * x[i];
                }
            }
        }
        let largest = |v: &[f64]| v.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        largest(&r) / largest(b)
    }

    proptest! {
        #[test]
        fn solutions_satisfy_the_equations(
            n in 1_usize..60,
            entries in proptest::collection::vec((0_usize..60, 0_usize..60, -1.0..1.0_f64), 0..400),
        ) {
            let (columns, rows, values) = matrix(n, &entries);
            let pattern = Pattern::new(&columns, &rows).unwrap();
            let factor = pattern.factor(&values).unwrap();
            let b: Vec<f64> = (0..n).map(|k| 1.0 + (k % 7) as f64).collect();
            let mut x = b.clone();
            factor.solve(&mut x);
            prop_assert!(residual(&columns, &rows, &values, &x, &b) < 1e-12);
        }
    }

    /// The equations of a grid, as of a network: supernodes of all sizes.
    #[test]
    fn a_large_system() {
        let side = 70;
        let at = |i: usize, j: usize| i * side + j;
        let mut entries = Vec::new();
        for i in 0..side {
            for j in 0..side {
                for (di, dj) in [(0, 1), (1, 0), (1, 1), (0, 2), (2, 0)] {
                    if i + di < side && j + dj < side {
                        entries.push((at(i, j), at(i + di, j + dj), -1.0 / (1 + di + dj) as f64));
                    }
                }
            }
        }
        // Column by column, without the dense matrix of the small systems.
        let n = side * side;
        let mut lists = vec![Vec::new(); n];
        let mut diagonal = vec![1e-3; n];
        for &(i, j, value) in &entries {
            lists[i].push((j as u32, value));
            diagonal[i] -= value;
            diagonal[j] -= value;
        }
        let (mut columns, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        for j in 0..n {
            rows.push(j as u32);
            values.push(diagonal[j]);
            lists[j].sort_unstable_by_key(|e| e.0);
            for &(i, value) in &lists[j] {
                rows.push(i);
                values.push(value);
            }
            columns.push(rows.len() as u32);
        }
        let factor = Pattern::new(&columns, &rows)
            .unwrap()
            .factor(&values)
            .unwrap();
        let b: Vec<f64> = (0..n).map(|k| (k % 11) as f64 - 5.0).collect();
        let mut x = b.clone();
        factor.solve(&mut x);
        assert!(residual(&columns, &rows, &values, &x, &b) < 1e-11);
    }

    #[test]
    fn matrices_that_are_not_definite_are_refused() {
        let pattern = Pattern::new(&[0, 2, 3], &[0, 1, 1]).unwrap();
        assert!(pattern.factor(&[1.0, 0.5, 1.0]).is_some());
        assert!(pattern.factor(&[1.0, 1.0, 1.0]).is_none());
        assert!(pattern.factor(&[1.0, 2.0, 1.0]).is_none());
        assert!(pattern.factor(&[f64::NAN, 0.0, 1.0]).is_none());
    }
}
