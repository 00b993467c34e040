//! The approximation problem: its data, a fit on given knots, and measures of that fit.
//!
//! ```text
//! fit:    minimise Σ w |X - S|² / Σ w + λ E(S),   λ = (0.02 r)² / E(previous fit)
//! reach r: T / 2 for exact points;  3 σ √(N / M), at least the bias, at most T, with noise
//! judge:  robust weights from residuals about local medians (`robust`)
//! ```
//!
//! The energy of the previous fit makes λ free of scale; it may fall by at most a factor of ten per fit.
//!
//! Source: thin-plate smoothing; the choice of λ is ours.

use super::adapt::{Criterion, Marks, Measure, OUTLIER_WEIGHT, fewest_breaks, first_breaks};
use super::least_error::Candidate;
use super::span_residuals::SpanResiduals;
use super::strategy::Solution;
use super::visits::{Gauge, Visits};
use crate::chart::Topology;
use crate::fit::approximate::{
    ApproximateOptions, Crossing, Facing, Goal, Round, Shortfall, Status,
};
use crate::fit::least_squares::fairness::noise_reach;
use crate::fit::least_squares::normal_equations::Assembly;
use crate::fit::least_squares::robust::{Judgement, Neighbourhoods};
use crate::fit::least_squares::samples::{Residual, SUPPORT_WEIGHT, Samples, residuals};
use crate::fit::least_squares::spline_space::{Fit, SplineSpace};
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{DVec3, Error, Result};

/// Factor by which the energy that sets the fairness may fall from fit to fit. Dimensionless.
/// Guard: the energy of an ill-conditioned fit can round to nothing, and the fairness that follows from it would
/// flatten the surface.
const MAX_ENERGY_FALL: f64 = 10.0;
/// Least scale of the judgement of exact points and vertices, in spacings.
/// Trial: not recorded. A point must be off eight times as far to lose all of its weight: what lies off by less than
/// the spacing may be a feature that the points between do not show.
const FEATURE_SPACINGS: f64 = 0.1;
/// Factor by which a round may raise the root mean square distance of the points that count before and after it.
/// Dimensionless.
/// Guard: more knots lower it unless the equations lose their digits.
const MAX_SETBACK: f64 = 2.0;
/// Largest relative residual of the normal equations with which a round counts. Dimensionless.
/// Guard: good fits have some 1e-15.
const MAX_EQUATION_RESIDUAL: f64 = 1e-10;
/// Length of which fairness may cost its share for exact points, in tolerances.
/// Trial: not recorded.
const EXACT_REACH: f64 = 0.5;
/// Quantile of the absolute residuals that bounds the scale of the judgement of exact points and vertices from below.
/// Share of the points.
/// Trial: not recorded. While the surface misses a tenth of the points, none of the others becomes an outlier.
const JUDGED_QUANTILE: f64 = 0.9;
/// The same bound in tolerances.
/// Trial: not recorded. With it a point loses all weight at four tolerances.
const JUDGED_TOLERANCES: f64 = 0.5;
/// Least share of the points that the unknowns are taken to leave free where sigma is corrected for them.
/// Guard: keeps the quotient finite.
const MIN_FREE_POINTS: f64 = 0.1;

/// Prior knowledge about the noise.
#[derive(Clone, Copy, Debug)]
pub(super) enum Known {
    Given(f64),
    /// From the quietest neighbourhoods, hence a lower bound.
    Estimated(f64),
}

