//! The least overall error within a budget that does not suffice for the tolerance.
//!
//! Here the worst spot does not count, which more knots may never mend, but the fall of the sum of squares per control
//! point:
//!
//! ```text
//! gain(span) = Σ_cells (n mean² - σ²)₊ / control points across
//! ```
//!
//! A cut span adds one row of control points. Its gain is estimated from the residuals of the present surface, so that
//! no cut has to be tried; the net grows by a factor of 1.6 per round. Ours.

use super::adapt::cut_spans;
use super::problem::{Problem, State};
use super::reparametrisation::Corrected;
use super::span_residuals::SpanResiduals;
use super::visits::Way;
use crate::fit::approximate::Round;
use crate::fit::least_squares::samples::Samples;
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::unit::grouped;

/// Factor by which the number of control points grows from round to round. Dimensionless.
/// Trial: not recorded. A larger factor cuts spans before the fit of the round shows that they need it; a smaller one
/// takes more rounds, each with a fit.
pub(super) const NET_GROWTH: f64 = 1.6;
/// Share of the best gain per control point of a round that a span must have to be cut in that round; others wait for
/// the next fit. Dimensionless.
/// Trial: not recorded.
const MIN_GAIN_SHARE: f64 = 0.1;
/// Multiple of the 90 % quantile at which mean residuals of sub-cells are capped, so that a single bad spot does not
/// draw all knots. Dimensionless.
/// Trial: not recorded.
const MEAN_CAP: f64 = 2.0;
/// Quantile of the absolute mean residuals of the sub-cells that [`MEAN_CAP`] multiplies. Share of the sub-cells.
/// Trial: not recorded. Bad spots of up to a tenth of the sub-cells do not raise it.
const MEAN_CAP_QUANTILE: f64 = 0.9;

/// Ratio of the cost of a larger net to the best one so far up to which the larger net is preferred. Dimensionless.
/// Guard: a difference of half a per cent is chance (1 % is the standard deviation of the 95 % quantile of ten thousand
/// normal errors).
const MAX_WORSENING: f64 = 1.005;

/// Corrections of the parameters on the final knots; there is one on all others. Count.
/// Trial: not recorded. Corrections end earlier where one brings less than 1 %.
const FINAL_CORRECTIONS: usize = 5;

/// A surface within the budget.
#[derive(Clone)]
pub(super) struct Candidate {
    pub(super) breaks: [Vec<f64>; 2],
    /// The samples with corrected parameters; `None` if nothing was corrected.
    pub(super) samples: Option<Samples>,
    pub(super) state: State,
    /// The weights of the fit where they differ from those of its judgement.
    pub(super) raised: Option<Vec<f64>>,
    pub(super) history: Vec<Round>,
}

