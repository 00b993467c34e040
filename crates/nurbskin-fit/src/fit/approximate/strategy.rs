//! The order of attempts of an approximation.
//!
//! A [`Problem`] (samples, tolerance, noise, budget) does not change while it is solved. A [`Candidate`] is a set of
//! knots with the fit on them. Each step takes a candidate and returns a better one, or the same:
//!
//! ```text
//! approximation
//!   no refinement       ─▶ one fit on the given spans                                   fit_once
//!   a goal (-t)         ─▶ the smallest net that reaches it                             reaching       search.rs
//!                            grow by the spans that gain most, bisect the last step
//!                            biased regions left: search again, with a smaller tolerance
//!   many samples        ─▶ knots on a reduced sample, then one fit to all of them       large          large.rs
//!   else                                                                                choose
//!     1. a budget?  least overall error within it                                       least_error
//!                     spend: spans cut by their gain per control point                          least_error.rs
//!                     correct: parameters moved to the foot points, if that is better   reparametrisation.rs
//!     2. the fewest control points for the tolerance                                    fewest
//!                     refine, best_cut: the spans over the criterion halved, along u or v   refinement.rs
//!                     refine_pooled, refine_rich: what single cells do not show
//!                     remove: knots placed anew, or removed one by one                  knot_removal.rs
//!     3. the better of both
//!   then                ─▶ cells that fold or cross made stiffer                        unfold         unfold.rs
//!                       ─▶ still crossing, the goal met: search again, with a smaller tolerance   sound  search.rs
//! ```
//!
//! The gain of a cut is estimated from the mean residuals of the span (`span_residuals`): no cut has to be tried. Knots
//! along one direction are placed on a profile of the dense surface (`knot_placement`). All visited surfaces are
//! recorded for the trade-off curve (`visits`, `trade`). Ours, but for the sources named at each step.

use super::adapt::{Criterion, OUTLIER_WEIGHT};
use super::least_error::Candidate;
use super::problem::{Problem, State};
use crate::fit::approximate::{ApproximateOptions, Approximation, Shortfall, Status};
use nurbskin_geometry::Result;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::statistics::quantile_in_place;

/// Samples above which knots are found on fewer of them. Count.
/// Guard: bounds the time of the rounds; one final fit takes all points.
pub(super) const LARGE_SCAN_POINTS: usize = 60_000;
/// Score above which a surface that put its knots where they gain most is taken to miss the tolerance with the same
/// number of knots elsewhere, too. In units of a score that is just good enough.
/// Trial: not recorded. Below it a search for fewer control points is still made.
const HOPELESS_SCORE: f64 = 3.0;
/// Most reweighted fits that lower the largest distances of exact points. Count.
/// Trial: not recorded. The full iteration converges slowly and costs the other points.
const PEAK_STEPS: usize = 4;
/// Relative rise of the weight of the farthest point in a step; others rise with the cube of their share of its
/// distance. Dimensionless.
/// Trial: not recorded.
const PEAK_GAIN: f64 = 2.0;
/// Factor by which the root mean square distance may rise for lower peaks. Dimensionless.
/// Trial: not recorded.
const PEAK_COST: f64 = 1.25;
/// Ratio of the costs below which the larger surface is returned instead of the one with the fewest control points.
/// Dimensionless.
/// Derived: two standard deviations of the 95 % quantile of ten thousand normal errors, which is 1 %.
const CLEAR_IMPROVEMENT: f64 = 0.98;
/// Budget of the second search for exact points, in control points of the first one's result. Dimensionless.
/// Trial: on the simulated face, where it leaves 360 control points instead of 450. With less room, knots go first
/// where the surface is farthest off, and fewer do; with less than this the last rounds have none.
const SECOND_SEARCH_ROOM: f64 = 1.3;
/// Least value of 1 - N/M in the cross-validation, the share of the points that the unknowns leave free.
/// Guard: keeps the quotient finite.
const MIN_FREE_SHARE: f64 = 0.05;
/// Every `VALIDATION_STRIDE`-th sample is held out to validate the correction of the parameters. Count.
/// Guard: an eighth of the points is enough to compare two surfaces and hardly missed by the fit.
const VALIDATION_STRIDE: usize = 8;
/// Standard errors of the mean gain by which the corrected parameters must bring the held-out samples closer.
/// Derived: by chance one of 740 normal variables exceeds 3.
const VALIDATION_ERRORS: f64 = 3.0;
/// Multiple of the 90 % quantile at which the distances of held-out samples are capped. Dimensionless.
/// Guard: bounds the influence of outliers; about 3.3 sigma of normal errors.
const VALIDATION_CAP: f64 = 2.0;
/// Quantile of the distances that [`VALIDATION_CAP`] multiplies. Share of the samples.
/// Guard: outliers are far fewer than a tenth.
const VALIDATION_CAP_QUANTILE: f64 = 0.9;

