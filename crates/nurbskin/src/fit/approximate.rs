//! Penalised least squares to scattered, parametrised points, with knots where the error is.
//!
//! Rounds of: fit with robust weights and a faint fairness, measure, cut the spans in which the surface is not good
//! enough, along u or along v, whichever brings more per control point. Then knots that do not matter are taken out
//! again. With noise "good enough" is a statistical statement about mean distances (the maximum would chase noise); without
//! it is the largest distance.

use super::adapt::{
    Criterion, Marks, Measure, OUTLIER_WEIGHT, Strips, cut, fewest_breaks, first_breaks, knot_use,
    without,
};
use super::normal_equations::Assembly;
use super::robust::{Judgement, Neighbourhoods};
use super::samples::{Residual, Samples, residuals};
use super::space::{Fit, Space};
use crate::chart::{Chart, Topology};
use crate::numeric::statistics::robust_sigma;
use crate::nurbs::{MAX_DEGREE, NurbsSurface};
use crate::progress::Progress;
use crate::{DVec2, DVec3, Error, Result};

/// Most rounds of refinement; each can double the spans of a direction.
const ROUNDS: usize = 48;
/// Noise below this part of the tolerance is no noise.
const NOISE_SHARE: f64 = 0.1;
/// Root mean square error that fairness may cost, in tolerances.
const FAIRNESS_SHARE: f64 = 0.02;
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
/// With more points than this, knots are found on a part of them ...
const MANY: usize = 60_000;
/// ... of about so many.
const PART: usize = 40_000;
/// Control points allowed where nothing is said.
const DEFAULT_BUDGET: usize = 20_000;

/// What to approximate to.
#[derive(Clone, Debug, PartialEq)]
pub struct ApproximateOptions {
    /// Largest error of the surface, in the unit of the points.
    pub tolerance: f64,
    /// Standard deviation of the points across the surface, where it is known; measured where not.
    pub noise: Option<f64>,
    /// Degrees along u and v.
    pub degree: [usize; 2],
    /// Most control points (distinct ones); the best surface within them is given where they do not suffice.
    pub max_control_points: Option<usize>,
    /// Whether knots are added at all; without, the surface is fitted once on `spans`.
    pub refine: bool,
    /// Spans along u and v to start with; few where nothing is said.
    pub spans: Option<[usize; 2]>,
    /// Root mean square error that fairness may cost, in tolerances.
    pub fairness: f64,
}

impl ApproximateOptions {
    /// Bicubic to this tolerance, noise measured, no limit but 20 000 control points.
    #[must_use]
    pub fn new(tolerance: f64) -> Self {
        Self {
            tolerance,
            noise: None,
            degree: [3, 3],
            max_control_points: None,
            refine: true,
            spans: None,
            fairness: FAIRNESS_SHARE,
        }
    }
}

/// Whether the tolerance was reached.
#[derive(Clone, Debug, PartialEq)]
pub enum Status {
    /// By the criterion of the approximation.
    Met,
    /// Why not, and what would help.
    NotMet(String),
}

/// One round of refinement.
#[derive(Clone, Debug, PartialEq)]
pub struct Round {
    /// Distinct control points along u and v.
    pub control_points: [usize; 2],
    /// Root mean square of the residuals with their weights, in the unit of the points.
    pub rms: f64,
    /// Largest distance of a point that is not an outlier.
    pub maximum: f64,
    /// Standard deviation of the residuals about their neighbourhoods.
    pub sigma: f64,
    /// Worst error as the criterion sees it; at most 1 is good enough.
    pub worst: f64,
}

/// A surface through the middle of scattered points.
#[derive(Clone, Debug)]
pub struct Approximation {
    /// The surface on \[0, 1\] x \[0, 1\].
    pub surface: NurbsSurface,
    /// (u, v) of each point, as they were used in the end.
    pub parameters: Vec<DVec2>,
    /// Foot point of each point: the place of the surface nearest to it, to a few Gauss-Newton steps.
    pub feet: Vec<DVec2>,
    /// Distance of each point to the surface along its normal, signed: positive on the side of `S_u x S_v`.
    pub residuals: Vec<f64>,
    /// Robust weight of each point, 0..=1; 0 = treated as an outlier.
    pub weights: Vec<f64>,
    /// Standard deviation of the points across the surface, measured from the residuals.
    pub sigma: f64,
    /// What was asked of the surface.
    pub criterion: Criterion,
    /// Residual of the normal equations, relative to their right-hand side.
    pub equation_residual: f64,
    /// The rounds of refinement, then the surface as it is.
    pub history: Vec<Round>,
    /// Whether the tolerance was reached.
    pub status: Status,
}

