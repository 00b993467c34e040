//! An approximation in the caller's unit and order.

use super::problem::{Problem, State};
use super::trade::Met;
use crate::fit::approximate::{Approximation, Round, Status};
use crate::fit::least_squares::samples::Unsorted;
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::statistics::robust_sigma;

/// Points from whose residuals the noise is reported.
const SCALE_POINTS: usize = 400_000;

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
        // So many evenly chosen points hold the scale to 0.2 %.
        let step = residuals.len().div_ceil(SCALE_POINTS).max(1);
        let inside: Vec<f64> = (0..residuals.len())
            .step_by(step)
            .filter(counts)
            .map(|k| residuals[k].signed)
            .collect();
        // Each unknown takes one residual's worth of the spread away.
        let unknowns = state.fit.space.unknowns() as f64;
        let freedom = points / (points - unknowns).max(0.5 * points).max(1.0);
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
