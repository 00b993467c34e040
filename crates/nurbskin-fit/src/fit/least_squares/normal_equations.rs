//! The normal equations of penalised least squares for scans: what is stiff where points are few.
//!
//! Minimises `sum w_k |X_k - S(u_k, v_k)|^2 / sum w_k + lambda E(S)`. In a cell of the knots the same (p + 1)(q + 1)
//! basis functions live; what the points say of them comes from [`moments`](super::moments), and [`system`](super::system)
//! puts the equations together.

use super::cell_moments::Moments;
use super::chebyshev::Pieces;
use super::empty_cells::Gaps;
use super::fairness::{Energies, quadratic_form};
use super::samples::{Cells, Samples};
use super::spline_space::{Fit, SplineSpace};
use super::system::Equations;
use nurbskin_geometry::numeric::cholesky::solve_refined;
use nurbskin_geometry::{DVec3, Result};

/// Largest pull towards the plane, relative to the mean diagonal, before a system is given up.
const LARGEST_PULL: f64 = 1e-6;

/// How much stiffer the surface is in a cell without points.
const EMPTY_STIFFNESS: f64 = 30.0;
/// How much stiffer it is beside such cells: few points and steep walls at a ragged edge say little of its slope there.
const EDGE_STIFFNESS: f64 = 3.0;
/// Lengths, as parts of the shorter side of the domain, over which the slope of the surface dies away: in cells without
/// points beside such with points, so that small holes are bridged as a thin plate would, and in cells further away.
const CALM_LENGTHS: [f64; 2] = [0.05, 0.01];
/// Length, in mean distances of points, below which the surface bends no more where there are none beside some: it
/// goes on straight there, however little of its slope fairness alone would leave.
const STRAIGHT: f64 = 1.2;
/// Weight of the third derivatives where a surface continues beyond its points, relative to the weight that fairness gives to
/// the second ones. Fairness may cost a hundredth of the aim; 400 = 20^2 allows the extension a fifth of it.
const EXTENSION_STIFFNESS: f64 = 400.0;
/// Length that makes the two comparable, as a part of the shorter side: 1 / (2 pi) for waves as long as that side.
const EXTENSION_LENGTH: f64 = 1.0 / 6.0;
/// Length, in mean distances of points, over which the first fit does not follow a single point.
const FIRST_LENGTH: f64 = 4.0;
/// Part of the points, in the cells of least energy, whose mean energy sets the fairness.
const QUIET_PART: f64 = 0.7;
/// A cell with so many points is held by them.
const HELD: f64 = 4.0;

/// Everything of a fit that does not change with weights and fairness.
#[derive(Debug)]
pub(crate) struct Assembly<'a> {
    pub(super) space: &'a SplineSpace,
    pub(super) samples: &'a Samples,
    pub(super) cells: Cells,
    pieces: [Pieces; 2],
    energies: Energies,
    size: [f64; 2],
    /// Whether the surface goes on smoothly beyond the points, to where the domain ends.
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

    /// The lambda of a fit of which nothing is known yet: no single point may bend the surface, for it may be an outlier
    /// where there are no others. To bend over a length l costs `lambda / l^2` per square of the height, a point pays
    /// its share of the area, `d^2` for points d apart: so lambda = `l^2 d^2`, l = 4 d. Features of many distances are
    /// hardly damped, and what is damped the next fit finds.
    pub(crate) fn first_lambda(&self) -> f64 {
        FIRST_LENGTH * FIRST_LENGTH * self.area_per_point().powi(2)
    }

    fn area_per_point(&self) -> f64 {
        self.size[0] * self.size[1] / self.samples.len() as f64
    }

    /// Solves for the surface with these weights and lambda >= 0; cells are stiffer by `stiff`, 1 for one in a gap between
    /// points.
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
        let calm = CALM_LENGTHS.map(|part| {
            let length = part * self.size[0].min(self.size[1]);
            if open { 1.0 / (length * length) } else { 0.0 }
        });
        let columns = self.space.spans()[0];
        let stiff = |a: usize, b: usize| stiff.map_or(0.0, |s| s[b * columns + a]);
        let gaps = Gaps::new(self.samples, weights, self.size, self.cells.len());
        let length = EXTENSION_LENGTH * self.size[0].min(self.size[1]);
        let extension = EXTENSION_STIFFNESS * lambda * length * length;
        let straight = STRAIGHT.powi(4) * self.area_per_point().powi(2);
        let (mut matrix, right) = equations.assemble(&plane, |[a, b], weight, block| {
            let loose = (1.0 - weight / HELD).max(0.0);
            let edge = if self.beside(a, b, |n| n == 0) {
                EDGE_STIFFNESS
            } else {
                1.0
            };
            let stiffness = lambda * edge * EMPTY_STIFFNESS.powf(loose);
            let calm = calm[usize::from(!self.beside(a, b, |n| n > 0))];
            self.energies.add_cell(
                a,
                b,
                stiffness + straight * (gaps.share(self.space, a, b) + stiff(a, b)),
                calm * stiffness * loose * loose,
                block,
            );
            if self.extends {
                let bare = gaps.bare(self.space, a, b);
                self.energies.add_jerk(a, b, extension * bare, block);
            }
        })?;
        let n = matrix.order();
        // Points on a line leave the tilt of the surface open: the faintest pull decides it, stronger where it must.
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
                Err(error) if pull >= LARGEST_PULL => return Err(error),
                _ if pull >= LARGEST_PULL => {
                    return Err(nurbskin_geometry::Error::NoSolution(
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

    /// Whether the number of points of the cell, or of one around it, is as asked.
    fn beside(&self, a: usize, b: usize, asked: impl Fn(usize) -> bool) -> bool {
        let [columns, rows] = self.space.spans();
        let around = |k: usize, n: usize| k.saturating_sub(1)..=(k + 1).min(n - 1);
        around(b, rows)
            .any(|b| around(a, columns).any(|a| asked(self.cells.samples(b * columns + a).len())))
    }

    /// Mean thin-plate energy at the points of the quieter cells: what swings at a ragged edge must not loosen the rest.
    pub(crate) fn energy(&self, fit: &Fit) -> f64 {
        let [columns, _] = self.space.spans();
        let [p, q] = self.space.degree();
        let [pairs_u, pairs_v] = self.pairs();
        let mut block = vec![0.0; pairs_u * pairs_v];
        let mut local = vec![DVec3::ZERO; (p + 1) * (q + 1)];
        let mut cells: Vec<(f64, f64)> = Vec::with_capacity(self.cells.len());
        for cell in 0..self.cells.len() {
            let count = self.cells.samples(cell).len() as f64;
            if count < HELD {
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
        let mut left = QUIET_PART * cells.iter().map(|c| c.1).sum::<f64>();
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
