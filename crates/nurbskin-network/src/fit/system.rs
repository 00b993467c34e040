//! The normal equations of a network: a sparse symmetric matrix of 3 x 3 blocks, one per pair of unknowns, and its solution.
//!
//! Every term of the objective is a sum of squares of rows that weigh unknowns by scalars `a_i`, with a symmetric 3 x 3 matrix
//! W between them: the block of the unknowns i and j is sum `a_i` `a_j` W, symmetric itself, six numbers. The pattern changes
//! only when knots are added.

use super::network::{Network, Rows, WIDTH, number};
use super::ways::Way;
use crate::cholesky;
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::{Error, Result};

/// A symmetric 3 x 3 matrix: xx, xy, xz, yy, yz, zz.
pub(crate) type Symmetric = [f64; 6];

/// `w` times the unit matrix.
pub(crate) fn scalar(w: f64) -> Symmetric {
    [w, 0.0, 0.0, w, 0.0, w]
}

/// `along` n n' + `across` (1 - n n') for a unit vector n.
pub(crate) fn directed(n: DVec3, along: f64, across: f64) -> Symmetric {
    let w = along - across;
    [
        across + w * n.x * n.x,
        w * n.x * n.y,
        w * n.x * n.z,
        across + w * n.y * n.y,
        w * n.y * n.z,
        across + w * n.z * n.z,
    ]
}

/// Adds `w` times `b` to `a`.
pub(crate) fn add(a: &mut Symmetric, b: &Symmetric, w: f64) {
    for (a, b) in a.iter_mut().zip(b) {
        *a += w * b;
    }
}

/// Places of a control point's partners in the half stencil of a face: itself and those after it whose basis functions
/// overlap, row by row.
pub(crate) const STENCIL: usize = WIDTH + (WIDTH - 1) * (2 * WIDTH - 1);

/// The place in the stencil of the partner `di`, `dj` further; `dj` at least 0, and `di` too where `dj` is 0.
pub(crate) fn place(di: isize, dj: isize) -> usize {
    const REACH: isize = WIDTH as isize - 1;
    #[expect(clippy::cast_sign_loss, reason = "in the half stencil")]
    if dj == 0 {
        di as usize
    } else {
        (REACH + 1 + (dj - 1) * (2 * REACH + 1) + di + REACH) as usize
    }
}

/// A small dense part of the matrix: the terms of one edge.
#[derive(Clone, Debug, Default)]
pub(crate) struct Element {
    /// The unknowns, ascending.
    pub(crate) nodes: Vec<u32>,
    /// Lower triangle, row by row.
    values: Vec<Symmetric>,
    touched: Vec<bool>,
    rhs: Vec<DVec3>,
}

impl Element {
    /// An element over the unknowns of some rows.
    pub(crate) fn over<'a>(rows: impl Iterator<Item = &'a [(u32, f64)]>) -> Self {
        let mut nodes: Vec<u32> = rows.flatten().map(|e| e.0).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let n = nodes.len();
        Self {
            nodes,
            values: vec![[0.0; 6]; n * (n + 1) / 2],
            touched: vec![false; n * (n + 1) / 2],
            rhs: vec![DVec3::ZERO; n],
        }
    }

    /// Adds |row x - target|^2 with the weight `w` between coordinates; a row names each unknown once.
    pub(crate) fn add_row(&mut self, row: &[(u32, f64)], w: &Symmetric, target: DVec3) {
        let local: Vec<(usize, f64)> = row
            .iter()
            .filter_map(|&(k, a)| self.nodes.binary_search(&k).ok().map(|at| (at, a)))
            .collect();
        let pull = times(w, target);
        for (m, &(i, a)) in local.iter().enumerate() {
            self.rhs[i] += a * pull;
            for &(j, b) in &local[..=m] {
                let (hi, lo) = (i.max(j), i.min(j));
                let at = hi * (hi + 1) / 2 + lo;
                self.touched[at] = true;
                add(&mut self.values[at], w, a * b);
            }
        }
    }

    /// The pairs of unknowns that rows touched, the later one first.
    fn pairs(&self) -> impl Iterator<Item = (u32, u32, usize)> + '_ {
        (0..self.nodes.len())
            .flat_map(move |i| {
                (0..=i).map(move |j| (self.nodes[i], self.nodes[j], i * (i + 1) / 2 + j))
            })
            .filter(|&(_, _, at)| self.touched[at])
    }
}

