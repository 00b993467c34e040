//! Sparse symmetric positive definite systems, with the same last digit on every machine.
//!
//! A = P^T L L^T P with a fill-reducing permutation P. Columns of L with nearly the same rows form a supernode, a dense
//! trapezoid of columns. The factorisation is left-looking: a supernode takes its entries of A, subtracts the products of
//! the earlier supernodes that reach its columns, and is factored as a dense matrix. It takes from supernodes below it in the
//! elimination tree only, so subtrees are factored side by side, and each number is the same on one core and on many.
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
use nurbskin_geometry::numeric::parallel::{ROOT, children_first};
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// The pattern of a matrix and of its factor: the same for all matrices with entries at the same places.
#[derive(Clone, Debug)]
pub(crate) struct Pattern(Arc<Places>);

#[derive(Debug)]
struct Places {
    /// The place of each row in the order of elimination.
    order: Vec<u32>,
    /// The entries of the lower triangle of the matrix, supernode by supernode, with their places among its numbers.
    entries: Vec<(u32, usize)>,
    supernodes: Vec<Supernode>,
    /// Rows below the columns of the supernodes.
    rows: Vec<u32>,
    /// What each supernode takes from earlier ones.
    updates: Vec<Update>,
    /// The supernode that takes from each first, the next above in the elimination tree; [`ROOT`] if none.
    parents: Vec<u32>,
    /// Multiplications for each supernode.
    costs: Vec<u64>,
}

/// Columns side by side with the same rows: a dense matrix of `width` columns with `width` + `below` rows.
#[derive(Clone, Debug, Default)]
struct Supernode {
    /// The first column.
    first: usize,
    width: usize,
    /// Where its rows below begin in `Places::rows`, and their number.
    rows: usize,
    below: usize,
    /// Its parts of `Places::updates` and `Places::entries`.
    updates: Range<usize>,
    entries: Range<usize>,
}

impl Supernode {
    fn height(&self) -> usize {
        self.width + self.below
    }
}

/// What a supernode takes from an earlier one: the product of rows of that one from the first that is a column here, with
/// those that are.
#[derive(Clone, Copy, Debug)]
struct Update {
    /// The earlier supernode.
    from: u32,
    /// How many of its rows below lie before the columns here, and how many are columns here.
    done: usize,
    reached: usize,
}

impl Places {
    /// Adds a supernode after the others.
    fn push(&mut self, columns: Range<usize>, below: &[u32]) -> Option<()> {
        let node = Supernode {
            first: columns.start,
            width: columns.len(),
            rows: self.rows.len(),
            below: below.len(),
            ..Supernode::default()
        };
        self.rows.extend_from_slice(below);
        node.width.checked_mul(node.height())?;
        self.supernodes.push(node);
        Some(())
    }

    /// Rows below the columns of a supernode.
    fn below(&self, node: &Supernode) -> &[u32] {
        &self.rows[node.rows..node.rows + node.below]
    }

    /// The supernode of each column.
    fn owners(&self) -> Vec<u32> {
        let mut owner = vec![0; self.order.len()];
        for (s, node) in (0_u32..).zip(&self.supernodes) {
            owner[node.first..node.first + node.width].fill(s);
        }
        owner
    }

    /// Finds where the entries of the matrix go.
    fn enter(&mut self, columns: &[u32], rows: &[u32], owner: &[u32]) -> Option<()> {
        let mut by_node = vec![Vec::new(); self.supernodes.len()];
        for j in 0..self.order.len() {
            for k in columns[j]..columns[j + 1] {
                let (a, b) = (self.order[rows[k as usize] as usize], self.order[j]);
                let (row, column) = (a.max(b), a.min(b) as usize);
                let s = owner[column] as usize;
                let node = &self.supernodes[s];
                let at = if (row as usize) < node.first + node.width {
                    row as usize - node.first
                } else {
                    node.width + self.below(node).binary_search(&row).ok()?
                };
                by_node[s].push((k, (column - node.first) * node.height() + at));
            }
        }
        for (node, entries) in self.supernodes.iter_mut().zip(by_node) {
            let from = self.entries.len();
            self.entries.extend(entries);
            node.entries = from..self.entries.len();
        }
        Some(())
    }

    /// Finds what each supernode takes from which, in an order that is fixed: sums are rounded by it.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rows are numbers of 32 bits"
    )]
    fn relate(&mut self, owner: &[u32]) {
        let count = self.supernodes.len();
        // The earlier ones that reach each supernode next, the last one first, and how many of their rows lie before.
        let mut waiting: Vec<Vec<u32>> = vec![Vec::new(); count];
        let mut done = vec![0; count];
        for s in 0..count {
            let node = &self.supernodes[s];
            let end = (node.first + node.width) as u32;
            let mut cost = multiplications(node.width, node.width, node.height());
            let mut updates = Vec::new();
            for d in std::mem::take(&mut waiting[s]).into_iter().rev() {
                let earlier = &self.supernodes[d as usize];
                let rows = &self.below(earlier)[done[d as usize]..];
                let reached = rows.partition_point(|row| *row < end);
                cost += multiplications(rows.len(), reached, earlier.width);
                updates.push(Update {
                    from: d,
                    done: done[d as usize],
                    reached,
                });
                done[d as usize] += reached;
                if let Some(&row) = rows.get(reached) {
                    waiting[owner[row as usize] as usize].push(d);
                }
            }
            let from = self.updates.len();
            self.updates.extend(updates);
            self.supernodes[s].updates = from..self.updates.len();
            self.costs.push(cost);
            let next = self.below(&self.supernodes[s]).first();
            let parent = next.map_or(ROOT, |&row| owner[row as usize]);
            self.parents.push(parent);
            if parent != ROOT {
                waiting[parent as usize].push(s as u32);
            }
        }
    }
}

