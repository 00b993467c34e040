//! Many points: knots are found on few samples, and all of them are fitted once or twice, and again if they ask for more.

use super::Shortfall;
use super::adapt::{Criterion, OUTLIER_WEIGHT};
use super::least_error::Candidate;
use super::problem::{Calm, Known, Problem, State};
use super::strategy::Solution;
use super::visits::Gauge;
use crate::fit::approximate::{ApproximateOptions, Status};
use crate::fit::least_squares::robust::{Judgement, Neighbourhoods};
use crate::fit::least_squares::samples::{Samples, residuals};
use nurbskin_geometry::Result;

/// A rough surface is fitted to a part of about so many points.
const PART: usize = 40_000;
/// On given knots so many per control point are enough to tell outliers, ...
const PART_EACH: usize = 24;
/// ... but at least so many.
const LEAST_PART: usize = 10_000;
/// Knots are found on so many groups per control point, within these limits.
const GROUPS_EACH: usize = 10;
const GROUPS: std::ops::RangeInclusive<usize> = 10_000..=60_000;
/// The rough surface has at most so many control points: what is finer shows in neighbours that agree.
const ROUGH: usize = 600;
/// Part of the points whose judgement may change with the last fit: with more, they are fitted once more.
const TURNED: f64 = 1e-4;
/// Most rounds in which all points ask for more knots.
const WHOLE_ROUNDS: usize = 24;
/// With more points than this, parameters are not corrected: the chart of so many points is good enough.
const CORRECTED: usize = 300_000;

