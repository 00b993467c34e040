//! An approximation in the caller's unit and order.

use super::approximate::{Approximation, Round, Status};
use super::engine::{Engine, State};
use crate::numeric::statistics::robust_sigma;
use crate::{DVec2, Result};

impl Engine<'_> {
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
        let inside: Vec<f64> = state
            .residuals
            .iter()
            .zip(&state.judgement.weights)
            .filter(|&(_, &w)| w > 0.0)
            .map(|(r, _)| r.signed)
            .collect();
        // Each unknown takes one residual's worth of the spread away.
        let (points, unknowns) = (inside.len() as f64, state.fit.space.unknowns() as f64);
        let freedom = points / (points - unknowns).max(0.5 * points).max(1.0);
        let sigma = scale * robust_sigma(&inside, 0.0) * freedom.sqrt();
        let n = self.samples.len();
        let mut out = Approximation {
            surface: state.fit.surface(|p| self.samples.restore(p))?,
            parameters: vec![DVec2::ZERO; n],
            feet: vec![DVec2::ZERO; n],
            residuals: vec![0.0; n],
            weights: vec![0.0; n],
            sigma: if sigma.is_finite() { sigma } else { 0.0 },
            criterion: self.criterion,
            equation_residual: state.equation_residual,
            history,
            status,
        };
        for (k, &original) in self.samples.original.iter().enumerate() {
            let original = original as usize;
            out.parameters[original] = self.samples.parameters[k];
            out.feet[original] = state.residuals[k].foot;
            out.residuals[original] = scale * state.residuals[k].signed;
            out.weights[original] = state.judgement.weights[k];
        }
        Ok(out)
    }
}
