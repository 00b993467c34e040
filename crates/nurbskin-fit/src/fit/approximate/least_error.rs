//! The least overall error within a budget that does not suffice for the tolerance.
//!
//! What counts then is not the worst spot, which more knots may never mend, but what a control point takes out of the
//! sum of squares wherever it is put. A cut span adds one row of control points across; what it can gain is told by the
//! residuals of the surface as it is, so that no cut has to be tried.

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

/// Factor by which the control points grow from round to round.
pub(super) const GROWTH: f64 = 1.6;
/// Spans that gain less than this part of the best per control point wait for the next round.
const SHARE: f64 = 0.1;
/// Mean residuals of sub-cells count up to this many times their 90 % quantile: one bad spot shall not take all knots.
const CAP: f64 = 2.0;

/// Factor by which more control points may leave the distance of 95 % of the points farther, so that chance is no reason to
/// give them up.
const WORSE: f64 = 1.005;

/// Corrections of the parameters on the last knots; one on all others.
const LAST_CORRECTIONS: usize = 5;

/// What the budget bought.
#[derive(Clone)]
pub(super) struct Candidate {
    pub(super) breaks: [Vec<f64>; 2],
    /// With corrected parameters, if they were.
    pub(super) samples: Option<Samples>,
    pub(super) state: State,
    /// The weights of the samples in the fit, where they are not those of its judgement.
    pub(super) raised: Option<Vec<f64>>,
    pub(super) history: Vec<Round>,
}

impl Problem<'_> {
    /// Refines from `breaks` until the criterion is met, the budget is used, or nothing more can be gained; with
    /// `correct` the parameters are corrected after each round. The samples are those of the problem where nothing was
    /// corrected. A larger net that is no closer to the points is given up for the best before it.
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
                (true, true) => LAST_CORRECTIONS,
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
            if best.as_ref().is_none_or(|b| level <= b.0 * WORSE) {
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

    /// The problem with these samples instead, where there are some.
    pub(super) fn with<'b>(&'b self, samples: Option<&'b Samples>) -> Problem<'b> {
        Problem {
            samples: samples.unwrap_or(self.samples),
            ..*self
        }
    }

    /// The breakpoints with those spans cut that gain most per control point, in both directions, where they gain more
    /// than `floor`.
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
        let cap = CAP * quantile_in_place(&mut means, 0.9);
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
        let least = (SHARE * spans.first()?.0).max(floor);
        spans.retain(|span| span.0 >= least);
        let enough = GROWTH * (counts[0] * counts[1]) as f64;
        cut_in_order(breaks, counts, &spans, enough, self.budget)
    }
}

/// The breakpoints with those of the spans, each a gain, a direction and a number, cut in their order that keep the
/// control points below `enough`, and the first below `most`; `None` if none may be cut.
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
