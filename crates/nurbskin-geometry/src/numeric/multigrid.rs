//! Algebraic multigrid for weighted graphs: vertices gathered in fours, level after level.

use glam::DVec2;

/// No vertex, no entry.
const NONE: u32 = u32::MAX;
/// Levels end at so many vertices, which are solved directly.
const COARSEST: usize = 96;
/// A level must have at most this part of the vertices of the finer one.
const COARSER: f64 = 0.8;

/// Two symmetric matrices of one pattern, for x and for y, with entries -w off the diagonal.
#[derive(Clone, Debug, Default)]
pub(super) struct Graph {
    /// Row k holds the entries `starts[k]..starts[k + 1]`.
    pub(super) starts: Vec<usize>,
    /// Columns of the entries, ascending in each row, without the diagonal.
    pub(super) columns: Vec<u32>,
    pub(super) weights: Vec<DVec2>,
    pub(super) diagonal: Vec<DVec2>,
}

impl Graph {
    pub(super) fn count(&self) -> usize {
        self.diagonal.len()
    }

    fn entries(&self, row: usize) -> impl Iterator<Item = (usize, DVec2)> + '_ {
        let range = self.starts[row]..self.starts[row + 1];
        let columns = self.columns[range.clone()].iter();
        columns
            .zip(&self.weights[range])
            .map(|(&c, &w)| (c as usize, w))
    }

    pub(super) fn multiply(&self, x: &[DVec2], out: &mut [DVec2]) {
        for (row, out) in out.iter_mut().enumerate() {
            let mut sum = self.diagonal[row] * x[row];
            for (column, w) in self.entries(row) {
                sum -= w * x[column];
            }
            *out = sum;
        }
    }

    /// A sweep of Gauss and Seidel's method from zero, first row to last, and what it leaves: after it only the later
    /// columns of each row are unbalanced.
    fn smooth_from_zero(
        &self,
        inverse: &[DVec2],
        right: &[DVec2],
        x: &mut [DVec2],
        rest: &mut [DVec2],
    ) {
        rest.fill(DVec2::ZERO);
        for row in 0..self.count() {
            let from = self.starts[row];
            let upto = self.starts[row + 1];
            let columns = &self.columns[from..upto];
            let earlier = columns.iter().take_while(|&&c| (c as usize) < row).count();
            let mut sum = right[row];
            for (&column, w) in columns[..earlier].iter().zip(&self.weights[from..upto]) {
                sum += *w * x[column as usize];
            }
            let own = sum * inverse[row];
            x[row] = own;
            for (&column, w) in columns[..earlier].iter().zip(&self.weights[from..upto]) {
                rest[column as usize] += *w * own;
            }
        }
    }

    /// A sweep of Gauss and Seidel's method from the last row to the first.
    fn smooth_backward(&self, inverse: &[DVec2], right: &[DVec2], x: &mut [DVec2]) {
        for row in (0..self.count()).rev() {
            let mut sum = right[row];
            for (column, w) in self.entries(row) {
                sum += w * x[column];
            }
            x[row] = sum * inverse[row];
        }
    }
}

/// A level and how it is gathered into the next.
#[derive(Clone, Debug)]
struct Level {
    graph: Graph,
    inverse: Vec<DVec2>,
    /// Vertex of the next level that each vertex belongs to.
    gathered: Vec<u32>,
    /// Entry of the next level that each entry is added to; [`NONE`] within a vertex.
    target: Vec<u32>,
}

/// A hierarchy of ever coarser graphs.
///
/// Source: Y. Notay, *An aggregation-based algebraic multigrid method*, ETNA 37, 2010: pairwise matching along the heaviest
/// edges, twice per level; two steps of conjugate gradients on each coarse level (the K-cycle), which makes up for plain
/// aggregation.
#[derive(Clone, Debug, Default)]
pub(super) struct Multigrid {
    levels: Vec<Level>,
    coarsest: Graph,
    /// Lower factors of the coarsest matrices, by rows.
    factors: Vec<DVec2>,
}

impl Multigrid {
    /// O(n).
    pub(super) fn new(graph: Graph) -> Self {
        let mut this = Self::default();
        let mut graph = graph;
        while graph.count() > COARSEST {
            let gathered = gather(&graph);
            let (next, target) = pattern(&graph, &gathered);
            if next.count() as f64 > COARSER * graph.count() as f64 {
                break;
            }
            let next = {
                let mut next = next;
                galerkin(&graph, &gathered, &target, &mut next);
                next
            };
            this.levels.push(Level {
                inverse: Vec::new(),
                graph: std::mem::replace(&mut graph, next),
                gathered,
                target,
            });
        }
        this.coarsest = graph;
        this.prepare();
        this
    }

