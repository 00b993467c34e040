//! The normal equations of penalised least squares, assembled cell by cell.
//!
//! Minimises `sum w_k |X_k - S(u_k, v_k)|^2 / sum w_k + lambda E(S)`. In a cell of the knots the same (p + 1)(q + 1)
//! basis functions live; the products of two of them are products of a pair along u and a pair along v, so that a cell
//! needs (p+1)(p+2)/2 x (q+1)(q+2)/2 sums (100 for bicubics) whatever its number of points.

use super::fairness::{ThinPlate, quadratic_form};
use super::samples::{CHUNK, Cells, Samples};
use super::space::{Fit, Space, values_and_slopes};
use crate::numeric::cholesky::{SymmetricBanded, solve_refined};
use crate::{DVec3, Result};
#[cfg(feature = "parallel")]
use rayon::prelude::*;

/// Largest pull towards the middle of the scan, relative to the mean diagonal, before a system is given up.
const LARGEST_PULL: f64 = 1e-6;

/// How much stiffer the surface is in cells without points: extrapolation is then calm.
const EMPTY_STIFFNESS: f64 = 100.0;

/// Sums over the points of one cell, or of a part of it.
#[derive(Clone, Debug)]
struct Sums {
    pairs: Vec<f64>,
    right: Vec<DVec3>,
}

/// Everything of a fit that does not change with weights and fairness.
#[derive(Debug)]
pub(super) struct Assembly<'a> {
    pub(super) space: &'a Space,
    pub(super) samples: &'a Samples,
    pub(super) cells: Cells,
    plate: ThinPlate,
}

/// A solved fit and the residual of its normal equations, relative to the right-hand side.
#[derive(Debug)]
pub(super) struct Solved {
    pub(super) fit: Fit,
    pub(super) equation_residual: f64,
}

impl<'a> Assembly<'a> {
    pub(super) fn new(space: &'a Space, samples: &'a Samples, size: [f64; 2]) -> Self {
        Self {
            space,
            samples,
            cells: Cells::of_space(space, samples),
            plate: ThinPlate::new(space, size),
        }
    }

    /// The pair count along u and v.
    fn pairs(&self) -> [usize; 2] {
        self.space.degree().map(|p| (p + 1) * (p + 2) / 2)
    }

    /// Sums over `order[from..to]`, all in cell (a, b).
    fn sums(&self, a: usize, b: usize, samples: &[u32], weights: &[f64]) -> Sums {
        let [p, q] = self.space.degree();
        let [pairs_u, pairs_v] = self.pairs();
        let mut sums = Sums {
            pairs: vec![0.0; pairs_u * pairs_v],
            right: vec![DVec3::ZERO; (p + 1) * (q + 1)],
        };
        let mut of_u = vec![0.0; pairs_u];
        let mut of_v = vec![0.0; pairs_v];
        for &k in samples {
            let k = k as usize;
            let w = weights[k];
            if w <= 0.0 {
                continue;
            }
            let t = self.samples.parameters[k];
            let (bu, _) = values_and_slopes(&self.space.knots[0], a, t.x);
            let (bv, _) = values_and_slopes(&self.space.knots[1], b, t.y);
            products(&bu[..=p], w, &mut of_u);
            products(&bv[..=q], 1.0, &mut of_v);
            if let (Ok(u), Ok(v), (rows, [])) = (
                <&[f64; 10]>::try_from(&of_u[..]),
                <&[f64; 10]>::try_from(&of_v[..]),
                sums.pairs.as_chunks_mut::<10>(),
            ) {
                // Bicubic: lengths the compiler knows.
                for (row, &x) in rows.iter_mut().zip(u) {
                    for (s, &y) in row.iter_mut().zip(v) {
                        *s += x * y;
                    }
                }
            } else {
                for (row, &x) in sums.pairs.chunks_mut(pairs_v).zip(&of_u) {
                    for (s, &y) in row.iter_mut().zip(&of_v) {
                        *s += x * y;
                    }
                }
            }
            let x = w * self.samples.points[k];
            for (row, &y) in sums.right.chunks_mut(p + 1).zip(&bv[..=q]) {
                let xy = y * x;
                for (r, &b) in row.iter_mut().zip(&bu) {
                    *r += b * xy;
                }
            }
        }
        sums
    }