/// Knots with the fit on them, and whether it meets the tolerance.
pub(super) struct Solution {
    pub(super) candidate: Candidate,
    pub(super) status: Status,
}

impl Problem<'_> {
    /// The requested approximation.
    pub(super) fn approximation(
        &self,
        options: &ApproximateOptions,
        scale: f64,
    ) -> Result<Approximation> {
        let breaks = self.start(options)?;
        let many = self.samples.len() > LARGE_SCAN_POINTS;
        let chosen = match self.goal {
            _ if !options.refine && many => self.fit_once_large(breaks)?,
            _ if !options.refine => self.fit_once(&breaks)?,
            Some(goal) => self.reaching(&breaks, goal, options)?,
            None if many => self.large(breaks, options)?,
            None => self.choose(&breaks, options)?,
        };
        let Solution {
            mut candidate,
            status,
        } = chosen;
        let samples = candidate.samples.take();
        let problem = self.with(samples.as_ref());
        if self.only_met && status != Status::Met {
            return problem.finish(candidate.state, candidate.history, status, scale);
        }
        let is_sound = problem.unfold(&mut candidate)?;
        if let (Some(goal), Status::Met, false) = (problem.goal, &status, is_sound)
            && let Some(sound) = problem.sound(&candidate, goal)?
        {
            candidate = sound;
        }
        problem.finish(candidate.state, candidate.history, status, scale)
    }

    /// The knots for the request, with the fit on them.
    pub(super) fn choose(
        &self,
        breaks: &[Vec<f64>; 2],
        options: &ApproximateOptions,
    ) -> Result<Solution> {
        // 1. The best surface within a budget.
        let mut candidate = None;
        if options.max_control_points.is_some() {
            let best = self.least_error(breaks, options.correct)?;
            if best.samples.is_some() {
                // Corrected since knots alone did not suffice; where it did, there may be too many knots.
                return self.corrected(best);
            }
            if self.is_hopeless(&best) {
                return Ok(self.judged_by_budget(best));
            }
            candidate = Some(best);
        }
        // 2. The fewest control points for the tolerance.
        let most = match &candidate {
            // The size that pays is known; larger ones need no search.
            Some(best) if self.price > 0.0 => best.state.fit.space.size(),
            _ => self.budget,
        };
        let economical = Problem {
            budget: most,
            ..*self
        }
        .fewest(breaks)?;
        let status = &economical.status;
        let over_budget = matches!(status, Status::NotMet(Shortfall::OverBudget(_)));
        let met = *status == Status::Met;
        if candidate.is_none() && (met || !over_budget) {
            return Ok(economical);
        }
        // 3. The better of both.
        let best = match candidate {
            Some(best) => best,
            None => self.least_error(breaks, options.correct)?,
        };
        let closer = match (met, self.criterion) {
            // Exact points need no more than the tolerance.
            (true, Criterion::Maximum) => false,
            (true, Criterion::Bias) => {
                let priced = |state: &State| self.expected(state) * self.priced(state);
                priced(&best.state) < CLEAR_IMPROVEMENT * priced(&economical.candidate.state)
            }
            (false, _) => self.cost(&best.state) < self.cost(&economical.candidate.state),
        };
        match closer {
            true => Ok(self.judged_by_budget(best)),
            false => Ok(economical),
        }
    }

    /// The fewest control points for the tolerance.
    pub(super) fn economical(&self, breaks: &[Vec<f64>; 2]) -> Result<Solution> {
        let mut breaks = breaks.clone();
        let (state, history, status) = self.refine(&mut breaks)?;
        let candidate = Candidate {
            breaks,
            samples: None,
            state,
            raised: None,
            history,
        };
        Ok(Solution { candidate, status })
    }

    /// The same; for exact points the smaller result of two searches, the second with a smaller budget. So the result
    /// hardly depends on the budget of the caller.
    pub(super) fn fewest(&self, breaks: &[Vec<f64>; 2]) -> Result<Solution> {
        let found = self.economical(breaks)?;
        let size = found.candidate.state.fit.space.size();
        let rounds = found.candidate.history.iter();
        let largest: usize = rounds
            .map(|round| round.control_points.iter().product())
            .max()
            .unwrap_or(size);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a count"
        )]
        let budget = (SECOND_SEARCH_ROOM * size as f64) as usize;
        let exact = self.criterion == Criterion::Maximum;
        if !exact || found.status != Status::Met || largest <= budget {
            return Ok(found);
        }
        let tighter = Problem { budget, ..*self };
        let fewer = tighter.economical(breaks)?;
        let is_smaller = fewer.candidate.state.fit.space.size() < size;
        Ok(match is_smaller && fewer.status == Status::Met {
            true => fewer,
            false => found,
        })
    }

    /// Whether the tolerance is out of reach for the number of control points that was used.
    pub(super) fn is_hopeless(&self, candidate: &Candidate) -> bool {
        candidate.history.last().map_or(0.0, |r| r.worst) > HOPELESS_SCORE
    }

    /// The candidate with corrected parameters, with fewer knots if the tolerance is met.
    fn corrected(&self, mut candidate: Candidate) -> Result<Solution> {
        if candidate.history.last().map_or(0.0, |r| r.worst) <= 1.0 {
            let problem = self.with(candidate.samples.as_ref());
            let limit = problem.limit(&candidate.state);
            candidate.state = problem.respace(candidate.state, &mut candidate.breaks, &limit)?;
            candidate.raised = None;
            let round = problem.round(&candidate.state, &problem.marks(&candidate.state));
            candidate.history.push(round);
        }
        Ok(self.judged_by_budget(candidate))
    }

    /// Whether the surface within the budget meets the tolerance, and why not.
    pub(super) fn judged_by_budget(&self, candidate: Candidate) -> Solution {
        let worst = candidate.history.last().map_or(0.0, |r| r.worst);
        let counts = candidate.state.fit.space.counts();
        let full = counts[0] * counts[1] + counts[0].min(counts[1]) > self.budget;
        let status = match worst <= 1.0 {
            true => Status::Met,
            false if full => Status::NotMet(self.over_budget()),
            false if self.price > 0.0 => Status::NotMet(Shortfall::LittleGain),
            false => Status::NotMet(Shortfall::TooFewPoints),
        };
        Solution { candidate, status }
    }

    /// The surface of least overall error within the budget, with corrected parameters if those are better.
    pub(super) fn least_error(&self, breaks: &[Vec<f64>; 2], correct: bool) -> Result<Candidate> {
        let mut candidate = if !correct {
            self.spend(breaks.clone(), false)?
        } else if self.criterion == Criterion::Maximum {
            // Exact points: every step was checked.
            self.spend(breaks.clone(), true)?
        } else {
            let held_out: Vec<bool> = (0..self.samples.len())
                .map(|k| {
                    k % VALIDATION_STRIDE == VALIDATION_STRIDE / 2 && !self.samples.is_support(k)
                })
                .collect();
            let problem = Problem {
                held_out: Some(&held_out),
                ..*self
            };
            let as_it_is = problem.spend(breaks.clone(), false)?;
            let corrected = problem.spend(breaks.clone(), true)?;
            if corrected.samples.is_some()
                && convinced(&held_out, &as_it_is.state, &corrected.state)
            {
                corrected
            } else {
                as_it_is
            }
        };
        if self.criterion == Criterion::Maximum {
            self.lower_peaks(&mut candidate)?;
            return Ok(candidate);
        }
        // All points, with settled weights.
        let problem = self.with(candidate.samples.as_ref());
        let settled = problem.settle(&candidate.breaks, Some(&candidate.state), 1)?;
        if problem.holds(&candidate.state, &settled) {
            let round = problem.round(&settled, &problem.marks(&settled));
            candidate.history.push(round);
            candidate.state = settled;
        }
        Ok(candidate)
    }

    /// Lowers the largest distances of exact points at a small cost for the others, by weights that grow with the
    /// distance.
    ///
    /// Source: C. L. Lawson, Contributions to the theory of linear least maximum approximation, 1961; with a few steps
    /// only, starting from the least squares fit.
    fn lower_peaks(&self, candidate: &mut Candidate) -> Result<()> {
        let problem = self.with(candidate.samples.as_ref());
        let measures = |state: &State| {
            let kept = state.residuals.iter().zip(&state.judgement.weights);
            let kept = kept.filter(|k| *k.1 > OUTLIER_WEIGHT).map(|k| k.0.distance);
            let (n, squares, largest) = kept.fold((0.0, 0.0, 0.0_f64), |(n, s, m), d| {
                (n + 1.0, s + d * d, m.max(d))
            });
            (largest, (squares / f64::max(n, 1.0)).sqrt())
        };
        let (mut largest, rms) = measures(&candidate.state);
        let mut raised = vec![1.0; problem.samples.len()];
        let mut state = candidate.state.clone();
        for _ in 0..PEAK_STEPS {
            if largest <= 0.0 {
                break;
            }
            for (w, r) in raised.iter_mut().zip(&state.residuals) {
                let share = (r.distance / largest).min(1.0);
                *w *= 1.0 + PEAK_GAIN * share * share * share;
            }
            let mut before = state.clone();
            for (w, raised) in before.judgement.weights.iter_mut().zip(&raised) {
                *w *= raised;
            }
            let next = problem.advance(&candidate.breaks, &before)?;
            let (peak, level) = measures(&next);
            if level > PEAK_COST * rms {
                break;
            }
            state = next;
            if peak < largest {
                largest = peak;
                candidate.state = state.clone();
                candidate.raised = Some(before.judgement.weights);
            }
        }
        let round = problem.round(&candidate.state, &problem.marks(&candidate.state));
        candidate.history.push(round);
        Ok(())
    }

    /// Expected p95 of other points of the same scan: a surface is closer to the points that it was fitted to, by the
    /// share of the points that its unknowns take. The root of generalised cross-validation (P. Craven, G. Wahba,
    /// Smoothing noisy data with spline functions, 1979), for the level instead of the mean square.
    fn expected(&self, state: &State) -> f64 {
        let points = self.samples.measured().max(1) as f64;
        let free = 1.0 - state.fit.space.unknowns() as f64 / points;
        self.level(state) / free.max(MIN_FREE_SHARE)
    }

    /// The cost by which surfaces of one sequence are compared: p95 or, where control points have to pay, the expected
    /// p95 of other points of the same scan times the price of the control points.
    pub(super) fn cost(&self, state: &State) -> f64 {
        match self.price > 0.0 {
            true => self.expected(state) * self.priced(state),
            false => self.level(state),
        }
    }

    /// The factor of the distance for the number of control points.
    fn priced(&self, state: &State) -> f64 {
        math::powf(state.fit.space.size() as f64, self.price)
    }

    /// The distance of 95 % of the points.
    pub(super) fn level(&self, state: &State) -> f64 {
        let measured = (0..state.residuals.len()).filter(|&k| !self.samples.is_support(k));
        let mut distances: Vec<f64> = measured.map(|k| state.residuals[k].distance).collect();
        quantile_in_place(&mut distances, 0.95)
    }
}

/// Whether the held-out samples lie significantly closer to the second surface.
fn convinced(held_out: &[bool], before: &State, after: &State) -> bool {
    let of = |state: &State| -> Vec<f64> {
        let held = state.residuals.iter().zip(held_out).filter(|h| *h.1);
        held.map(|h| h.0.distance).collect()
    };
    let (mut before, mut after) = (of(before), of(after));
    // Outliers carry no information.
    let cap = VALIDATION_CAP * quantile_in_place(&mut before.clone(), VALIDATION_CAP_QUANTILE);
    for d in before.iter_mut().chain(&mut after) {
        *d = d.min(cap);
    }
    let n = before.len() as f64;
    let gains: Vec<f64> = before
        .iter()
        .zip(&after)
        .map(|(b, a)| b * b - a * a)
        .collect();
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    mean > VALIDATION_ERRORS * (variance / n).sqrt()
}
