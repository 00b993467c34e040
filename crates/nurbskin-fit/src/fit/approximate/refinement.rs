//! Rounds of refinement: measure the residuals, halve the spans where the surface is not good enough, fit again.
//!
//! ```text
//! round:  settle → score > 1? → halve marked spans along u or v, by gain per control point → settle
//! pooled: windows of cells whose Σ n mean² exceeds noise together, while a control point pays k σ² of it
//! rich:   more knots than the tolerance needs, while each lowers Σ w d² by 2.5 σ²
//! ```
//!
//! Then knots are removed (`knot_removal`) and the weights settled.
//!
//! Source: prices of control points after H. Akaike (2 variances) and C. L. Mallows; the tests are ours.

use super::adapt::{Criterion, Marks, cut, respaced};
use super::problem::{Problem, State};
use super::span_residuals::SpanResiduals;
use crate::fit::approximate::{Round, Shortfall, Status};
use nurbskin_geometry::Result;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::parallel::each;

/// Most rounds of refinement. Count.
/// Guard: ends a refinement that does not converge; each round can double the spans of a direction.
const MAX_REFINEMENT_ROUNDS: usize = 48;
/// Most removals of knots that make room for others within the budget. Count.
/// Guard: knots that are added and removed in turn would never end.
const MAX_REMOVALS: usize = 3;
/// Fall of the sum of squares per control point, in variances of the noise, with which an added control point pays for
/// itself.
/// Trial: not recorded. A control point takes in one variance of noise and should take out more than that of error; 2
/// is the price of Akaike.
const CONTROL_POINT_PRICE: f64 = 3.0;
/// Pooled score above which the lower price [`PLAIN_PRICE`] holds. In units of a score that is just good enough.
/// Trial: not recorded.
const PLAIN_BIAS_SCORE: f64 = 2.0;
/// Price of a control point where the bias is plain, in variances of the noise.
/// Trial: not recorded. Above 1, as fitting noise lowers the sum by one variance per control point.
const PLAIN_PRICE: f64 = 1.3;

/// Ratio of the estimated gains of the two directions above which the lesser one is not tried. Dimensionless.
/// Guard: saves a fit; the estimates are right to within such a factor.
const DIRECTION_GAIN_RATIO: f64 = 4.0;
/// Price of a control point that is added whatever the tolerance, in variances of the noise on average.
/// Trial: not recorded. It takes in one variance of noise; near 1 the net grows into the noise.
const RICH_PRICE: f64 = 2.5;
/// Spans for each of which such a round adds one. Count.
/// Trial: not recorded.
const DENSIFYING_DIVISOR: usize = 5;
/// Most rounds of knots beyond the tolerance. Count.
/// Guard: bounds the time; it was 8 before.
const MAX_RICH_ROUNDS: usize = 4;
/// Fewest samples per control point in these rounds. Count.
/// Trial: not recorded. With fewer the net fits noise.
const RICH_POINTS_PER_CONTROL_POINT: usize = 4;