    /// Solves for the surface with these weights and lambda >= 0.
    ///
    /// # Errors
    /// [`Error::NoSolution`](crate::Error::NoSolution) if the points do not determine a surface.
    pub(super) fn solve(&self, weights: &[f64], lambda: f64) -> Result<Solved> {
        let [columns, _] = self.space.spans();
        let [p, q] = self.space.degree();
        // Large cells are cut, so that all cores have work; parts are added in order.
        let mut tasks = Vec::new();
        for cell in 0..self.cells.len() {
            let samples = self.cells.samples(cell);
            let parts = samples.chunks(CHUNK);
            tasks.extend(parts.map(|part| (cell, part)));
        }
        let run = |&(cell, part): &(usize, &[u32])| {
            self.sums(cell % columns, cell / columns, part, weights)
        };
        #[cfg(feature = "parallel")]
        let partial: Vec<Sums> = tasks.par_iter().with_min_len(16).map(run).collect();
        #[cfg(not(feature = "parallel"))]
        let partial: Vec<Sums> = tasks.iter().map(run).collect();

        let total: f64 = weights.iter().sum();
        let share = if total > 0.0 { 1.0 / total } else { 0.0 };
        let n = self.space.unknowns();
        let mut matrix = SymmetricBanded::zeros(n, self.space.half_band())?;
        let mut right = vec![DVec3::ZERO; n];
        let [pairs_u, pairs_v] = self.pairs();
        let mut block = vec![0.0; pairs_u * pairs_v];
        let mut next = 0;
        let mut local = vec![0; (p + 1) * (q + 1)];
        for cell in 0..self.cells.len() {
            let (a, b) = (cell % columns, cell / columns);
            for (k, at) in local.iter_mut().enumerate() {
                let (i, j) = (k % (p + 1), k / (p + 1));
                *at = self.space.index()[(b + j) * self.space.stride() + a + i];
            }
            block.fill(0.0);
            let mut empty = true;
            while next < tasks.len() && tasks[next].0 == cell {
                let sums = &partial[next];
                block
                    .iter_mut()
                    .zip(&sums.pairs)
                    .for_each(|(x, s)| *x += share * s);
                for (&at, &r) in local.iter().zip(&sums.right) {
                    right[at] += share * r;
                }
                empty = false;
                next += 1;
            }
            let stiffness = if empty {
                EMPTY_STIFFNESS * lambda
            } else {
                lambda
            };
            self.plate.add_cell(a, b, stiffness, &mut block);
            scatter(&block, &local, p, q, &mut matrix);
        }
        // Points on a line leave the tilt of the surface open: the faintest pull decides it, stronger where it must.
        let mean = (0..n).map(|i| matrix.entry(i, i)).sum::<f64>() / n as f64;
        let mut pull = 0.0;
        loop {
            match solve_refined(&matrix, &right) {
                Ok((x, equation_residual)) if x.iter().all(|p| p.is_finite()) => {
                    return Ok(Solved {
                        fit: Fit::from_unknowns(self.space.clone(), &x),
                        equation_residual,
                    });
                }
                Err(error) if pull >= LARGEST_PULL => return Err(error),
                _ if pull >= LARGEST_PULL => {
                    return Err(crate::Error::NoSolution(
                        "the points do not determine a surface: give more of them, or fewer control points".into(),
                    ));
                }
                _ => {
                    let more = if pull > 0.0 { 99.0 * pull } else { 1e-12 };
                    for i in 0..n {
                        matrix.add(i, i, more * mean);
                    }
                    pull += more;
                }
            }
        }
    }

    /// Mean thin-plate energy over the cells that hold points.
    pub(super) fn energy(&self, fit: &Fit) -> f64 {
        let [columns, _] = self.space.spans();
        let [p, q] = self.space.degree();
        let [pairs_u, pairs_v] = self.pairs();
        let mut block = vec![0.0; pairs_u * pairs_v];
        let mut local = vec![DVec3::ZERO; (p + 1) * (q + 1)];
        let (mut sum, mut area) = (0.0, 0.0);
        for cell in 0..self.cells.len() {
            if self.cells.samples(cell).is_empty() {
                continue;
            }
            let (a, b) = (cell % columns, cell / columns);
            for (k, c) in local.iter_mut().enumerate() {
                let (i, j) = (k % (p + 1), k / (p + 1));
                *c = fit.net[(b + j) * self.space.stride() + a + i];
            }
            block.fill(0.0);
            self.plate.add_cell(a, b, 1.0, &mut block);
            sum += quadratic_form(&block, &local, p, q);
            let [bu, bv] = &self.space.breaks;
            area += (bu[a + 1] - bu[a]) * (bv[b + 1] - bv[b]);
        }
        if area > 0.0 {
            (sum / area).max(0.0)
        } else {
            0.0
        }
    }
}

/// `scale` times the products of all pairs i <= k of `values`.
fn products(values: &[f64], scale: f64, out: &mut [f64]) {
    let mut at = 0;
    for (i, &x) in values.iter().enumerate() {
        let x = scale * x;
        for &y in &values[i..] {
            out[at] = x * y;
            at += 1;
        }
    }
}

/// Adds a cell's sums over pairs to the entries of its unknowns.
fn scatter(block: &[f64], local: &[usize], p: usize, q: usize, matrix: &mut SymmetricBanded) {
    let mut add = |x: usize, y: usize, value: f64| {
        let (x, y) = (local[x], local[y]);
        // A pair of functions that shares one unknown (at a pole) counts in both orders.
        matrix.add(x.max(y), x.min(y), if x == y { 2.0 * value } else { value });
    };
    let at = |i: usize, j: usize| j * (p + 1) + i;
    let mut entries = block.iter();
    for i in 0..=p {
        for k in i..=p {
            for j in 0..=q {
                for l in j..=q {
                    let Some(&value) = entries.next() else { return };
                    if i == k && j == l {
                        add(at(i, j), at(i, j), 0.5 * value);
                        continue;
                    }
                    add(at(i, j), at(k, l), value);
                    if i != k && j != l {
                        add(at(i, l), at(k, j), value);
                    }
                }
            }
        }
    }
}
