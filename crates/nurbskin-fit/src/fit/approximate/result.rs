//! The result of an approximation in the unit and order of the caller.
//!
//! ```text
//! σ = 1.4826 median |d| · √(M / (M - unknowns))
//! ```
//!
//! Each unknown takes the spread of one residual away, which the factor restores. Ours.

use super::problem::{Problem, State};
use super::trade::Met;
use crate::fit::approximate::{Approximation, Round, Status};
use crate::fit::least_squares::samples::Unsorted;
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::statistics::robust_sigma;

/// Points, at most, from whose residuals the reported noise is computed. Count.
/// Derived: they hold the scale to 0.2 %.
const SIGMA_POINTS: usize = 400_000;
/// Least share of the points that the unknowns are taken to leave free in the reported noise.
/// Guard: bounds its correction to a factor of the root of 2.
const MIN_FREE_POINTS_REPORTED: f64 = 0.5;

impl Problem<'_> {
    /// The result in the caller's unit and order.
    pub(super) fn finish(
        &self,
        state: State,
        mut history: Vec<Round>,
        status: Status,
        scale: f64,
    ) -> Result<Approximation> {
        for round in &mut history {
            round.rms *= scale;
            round.maximum *= scale;
            round.sigma *= scale;
        }
        let (residuals, weights) = (&state.residuals, &state.judgement.weights);
        let counts = |k: &usize| weights[*k] > 0.0 && !self.samples.is_support(*k);
        let points = (0..weights.len()).filter(counts).count() as f64;
        // An even subset of [`SIGMA_POINTS`] suffices.
        let step = residuals.len().div_ceil(SIGMA_POINTS).max(1);
        let inside: Vec<f64> = (0..residuals.len())
            .step_by(step)
            .filter(counts)
            .map(|k| residuals[k].signed)
            .collect();
        // Each unknown removes the spread of one residual.
        let unknowns = state.fit.space.unknowns() as f64;
        let freedom = points
            / (points - unknowns)
                .max(MIN_FREE_POINTS_REPORTED * points)
                .max(1.0);
        let sigma = scale * robust_sigma(&inside, 0.0) * freedom.sqrt();
        let mut ranks = self.samples.ranks();
        ranks.truncate(self.samples.measured());
        let in_order = Unsorted(&ranks);
        Ok(Approximation {
            surface: state.fit.surface(|p| self.samples.restore(p))?,
            parameters: in_order.map(|k| self.samples.parameters[k]),
            feet: in_order.map(|k| residuals[k].foot),
            residuals: in_order.map(|k| scale * residuals[k].signed),
            weights: in_order.map(|k| weights[k]),
            sigma: if sigma.is_finite() { sigma } else { 0.0 },
            criterion: self.criterion,
            equation_residual: state.equation_residual,
            history,
            met: Met::default(),
            status,
        })
    }
}