/// The problem of one approximation: nothing in it changes while it is solved. Steps that need another budget, other
/// samples or stiffer cells make a copy with that field replaced.
#[derive(Clone, Copy)]
pub(super) struct Problem<'a> {
    pub(super) samples: &'a Samples,
    pub(super) neighbourhoods: &'a Neighbourhoods,
    pub(super) topology: Topology,
    pub(super) degree: [usize; 2],
    pub(super) size: [f64; 2],
    pub(super) tolerance: f64,
    pub(super) noise: Known,
    pub(super) criterion: Criterion,
    /// The goal of the caller, if any.
    pub(super) goal: Option<Goal>,
    /// Number of the caller's points, from the first on, that count for the goal.
    pub(super) own: usize,
    /// Further points that count for the goal, in the coordinates of the caller.
    pub(super) unseen: &'a [DVec3],
    /// Whether the points are vertices of a mesh.
    pub(super) vertices: bool,
    pub(super) budget: usize,
    /// Exponent of the number of control points in the cost by which surfaces are compared; 0 where they need not pay.
    pub(super) price: f64,
    pub(super) fairness: f64,
    /// Samples that are excluded from the fits and validate them.
    pub(super) held_out: Option<&'a [bool]>,
    /// Whether the surface continues smoothly where the domain has no points.
    pub(super) extends: bool,
    /// Finds self-intersections of a surface.
    pub(super) crossing: Option<Crossing<'a>>,
    /// Intended directions of the normal.
    pub(super) facing: &'a [Facing],
    /// Whether a surface that misses the goal is of no use.
    pub(super) only_met: bool,
    /// Additional stiffness of each cell where a fit folded; 1 as for a gap between points.
    pub(super) stiff: Option<&'a [f64]>,
    /// Share of the points that must keep a tolerance.
    pub(super) share: f64,
    /// Record of the visited surfaces.
    pub(super) visits: &'a Visits,
    /// Points that measure the visited surfaces; `None`: the samples.
    pub(super) gauge: Option<&'a Gauge>,
    pub(super) progress: &'a dyn Progress,
}

/// What sets the fairness of the next fit: the energy of the last one, and its root mean square error beyond the noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct Calm {
    energy: f64,
    bias: f64,
}

impl Calm {
    /// Before the first fit.
    const UNKNOWN: Self = Self {
        energy: f64::INFINITY,
        bias: 0.0,
    };
}

/// A fit with its residuals and their judgement.
#[derive(Clone)]
pub(super) struct State {
    pub(super) fit: Fit,
    pub(super) equation_residual: f64,
    pub(super) calm: Calm,
    pub(super) residuals: Vec<Residual>,
    pub(super) judgement: Judgement,
}

