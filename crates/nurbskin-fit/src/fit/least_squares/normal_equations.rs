//! The normal equations of penalised least squares for scans, with more stiffness where points are few.
//!
//! ```text
//! minimise  Σ w |X - S|² / Σ w + ∫ λ e(a, b) |D²S|² + membrane and third-derivative terms in cells without points
//! ```
//!
//! Cells without points are stiffer by a factor of 30, their neighbours by 3; gaps between points bend no more than a
//! length of 1.2 mean distances allows. Where the surface goes on beyond an outline, its third derivatives in the direction
//! away from the points are penalised in place of the stiffness of empty cells. The sums over the points come from
//! [`cell_moments`](super::cell_moments), and [`system`](super::system) assembles the equations.
//!
//! Source: thin-plate splines; the stiffness of empty cells is ours.

use super::cell_moments::Moments;
use super::chebyshev::Pieces;
use super::empty_cells::Gaps;
use super::fairness::{Energies, quadratic_form};
use super::samples::{Cells, Samples};
use super::spline_space::{Fit, SplineSpace};
use super::system::Equations;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::cholesky::solve_refined;
use nurbskin_geometry::{DVec3, Result};

/// Largest pull towards the plane, in mean entries of the diagonal, before a system is given up. Dimensionless.
/// Guard: more would move the surface.
const MAX_PULL: f64 = 1e-6;
/// First pull, in the same unit.
/// Guard: above the rounding of the factorisation.
const FIRST_PULL: f64 = 1e-12;
/// Pull that is added to a pull that did not suffice, as a multiple of it. Dimensionless.
/// Derived: it becomes a hundred times as large, so that three attempts reach [`MAX_PULL`].
const PULL_GROWTH: f64 = 99.0;

/// Factor of the stiffness of a cell without points. Dimensionless.
/// Trial: not recorded; 100 was used before.
const EMPTY_STIFFNESS: f64 = 30.0;
/// Factor of the stiffness of a cell beside one without points. Dimensionless.
/// Trial: not recorded. Few points and steep walls at a ragged edge say little of the slope there.
const EDGE_STIFFNESS: f64 = 3.0;
/// Lengths over which the slope of the surface dies away without points, as shares of the shorter side of the domain:
/// in cells beside such with points, so that small holes are bridged as by a thin plate, and in cells farther away.
/// Trial: not recorded.
const MEMBRANE_LENGTHS: [f64; 2] = [0.05, 0.01];
/// Length, in mean distances of points, below which the surface does not bend in a gap between points: it goes on
/// straight there, however little of its slope fairness alone would leave.
/// Trial: on sheets with ragged edges, beside which surfaces swung off; 1.5 was used before.
const GAP_BENDING_LENGTH: f64 = 1.2;
/// Weight of the third derivatives where a surface continues beyond its points, relative to the weight that fairness
/// gives to the second ones. Dimensionless.
/// Trial: on the sheets of compare/outlines.py. With 400, used before, tight bends that end at an outline bent away there, and
/// a mesh of a channel cut to an L took six times the control points; flat sheets hardly differ between 4 and 400.
const EXTENSION_STIFFNESS: f64 = 4.0;
/// Length that makes second and third derivatives comparable, as a share of the shorter side, at a depth of half that side
/// beyond the points; less deep, it is in proportion.
/// Derived: 1 / (2 pi) for waves as long as that side.
const EXTENSION_LENGTH: f64 = 1.0 / 6.0;
/// Length, in mean distances of points, over which the first fit does not follow a single point.
/// Trial: not recorded. Features of many distances are hardly damped.
const FIRST_FIT_LENGTH: f64 = 4.0;
/// Share of the points, in the cells of least energy, whose mean energy sets the fairness. Dimensionless.
/// Trial: not recorded. The rest may swing at a ragged edge without loosening the surface.
const QUIET_SHARE: f64 = 0.7;
/// Points, by their weights, from which on a cell is held by them. Count.
/// Trial: not recorded.
const HELD_CELL_POINTS: f64 = 4.0;