/// A surface that approximates `points`, which the chart places in \[0, 1\] x \[0, 1\], to the tolerance.
///
/// Outliers lose their weight; where the domain holds no points the surface continues as calmly as its knots allow.
/// The result does not depend on the order of the points or the number of threads.
///
/// Source: penalised least squares with thin-plate energy, knots by a test of mean residuals; local medians keep
/// features from being taken for outliers. O(M) per round for M points plus O(N w^2) for N control points in a band w.
///
/// ```
/// use nurbskin::chart::{Chart, Topology};
/// use nurbskin::fit::approximate::{ApproximateOptions, approximate};
/// use nurbskin::{DVec2, DVec3, progress::Silent};
/// let parameters: Vec<DVec2> = (0..900)
///     .map(|k| DVec2::new((k % 30) as f64, (k / 30) as f64) / 29.0)
///     .collect();
/// let points: Vec<DVec3> = parameters
///     .iter()
///     .map(|t| DVec3::new(100.0 * t.x, 100.0 * t.y, 20.0 * (3.0 * t.x).sin()))
///     .collect();
/// let chart = Chart { topology: Topology::Disk, parameters, size: [100.0, 100.0], reason: String::new() };
/// let fit = approximate(&points, &chart, &ApproximateOptions::new(0.05), &Silent)?;
/// assert!((fit.surface.point(0.5, 0.3).z - 20.0 * 1.5_f64.sin()).abs() < 0.05);
/// # Ok::<(), nurbskin::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] if counts disagree, a number is not finite, a size or the tolerance is not positive, or a degree is
/// out of range; [`Error::NoSolution`] if there are fewer than 16 points or they do not determine a surface;
/// [`Error::Cancelled`].
pub fn approximate(
    points: &[DVec3],
    chart: &Chart,
    options: &ApproximateOptions,
    progress: &dyn Progress,
) -> Result<Approximation> {
    check(points, chart, options)?;
    let scale = chart.size[0].hypot(chart.size[1]);
    let samples = Samples::new(points, &chart.parameters, scale);
    let size = chart.size.map(|s| s / scale);
    let neighbourhoods = Neighbourhoods::new(&samples, size);
    let noise = match options.noise {
        Some(noise) => noise / scale,
        None => neighbourhoods.noise(&samples),
    };
    let tolerance = options.tolerance / scale;
    let criterion = if noise < NOISE_SHARE * tolerance {
        Criterion::Maximum
    } else {
        Criterion::Bias
    };
    let engine = Engine {
        samples: &samples,
        neighbourhoods: &neighbourhoods,
        topology: chart.topology,
        degree: options.degree,
        size,
        tolerance,
        noise: match options.noise {
            Some(_) => Known::Given(noise),
            None => Known::Estimated(noise),
        },
        criterion,
        budget: options.max_control_points.unwrap_or(DEFAULT_BUDGET),
        fairness: options.fairness,
        progress,
    };
    progress.stage("approximate", None);
    let mut breaks = engine.start(options)?;
    if !options.refine {
        let (state, history, status) = engine.fit_once(&breaks)?;
        return engine.finish(state, history, status, scale);
    }
    let mut history = Vec::new();
    let many = samples.len() > MANY;
    if many {
        // Most of the way on a part of the points; all of them only have to confirm it.
        let part = samples.part(samples.len().div_ceil(PART));
        let neighbourhoods = Neighbourhoods::new(&part, size);
        let first = Engine {
            samples: &part,
            neighbourhoods: &neighbourhoods,
            ..engine
        };
        let (state, rounds, _) = first.refine(&mut breaks, true)?;
        drop(state);
        history = rounds;
    }
    let (state, rounds, status) = engine.refine(&mut breaks, !many)?;
    history.extend(rounds);
    engine.finish(state, history, status, scale)
}

