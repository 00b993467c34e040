//! The linear system of a least squares surface, assembled from the sums over the points of each cell.
//!
//! ```text
//! S = plane + Σ N_i x_i,   (Σ w N Nᵀ / Σ w + stiffness) x = Σ w N (X - plane) / Σ w
//! ```
//!
//! The best plane is subtracted first, so that stiffness pulls towards it. The matrix is symmetric and banded; cells
//! are expanded in parallel and added in order, so that the sums do not depend on the number of threads.
//!
//! Source: *The NURBS Book*, 9.4; banded Cholesky factorisation.

use super::cell_moments::{CellSums, Moments};
use super::chebyshev::Pieces;
use super::fairness::quadratic_form;
use super::spline_space::{Numbering, Sum};
use glam::DMat3;
use nurbskin_geometry::numeric::cholesky::SymmetricBanded;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::nurbs::KnotVector;
use nurbskin_geometry::{DVec3, Result};

/// Memory of the sums of cells that are expanded at a time. Bytes.
/// Guard: bounds the memory; small against the matrix.
const ASSEMBLY_BYTES: usize = 8 << 20;
/// Cells of a parallel task. Count.
/// Guard: enough work to be worth handing over.
const CELLS_PER_TASK: usize = 64;
/// Determinant of the second moments of the parameters, relative to that of evenly spread ones, below which they
/// determine no plane. Dimensionless.
/// Guard: above rounding.
const DEGENERATE_PLANE: f64 = 1e-9;

/// X = a + b s + c t with s, t from -1/2 to 1/2 over the domain. The fit is of the difference to this plane, so that
/// stiffness pulls towards it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    /// Middle and length of the domain along u and v.
    domain: [[f64; 2]; 2],
    coefficients: [DVec3; 3],
}

impl Plane {
    fn at(&self, u: f64, v: f64) -> DVec3 {
        let [a, b, c] = self.coefficients;
        let [s, t] = self.place([u, v]);
        a + s * b + t * c
    }
    fn place(&self, uv: [f64; 2]) -> [f64; 2] {
        let [u, v] = self.domain;
        [(uv[0] - u[0]) / u[1], (uv[1] - v[0]) / v[1]]
    }
    /// Value and slopes in coordinates -1..=1 of a cell with these middles and half lengths.
    fn local(&self, [[u, hu], [v, hv]]: [[f64; 2]; 2]) -> [DVec3; 3] {
        let [[_, lu], [_, lv]] = self.domain;
        let [_, b, c] = self.coefficients;
        [self.at(u, v), hu / lu * b, hv / lv * c]
    }
}

/// The components of the system.
#[derive(Clone, Copy, Debug)]
pub(super) struct Equations<'a> {
    pub(super) knots: &'a [KnotVector; 2],
    pub(super) numbering: &'a Numbering,
    pub(super) pieces: &'a [Pieces; 2],
    pub(super) moments: &'a Moments,
}