    /// New weights on the same pattern, set by `change`. O(n).
    pub(super) fn reweigh(&mut self, change: impl FnOnce(&mut Graph)) {
        match self.levels.first_mut() {
            Some(level) => change(&mut level.graph),
            None => change(&mut self.coarsest),
        }
        for k in 0..self.levels.len() {
            let (fine, coarse) = self.levels.split_at_mut(k + 1);
            let next = coarse
                .first_mut()
                .map_or(&mut self.coarsest, |level| &mut level.graph);
            let level = &fine[k];
            galerkin(&level.graph, &level.gathered, &level.target, next);
        }
        self.prepare();
    }

    pub(super) fn finest(&self) -> &Graph {
        self.levels
            .first()
            .map_or(&self.coarsest, |level| &level.graph)
    }

    fn prepare(&mut self) {
        for level in &mut self.levels {
            let inverse = level.graph.diagonal.iter().map(|&d| inverse(d));
            level.inverse = inverse.collect();
        }
        // Dense factors; coordinates that nothing belongs to stay zero.
        let n = self.coarsest.count();
        let mut a = vec![DVec2::ZERO; n * n];
        for row in 0..n {
            a[row * n + row] = self.coarsest.diagonal[row];
            for (column, w) in self.coarsest.entries(row) {
                a[row * n + column] -= w;
            }
        }
        for row in 0..n {
            for column in 0..=row {
                let mut sum = a[row * n + column];
                for k in 0..column {
                    sum -= a[row * n + k] * a[column * n + k];
                }
                a[row * n + column] = if column < row {
                    // The diagonal holds the inverse root.
                    sum * a[column * n + column]
                } else {
                    let least = 1e-14 * self.coarsest.diagonal[row];
                    let one = |x: f64, least: f64| {
                        if x > least && x > 0.0 {
                            1.0 / x.sqrt()
                        } else {
                            0.0
                        }
                    };
                    DVec2::new(one(sum.x, least.x), one(sum.y, least.y))
                };
            }
        }
        self.factors = a;
    }

    /// Roughly the solution for `right`. O(n).
    pub(super) fn precondition(&self, right: &[DVec2], x: &mut [DVec2]) {
        self.cycle(0, right, x);
    }

    fn cycle(&self, k: usize, right: &[DVec2], x: &mut [DVec2]) {
        let Some(level) = self.levels.get(k) else {
            self.solve_coarsest(right, x);
            return;
        };
        let n = level.graph.count();
        let mut rest = vec![DVec2::ZERO; n];
        level
            .graph
            .smooth_from_zero(&level.inverse, right, x, &mut rest);
        let next = self
            .levels
            .get(k + 1)
            .map_or(self.coarsest.count(), |l| l.graph.count());
        let mut coarse = vec![DVec2::ZERO; next];
        for (&to, rest) in level.gathered.iter().zip(&rest) {
            coarse[to as usize] += rest;
        }
        let mut correction = vec![DVec2::ZERO; next];
        self.accelerated(k + 1, &coarse, &mut correction);
        for (&to, x) in level.gathered.iter().zip(x.iter_mut()) {
            *x += correction[to as usize];
        }
        level.graph.smooth_backward(&level.inverse, right, x);
    }

    /// Two steps of flexible conjugate gradients with the cycle of this level.
    fn accelerated(&self, k: usize, right: &[DVec2], x: &mut [DVec2]) {
        let Some(level) = self.levels.get(k) else {
            self.solve_coarsest(right, x);
            return;
        };
        let n = right.len();
        let mut first = vec![DVec2::ZERO; n];
        self.cycle(k, right, &mut first);
        let mut a_first = vec![DVec2::ZERO; n];
        level.graph.multiply(&first, &mut a_first);
        let rho = dot(&first, &a_first);
        let step = ratio(dot(&first, right), rho);
        let rest: Vec<DVec2> = right
            .iter()
            .zip(&a_first)
            .map(|(r, a)| r - step * a)
            .collect();
        let mut second = vec![DVec2::ZERO; n];
        self.cycle(k, &rest, &mut second);
        let mut a_second = vec![DVec2::ZERO; n];
        level.graph.multiply(&second, &mut a_second);
        let gamma = dot(&second, &a_first);
        let beta = dot(&second, &a_second);
        let share = ratio(gamma, rho);
        let other = ratio(dot(&second, &rest), beta - gamma * share);
        let own = step - share * other;
        for ((x, a), b) in x.iter_mut().zip(&first).zip(&second) {
            *x = own * a + other * b;
        }
    }

    fn solve_coarsest(&self, right: &[DVec2], x: &mut [DVec2]) {
        let n = right.len();
        for row in 0..n {
            let mut sum = right[row];
            for (k, x) in x.iter().enumerate().take(row) {
                sum -= self.factors[row * n + k] * x;
            }
            x[row] = sum * self.factors[row * n + row];
        }
        for row in (0..n).rev() {
            let mut sum = x[row];
            for (k, x) in x.iter().enumerate().skip(row + 1) {
                sum -= self.factors[k * n + row] * x;
            }
            x[row] = sum * self.factors[row * n + row];
        }
    }
}