/// A symmetric matrix times a vector.
pub(crate) fn times(w: &Symmetric, x: DVec3) -> DVec3 {
    DVec3::new(
        w[0] * x.x + w[1] * x.y + w[2] * x.z,
        w[1] * x.x + w[3] * x.y + w[4] * x.z,
        w[2] * x.x + w[4] * x.y + w[5] * x.z,
    )
}

/// Where the stencil of a face goes in the matrix.
#[derive(Clone, Debug, Default)]
struct Plan {
    /// For each control point and place of the stencil the first of its `targets`.
    start: Vec<u32>,
    /// Slot in the matrix, and weight.
    targets: Vec<(u32, f64)>,
}

/// The pattern of the normal equations of a network, and the order of elimination.
#[derive(Clone, Debug)]
pub(crate) struct Pattern {
    unknowns: usize,
    /// Column by column the rows at or below the diagonal.
    start: Vec<usize>,
    rows: Vec<u32>,
    plans: Vec<Plan>,
    /// That of the last solution.
    elimination: Option<Elimination>,
}

/// The pattern of the numbers to find, three for each unknown that moves all ways, one for the others, and the order of
/// elimination.
#[derive(Clone, Debug)]
struct Elimination {
    /// The first number of each unknown, and the count of all.
    first: Vec<usize>,
    pattern: cholesky::Pattern,
}

/// The normal equations.
#[derive(Clone, Debug)]
pub(crate) struct System {
    values: Vec<Symmetric>,
    rhs: Vec<DVec3>,
}

/// Calls `f` with each pair of control points whose functions overlap: the first, its place in the stencil, the second.
fn partners([nu, nv]: [usize; 2], mut f: impl FnMut(usize, usize, usize)) {
    for j in 0..nv {
        for i in 0..nu {
            for dj in 0..WIDTH.min(nv - j) {
                let first = if dj == 0 { 0 } else { i.min(WIDTH - 1) };
                for k in (i - first)..(i + WIDTH).min(nu) {
                    let at = place(k.cast_signed() - i.cast_signed(), dj.cast_signed());
                    f(j * nu + i, at, (j + dj) * nu + k);
                }
            }
        }
    }
}

/// Calls `f` with each pair of unknowns, the later first, that a pair of control points stands for, and its weight.
fn spread(rows: &Rows, a: usize, b: usize, mut f: impl FnMut(u32, u32, f64)) {
    for (m, &(i, p)) in rows.of(a).iter().enumerate() {
        let others = if a == b {
            &rows.of(b)[..=m]
        } else {
            rows.of(b)
        };
        for &(j, q) in others {
            // The product counts twice on the diagonal when the two control points differ.
            let both = if i == j && a != b { 2.0 } else { 1.0 };
            f(i.max(j), i.min(j), both * p * q);
        }
    }
}