/// Multiplications of a product of matrices, of sizes whose product may be beyond 32 bits, the size of `usize` in a browser.
fn multiplications(rows: usize, columns: usize, inner: usize) -> u64 {
    rows as u64 * columns as u64 * inner as u64
}

/// The factor L of a matrix: the numbers of each supernode, column by column.
#[derive(Debug)]
pub(crate) struct Factor {
    pattern: Pattern,
    values: Vec<Vec<f64>>,
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
            updates: Vec::new(),
            parents: Vec::new(),
            costs: Vec::new(),
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
        places.enter(columns, rows, &owner)?;
        places.relate(&owner);
        Some(Self(Arc::new(places)))
    }

    /// The factor of the matrix with these entries, in the order of the pattern. None if the matrix is not positive
    /// definite to rounding, or there is no memory. Subtrees of the elimination tree are factored side by side.
    pub(crate) fn factor(&self, entries: &[f64]) -> Option<Factor> {
        let places = &*self.0;
        let made: Vec<OnceLock<Vec<f64>>> =
            places.supernodes.iter().map(|_| OnceLock::new()).collect();
        let good = children_first(
            &places.parents,
            &places.costs,
            || Work::new(places),
            |work, s| {
                let values = work.factored(places, &made, entries, s);
                values.is_some_and(|values| made[s].set(values).is_ok())
            },
        );
        let values = good.then(|| made.into_iter().map(OnceLock::into_inner));
        Some(Factor {
            pattern: self.clone(),
            values: values?.collect::<Option<_>>()?,
        })
    }
}

/// What a task of the factorisation works with.
struct Work {
    /// Where a row lies in the supernode that is made now.
    local: Vec<u32>,
    product: Vec<f64>,
}

impl Work {
    fn new(places: &Places) -> Self {
        Self {
            local: vec![0; places.order.len()],
            product: Vec::new(),
        }
    }

    /// The numbers of supernode `s`, after all that it takes from are made. None as for [`Pattern::factor`].
    fn factored(
        &mut self,
        places: &Places,
        made: &[OnceLock<Vec<f64>>],
        entries: &[f64],
        s: usize,
    ) -> Option<Vec<f64>> {
        let node = &places.supernodes[s];
        let mut values = Vec::new();
        values.try_reserve_exact(node.width * node.height()).ok()?;
        values.resize(node.width * node.height(), 0.0);
        for &(k, place) in &places.entries[node.entries.clone()] {
            values[place] += entries[k as usize];
        }
        let columns = node.first..node.first + node.width;
        let rows = (0_u32..).zip(columns.chain(places.below(node).iter().map(|row| *row as usize)));
        for (k, row) in rows {
            self.local[row] = k;
        }
        for update in &places.updates[node.updates.clone()] {
            let earlier = made[update.from as usize].get()?;
            self.subtract(places, node, &mut values, update, earlier);
        }
        dense::factor(&mut values, node.height(), node.width).then_some(values)
    }

    /// Subtracts from the numbers of a supernode what it takes from an earlier one.
    fn subtract(
        &mut self,
        places: &Places,
        node: &Supernode,
        values: &mut [f64],
        update: &Update,
        earlier: &[f64],
    ) {
        let from = &places.supernodes[update.from as usize];
        let rows = &places.below(from)[update.done..];
        self.product.clear();
        self.product.resize(rows.len() * update.reached, 0.0);
        dense::subtract_product(
            &mut self.product,
            rows.len(),
            &earlier[from.width + update.done..],
            from.height(),
            [rows.len(), update.reached, from.width],
        );
        for (j, column) in self.product.chunks_exact(rows.len()).enumerate() {
            let to = (rows[j] as usize - node.first) * node.height();
            let to = &mut values[to..to + node.height()];
            for (&row, part) in rows[j..].iter().zip(&column[j..]) {
                to[self.local[row as usize] as usize] += part;
            }
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
        for (node, values) in places.supernodes.iter().zip(&self.values) {
            let (columns, below) = (values.chunks_exact(node.height()), places.below(node));
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
        for (node, values) in places.supernodes.iter().zip(&self.values).rev() {
            let (columns, below) = (values.chunks_exact(node.height()), places.below(node));
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
        let pattern = Pattern::new(&columns, &rows).unwrap();
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build()
                .unwrap()
                .install(|| pattern.factor(&values).unwrap())
        };
        let factor = on(1);
        assert_eq!(factor.values, on(4).values);
        let b: Vec<f64> = (0..n).map(|k| (k % 11) as f64 - 5.0).collect();
        let mut x = b.clone();
        factor.solve(&mut x);
        assert!(residual(&columns, &rows, &values, &x, &b) < 1e-11);
    }

    #[test]
    fn costs_do_not_overflow() {
        assert_eq!(multiplications(2000, 2000, 2000), 8_000_000_000);
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