impl Problem<'_> {
    /// Refines from `breaks` until the criterion is met, the budget is used, or nothing more can be gained. With
    /// `correct`, the parameters are corrected after each round. Where a larger net is no closer to the points, the
    /// best net before it is returned.
    pub(super) fn spend(&self, mut breaks: [Vec<f64>; 2], correct: bool) -> Result<Candidate> {
        let mut samples: Option<Samples> = None;
        let mut best: Option<(f64, Candidate)> = None;
        let mut history = Vec::new();
        let mut state = self.settle(&breaks, None, 1)?;
        let mut last = false;
        self.visits.begin();
        loop {
            let corrections = match (correct, last) {
                (false, _) => 0,
                (true, false) => 1,
                (true, true) => FINAL_CORRECTIONS,
            };
            for _ in 0..corrections {
                let problem = self.with(samples.as_ref());
                let Some(Corrected {
                    samples: moved,
                    state: next,
                }) = problem.correct(&state)?
                else {
                    break;
                };
                (samples, state) = (Some(moved), next);
            }
            let problem = self.with(samples.as_ref());
            problem.step(&state, None, Way::Budget);
            let round = problem.round(&state, &problem.marks(&state));
            let met = round.worst <= 1.0;
            history.push(round);
            self.progress.advance(1);
            self.progress.tell(&format!(
                "{} of at most {} control points",
                grouped(state.fit.space.size()),
                grouped(self.budget)
            ));
            let now = Candidate {
                breaks: breaks.clone(),
                samples: samples.clone(),
                state: state.clone(),
                raised: None,
                history: history.clone(),
            };
            let level = problem.cost(&state);
            if best.as_ref().is_none_or(|b| level <= b.0 * MAX_WORSENING) {
                best = Some((level.min(best.map_or(level, |b| b.0)), now));
            }
            let trial = if met || last {
                None
            } else {
                problem.best_spans(&state, &breaks, 0.0)
            };
            let Some(trial) = trial else {
                if last || !correct || met {
                    break;
                }
                last = true;
                continue;
            };
            let next = problem.advance(&trial, &state)?;
            if !problem.holds(&state, &next) {
                break;
            }
            (breaks, state) = (trial, next);
        }
        Ok(match best {
            Some((_, best)) => best,
            None => Candidate {
                breaks,
                samples,
                state,
                raised: None,
                history,
            },
        })
    }

    /// The problem with these samples, if there are any, in place of its own.
    pub(super) fn with<'b>(&'b self, samples: Option<&'b Samples>) -> Problem<'b> {
        Problem {
            samples: samples.unwrap_or(self.samples),
            ..*self
        }
    }

    /// The breakpoints after halving the spans of both directions that gain most per control point, and more than
    /// `floor`.
    pub(super) fn best_spans(
        &self,
        state: &State,
        breaks: &[Vec<f64>; 2],
        floor: f64,
    ) -> Option<[Vec<f64>; 2]> {
        let measure = self.measure(state);
        let weights = &state.judgement.weights;
        let space = &state.fit.space;
        let strips = SpanResiduals::coarse(space, self.samples, &state.residuals, weights);
        let mut means: Vec<f64> = strips.iter().flat_map(SpanResiduals::means).collect();
        let cap = MEAN_CAP * quantile_in_place(&mut means, MEAN_CAP_QUANTILE);
        let counts = state.fit.space.counts();
        let mut spans: Vec<(f64, usize, usize)> = Vec::new();
        for d in 0..2 {
            let energies = measure.energies(&strips[d], cap);
            let gains = energies.into_iter().enumerate();
            spans.extend(
                gains
                    .filter(|g| g.1 > 0.0)
                    .map(|(a, e)| (e / counts[1 - d] as f64, d, a)),
            );
        }
        spans.sort_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2).cmp(&(y.1, y.2))));
        let least = (MIN_GAIN_SHARE * spans.first()?.0).max(floor);
        spans.retain(|span| span.0 >= least);
        let enough = NET_GROWTH * (counts[0] * counts[1]) as f64;
        cut_in_order(breaks, counts, &spans, enough, self.budget)
    }
}

/// The breakpoints after halving spans in the given order, each a gain, a direction and a number, while the control
/// points stay below `enough`; the first one may go up to `most`. `None` if none may be cut.
pub(super) fn cut_in_order(
    breaks: &[Vec<f64>; 2],
    mut counts: [usize; 2],
    spans: &[(f64, usize, usize)],
    enough: f64,
    most: usize,
) -> Option<[Vec<f64>; 2]> {
    let mut chosen = [Vec::new(), Vec::new()];
    for &(_, d, a) in spans {
        let more = (counts[d] + 1) * counts[1 - d];
        let first = chosen[0].is_empty() && chosen[1].is_empty();
        if more > most || more as f64 > enough && !first {
            continue;
        }
        counts[d] += 1;
        chosen[d].push(a);
    }
    let cut = [0, 1].map(|d| cut_spans(&breaks[d], &chosen[d]));
    (cut[0].len() > breaks[0].len() || cut[1].len() > breaks[1].len()).then_some(cut)
}