impl Pattern {
    /// The pattern of a network with further elements, whose values do not matter.
    pub(crate) fn new(network: &Network, elements: &[Element]) -> Self {
        let key = |i: u32, j: u32| u64::from(j) << 32 | u64::from(i);
        let mut keys: Vec<u64> = each(network.faces.len(), |k| {
            let face = &network.faces[k];
            let mut keys = Vec::new();
            partners(face.counts(), |a, _, b| {
                spread(&face.rows, a, b, |i, j, _| keys.push(key(i, j)));
            });
            keys.sort_unstable();
            keys.dedup();
            keys
        })
        .concat();
        keys.extend(
            elements
                .iter()
                .flat_map(|e| e.pairs().map(|(i, j, _)| key(i, j))),
        );
        let unknowns = network.unknowns();
        keys.extend((0..number(unknowns)).map(|k| key(k, k)));
        keys.sort_unstable();
        keys.dedup();
        #[expect(clippy::cast_possible_truncation, reason = "the halves of the key")]
        let split = |key: u64| ((key >> 32) as usize, key as u32);
        let mut start = vec![0; unknowns + 1];
        for &key in &keys {
            start[split(key).0 + 1] += 1;
        }
        for k in 0..unknowns {
            start[k + 1] += start[k];
        }
        let rows: Vec<u32> = keys.iter().map(|&key| split(key).1).collect();
        let mut pattern = Self {
            unknowns,
            start,
            rows,
            plans: Vec::new(),
            elimination: None,
        };
        pattern.plans = each(network.faces.len(), |k| {
            let face = &network.faces[k];
            let [nu, nv] = face.counts();
            let mut lists = vec![Vec::new(); nu * nv * STENCIL];
            partners([nu, nv], |a, at, b| {
                spread(&face.rows, a, b, |i, j, w| {
                    if let Some(slot) = pattern.slot(i, j) {
                        lists[a * STENCIL + at].push((number(slot), w));
                    }
                });
            });
            let mut plan = Plan {
                start: vec![0],
                targets: Vec::new(),
            };
            for list in lists {
                plan.targets.extend(list);
                plan.start.push(number(plan.targets.len()));
            }
            plan
        });
        pattern
    }

    /// The place of the block (i, j), i >= j.
    fn slot(&self, i: u32, j: u32) -> Option<usize> {
        let column = self.start[j as usize]..self.start[j as usize + 1];
        let at = self.rows[column.clone()].binary_search(&i).ok()?;
        Some(column.start + at)
    }

    /// Equations without terms.
    pub(crate) fn system(&self) -> System {
        System {
            values: vec![[0.0; 6]; self.rows.len()],
            rhs: vec![DVec3::ZERO; self.unknowns],
        }
    }

    /// Adds the terms of a face: its stencil and right-hand sides by control point.
    pub(crate) fn add_face(
        &self,
        system: &mut System,
        face: usize,
        rows: &Rows,
        stencil: &[Symmetric],
        rhs: &[DVec3],
    ) {
        let plan = &self.plans[face];
        for (k, block) in stencil.iter().enumerate() {
            for &(slot, w) in &plan.targets[plan.start[k] as usize..plan.start[k + 1] as usize] {
                add(&mut system.values[slot as usize], block, w);
            }
        }
        for (k, pull) in rhs.iter().enumerate() {
            for &(at, w) in rows.of(k) {
                system.rhs[at as usize] += w * *pull;
            }
        }
    }

    /// Adds the terms of an edge.
    pub(crate) fn add_element(&self, system: &mut System, element: &Element, weight: f64) {
        for (i, j, at) in element.pairs() {
            debug_assert!(self.slot(i, j).is_some(), "a term outside the pattern");
            if let Some(slot) = self.slot(i, j) {
                add(&mut system.values[slot], &element.values[at], weight);
            }
        }
        for (&node, &pull) in element.nodes.iter().zip(&element.rhs) {
            system.rhs[node as usize] += weight * pull;
        }
    }

    /// Adds |row x - target|^2 with weight `w` for a row of few unknowns.
    pub(crate) fn add_row(&self, system: &mut System, row: &[(u32, f64)], w: f64, target: DVec3) {
        for (m, &(i, a)) in row.iter().enumerate() {
            system.rhs[i as usize] += w * a * target;
            for &(j, b) in &row[..=m] {
                debug_assert!(
                    self.slot(i.max(j), i.min(j)).is_some(),
                    "a term outside the pattern"
                );
                if let Some(slot) = self.slot(i.max(j), i.min(j)) {
                    add(&mut system.values[slot], &scalar(1.0), w * a * b);
                }
            }
        }
    }

