//! The rounds of an approximation: fit, judge, measure, cut spans, take out knots.

use super::adapt::{
    Criterion, Marks, Measure, OUTLIER_WEIGHT, Strips, cut, fewest_breaks, first_breaks, knot_use,
    without,
};
use super::approximate::{ApproximateOptions, Approximation, Round, Status};
use super::fairness::noise_reach;
use super::normal_equations::Assembly;
use super::robust::{Judgement, Neighbourhoods};
use super::samples::{Residual, Samples, Unsorted, residuals};
use super::space::{Fit, Space};
use crate::chart::Topology;
use crate::numeric::statistics::robust_sigma;
use crate::progress::Progress;
use crate::{Error, Result};

/// Most rounds of refinement; each can double the spans of a direction.
const ROUNDS: usize = 48;
/// Variances by which a control point must lower the sum of squares to pay for itself. It takes one variance of noise in
/// and should take out more than that of error; 2 is Akaike's price.
const PRICE: f64 = 3.0;
/// Pooled score above which a control point costs less: fitting noise lowers the sum by one variance each.
const PLAIN: f64 = 2.0;
const PLAIN_PRICE: f64 = 1.3;
/// Variances by which the sum of squares may rise per control point taken out: less than its price, so that local errors
/// do not come back.
const REFUND: f64 = 2.0;
/// So many knots in a row that cannot be taken out end the search.
const FAILURES: usize = 10;
/// Factor by which the energy may fall from fit to fit: that of an ill-conditioned fit can round to nothing, and the
/// fairness that follows from it would flatten the surface.
const CALMING: f64 = 10.0;
/// Factor by which a round may raise the root mean square distance of the points that count before and after it.
const SETBACK: f64 = 2.0;
/// Largest relative residual of the normal equations, some 1e-15 in good fits, with which a round counts.
const LOST_DIGITS: f64 = 1e-10;

const TOO_FEW: &str = "where the surface is still off there are too few points to follow: scan more densely, or allow a larger tolerance";

/// Points from whose residuals the noise is reported.
const SCALE_POINTS: usize = 400_000;

/// What is known of the noise before there is a surface.
#[derive(Clone, Copy, Debug)]
pub(super) enum Known {
    Given(f64),
    /// From the quietest neighbourhoods, so a lower bound.
    Estimated(f64),
}

/// What all fits of one approximation share.
#[derive(Clone, Copy)]
pub(super) struct Engine<'a> {
    pub(super) samples: &'a Samples,
    pub(super) neighbourhoods: &'a Neighbourhoods,
    pub(super) topology: Topology,
    pub(super) degree: [usize; 2],
    pub(super) size: [f64; 2],
    pub(super) tolerance: f64,
    pub(super) noise: Known,
    pub(super) criterion: Criterion,
    pub(super) budget: usize,
    pub(super) fairness: f64,
    pub(super) progress: &'a dyn Progress,
}

/// A fit with what is known of it.
pub(super) struct State {
    fit: Fit,
    equation_residual: f64,
    energy: f64,
    residuals: Vec<Residual>,
    judgement: Judgement,
}