impl Problem<'_> {
    /// A fit with the weights and the energy of an earlier one.
    pub(super) fn fit(
        &self,
        breaks: &[Vec<f64>; 2],
        weights: &[f64],
        calm: Calm,
    ) -> Result<(Fit, f64, Calm, Vec<Residual>)> {
        self.progress.check()?;
        let space = SplineSpace::new(self.degree, breaks.clone(), self.topology)?;
        let assembly = Assembly::new(&space, self.samples, self.size, self.extends);
        let energy = calm.energy;
        // A plane has no energy; the bound keeps lambda below values that ruin the condition.
        let bounded = energy.max(self.tolerance * self.tolerance);
        let reach = match (self.criterion, self.noise) {
            (Criterion::Bias, Known::Given(sigma) | Known::Estimated(sigma)) => {
                // A surface limited by bias loses nothing by being calm where there are no points.
                let least = noise_reach(sigma, space.unknowns(), self.samples.measured());
                least.max(calm.bias).min(self.tolerance)
            }
            // Exact points leave nothing to smooth.
            (Criterion::Maximum, _) => EXACT_REACH * self.tolerance,
        };
        let lambda = if energy.is_finite() {
            (self.fairness * reach).powi(2) / bounded
        } else {
            assembly.first_lambda()
        };
        let solved = match (self.held_out, self.samples.measured() < self.samples.len()) {
            (None, false) => assembly.solve(weights, lambda, self.stiff)?,
            (held_out, _) => {
                let weight = |k: usize| match held_out {
                    _ if self.samples.is_support(k) => SUPPORT_WEIGHT,
                    Some(held_out) if held_out[k] => 0.0,
                    _ => weights[k],
                };
                let seen: Vec<f64> = (0..weights.len()).map(weight).collect();
                assembly.solve(&seen, lambda, self.stiff)?
            }
        };
        let floor = if energy.is_finite() {
            energy / MAX_ENERGY_FALL
        } else {
            0.0
        };
        let energy = assembly.energy(&solved.fit).max(floor);
        self.progress.check()?;
        let residuals = residuals(&solved.fit, self.samples);
        let bias = self.bias(&residuals, weights);
        let calm = Calm { energy, bias };
        Ok((solved.fit, solved.equation_residual, calm, residuals))
    }

    /// Root mean square of the residuals beyond the noise; 0 where the noise is not given.
    fn bias(&self, residuals: &[Residual], weights: &[f64]) -> f64 {
        let Known::Given(sigma) = self.noise else {
            return 0.0;
        };
        let (mut squares, mut total) = (0.0, 0.0);
        for (r, w) in residuals.iter().zip(weights) {
            squares += w * r.signed * r.signed;
            total += w;
        }
        (squares / total.max(1.0) - sigma * sigma).max(0.0).sqrt()
    }

    /// Fits, judges the points, and fits `times` more times with the new weights.
    pub(super) fn settle(
        &self,
        breaks: &[Vec<f64>; 2],
        before: Option<&State>,
        times: usize,
    ) -> Result<State> {
        let first = self.neighbourhoods.first_weights();
        let (weights, calm) = match before {
            Some(state) => (&state.judgement.weights, state.calm),
            None => (&first, Calm::UNKNOWN),
        };
        let (mut fit, mut equation_residual, mut calm, mut residuals) =
            self.fit(breaks, weights, calm)?;
        let mut judgement = self.judge(&residuals);
        for _ in 0..times {
            (fit, equation_residual, calm, residuals) =
                self.fit(breaks, &judgement.weights, calm)?;
            let next = self.judge(&residuals);
            if times > 1 {
                judgement = next;
            } else {
                judgement.sigma = next.sigma;
            }
        }
        Ok(State {
            fit,
            equation_residual,
            calm,
            residuals,
            judgement,
        })
    }

    /// One fit with the weights of the previous state, and the judgement of the points by it.
    pub(super) fn advance(&self, breaks: &[Vec<f64>; 2], before: &State) -> Result<State> {
        let weights = &before.judgement.weights;
        let (fit, equation_residual, calm, residuals) = self.fit(breaks, weights, before.calm)?;
        let judgement = self.judge(&residuals);
        Ok(State {
            fit,
            equation_residual,
            calm,
            residuals,
            judgement,
        })
    }

    /// The judgement of the points by their residuals.
    pub(super) fn judge(&self, residuals: &[Residual]) -> Judgement {
        // Exact points, and vertices of a mesh, lie within a few tolerances of their neighbours, or are wrong; where
        // the surface is not that good, within a few times the residual of most points. A point that is off by less
        // than the spacing counts: a feature of that size would not show in the points between.
        let floor = if self.criterion == Criterion::Maximum || self.vertices {
            let measured = (0..residuals.len()).filter(|&k| !self.samples.is_support(k));
            let mut off: Vec<f64> = measured.map(|k| residuals[k].signed.abs()).collect();
            let area = self.size[0] * self.size[1];
            let spacing = (area / self.samples.measured().max(1) as f64).sqrt();
            quantile_in_place(&mut off, JUDGED_QUANTILE)
                .max(JUDGED_TOLERANCES * self.tolerance)
                .max(FEATURE_SPACINGS * spacing)
        } else {
            0.0
        };
        self.neighbourhoods.judge(self.samples, residuals, floor)
    }

    /// Whether `after` is not clearly worse than `before`: more knots lower the sum of squares unless the equations
    /// lose their digits.
    pub(super) fn holds(&self, before: &State, after: &State) -> bool {
        let (mut squares, mut total) = ([0.0; 2], 0.0);
        for k in 0..self.samples.len() {
            let w = before.judgement.weights[k].min(after.judgement.weights[k]);
            squares[0] += w * before.residuals[k].signed.powi(2);
            squares[1] += w * after.residuals[k].signed.powi(2);
            total += w;
        }
        let [was, is] = squares.map(|s| (s / total.max(1.0)).sqrt());
        is <= (MAX_SETBACK * was).max(self.tolerance)
            && after.equation_residual <= MAX_EQUATION_RESIDUAL
    }

    pub(super) fn measure(&self, state: &State) -> Measure {
        Measure {
            criterion: self.criterion,
            tolerance: self.tolerance,
            sigma: match self.noise {
                Known::Given(sigma) => sigma,
                // A surface with almost as many control points as points has residuals smaller than their noise.
                Known::Estimated(least) => {
                    let (points, unknowns) = (
                        self.samples.measured() as f64,
                        state.fit.space.unknowns() as f64,
                    );
                    let freedom = points / (points - unknowns).max(MIN_FREE_POINTS * points);
                    least.max(state.judgement.sigma * freedom.sqrt())
                }
            },
        }
    }

    pub(super) fn strips(&self, state: &State) -> [Vec<SpanResiduals>; 2] {
        let weights = &state.judgement.weights;
        let space = &state.fit.space;
        SpanResiduals::levels(
            space,
            self.samples,
            &state.residuals,
            weights,
            self.criterion,
        )
    }

    pub(super) fn marks(&self, state: &State) -> [Marks; 2] {
        let measure = self.measure(state);
        self.strips(state).map(|s| measure.marks(&s))
    }

    /// The summary of a round for the history. The round is also recorded for the trade curve.
    pub(super) fn round(&self, state: &State, marks: &[Marks; 2]) -> Round {
        self.visit(state, None);
        let weights = &state.judgement.weights;
        let inliers = || {
            state
                .residuals
                .iter()
                .zip(weights)
                .filter(|&(_, &w)| w > OUTLIER_WEIGHT)
        };
        let total: f64 = weights.iter().sum();
        let squares: f64 = inliers().map(|(r, w)| w * r.signed * r.signed).sum();
        Round {
            control_points: state.fit.space.counts(),
            rms: (squares / total.max(1.0)).sqrt(),
            maximum: inliers().fold(0.0, |m, (r, _)| m.max(r.distance)),
            sigma: state.judgement.sigma,
            worst: marks[0].worst.max(marks[1].worst),
        }
    }

    /// The initial breakpoints.
    pub(super) fn start(&self, options: &ApproximateOptions) -> Result<[Vec<f64>; 2]> {
        let closed = self.topology.closed();
        let even = |n: usize| (0..=n).map(|i| i as f64 / n as f64).collect::<Vec<_>>();
        let fewest = |d: usize| fewest_breaks(self.degree[d], closed[d]) - 1;
        let size = |spans: [usize; 2]| -> usize {
            let n = [0, 1].map(|d| {
                if closed[d] {
                    spans[d]
                } else {
                    spans[d].saturating_add(self.degree[d])
                }
            });
            n[0].saturating_mul(n[1])
        };
        let least = [fewest(0), fewest(1)];
        let usual = [0, 1].map(|d| first_breaks(self.degree[d], closed[d]).len() - 1);
        let spans = match options.spans {
            Some(spans) => [spans[0].max(least[0]), spans[1].max(least[1])],
            None if size(usual) <= self.budget => usual,
            None => least,
        };
        if size(spans) > self.budget {
            return Err(Error::invalid(format!(
                "{} control points are not enough: these degrees and spans need {}",
                self.budget,
                size(spans)
            )));
        }
        Ok(spans.map(even))
    }

    /// One fit without refinement.
    pub(super) fn fit_once(&self, breaks: &[Vec<f64>; 2]) -> Result<Solution> {
        let mut state = self.settle(breaks, None, 1)?;
        // The first fit, by which the outliers were found, is bent by them.
        if state.judgement.weights.contains(&0.0) {
            state = self.settle(breaks, Some(&state), 0)?;
        }
        Ok(self.unrefined(breaks.clone(), state))
    }

    /// A fit on given spans.
    pub(super) fn unrefined(&self, breaks: [Vec<f64>; 2], state: State) -> Solution {
        let round = self.round(&state, &self.marks(&state));
        let status = if round.worst <= 1.0 {
            Status::Met
        } else {
            Status::NotMet(Shortfall::GivenSpans)
        };
        Solution {
            candidate: Candidate {
                breaks,
                samples: None,
                state,
                raised: None,
                history: vec![round],
            },
            status,
        }
    }
}