    /// Solves the equations, with the `last` solution as a weak target: `damping` is its weight as a share of the mean
    /// diagonal. Each unknown moves its way.
    ///
    /// # Errors
    /// [`Error::NoSolution`] if the matrix is not positive definite, or there is no memory for it.
    pub(crate) fn solve(
        &mut self,
        mut system: System,
        last: &[DVec3],
        damping: f64,
        ways: &[Way],
    ) -> Result<Vec<DVec3>> {
        let mean = {
            let diagonal = |k: usize| system.values[self.start[k]];
            let trace: f64 = (0..self.unknowns)
                .map(|k| diagonal(k)[0] + diagonal(k)[3] + diagonal(k)[5])
                .sum();
            trace / (3 * self.unknowns.max(1)) as f64
        };
        // The unknowns are the changes: the right-hand side becomes the residual.
        self.subtract_product(&mut system, last);
        let damping = mean * damping.max(RIDGE);
        for k in 0..self.unknowns {
            add(&mut system.values[self.start[k]], &scalar(1.0), damping);
        }
        let mut first = vec![0];
        for way in ways {
            let count = if way.is_some() { 1 } else { 3 };
            first.push(first[first.len() - 1] + count);
        }
        let elimination = match self.elimination.take() {
            Some(known) if known.first == first => known,
            _ => self.eliminated(first)?,
        };
        let values = self.scalar_values(&system.values, ways);
        let factor = elimination.pattern.factor(&values).ok_or_else(|| {
            Error::NoSolution("the equations of the network are not definite".into())
        })?;
        let pulls = system.rhs.iter().zip(ways);
        let mut change: Vec<f64> = pulls
            .flat_map(|(pull, way)| directions(*way).map(|d| d.dot(*pull)))
            .collect();
        factor.solve(&mut change);
        let moved = |(k, way): (usize, &Way)| {
            let first = elimination.first[k];
            let along = directions(*way).enumerate();
            let change: DVec3 = along.map(|(c, d)| change[first + c] * d).sum();
            last[k] + change
        };
        let x = ways.iter().enumerate().map(moved).collect();
        self.elimination = Some(elimination);
        Ok(x)
    }

    /// Subtracts the matrix times `x` from the right-hand side.
    fn subtract_product(&self, system: &mut System, x: &[DVec3]) {
        for j in 0..self.unknowns {
            for slot in self.start[j]..self.start[j + 1] {
                let i = self.rows[slot] as usize;
                let block = &system.values[slot];
                system.rhs[i] -= times(block, x[j]);
                if i != j {
                    system.rhs[j] -= times(block, x[i]);
                }
            }
        }
    }

    /// The lower triangle of the numbers to find, and its order of elimination.
    fn eliminated(&self, first: Vec<usize>) -> Result<Elimination> {
        let no_memory = || {
            Error::NoSolution("the network has too many unknowns for this machine's memory".into())
        };
        let mut columns = vec![0];
        let mut indices = Vec::new();
        for j in 0..self.unknowns {
            for column in first[j]..first[j + 1] {
                for &i in &self.rows[self.start[j]..self.start[j + 1]] {
                    let own = first[i as usize]..first[i as usize + 1];
                    indices.extend(own.filter(|row| *row >= column).map(number));
                }
                columns.push(u32::try_from(indices.len()).map_err(|_| no_memory())?);
            }
        }
        let pattern = cholesky::Pattern::new(&columns, &indices).ok_or_else(no_memory)?;
        Ok(Elimination { first, pattern })
    }