/// The parts of a fit that do not depend on weights and fairness.
#[derive(Debug)]
pub(crate) struct Assembly<'a> {
    pub(super) space: &'a SplineSpace,
    pub(super) samples: &'a Samples,
    pub(super) cells: Cells,
    pieces: [Pieces; 2],
    energies: Energies,
    size: [f64; 2],
    /// Whether the surface continues smoothly beyond the points to the border of the domain.
    extends: bool,
}

/// A solved fit and the residual of its normal equations, relative to the right-hand side.
#[derive(Debug)]
pub(crate) struct Solved {
    pub(crate) fit: Fit,
    pub(crate) equation_residual: f64,
}

impl<'a> Assembly<'a> {
    pub(crate) fn new(
        space: &'a SplineSpace,
        samples: &'a Samples,
        size: [f64; 2],
        extends: bool,
    ) -> Self {
        Self {
            space,
            samples,
            cells: Cells::of_space(space, samples),
            pieces: [0, 1].map(|d| Pieces::new(&space.knots[d])),
            energies: Energies::new(&space.knots, size),
            size,
            extends,
        }
    }

    /// The pair count along u and v.
    fn pairs(&self) -> [usize; 2] {
        self.space.degree().map(|p| (p + 1) * (p + 2) / 2)
    }

    /// The lambda of the first fit. No single point may bend the surface, since it may be an outlier where there are no
    /// others. To bend over a length l costs `lambda / l^2` per square of the height, and a point contributes its share
    /// of the area, `d^2` for points d apart: so lambda = `l^2 d^2`, l = 4 d. Features of many distances are hardly
    /// damped, and the next fit finds those that are.
    pub(crate) fn first_lambda(&self) -> f64 {
        FIRST_FIT_LENGTH * FIRST_FIT_LENGTH * self.area_per_point().powi(2)
    }

    fn area_per_point(&self) -> f64 {
        self.size[0] * self.size[1] / self.samples.len() as f64
    }

    /// Solves for the surface with these weights and lambda >= 0; cells are stiffer by `stiff`, 1 for one in a gap
    /// between points.
    ///
    /// # Errors
    /// [`Error::NoSolution`](nurbskin_geometry::Error::NoSolution) if the points do not determine a surface.
    pub(crate) fn solve(
        &self,
        weights: &[f64],
        lambda: f64,
        stiff: Option<&[f64]>,
    ) -> Result<Solved> {
        let moments = Moments::new(self.space, &self.pieces, self.samples, &self.cells, weights);
        let equations = Equations {
            knots: &self.space.knots,
            numbering: self.space.numbering(),
            pieces: &self.pieces,
            moments: &moments,
        };
        let plane = equations.plane();
        let open = self.space.topology.closed() == [false, false];
        let calm = MEMBRANE_LENGTHS.map(|part| {
            let length = part * self.size[0].min(self.size[1]);
            if open { 1.0 / (length * length) } else { 0.0 }
        });
        let columns = self.space.spans()[0];
        let stiff = |a: usize, b: usize| stiff.map_or(0.0, |s| s[b * columns + a]);
        let gaps = Gaps::new(
            self.samples,
            weights,
            self.size,
            (self.cells.len(), self.extends),
        );
        let length = EXTENSION_LENGTH * self.size[0].min(self.size[1]);
        let extension = EXTENSION_STIFFNESS * lambda * length * length;
        let straight = GAP_BENDING_LENGTH.powi(4) * self.area_per_point().powi(2);
        let (mut matrix, right) = equations.assemble(&plane, |[a, b], weight, block| {
            let loose = (1.0 - weight / HELD_CELL_POINTS).max(0.0);
            let empty = math::powf(EMPTY_STIFFNESS, loose);
            // Where the surface extends, the third derivatives hold it in place of the stiffness of empty cells.
            let stiffness = match self.extends {
                true => lambda,
                false if self.beside(a, b, |n| n == 0) => lambda * EDGE_STIFFNESS * empty,
                false => lambda * empty,
            };
            let calm = calm[usize::from(!self.beside(a, b, |n| n > 0))];
            self.energies.add_cell(
                a,
                b,
                stiffness + straight * (gaps.share(self.space, a, b) + stiff(a, b)),
                calm * stiffness * loose * loose,
                block,
            );
            if self.extends {
                let shares = gaps.extension(self.space, a, b);
                let jerk = shares.map(|share| extension * share);
                self.energies.add_jerk(a, b, jerk, block);
            }
        })?;
        let n = matrix.order();
        // Points on a line leave the tilt of the surface open: a small pull towards the plane decides it, increased
        // where necessary.
        let mean = (0..n).map(|i| matrix.entry(i, i)).sum::<f64>() / n as f64;
        let mut pull = 0.0;
        loop {
            match solve_refined(&matrix, &right) {
                Ok((x, equation_residual)) if x.iter().all(|p| p.is_finite()) => {
                    let fit = Fit {
                        space: self.space.clone(),
                        net: equations.net(&plane, &x),
                    };
                    return Ok(Solved {
                        fit,
                        equation_residual,
                    });
                }
                Err(error) if pull >= MAX_PULL => return Err(error),
                _ if pull >= MAX_PULL => {
                    return Err(nurbskin_geometry::Error::NoSolution(
                        "the points do not determine a surface: give more of them, or fewer control points".into(),
                    ));
                }
                _ => {
                    let more = if pull > 0.0 {
                        PULL_GROWTH * pull
                    } else {
                        FIRST_PULL
                    };
                    for i in 0..n {
                        matrix.add(i, i, more * mean);
                    }
                    pull += more;
                }
            }
        }
    }