impl Equations<'_> {
    fn degree(&self) -> [usize; 2] {
        self.knots.each_ref().map(KnotVector::degree)
    }
    /// Cells (a, b) of the knots, u fastest.
    fn cells(&self) -> impl Iterator<Item = [usize; 2]> + use<> {
        let [columns, rows] = self.pieces.each_ref().map(Pieces::len);
        (0..rows).flat_map(move |b| (0..columns).map(move |a| [a, b]))
    }
    fn number(&self, [a, b]: [usize; 2]) -> usize {
        b * self.pieces[0].len() + a
    }
    /// Middle and half length of a cell along u and v.
    fn frame(&self, [a, b]: [usize; 2]) -> [[f64; 2]; 2] {
        [self.pieces[0].span(a), self.pieces[1].span(b)]
    }
    /// The stored control points that shape a cell, u fastest.
    fn local(&self, [a, b]: [usize; 2]) -> impl Iterator<Item = usize> + use<> {
        let [p, q] = self.degree();
        let (i, j) = (self.pieces[0].first(a), self.pieces[1].first(b));
        let stride = self.numbering.stride();
        (0..=q).flat_map(move |l| (0..=p).map(move |k| (j + l) * stride + i + k))
    }
    /// The weight of all points.
    fn weight(&self) -> f64 {
        self.cells()
            .map(|c| self.moments.weight(self.number(c)))
            .sum()
    }

    /// The plane of an open surface; the mean point of a closed one, where only constants are flat. From the moments up
    /// to second order.
    pub(super) fn plane(&self) -> Plane {
        let domain = self.knots.each_ref().map(|k| {
            let (from, to) = k.domain();
            [0.5 * (from + to), to - from]
        });
        let plane = |coefficients| Plane {
            domain,
            coefficients,
        };
        let unit = plane([DVec3::ZERO; 3]);
        let mut n = [[0.0; 3]; 3];
        let mut b = [DVec3::ZERO; 3];
        for cell in self.cells() {
            let [[u, hu], [v, hv]] = self.frame(cell);
            let [u, v] = unit.place([u, v]);
            let (hu, hv) = (hu / domain[0][1], hv / domain[1][1]);
            let cell = self.number(cell);
            let m = |a: usize, b: usize| self.moments.moment(cell, a, b);
            // Sums of 1, s, t, s^2, s t, t^2, with T_2 = 2 s^2 - 1, and of X, s X, t X.
            let (w, s, t) = (m(0, 0), m(1, 0), m(0, 1));
            let (ss, st, tt) = (0.5 * (m(2, 0) + w), m(1, 1), 0.5 * (m(0, 2) + w));
            let [x, sx, tx] = [(0, 0), (1, 0), (0, 1)].map(|(a, b)| self.moments.right(cell, a, b));
            n[0][0] += w;
            n[0][1] += u * w + hu * s;
            n[0][2] += v * w + hv * t;
            n[1][1] += u * u * w + 2.0 * u * hu * s + hu * hu * ss;
            n[1][2] += u * v * w + u * hv * t + v * hu * s + hu * hv * st;
            n[2][2] += v * v * w + 2.0 * v * hv * t + hv * hv * tt;
            b[0] += x;
            b[1] += u * x + hu * sx;
            b[2] += v * x + hv * tx;
        }
        (n[1][0], n[2][0], n[2][1]) = (n[0][1], n[0][2], n[1][2]);
        let mean = b[0] / n[0][0].max(f64::MIN_POSITIVE);
        let matrix = DMat3::from_cols_array_2d(&n);
        // Parameters on a line have no plane; 1e-9 of the determinant of evenly spread ones is as good as that.
        let closed = self.knots.iter().any(KnotVector::is_periodic);
        if closed
            || matrix.determinant() < DEGENERATE_PLANE / 144.0 * n[0][0].powi(3)
            || n[0][0] <= 0.0
        {
            return plane([mean, DVec3::ZERO, DVec3::ZERO]);
        }
        let inverse = matrix.inverse().to_cols_array_2d();
        plane(inverse.map(|row| row[0] * b[0] + row[1] * b[1] + row[2] * b[2]))
    }

    /// The matrix and the right-hand side for the surface less the plane, per unit of weight. `stiffen` adds to the
    /// sums over pairs of functions of a cell, given its weight.
    ///
    /// # Errors
    /// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if the matrix is too large.
    pub(super) fn assemble(
        &self,
        plane: &Plane,
        stiffen: impl Fn([usize; 2], f64, &mut [f64]) + Sync,
    ) -> Result<(SymmetricBanded, Vec<DVec3>)> {
        let [p, q] = self.degree();
        let total = self.weight();
        let share = if total > 0.0 { 1.0 / total } else { 0.0 };
        let n = self.numbering.unknowns();
        let mut matrix = SymmetricBanded::zeros(n, self.numbering.half_band())?;
        let mut right = vec![DVec3::ZERO; n];
        let cells: Vec<[usize; 2]> = self.cells().collect();
        // Cells are expanded on all cores, and added in order.
        let sums_of = |cells: &[[usize; 2]]| -> Vec<(Vec<f64>, Vec<DVec3>)> {
            let mut sums = CellSums::new([p, q]);
            let of_cell = |&cell: &[usize; 2]| {
                self.moments
                    .expand(self.pieces, cell, plane.local(self.frame(cell)), &mut sums);
                let mut block = sums.pairs.clone();
                block.iter_mut().for_each(|x| *x *= share);
                stiffen(cell, self.moments.weight(self.number(cell)), &mut block);
                (block, sums.right.clone())
            };
            cells.iter().map(of_cell).collect()
        };
        let bytes = size_of_val(CellSums::new([p, q]).pairs.as_slice());
        let at_once = (ASSEMBLY_BYTES / bytes).max(1);
        let mut local = Vec::with_capacity((p + 1) * (q + 1));
        for cells in cells.chunks(at_once) {
            let tasks: Vec<_> = cells.chunks(CELLS_PER_TASK).collect();
            let blocks = each(tasks.len(), |k| sums_of(tasks[k]));
            for (&cell, (block, sums)) in cells.iter().zip(blocks.iter().flatten()) {
                local.clear();
                local.extend(self.local(cell).map(|k| self.numbering.sums()[k]));
                for (point, &r) in local.iter().zip(sums) {
                    for &(at, factor) in point.terms() {
                        right[at] += share * factor * r;
                    }
                }
                scatter(block, &local, p, q, &mut matrix);
            }
        }
        Ok((matrix, right))
    }

    /// The stored control points of the surface that is the plane and the unknowns `x`.
    pub(super) fn net(&self, plane: &Plane, x: &[DVec3]) -> Vec<DVec3> {
        let [gu, gv] = self.knots.each_ref().map(KnotVector::greville);
        let of_terms = |sum: &Sum| -> DVec3 { sum.terms().iter().map(|&(at, f)| f * x[at]).sum() };
        let sums = self.numbering.sums().iter().enumerate();
        sums.map(|(k, sum)| of_terms(sum) + plane.at(gu[k % gu.len()], gv[k / gu.len()]))
            .collect()
    }

    /// `sum w (|X - S|^2 - |X|^2)` over the points for the surface S with these stored control points.
    pub(super) fn misfit(&self, net: &[DVec3]) -> f64 {
        let [p, q] = self.degree();
        let mut sums = CellSums::new([p, q]);
        let mut local = Vec::with_capacity((p + 1) * (q + 1));
        let mut misfit = 0.0;
        for cell in self.cells() {
            local.clear();
            local.extend(self.local(cell).map(|k| net[k]));
            self.moments
                .expand(self.pieces, cell, [DVec3::ZERO; 3], &mut sums);
            let linear: f64 = local.iter().zip(&sums.right).map(|(c, r)| c.dot(*r)).sum();
            misfit += quadratic_form(&sums.pairs, &local, p, q) - 2.0 * linear;
        }
        misfit
    }
}

/// Adds a cell's sums over pairs to the entries of its unknowns.
fn scatter(block: &[f64], local: &[Sum], p: usize, q: usize, matrix: &mut SymmetricBanded) {
    let mut add = |x: usize, y: usize, value: f64| {
        for &(a, f) in local[x].terms() {
            for &(b, g) in local[y].terms() {
                // A pair of functions that shares one unknown (at a pole) counts in both orders.
                let times = if a == b { 2.0 } else { 1.0 };
                matrix.add(a.max(b), a.min(b), times * f * g * value);
            }
        }
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