    /// The entries of that triangle.
    fn scalar_values(&self, blocks: &[Symmetric], ways: &[Way]) -> Vec<f64> {
        let mut values = Vec::new();
        for (j, column) in self.start.windows(2).enumerate() {
            for (c, along) in directions(ways[j]).enumerate() {
                let own = column[0]..column[1];
                for (&i, block) in self.rows[own.clone()].iter().zip(&blocks[own]) {
                    let i = i as usize;
                    let pull = times(block, along);
                    let first = if i == j { c } else { 0 };
                    values.extend(directions(ways[i]).skip(first).map(|d| d.dot(pull)));
                }
            }
        }
        values
    }
}

/// The directions along which an unknown moves.
fn directions(way: Way) -> impl Iterator<Item = DVec3> {
    let all = [DVec3::X, DVec3::Y, DVec3::Z];
    let count = if way.is_some() { 1 } else { 3 };
    let own = way.map_or(all, |along| [along; 3]);
    own.into_iter().take(count)
}

/// Share of the mean diagonal that is added to each entry of it.
/// Guard: unknowns that nothing else holds; far below any term.
const RIDGE: f64 = 1e-12;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{EdgeKind, Layout, LayoutEdge, LayoutFace, Side};

    /// One open face.
    fn square() -> Network {
        let edge = |ends| LayoutEdge {
            ends,
            kind: EdgeKind::Open,
            line: None,
        };
        let side = |edge, reversed| Side { edge, reversed };
        let layout = Layout {
            vertices: vec![DVec3::ZERO, DVec3::X, DVec3::ONE, DVec3::Y],
            edges: [[0, 1], [1, 2], [2, 3], [3, 0]].map(edge).to_vec(),
            faces: vec![LayoutFace {
                corners: [0, 1, 2, 3],
                sides: [side(0, false), side(1, false), side(2, true), side(3, true)],
            }],
            ..Layout::default()
        };
        Network::new(&layout, &[0.5]).unwrap()
    }

    #[test]
    fn the_gradient_vanishes_along_the_ways() {
        let network = square();
        let n = network.unknowns();
        let row = |k: u32| match k + 1 < number(n) {
            true => vec![(k, 1.0 + f64::from(k % 3)), (k + 1, -0.5)],
            false => vec![(k, 1.0)],
        };
        let rows: Vec<Vec<(u32, f64)>> = (0..number(n)).map(row).collect();
        let mut element = Element::over(rows.iter().map(Vec::as_slice));
        for (k, row) in (0..).zip(&rows) {
            let normal = DVec3::new(f64::from(k % 5), 1.0, f64::from(k % 2)).normalize();
            let target = DVec3::new(f64::from(k), 2.0, -f64::from(k % 7));
            element.add_row(row, &directed(normal, 1.0, 0.1), target);
        }
        let last = network.x.clone();
        for one_way in [0, 1, 2] {
            let way =
                |k: usize| (k % 3 < one_way).then(|| DVec3::new(1.0, k as f64, 2.0).normalize());
            let ways: Vec<Way> = (0..n).map(way).collect();
            let mut pattern = Pattern::new(&network, std::slice::from_ref(&element));
            let build = |pattern: &Pattern| {
                let mut system = pattern.system();
                pattern.add_element(&mut system, &element, 1.0);
                system
            };
            let system = build(&pattern);
            let x = pattern.solve(system, &last, 0.0, &ways).unwrap();
            // A second time, with the order of elimination known.
            let system = build(&pattern);
            assert_eq!(x, pattern.solve(system, &last, 0.0, &ways).unwrap());
            let mut residual = build(&pattern);
            pattern.subtract_product(&mut residual, &x);
            for (k, way) in ways.iter().enumerate() {
                for along in directions(*way) {
                    assert!(residual.rhs[k].dot(along).abs() < 1e-8, "{k} {residual:?}");
                }
                if let Some(along) = way {
                    assert!((x[k] - last[k]).reject_from(*along).length() < 1e-10);
                }
            }
        }
    }
}