impl Problem<'_> {
    /// The rounds of refinement, the pooled test and the removal of knots. Returns the last state, the history and
    /// whether the tolerance was met.
    pub(super) fn refine(&self, breaks: &mut [Vec<f64>; 2]) -> Result<(State, Vec<Round>, Status)> {
        let mut history = Vec::new();
        let mut state = self.settle(breaks, None, 1)?;
        let mut why = Shortfall::Unfinished;
        let mut removals = 0;
        for _ in 0..MAX_REFINEMENT_ROUNDS {
            let marks = self.marks(&state);
            history.push(self.round(&state, &marks));
            self.progress.advance(1);
            if marks[0].worst <= 1.0 && marks[1].worst <= 1.0 {
                break;
            }
            let (best, over_budget) = self.best_cut(&state, breaks, &marks, 0.0)?;
            if let Some(trial) = best {
                let next = self.settle(&trial, Some(&state), 1)?;
                if !self.holds(&state, &next) {
                    why = Shortfall::TooFewPoints;
                    break;
                }
                (*breaks, state) = (trial, next);
                continue;
            }
            // Knots that are no longer needed make room for others.
            if over_budget && removals < MAX_REMOVALS {
                removals += 1;
                let before = state.fit.space.size();
                state = self.remove(state, breaks)?;
                if state.fit.space.size() < before {
                    continue;
                }
            }
            why = if over_budget {
                self.over_budget()
            } else {
                Shortfall::TooFewPoints
            };
            break;
        }
        if self.criterion == Criterion::Bias {
            state = self.refine_pooled(state, breaks, &mut history)?;
            state = self.refine_rich(state, breaks, &mut history)?;
        }
        let worst = |state: &State| {
            let marks = self.marks(state);
            marks[0].worst.max(marks[1].worst)
        };
        // A met criterion must stay met: after the removal of knots, and with settled weights.
        let mut fewer = breaks.clone();
        let removed = self.remove(state.clone(), &mut fewer)?;
        if worst(&self.judged(&removed)) <= worst(&state).max(1.0) {
            (*breaks, state) = (fewer, removed);
        }
        let settled = self.settle(breaks, Some(&state), 2)?;
        if self.holds(&state, &settled) && worst(&settled) <= worst(&state).max(1.0) {
            state = settled;
        }
        let marks = self.marks(&state);
        let last = self.round(&state, &marks);
        let status = if last.worst <= 1.0 {
            Status::Met
        } else {
            Status::NotMet(why)
        };
        history.push(last);
        Ok((state, history, status))
    }

    pub(super) fn over_budget(&self) -> Shortfall {
        Shortfall::OverBudget(self.budget)
    }

    /// The state with its points judged by their own residuals.
    fn judged(&self, state: &State) -> State {
        State {
            judgement: self.judge(&state.residuals),
            ..state.clone()
        }
    }

    /// Adds knots whatever the tolerance, as long as they pay: many points determine more than the tolerance requires.
    /// Single mean residuals would not show it, since noise hides in each what all of them show together.
    fn refine_rich(
        &self,
        mut state: State,
        breaks: &mut [Vec<f64>; 2],
        history: &mut Vec<Round>,
    ) -> Result<State> {
        let worst = |state: &State| {
            let marks = self.marks(state);
            marks[0].worst.max(marks[1].worst)
        };
        for _ in 0..MAX_RICH_ROUNDS {
            let measure = self.measure(&state);
            let price = RICH_PRICE * measure.sigma * measure.sigma;
            let dense = |more: [bool; 2]| {
                let of = |d: usize| {
                    let spans = breaks[d].len() - 1;
                    let added = if more[d] {
                        spans.div_ceil(DENSIFYING_DIVISOR)
                    } else {
                        0
                    };
                    respaced(&breaks[d], spans + added)
                };
                [of(0), of(1)]
            };
            let even = [0, 1].map(|d| {
                let spans = breaks[d].len() - 1;
                respaced(&[0.0, 1.0], spans + spans.div_ceil(DENSIFYING_DIVISOR))
            });
            let trials = [
                Some(even),
                Some(dense([true, true])),
                self.best_spans(&state, breaks, price),
                Some(dense([true, false])),
                Some(dense([false, true])),
            ];
            let mut better: Option<([Vec<f64>; 2], State)> = None;
            let mut most = 0.0;
            for (k, trial) in trials.into_iter().enumerate() {
                let Some(trial) = trial else { continue };
                let counts = self.counts(&trial.each_ref());
                if counts > self.budget
                    || RICH_POINTS_PER_CONTROL_POINT * counts > self.samples.len()
                {
                    continue;
                }
                let next = self.advance(&trial, &state)?;
                let weights = &state.judgement.weights;
                let drop = measure.objective(&state.residuals, weights)
                    - measure.objective(&next.residuals, weights);
                let added = next.fit.space.size() as f64 - state.fit.space.size() as f64;
                let pays = drop >= price * added;
                let good = worst(&next) <= worst(&state).max(1.0) && self.holds(&state, &next);
                if pays && good && drop > most {
                    most = drop;
                    better = Some((trial, next));
                }
                // The first two have the same number of knots; the others are tried if these fail.
                if k > 0 && better.is_some() {
                    break;
                }
            }
            let Some((trial, next)) = better else { break };
            (*breaks, state) = (trial, next);
            history.push(self.round(&state, &self.marks(&state)));
        }
        Ok(state)
    }

    /// Distinct control points on these breakpoints.
    pub(super) fn counts(&self, breaks: &[&Vec<f64>; 2]) -> usize {
        let closed = self.topology.closed();
        let of = |d: usize| breaks[d].len() - 1 + if closed[d] { 0 } else { self.degree[d] };
        of(0) * of(1)
    }

    /// The breakpoints after halving the marked spans along u or along v, whichever lowers the objective more per
    /// control point; `None` if neither may be cut, or none lowers it by `price` variances per control point. Also
    /// whether the budget prevented a cut.
    fn best_cut(
        &self,
        state: &State,
        breaks: &[Vec<f64>; 2],
        marks: &[Marks; 2],
        price: f64,
    ) -> Result<(Option<[Vec<f64>; 2]>, bool)> {
        let measure = self.measure(state);
        let weights = &state.judgement.weights;
        let now = measure.objective(&state.residuals, weights);
        let mut best: Option<(f64, [Vec<f64>; 2])> = None;
        let mut over_budget = false;
        let likely = self.likely(state, marks);
        let mut trials = Vec::new();
        for (d, likely) in likely.into_iter().enumerate() {
            if price <= 0.0 && !likely {
                continue;
            }
            let (trial, over) = self.cut_along(d, state, breaks, marks);
            over_budget |= over;
            trials.extend(trial);
        }
        let fits = each(trials.len(), |k| self.fit(&trials[k], weights, state.calm));
        for (trial, made) in trials.into_iter().zip(fits) {
            let (fit, _, _, residuals) = made?;
            let then = measure.objective(&residuals, weights);
            let added = (fit.space.size() - state.fit.space.size()) as f64;
            if price > 0.0 && now - then < price * added * measure.sigma * measure.sigma {
                continue;
            }
            let tiny = f64::MIN_POSITIVE;
            let gain = (math::ln(now + tiny) - math::ln(then + tiny)) / added;
            if best.as_ref().is_none_or(|b| gain > b.0) {
                best = Some((gain, trial));
            }
        }
        Ok((best.map(|b| b.1), over_budget))
    }

    /// Continues cutting where noise hides an error from the test of single cells but not from their sum, as long as
    /// the knots pay.
    fn refine_pooled(
        &self,
        mut state: State,
        breaks: &mut [Vec<f64>; 2],
        history: &mut Vec<Round>,
    ) -> Result<State> {
        for _ in 0..MAX_REFINEMENT_ROUNDS {
            let measure = self.measure(&state);
            let mut marks = self.strips(&state).map(|s| measure.pooled_marks(&s));
            // A plain bias is followed while it gains more than fitting noise would.
            let worst = marks[0].worst.max(marks[1].worst);
            let price = if worst > PLAIN_BIAS_SCORE {
                PLAIN_PRICE
            } else {
                CONTROL_POINT_PRICE
            };
            let mut best = self.best_cut(&state, breaks, &marks, price)?.0;
            if best.is_none() {
                for marks in &mut marks {
                    marks
                        .spans
                        .sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
                    marks.spans.truncate(1);
                }
                best = self
                    .best_cut(&state, breaks, &marks, CONTROL_POINT_PRICE)?
                    .0;
            }
            let Some(trial) = best else { break };
            let next = self.settle(&trial, Some(&state), 1)?;
            if !self.holds(&state, &next) {
                break;
            }
            (*breaks, state) = (trial, next);
            history.push(self.round(&state, &self.marks(&state)));
        }
        Ok(state)
    }

    /// The breakpoints after halving the marked spans in the direction with the larger estimated gain, or else with the
    /// longer spans, without a trial fit; `None` if neither may be cut. Also whether the budget prevented a cut.
    pub(super) fn likely_cut(
        &self,
        state: &State,
        breaks: &[Vec<f64>; 2],
        marks: &[Marks; 2],
    ) -> (Option<[Vec<f64>; 2]>, bool) {
        let gains = self.gains(state, marks);
        let longest = [0, 1].map(|d| {
            let spans = marks[d].spans.iter();
            let lengths = spans.map(|&(a, _)| self.size[d] * (breaks[d][a + 1] - breaks[d][a]));
            lengths.fold(0.0, f64::max)
        });
        let first = usize::from((gains[1], longest[1]) > (gains[0], longest[0]));
        let mut over_budget = false;
        for d in [first, 1 - first] {
            let (trial, over) = self.cut_along(d, state, breaks, marks);
            over_budget |= over;
            if trial.is_some() {
                return (trial, over_budget);
            }
        }
        (None, over_budget)
    }

    /// The breakpoints after halving the marked spans of direction d within the budget; `None` if none may be cut. Also
    /// whether the budget prevented a cut.
    fn cut_along(
        &self,
        d: usize,
        state: &State,
        breaks: &[Vec<f64>; 2],
        marks: &[Marks; 2],
    ) -> (Option<[Vec<f64>; 2]>, bool) {
        let counts = state.fit.space.counts();
        let room = (self.budget / counts[1 - d]).saturating_sub(counts[d]);
        let trial = cut(&breaks[d], &marks[d], room).map(|more| {
            let mut trial = breaks.clone();
            trial[d] = more;
            trial
        });
        (trial, room < marks[d].spans.len())
    }

    /// Which directions are worth a trial, by the estimated gain of their marked spans per control point.
    fn likely(&self, state: &State, marks: &[Marks; 2]) -> [bool; 2] {
        let gains = self.gains(state, marks);
        let marked = [0, 1].map(|d| !marks[d].spans.is_empty());
        let likely = [0, 1].map(|d| marked[d] && gains[d] * DIRECTION_GAIN_RATIO >= gains[1 - d]);
        if likely.contains(&true) {
            likely
        } else {
            marked
        }
    }

    /// Estimated gain of the marked spans of each direction per control point.
    fn gains(&self, state: &State, marks: &[Marks; 2]) -> [f64; 2] {
        let counts = state.fit.space.counts();
        let measure = self.measure(state);
        let weights = &state.judgement.weights;
        let space = &state.fit.space;
        let strips = SpanResiduals::coarse(space, self.samples, &state.residuals, weights);
        [0, 1].map(|d| {
            let energies = measure.energies(&strips[d], f64::INFINITY);
            let sum: f64 = marks[d].spans.iter().map(|s| energies[s.0]).sum();
            sum / (marks[d].spans.len().max(1) * counts[1 - d]) as f64
        })
    }
}