impl Problem<'_> {
    /// One fit without refinement: a part of the points tells which of them count.
    pub(super) fn fit_once_large(&self, breaks: [Vec<f64>; 2]) -> Result<Solution> {
        let control_points = self.counts(&breaks.each_ref());
        let part = self.part((PART_EACH * control_points).clamp(LEAST_PART, PART));
        let neighbourhoods = Neighbourhoods::new(&part, self.size, self.topology);
        let rough = self.on(&part, &neighbourhoods).fit_once(&breaks)?;
        let rough = rough.candidate.state;
        let state = self.whole(&breaks, self.seen_by(&rough), rough.calm)?;
        Ok(self.unrefined(breaks, state))
    }

    /// The approximation asked for.
    ///
    /// A rough surface through a part of the points tells which of them count. Points with noise are then condensed: what
    /// many say together is all that the knots need to know; of exact points a part is asked. All of them are fitted on
    /// these knots, and more are added where they still ask for it.
    pub(super) fn large(
        &self,
        breaks: [Vec<f64>; 2],
        options: &ApproximateOptions,
    ) -> Result<Solution> {
        let part = self.part(PART);
        let neighbourhoods = Neighbourhoods::new(&part, self.size, self.topology);
        let first = self.on(&part, &neighbourhoods);
        let as_charted = ApproximateOptions {
            correct: false,
            ..options.clone()
        };
        let (chosen, judgement) = match self.criterion {
            Criterion::Maximum => (first.choose(&breaks, &as_charted)?, None),
            Criterion::Bias => {
                let least = self.degree.map(|p| p + 1).iter().product::<usize>();
                let rough = Problem {
                    budget: self.budget.min(ROUGH.max(2 * least)),
                    ..first
                };
                let rough = rough.spend(breaks.clone(), false)?.state;
                let judgement = self.seen_by(&rough);
                let gauge = Gauge::new(&part, &rough.judgement.weights);
                let problem = Problem {
                    gauge: Some(&gauge),
                    ..*self
                };
                (
                    problem.condensed(&judgement, &breaks, &as_charted)?,
                    Some(judgement),
                )
            }
        };
        let hopeless = self.is_hopeless(&chosen.candidate);
        if hopeless && options.correct && self.samples.len() <= CORRECTED {
            return Ok(self.judged_by_budget(self.least_error(&breaks, true)?));
        }
        let Solution {
            mut candidate,
            status,
        } = chosen;
        let judgement = judgement.unwrap_or_else(|| self.seen_by(&candidate.state));
        let state = self.whole(&candidate.breaks, judgement, candidate.state.calm)?;
        (candidate.state, candidate.raised) = (state, None);
        let out_of_reach =
            hopeless || status != Status::Met && options.max_control_points.is_some();
        if out_of_reach {
            let round = self.round(&candidate.state, &self.marks(&candidate.state));
            let met = round.worst <= 1.0;
            candidate.history.push(round);
            return Ok(Solution {
                candidate,
                status: if met { Status::Met } else { status },
            });
        }
        let status = self.refine_whole(&mut candidate)?;
        Ok(Solution { candidate, status })
    }

    /// More knots as long as all points ask for them, with one fit for each round, or two where that changes which points
    /// count. None are taken out.
    fn refine_whole(&self, candidate: &mut Candidate) -> Result<Status> {
        let mut rounds = 0;
        loop {
            let state = &candidate.state;
            let marks = self.marks(state);
            let round = self.round(state, &marks);
            let met = round.worst <= 1.0;
            candidate.history.push(round);
            self.progress.advance(1);
            if met {
                return Ok(Status::Met);
            }
            if rounds == WHOLE_ROUNDS {
                return Ok(Status::NotMet(Shortfall::Unfinished));
            }
            let (trial, over_budget) = self.likely_cut(state, &candidate.breaks, &marks);
            let Some(trial) = trial else {
                return Ok(Status::NotMet(match over_budget {
                    true => self.over_budget(),
                    false => Shortfall::TooFewPoints,
                }));
            };
            let next = self.whole(&trial, state.judgement.clone(), state.calm)?;
            if !self.holds(state, &next) {
                return Ok(Status::NotMet(Shortfall::TooFewPoints));
            }
            (candidate.breaks, candidate.state) = (trial, next);
            rounds += 1;
        }
    }

    /// A regular subset of about this many samples.
    pub(super) fn part(&self, wanted: usize) -> Samples {
        self.samples.part(self.samples.len().div_ceil(wanted))
    }

    /// The same task for other samples.
    pub(super) fn on<'a>(
        &'a self,
        samples: &'a Samples,
        neighbourhoods: &'a Neighbourhoods,
    ) -> Problem<'a> {
        Problem {
            samples,
            neighbourhoods,
            held_out: None,
            ..*self
        }
    }

    /// What all points are to a surface through some of them.
    pub(super) fn seen_by(&self, rough: &State) -> Judgement {
        self.judge(&residuals(&rough.fit, self.samples))
    }

    /// The knots, found on condensed samples.
    fn condensed(
        &self,
        judgement: &Judgement,
        breaks: &[Vec<f64>; 2],
        options: &ApproximateOptions,
    ) -> Result<Solution> {
        let weights = &judgement.weights;
        let groups = (GROUPS_EACH * self.budget).clamp(*GROUPS.start(), *GROUPS.end());
        let condensed = self.samples.condensed(weights, groups, self.size);
        let neighbourhoods = Neighbourhoods::new(&condensed, self.size, self.topology);
        let per_group = weights.iter().sum::<f64>() / condensed.measured().max(1) as f64;
        let per_group = per_group.max(1.0);
        let problem = Problem {
            noise: match self.noise {
                Known::Given(sigma) => Known::Given(sigma / per_group.sqrt()),
                Known::Estimated(least) => Known::Estimated(least / per_group.sqrt()),
            },
            // A group is no vertex: one that is off is one of outliers.
            vertices: false,
            ..self.on(&condensed, &neighbourhoods)
        };
        problem.choose(breaks, options)
    }

    /// All samples, fitted with these weights, and once more if that tells many of them to be something else.
    pub(super) fn whole(
        &self,
        breaks: &[Vec<f64>; 2],
        mut judgement: Judgement,
        mut calm: Calm,
    ) -> Result<State> {
        let counts = |weight: f64| weight > OUTLIER_WEIGHT;
        let mut again = true;
        loop {
            let (fit, equation_residual, next, residuals) =
                self.fit(breaks, &judgement.weights, calm)?;
            let judged = self.judge(&residuals);
            let both = judgement.weights.iter().zip(&judged.weights);
            let turned = both.filter(|(a, b)| counts(**a) != counts(**b)).count();
            (judgement, calm) = (judged, next);
            if !again || turned as f64 <= TURNED * self.samples.len() as f64 {
                return Ok(State {
                    fit,
                    equation_residual,
                    calm,
                    residuals,
                    judgement,
                });
            }
            again = false;
        }
    }
}