/// Refuses what cannot be approximated.
fn check(points: &[DVec3], chart: &Chart, options: &ApproximateOptions) -> Result<()> {
    if points.len() != chart.parameters.len() {
        return Err(Error::invalid(format!(
            "{} points come with {} parameters: each point needs one",
            points.len(),
            chart.parameters.len()
        )));
    }
    if u32::try_from(points.len()).is_err() {
        return Err(Error::Unsupported(
            "more than 4 billion points cannot be approximated at once: thin them out first".into(),
        ));
    }
    if let Some(k) = points.iter().position(|p| !p.is_finite()) {
        return Err(Error::invalid(format!("point {k} is not finite")));
    }
    let domain = |t: &DVec2| t.cmpge(DVec2::ZERO).all() && t.cmple(DVec2::ONE).all();
    if let Some(k) = chart.parameters.iter().position(|t| !domain(t)) {
        return Err(Error::invalid(format!(
            "the parameters of point {k} lie outside 0..1"
        )));
    }
    let positive = |x: f64| x.is_finite() && x > 0.0;
    if !chart.size.iter().all(|&s| positive(s)) {
        return Err(Error::invalid("the lengths of the chart must be positive"));
    }
    if !positive(options.tolerance) {
        return Err(Error::invalid("the tolerance must be positive"));
    }
    if options.noise.is_some_and(|s| !(s.is_finite() && s >= 0.0)) {
        return Err(Error::invalid("the noise must not be negative"));
    }
    if !(options.fairness.is_finite() && options.fairness >= 0.0) {
        return Err(Error::invalid("the fairness must not be negative"));
    }
    if options.degree.iter().any(|p| !(1..=MAX_DEGREE).contains(p)) {
        return Err(Error::invalid(format!(
            "degrees must lie in 1..={MAX_DEGREE}"
        )));
    }
    if points.len() < 16 {
        return Err(Error::NoSolution(format!(
            "{} points are too few for a surface: at least 16 are needed",
            points.len()
        )));
    }
    Ok(())
}

/// What is known of the noise before there is a surface.
#[derive(Clone, Copy, Debug)]
enum Known {
    Given(f64),
    /// From the quietest neighbourhoods, so a lower bound.
    Estimated(f64),
}

/// What all fits of one approximation share.
#[derive(Clone, Copy)]
struct Engine<'a> {
    samples: &'a Samples,
    neighbourhoods: &'a Neighbourhoods,
    topology: Topology,
    degree: [usize; 2],
    size: [f64; 2],
    tolerance: f64,
    noise: Known,
    criterion: Criterion,
    budget: usize,
    fairness: f64,
    progress: &'a dyn Progress,
}

/// A fit with what is known of it.
struct State {
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
        let share = match self.criterion {
            Criterion::Bias => self.fairness,
            // Exact points leave nothing to smooth.
            Criterion::Maximum => 0.5 * self.fairness,
        };
        let lambda = (share * self.tolerance).powi(2) / bounded;
        let solved = assembly.solve(weights, lambda)?;
        let energy = assembly.energy(&solved.fit);
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
        let ones = vec![1.0; self.samples.len()];
        let (weights, energy) = match before {
            Some(state) => (&state.judgement.weights, state.energy),
            None => (&ones, f64::INFINITY),
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
            judgement.sigma = self
                .neighbourhoods
                .judge(self.samples, &residuals, floor)
                .sigma;
            if times > 1 {
                judgement = self.neighbourhoods.judge(self.samples, &residuals, floor);
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
    fn start(&self, options: &ApproximateOptions) -> Result<[Vec<f64>; 2]> {
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
    fn fit_once(&self, breaks: &[Vec<f64>; 2]) -> Result<(State, Vec<Round>, Status)> {
        let state = self.settle(breaks, None, 3)?;
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
    fn refine(
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
                    *breaks = trial;
                    state = self.settle(breaks, Some(&state), 1)?;
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
                        "where the surface is still off there are too few points to follow: scan more densely, or allow a larger tolerance".into()
                    }));
                    break;
                }
            }
        }
        if polish {
            state = self.refine_pooled(state, breaks, &mut history)?;
            state = self.remove(state, breaks)?;
        }
        state = self.settle(breaks, Some(&state), 2)?;
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
            *breaks = trial;
            state = self.settle(breaks, Some(&state), 1)?;
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
    fn finish(
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
            out.parameters[original] = self.samples.parameters[k];
            out.feet[original] = state.residuals[k].foot;
            out.residuals[original] = scale * state.residuals[k].signed;
            out.weights[original] = state.judgement.weights[k];
        }
        Ok(out)
    }
}