impl Engine<'_> {
    /// A fit with the weights and the energy of an earlier one.
    fn fit(
        &self,
        breaks: &[Vec<f64>; 2],
        weights: &[f64],
        energy: f64,
    ) -> Result<(Fit, f64, f64, Vec<Residual>)> {
        self.progress.check()?;
        let space = Space::new(self.degree, breaks.clone(), self.topology)?;
        let assembly = Assembly::new(&space, self.samples, self.size);
        // A plane has no energy; the bound keeps lambda below what ruins the condition.
        let bounded = energy.max(self.tolerance * self.tolerance);
        let reach = match (self.criterion, self.noise) {
            (Criterion::Bias, Known::Given(sigma) | Known::Estimated(sigma)) => {
                noise_reach(sigma, space.unknowns(), self.samples.len()).min(self.tolerance)
            }
            // Exact points leave nothing to smooth.
            (Criterion::Maximum, _) => 0.5 * self.tolerance,
        };
        let lambda = match energy.is_finite() {
            true => (self.fairness * reach).powi(2) / bounded,
            false => assembly.first_lambda(),
        };
        let solved = assembly.solve(weights, lambda)?;
        let floor = if energy.is_finite() {
            energy / CALMING
        } else {
            0.0
        };
        let energy = assembly.energy(&solved.fit).max(floor);
        self.progress.check()?;
        let residuals = residuals(&solved.fit, self.samples);
        Ok((solved.fit, solved.equation_residual, energy, residuals))
    }

    /// Fits, judges the points, and fits with the new weights `times` times.
    fn settle(
        &self,
        breaks: &[Vec<f64>; 2],
        before: Option<&State>,
        times: usize,
    ) -> Result<State> {
        let first = self.neighbourhoods.first_weights();
        let (weights, energy) = match before {
            Some(state) => (&state.judgement.weights, state.energy),
            None => (&first, f64::INFINITY),
        };
        let floor = match self.criterion {
            // Exact points lie within a few tolerances of their neighbours, or are wrong.
            Criterion::Maximum => 0.5 * self.tolerance,
            Criterion::Bias => 0.0,
        };
        let (mut fit, mut equation_residual, mut energy, mut residuals) =
            self.fit(breaks, weights, energy)?;
        let mut judgement = self.neighbourhoods.judge(self.samples, &residuals, floor);
        for _ in 0..times {
            (fit, equation_residual, energy, residuals) =
                self.fit(breaks, &judgement.weights, energy)?;
            let next = self.neighbourhoods.judge(self.samples, &residuals, floor);
            if times > 1 {
                judgement = next;
            } else {
                judgement.sigma = next.sigma;
            }
        }
        Ok(State {
            fit,
            equation_residual,
            energy,
            residuals,
            judgement,
        })
    }

    /// Whether `after` is not clearly worse than `before`: more knots lower the sum of squares unless the equations lose
    /// their digits.
    fn holds(&self, before: &State, after: &State) -> bool {
        let (mut squares, mut total) = ([0.0; 2], 0.0);
        for k in 0..self.samples.len() {
            let w = before.judgement.weights[k].min(after.judgement.weights[k]);
            squares[0] += w * before.residuals[k].signed.powi(2);
            squares[1] += w * after.residuals[k].signed.powi(2);
            total += w;
        }
        let [was, is] = squares.map(|s| (s / total.max(1.0)).sqrt());
        is <= (SETBACK * was).max(self.tolerance) && after.equation_residual <= LOST_DIGITS
    }

    fn measure(&self, state: &State) -> Measure {
        Measure {
            criterion: self.criterion,
            tolerance: self.tolerance,
            sigma: match self.noise {
                Known::Given(sigma) => sigma,
                // A surface with almost as many control points as points has residuals smaller than their noise.
                Known::Estimated(least) => {
                    let (points, unknowns) =
                        (self.samples.len() as f64, state.fit.space.unknowns() as f64);
                    let freedom = points / (points - unknowns).max(0.1 * points);
                    least.max(state.judgement.sigma * freedom.sqrt())
                }
            },
        }
    }

    fn strips(&self, state: &State) -> [Vec<Strips>; 2] {
        let weights = &state.judgement.weights;
        [0, 1].map(|d| Strips::levels(&state.fit.space, self.samples, &state.residuals, weights, d))
    }

    fn marks(&self, state: &State) -> [Marks; 2] {
        let measure = self.measure(state);
        self.strips(state).map(|s| measure.marks(&s))
    }

    fn round(&self, state: &State, marks: &[Marks; 2]) -> Round {
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

    /// The breakpoints to start with.
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
    pub(super) fn fit_once(&self, breaks: &[Vec<f64>; 2]) -> Result<(State, Vec<Round>, Status)> {
        let mut state = self.settle(breaks, None, 1)?;
        // Outliers bent the first fit, by which they were found.
        if state.judgement.weights.contains(&0.0) {
            state = self.settle(breaks, Some(&state), 0)?;
        }
        let marks = self.marks(&state);
        let round = self.round(&state, &marks);
        let status = if round.worst <= 1.0 {
            Status::Met
        } else {
            Status::NotMet(
                "the given spans do not suffice for the tolerance: let them be refined".into(),
            )
        };
        Ok((state, vec![round], status))
    }

    /// The rounds of refinement; with `polish` also the finer test and the removal of knots. Returns the last state, the
    /// history and whether the tolerance was met.
    pub(super) fn refine(
        &self,
        breaks: &mut [Vec<f64>; 2],
        polish: bool,
    ) -> Result<(State, Vec<Round>, Status)> {
        let mut history = Vec::new();
        let mut state = self.settle(breaks, None, 1)?;
        let mut status = None;
        let mut removals = 0;
        for _ in 0..ROUNDS {
            let marks = self.marks(&state);
            history.push(self.round(&state, &marks));
            self.progress.advance(1);
            let good = marks[0].worst <= 1.0 && marks[1].worst <= 1.0;
            if good {
                status = Some(Status::Met);
                break;
            }
            let (best, over_budget) = self.best_cut(&state, breaks, &marks, 0.0)?;
            match best {
                Some(trial) => {
                    let next = self.settle(&trial, Some(&state), 1)?;
                    if !self.holds(&state, &next) {
                        status = Some(Status::NotMet(TOO_FEW.into()));
                        break;
                    }
                    (*breaks, state) = (trial, next);
                }
                None => {
                    // Knots in places that do not need them any more make room for others.
                    if over_budget && removals < 3 {
                        removals += 1;
                        let before = state.fit.space.size();
                        state = self.remove(state, breaks)?;
                        if state.fit.space.size() < before {
                            continue;
                        }
                    }
                    status = Some(Status::NotMet(if over_budget {
                        format!(
                            "{} control points do not suffice for the tolerance: allow more of them, or a larger tolerance",
                            self.budget
                        )
                    } else {
                        TOO_FEW.into()
                    }));
                    break;
                }
            }
        }
        if polish {
            state = self.refine_pooled(state, breaks, &mut history)?;
            state = self.remove(state, breaks)?;
        }
        let settled = self.settle(breaks, Some(&state), 2)?;
        if self.holds(&state, &settled) {
            state = settled;
        }
        let marks = self.marks(&state);
        history.push(self.round(&state, &marks));
        let status = status.unwrap_or_else(|| {
            Status::NotMet("refinement did not come to an end: allow a larger tolerance".into())
        });
        Ok((state, history, status))
    }

    /// The breakpoints with the marked spans cut along u or along v, whichever lowers the objective more per control
    /// point; `None` if neither may be cut, or none lowers it by `price` variances per control point. Also whether the
    /// budget stood in the way.
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
        let counts = state.fit.space.counts();
        let mut best: Option<(f64, [Vec<f64>; 2])> = None;
        let mut over_budget = false;
        for d in 0..2 {
            let room = (self.budget / counts[1 - d]).saturating_sub(counts[d]);
            over_budget |= room < marks[d].spans.len();
            let Some(more) = cut(&breaks[d], &marks[d], room) else {
                continue;
            };
            let mut trial = breaks.clone();
            trial[d] = more;
            let (fit, _, _, residuals) = self.fit(&trial, weights, state.energy)?;
            let then = measure.objective(&residuals, weights);
            let added = (fit.space.size() - state.fit.space.size()) as f64;
            if price > 0.0 && now - then < price * added * measure.sigma * measure.sigma {
                continue;
            }
            let tiny = f64::MIN_POSITIVE;
            let gain = ((now + tiny).ln() - (then + tiny).ln()) / added;
            if best.as_ref().is_none_or(|b| gain > b.0) {
                best = Some((gain, trial));
            }
        }
        Ok((best.map(|b| b.1), over_budget))
    }

    /// Cuts on, where noise hides an error from the test of single cells but not from all of them together, as long as
    /// the knots pay for themselves.
    fn refine_pooled(
        &self,
        mut state: State,
        breaks: &mut [Vec<f64>; 2],
        history: &mut Vec<Round>,
    ) -> Result<State> {
        for _ in 0..ROUNDS {
            let measure = self.measure(&state);
            let mut marks = self.strips(&state).map(|s| measure.pooled_marks(&s));
            // What is plainly off is followed while it brings more than fitting noise would.
            let worst = marks[0].worst.max(marks[1].worst);
            let price = if worst > PLAIN { PLAIN_PRICE } else { PRICE };
            let mut best = self.best_cut(&state, breaks, &marks, price)?.0;
            if best.is_none() {
                for marks in &mut marks {
                    marks
                        .spans
                        .sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
                    marks.spans.truncate(1);
                }
                best = self.best_cut(&state, breaks, &marks, PRICE)?.0;
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

    /// Takes out knots, the least used first, as long as the surface stays as good as it is.
    fn remove(&self, mut state: State, breaks: &mut [Vec<f64>; 2]) -> Result<State> {
        let closed = self.topology.closed();
        let measure = self.measure(&state);
        // The surface may become as bad as it may be, or as it is, whichever is worse, by single cells and by windows.
        let worst = |state: &State| {
            let strips = self.strips(state);
            let single = strips.each_ref().map(|s| measure.marks(s).worst);
            let pooled = strips.each_ref().map(|s| measure.pooled_marks(s).worst);
            [single[0].max(single[1]), pooled[0].max(pooled[1])]
        };
        let allowed = worst(&state).map(|w| w.max(1.0));
        let mut knots: Vec<(f64, usize, f64)> = (0..2)
            .flat_map(|d| {
                let uses = knot_use(&state.fit, d);
                let places = breaks[d][1..].to_vec();
                uses.into_iter().zip(places).map(move |(u, t)| (u, d, t))
            })
            .collect();
        knots.sort_by(|a, b| {
            a.0.total_cmp(&b.0)
                .then(a.1.cmp(&b.1))
                .then(a.2.total_cmp(&b.2))
        });
        let mut failures = 0;
        for (_, d, place) in knots {
            let Some(r) = breaks[d].iter().position(|b| b.total_cmp(&place).is_eq()) else {
                continue;
            };
            if breaks[d].len() <= fewest_breaks(self.degree[d], closed[d]) {
                continue;
            }
            let mut trial = breaks.clone();
            trial[d] = without(&breaks[d], r);
            let (fit, equation_residual, energy, residuals) =
                self.fit(&trial, &state.judgement.weights, state.energy)?;
            let saved = (state.fit.space.size() - fit.space.size()) as f64;
            let candidate = State {
                fit,
                equation_residual,
                energy,
                residuals,
                judgement: state.judgement.clone(),
            };
            let weights = &state.judgement.weights;
            let rise = measure.objective(&candidate.residuals, weights)
                - measure.objective(&state.residuals, weights);
            let cheap = match self.criterion {
                // The tolerance is missed somewhere; that is no licence to miss it elsewhere.
                Criterion::Maximum if allowed[0] > 1.0 => rise <= 0.0,
                Criterion::Bias => rise <= REFUND * saved * measure.sigma * measure.sigma,
                Criterion::Maximum => true,
            };
            let within = |w: [f64; 2]| w[0] <= allowed[0] && w[1] <= allowed[1];
            if cheap && within(worst(&candidate)) {
                *breaks = trial;
                state = candidate;
                failures = 0;
            } else {
                failures += 1;
                if failures == FAILURES && self.criterion == Criterion::Bias {
                    break;
                }
            }
        }
        Ok(state)
    }

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
        let points = weights.iter().filter(|&&w| w > 0.0).count() as f64;
        // So many evenly chosen points hold the scale to 0.2 %.
        let step = residuals.len().div_ceil(SCALE_POINTS).max(1);
        let inside: Vec<f64> = (0..residuals.len())
            .step_by(step)
            .filter(|&k| weights[k] > 0.0)
            .map(|k| residuals[k].signed)
            .collect();
        // Each unknown takes one residual's worth of the spread away.
        let unknowns = state.fit.space.unknowns() as f64;
        let freedom = points / (points - unknowns).max(0.5 * points).max(1.0);
        let sigma = scale * robust_sigma(&inside, 0.0) * freedom.sqrt();
        let ranks = self.samples.ranks();
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
            status,
        })
    }
}