pub(super) fn dot(a: &[DVec2], b: &[DVec2]) -> DVec2 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The quotients, 0 where the divisor is not positive.
pub(super) fn ratio(a: DVec2, b: DVec2) -> DVec2 {
    let one = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
    DVec2::new(one(a.x, b.x), one(a.y, b.y))
}

fn inverse(d: DVec2) -> DVec2 {
    ratio(DVec2::ONE, d)
}

/// Pairs of pairs along the heaviest edges: the vertex of the next level for each one.
fn gather(graph: &Graph) -> Vec<u32> {
    let pairs = matched(graph);
    let (mut coarse, target) = pattern(graph, &pairs);
    galerkin(graph, &pairs, &target, &mut coarse);
    let again = matched(&coarse);
    pairs.iter().map(|&p| again[p as usize]).collect()
}

/// Each vertex with the free neighbour that it is tied to most; in order. Vertices without any tie, which smoothing solves,
/// are one.
fn matched(graph: &Graph) -> Vec<u32> {
    let mut of = vec![NONE; graph.count()];
    let mut count = 0;
    let mut alone = NONE;
    for row in 0..of.len() {
        if of[row] != NONE {
            continue;
        }
        if graph.entries(row).all(|(_, w)| w.x + w.y <= 0.0) {
            if alone == NONE {
                alone = count;
                count += 1;
            }
            of[row] = alone;
            continue;
        }
        of[row] = count;
        let mut heaviest = (0.0, None);
        for (column, w) in graph.entries(row) {
            let weight = w.x + w.y;
            if of[column] == NONE && weight > heaviest.0 {
                heaviest = (weight, Some(column));
            }
        }
        if let Some(other) = heaviest.1 {
            of[other] = count;
        }
        count += 1;
    }
    of
}

/// The pattern of the graph whose vertices are gathered so, and the entry of it that each entry is added to.
fn pattern(graph: &Graph, gathered: &[u32]) -> (Graph, Vec<u32>) {
    let count = gathered.iter().max().map_or(0, |&m| m as usize + 1);
    let mut starts = vec![0; count + 1];
    for &g in gathered {
        starts[g as usize + 1] += 1;
    }
    for k in 0..count {
        starts[k + 1] += starts[k];
    }
    let mut members = vec![0_u32; gathered.len()];
    let mut next = starts.clone();
    for (k, &g) in (0_u32..).zip(gathered) {
        members[next[g as usize]] = k;
        next[g as usize] += 1;
    }
    let mut coarse = Graph {
        starts: vec![0],
        diagonal: vec![DVec2::ZERO; count],
        ..Graph::default()
    };
    let mut target = vec![NONE; graph.columns.len()];
    // Where the current row has a column.
    let mut at = vec![NONE; count];
    for g in 0..count {
        let from = coarse.columns.len();
        let own = &members[starts[g]..starts[g + 1]];
        let entries = || {
            own.iter()
                .flat_map(|&row| graph.starts[row as usize]..graph.starts[row as usize + 1])
        };
        for e in entries() {
            let column = gathered[graph.columns[e] as usize];
            if column as usize != g && at[column as usize] == NONE {
                at[column as usize] = 0;
                coarse.columns.push(column);
            }
        }
        coarse.columns[from..].sort_unstable();
        for (k, &column) in (from..).zip(&coarse.columns[from..]) {
            at[column as usize] = u32::try_from(k).unwrap_or(NONE);
        }
        for e in entries() {
            let column = gathered[graph.columns[e] as usize];
            if column as usize != g {
                target[e] = at[column as usize];
            }
        }
        for &column in &coarse.columns[from..] {
            at[column as usize] = NONE;
        }
        coarse.starts.push(coarse.columns.len());
    }
    coarse.weights = vec![DVec2::ZERO; coarse.columns.len()];
    (coarse, target)
}

/// Sums of the fine entries in the coarse ones.
fn galerkin(fine: &Graph, gathered: &[u32], target: &[u32], coarse: &mut Graph) {
    coarse.weights.fill(DVec2::ZERO);
    coarse.diagonal.fill(DVec2::ZERO);
    for (row, (&group, diagonal)) in gathered.iter().zip(&fine.diagonal).enumerate() {
        let mut own = *diagonal;
        let entries = fine.starts[row]..fine.starts[row + 1];
        for (&target, weight) in target[entries.clone()].iter().zip(&fine.weights[entries]) {
            match target {
                NONE => own -= weight,
                t => coarse.weights[t as usize] += weight,
            }
        }
        coarse.diagonal[group as usize] += own;
    }
}
