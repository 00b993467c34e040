//! Approximation of many points: knots are found on few samples, then all points are fitted once or twice, and again
//! where their residuals require more knots.
//!
//! 1. Fit a rough surface to a regular subset; judge all points by it.
//! 2. Noise: find the knots on means of groups, whose noise is σ / √(points per group). Exact points: on the subset.
//! 3. Fit all points on these knots, and refine while their residuals exceed the criterion.
//!
//! O(M) for the final fits of M points; the number of rounds does not grow with M. Ours.

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

/// Points, about, of the regular subset to which a rough surface is fitted. Count.
/// Guard: below the 60 000 up to which a fit takes all points; the subset needs only to tell outliers.
const ROUGH_FIT_POINTS: usize = 40_000;
/// Points per control point of the subset that finds the outliers on given knots.
/// Trial: not recorded. A cell of a net then holds about one neighbourhood of 20 points.
const JUDGING_POINTS_PER_CONTROL_POINT: usize = 24;
/// Least number of points of that subset. Count.
/// Guard: a subset this small takes no time that matters.
const MIN_JUDGING_POINTS: usize = 10_000;
/// Groups of condensed samples per control point of the budget.
/// Trial: not recorded; it was 16 before.
const GROUPS_PER_CONTROL_POINT: usize = 10;
/// Least and largest number of groups of condensed samples. Count.
/// Guard: the upper end is the number of samples up to which a fit is not condensed, the lower one costs no time that
/// matters.
const GROUP_COUNTS: std::ops::RangeInclusive<usize> = 10_000..=60_000;
/// Most control points of the rough surface. Count.
/// Trial: not recorded. What it misses shows in neighbours that agree, and does not make them outliers.
const ROUGH_FIT_BUDGET: usize = 600;
/// Share of the points whose judgement as an outlier may change with the last fit; with more, all are fitted once more.
/// Guard: so few points do not move the surface.
const MAX_REJUDGED_SHARE: f64 = 1e-4;
/// Most rounds of refinement on all points. Count.
/// Guard: bounds the time; each round can double the spans of a direction.
const MAX_WHOLE_ROUNDS: usize = 24;
/// Samples above which parameters are not corrected. Count.
/// Guard: bounds the time; the chart of that number of points is good enough.
const CORRECTION_MAX_POINTS: usize = 300_000;

impl Problem<'_> {
    /// One fit without refinement, with outliers found on a subset of the points.
    pub(super) fn fit_once_large(&self, breaks: [Vec<f64>; 2]) -> Result<Solution> {
        let control_points = self.counts(&breaks.each_ref());
        let part = self.part(
            (JUDGING_POINTS_PER_CONTROL_POINT * control_points)
                .clamp(MIN_JUDGING_POINTS, ROUGH_FIT_POINTS),
        );
        let neighbourhoods = Neighbourhoods::new(&part, self.size, self.topology);
        let rough = self.on(&part, &neighbourhoods).fit_once(&breaks)?;
        let rough = rough.candidate.state;
        let state = self.whole(&breaks, self.seen_by(&rough), rough.calm)?;
        Ok(self.unrefined(breaks, state))
    }

    /// The requested approximation.
    ///
    /// A rough surface through a subset finds the outliers. Noisy points are then condensed to means of groups, which
    /// hold all that knots need; of exact points a subset is taken. All points are fitted on these knots, and more
    /// knots are added where their residuals require it.
    pub(super) fn large(
        &self,
        breaks: [Vec<f64>; 2],
        options: &ApproximateOptions,
    ) -> Result<Solution> {
        let part = self.part(ROUGH_FIT_POINTS);
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
                    budget: self.budget.min(ROUGH_FIT_BUDGET.max(2 * least)),
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
        if hopeless && options.correct && self.samples.len() <= CORRECTION_MAX_POINTS {
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

    /// Adds knots while the residuals of all points require it, with one fit per round, or two where the fit changes
    /// which points count. No knots are removed.
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
            if rounds == MAX_WHOLE_ROUNDS {
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

    /// The judgement of all points by a surface through some of them.
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
        let groups = (GROUPS_PER_CONTROL_POINT * self.budget)
            .clamp(*GROUP_COUNTS.start(), *GROUP_COUNTS.end());
        let condensed = self.samples.condensed(weights, groups, self.size);
        let neighbourhoods = Neighbourhoods::new(&condensed, self.size, self.topology);
        let per_group = weights.iter().sum::<f64>() / condensed.measured().max(1) as f64;
        let per_group = per_group.max(1.0);
        let problem = Problem {
            noise: match self.noise {
                Known::Given(sigma) => Known::Given(sigma / per_group.sqrt()),
                Known::Estimated(least) => Known::Estimated(least / per_group.sqrt()),
            },
            // A group is no vertex: one that is off consists of outliers.
            vertices: false,
            ..self.on(&condensed, &neighbourhoods)
        };
        problem.choose(breaks, options)
    }

    /// A fit to all samples with these weights, and a second one if the first changes the judgement of many.
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
            if !again || turned as f64 <= MAX_REJUDGED_SHARE * self.samples.len() as f64 {
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