    /// Whether the number of points of the cell, or of one around it, satisfies `asked`.
    fn beside(&self, a: usize, b: usize, asked: impl Fn(usize) -> bool) -> bool {
        let [columns, rows] = self.space.spans();
        let around = |k: usize, n: usize| k.saturating_sub(1)..=(k + 1).min(n - 1);
        around(b, rows)
            .any(|b| around(a, columns).any(|a| asked(self.cells.samples(b * columns + a).len())))
    }

    /// Mean thin-plate energy at the points of the quieter cells: oscillations at a ragged edge must not reduce the
    /// fairness of the rest.
    pub(crate) fn energy(&self, fit: &Fit) -> f64 {
        let [columns, _] = self.space.spans();
        let [p, q] = self.space.degree();
        let [pairs_u, pairs_v] = self.pairs();
        let mut block = vec![0.0; pairs_u * pairs_v];
        let mut local = vec![DVec3::ZERO; (p + 1) * (q + 1)];
        let mut cells: Vec<(f64, f64)> = Vec::with_capacity(self.cells.len());
        for cell in 0..self.cells.len() {
            let count = self.cells.samples(cell).len() as f64;
            if count < HELD_CELL_POINTS {
                continue;
            }
            let (a, b) = (cell % columns, cell / columns);
            for (k, c) in local.iter_mut().enumerate() {
                let (i, j) = (k % (p + 1), k / (p + 1));
                *c = fit.net[(b + j) * self.space.stride() + a + i];
            }
            block.fill(0.0);
            self.energies.add_cell(a, b, 1.0, 0.0, &mut block);
            let [bu, bv] = &self.space.breaks;
            let area = (bu[a + 1] - bu[a]) * (bv[b + 1] - bv[b]);
            cells.push((quadratic_form(&block, &local, p, q) / area, count));
        }
        cells.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut left = QUIET_SHARE * cells.iter().map(|c| c.1).sum::<f64>();
        let (mut sum, mut points) = (0.0, 0.0);
        for (energy, count) in cells {
            let part = count.min(left);
            sum += part * energy;
            points += part;
            left -= part;
        }
        if points > 0.0 {
            (sum / points).max(0.0)
        } else {
            0.0
        }
    }
}
