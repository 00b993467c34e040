//! Removal of knots that the surface does not need.
//!
//! A candidate with fewer knots is accepted if its sum of squares rises by at most the refund per removed control
//! point,
//!
//! ```text
//! Δ Σ w d² ≤ refund · σ² · (N before - N after),   2 ≤ refund ≤ 19.2,
//! ```
//!
//! and its scores stay within a [`Limit`]. Noisy points: the knots are placed anew (`knot_placement`). Otherwise spans
//! are respaced with the same density, then single knots are removed, the least used first.
//!
//! Source: the lower bound is C. L. Mallows, Some comments on `C_p`, Technometrics 15, 1973; the refund and the order
//! are ours. *The NURBS Book*, 9.4.5, removes knots within an error bound instead.

use super::adapt::{Criterion, Measure, OUTLIER_WEIGHT, fewest_breaks, knot_use, respaced};
use super::knot_placement::{MAX_PLACED_SPANS, placed};
use super::problem::{Problem, State};
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::bias::{ALL_WITHIN, Allowed, Placed, bias};
use nurbskin_geometry::numeric::parallel::each;

/// Rise of the sum of squares per removed control point, in variances of the noise, that is accepted where sigma is
/// half of the tolerance, see [`Problem::refund`].
/// Trial: on the pot of docs/scattered.md, which has that ratio: some 18 variances leave 135 control points, 7 leave
/// 170. At a third, the ratio that fits aim at where noise sets their aim, hardly more than [`MIN_REFUND`] is left.
const REFUND_AT_HALF_TOLERANCE: f64 = 16.4;
/// Power of sigma/T with which the refund falls below one half. Dimensionless.
/// Trial: with it a ratio of one third keeps (2/3)^5 = 13 % of the refund at one half. A flat refund of 12 variances
/// kept a larger error on the face with outliers and on the bump at a tolerance of 3 sigma.
const REFUND_NOISE_POWER: i32 = 5;
/// Upper bound of the refund, in variances of the noise per control point.
/// Trial: on simulated clouds; earlier values were 18 and 12.
const MAX_REFUND: f64 = 19.2;
/// Lower bound of the refund, in variances of the noise per control point: twice the variance that a control point
/// takes in. Less than the price of an added control point, so that a removed knot is not added again.
/// Source: the expected error is least with it (C. L. Mallows, Some comments on `C_p`, Technometrics 15, 1973).
const MIN_REFUND: f64 = 2.0;
/// Mean variance of the surface, `sigma^2 N / M` in squared tolerances, from which on the refund is not reduced; below
/// it the refund falls with the power [`REFUND_VARIANCE_POWER`].
/// Trial: not recorded.
const SATURATION_VARIANCE: f64 = 0.0013;
/// Power with which the refund falls below [`SATURATION_VARIANCE`]. Dimensionless.
/// Trial: not recorded.
const REFUND_VARIANCE_POWER: i32 = 3;
/// Root mean square error, in tolerances, that all control points together may be worth where the points determine the
/// surface far better than that.
/// Trial: on the bump, which takes 552 instead of 600 control points at a million points, and on a tube (936 instead of
/// 1558 at ten million). A larger value gives up accuracy that the points hold.
const NEGLIGIBLE_RMS: f64 = 0.017;
/// Upper bound of the refund that [`NEGLIGIBLE_RMS`] allows, in variances of the noise per control point.
/// Trial: not recorded.
const MAX_NEGLIGIBLE_REFUND: f64 = 12.0;
/// Factor by which the score of windows of cells may exceed its limit after a removal, where the tolerance is met.
/// Dimensionless.
/// Trial: not recorded.
const WINDOW_LEEWAY: f64 = 2.0;
/// Share of the points that may lie beyond a tolerance of at least 4 sigma that still counts as met.
/// Trial: not recorded. It is below the 0.5 % that a verdict allows by default.
const MAX_SHARE_BEYOND: f64 = 0.002;
/// Least first price of a control point, in variances of the noise, by which numbers of knots are chosen from the dense
/// surface; the price falls until the points agree.
/// Trial: with paired seeds of the simulated clouds; 12 was used before. A high price proposes too few knots and costs
/// trials.
const MIN_FIRST_PRICE: f64 = 6.0;
/// The first price of a control point as a multiple of the refund. Dimensionless.
/// Trial: not recorded.
const FIRST_PRICE_IN_REFUNDS: f64 = 1.6;
/// Factor of the price of a control point from trial to trial. Dimensionless.
/// Trial: on the pot of docs/scattered.md; it was 0.7 with 10 trials before.
const PRICE_DECAY: f64 = 0.8;
/// Most prices that are tried for a placement of knots. Count.
/// Derived: the prices span a factor of 0.8^-14 = 23, from the highest first price of 31 variances down to 1.4.
const MAX_PLACEMENT_TRIALS: usize = 15;
/// Failed removals in a row that end the removal of single knots of noisy points or of a large net. Count.
/// Trial: not recorded. Knots are tried in the order of their use, so that later ones are less likely to be removable.
const MAX_FAILED_REMOVALS: usize = 10;
/// Most knots that are removed in one trial; where that fails half of them are tried. Count.
/// Guard: bounds the fits that a failed batch wastes.
const MAX_REMOVAL_BATCH: usize = 16;
/// Divisor of the number of knots that gives the size of the first batch. Dimensionless.
/// Trial: not recorded.
const FIRST_BATCH_DIVISOR: usize = 8;
/// Single knots whose removal is tried at the same time, each from the same state. Count.
/// Guard: two cores share them; fixed, so that the result does not depend on the number of threads.
const PARALLEL_REMOVALS: usize = 2;
/// Control points above which the removal from exact points, too, ends after [`MAX_FAILED_REMOVALS`]. Count.
/// Guard: bounds the time, one fit for each knot.
const EXHAUSTIVE_REMOVAL_SIZE: usize = 2000;

/// Bounds for a surface with fewer knots.
pub(super) struct Limit {
    measure: Measure,
    /// Largest allowed scores of single cells and of windows.
    allowed: [f64; 2],
    /// Largest number of points or regions that a verdict may object to.
    shortfall: usize,
    /// Variances by which the sum of squares may rise per removed control point.
    refund: f64,
}

/// Whether the tolerance is so wide that noise leaves all points within it.
fn all_within(measure: &Measure) -> bool {
    measure.tolerance >= ALL_WITHIN * measure.sigma
}

/// The refund, in variances, for `noise` in tolerances and `per_point` control points per point.
fn refund(noise: f64, per_point: f64) -> f64 {
    let variance = noise * noise * per_point;
    let share = (variance / SATURATION_VARIANCE)
        .min(1.0)
        .powi(REFUND_VARIANCE_POWER);
    let largest =
        (REFUND_AT_HALF_TOLERANCE * (2.0 * noise).powi(REFUND_NOISE_POWER)).min(MAX_REFUND);
    let negligible = (NEGLIGIBLE_RMS * NEGLIGIBLE_RMS / variance).min(MAX_NEGLIGIBLE_REFUND);
    (largest * share).max(negligible).max(MIN_REFUND)
}

impl Problem<'_> {
    /// Removes knots as long as the surface stays within its [`Limit`]. For noisy points, fewer knots are placed anew.
    /// For exact points, or if that fails, the spans are first respaced with the same density, which undoes the
    /// repeated halving; then single knots are removed, the least used first.
    pub(super) fn remove(&self, state: State, breaks: &mut [Vec<f64>; 2]) -> Result<State> {
        let limit = self.limit(&state);
        if self.criterion == Criterion::Bias
            && let Some((fewer, state)) = self.replace(&state, &limit)?
        {
            *breaks = fewer;
            return Ok(state);
        }
        let state = self.respace(state, breaks, &limit)?;
        self.thin_out(state, breaks, &limit)
    }

    /// The limit: scores of single cells, and the objections of a verdict, may rise to the allowed value or stay at the
    /// present one, whichever is worse; scores of windows may double where the tolerance is met.
    pub(super) fn limit(&self, state: &State) -> Limit {
        let measure = self.measure(state);
        let worst = self.worst(state, &measure).map(|w| w.max(1.0));
        let shortfall = self.shortfall(state, &measure);
        let may_fall_short = match all_within(&measure) {
            true => MAX_SHARE_BEYOND * self.samples.measured() as f64,
            false => 0.0,
        };
        // A missed tolerance leaves no room.
        let missed = worst[0] > 1.0 || shortfall as f64 > may_fall_short;
        let (leeway, refund) = if missed {
            (1.0, MIN_REFUND)
        } else {
            (WINDOW_LEEWAY, self.refund(state, &measure))
        };
        Limit {
            measure,
            allowed: [worst[0], leeway * worst[1]],
            shortfall,
            refund,
        }
    }

    /// Number of objections that a verdict would have: points beyond the tolerance or, where noise alone puts some of
    /// them there, biased regions.
    fn shortfall(&self, state: &State, measure: &Measure) -> usize {
        let (tolerance, sigma) = (measure.tolerance, measure.sigma);
        let weights = &state.judgement.weights;
        let counts = |k: &usize| !self.samples.is_support(*k) && weights[*k] > OUTLIER_WEIGHT;
        let residuals = (0..state.residuals.len()).filter(counts);
        if all_within(measure) {
            let beyond = |k: &usize| state.residuals[*k].distance > tolerance;
            return residuals.filter(beyond).count();
        }
        let placed: Vec<Placed> = residuals
            .map(|k| {
                let residual = &state.residuals[k];
                Placed {
                    face: 0,
                    u: residual.foot.x,
                    v: residual.foot.y,
                    signed: residual.distance.copysign(residual.signed),
                }
            })
            .collect();
        bias(&placed, Allowed::in_fits(tolerance, sigma)).biased
    }

    /// The refund of a removed control point, in variances of the noise. It depends on how well the points determine
    /// the surface: with N control points through M points the mean variance of the surface is sigma^2 N / M.
    ///
    /// Where noise puts points beyond the tolerance, and the variance of the surface is a good part of it, an error
    /// below the noise buys a fairer surface with fewer control points. Where this variance is negligible, an error of
    /// a hundredth of the tolerance does the same. In between, control points stay as long as they bring the surface
    /// closer to the truth.
    fn refund(&self, state: &State, measure: &Measure) -> f64 {
        let per_point = state.fit.space.size() as f64 / self.samples.measured().max(1) as f64;
        refund(measure.sigma / measure.tolerance, per_point)
    }

    fn worst(&self, state: &State, measure: &Measure) -> [f64; 2] {
        let strips = self.strips(state);
        let single = strips.each_ref().map(|s| measure.marks(s).worst);
        let pooled = strips.each_ref().map(|s| measure.pooled_marks(s).worst);
        [single[0].max(single[1]), pooled[0].max(pooled[1])]
    }

    /// Whether the candidate, with fewer control points, is as good as the state.
    fn suffices(&self, state: &State, candidate: &State, limit: &Limit) -> bool {
        let Limit {
            measure,
            allowed,
            shortfall,
            refund,
        } = limit;
        let saved = state.fit.space.size() as f64 - candidate.fit.space.size() as f64;
        let weights = &state.judgement.weights;
        let rise = measure.objective(&candidate.residuals, weights)
            - measure.objective(&state.residuals, weights);
        let cheap = match self.criterion {
            // The tolerance is missed somewhere; the candidate must not miss it elsewhere.
            Criterion::Maximum if allowed[0] > 1.0 => rise <= 0.0,
            Criterion::Bias => rise <= refund * saved * measure.sigma * measure.sigma,
            Criterion::Maximum => true,
        };
        if !cheap {
            return false;
        }
        let worst = self.worst(candidate, measure);
        let enough = worst[0] <= allowed[0] && worst[1] <= allowed[1];
        let biased = self.criterion == Criterion::Bias;
        enough && (!biased || self.shortfall(candidate, measure) <= *shortfall)
    }

    /// Fewer knots at better places, computed from the present dense surface: the numbers along u and v that minimise
    /// error plus price of the control points. The price falls from trial to trial until the points agree.
    fn replace(&self, state: &State, limit: &Limit) -> Result<Option<([Vec<f64>; 2], State)>> {
        let closed = self.topology.closed();
        // Both directions are needed for a choice.
        if state
            .fit
            .space
            .breaks
            .iter()
            .any(|b| b.len() - 1 > MAX_PLACED_SPANS)
        {
            return Ok(None);
        }
        let variance = limit.measure.sigma.powi(2) / self.samples.measured().max(1) as f64;
        let size = state.fit.space.size() as f64;
        let first_price = MIN_FIRST_PRICE.max(FIRST_PRICE_IN_REFUNDS * limit.refund);
        let bound = first_price * size * variance;
        let choices = each(2, |d| {
            let fewest = fewest_breaks(self.degree[d], closed[d]);
            placed(&state.fit, self.samples, d, fewest, bound)
        });
        let mut lists = Vec::new();
        for choice in choices {
            lists.push(choice?);
        }
        self.progress.check()?;
        let [along, across] = lists.as_slice() else {
            return Ok(None);
        };
        let mut before = None;
        let mut price = first_price / PRICE_DECAY;
        for _ in 0..MAX_PLACEMENT_TRIALS {
            price *= PRICE_DECAY;
            let mut best: Option<(f64, usize, usize)> = None;
            for (i, x) in along.iter().enumerate() {
                for (j, y) in across.iter().enumerate() {
                    let count = self.counts(&[&x.breaks, &y.breaks]) as f64;
                    let cost = (x.error + y.error) / variance + price * count;
                    if best.is_none_or(|b| cost < b.0) {
                        best = Some((cost, i, j));
                    }
                }
            }
            let Some((_, i, j)) = best.filter(|b| (b.1, b.2) != (0, 0)) else {
                break;
            };
            if before == Some((i, j)) {
                continue;
            }
            before = Some((i, j));
            let trial = [along[i].breaks.clone(), across[j].breaks.clone()];
            let candidate = self.thinner(state, &trial)?;
            if self.suffices(state, &candidate, limit) {
                return Ok(Some((trial, candidate)));
            }
        }
        Ok(None)
    }

    /// The fewest spans, between half of the present number and all of them, with the present density, direction by
    /// direction.
    pub(super) fn respace(
        &self,
        mut state: State,
        breaks: &mut [Vec<f64>; 2],
        limit: &Limit,
    ) -> Result<State> {
        let closed = self.topology.closed();
        for d in 0..2 {
            let spans = breaks[d].len() - 1;
            let (mut fewest, mut enough) = (
                spans
                    .div_ceil(2)
                    .max(fewest_breaks(self.degree[d], closed[d]) - 1),
                spans,
            );
            let dense = breaks[d].clone();
            let mut best = None;
            while fewest < enough {
                let tried = fewest.midpoint(enough);
                let mut trial = breaks.clone();
                trial[d] = respaced(&dense, tried);
                let candidate = self.thinner(&state, &trial)?;
                if self.suffices(&state, &candidate, limit) {
                    enough = tried;
                    best = Some((trial, candidate));
                } else {
                    fewest = tried + 1;
                }
            }
            if let Some((trial, candidate)) = best {
                (*breaks, state) = (trial, candidate);
            }
        }
        Ok(state)
    }

    fn thin_out(
        &self,
        mut state: State,
        breaks: &mut [Vec<f64>; 2],
        limit: &Limit,
    ) -> Result<State> {
        let closed = self.topology.closed();
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
        let mut batch = (knots.len() / FIRST_BATCH_DIVISOR).clamp(1, MAX_REMOVAL_BATCH);
        let mut next = 0;
        while next < knots.len() {
            // Removals of single knots are tried in parallel from the same state, since most of them fail.
            let ahead = if batch == 1 { PARALLEL_REMOVALS } else { 1 };
            let groups: Vec<_> = knots[next..].chunks(batch).take(ahead).collect();
            let tried = each(groups.len(), |k| {
                let mut trial = breaks.clone();
                for &(_, d, place) in groups[k] {
                    if trial[d].len() > fewest_breaks(self.degree[d], closed[d]) {
                        trial[d].retain(|b| b.total_cmp(&place).is_ne());
                    }
                }
                let candidate = self.thinner(&state, &trial)?;
                let good = self.suffices(&state, &candidate, limit);
                Ok(good.then_some((trial, candidate)))
            });
            for (group, tried) in groups.into_iter().zip(tried) {
                if let Some(better) = tried? {
                    (*breaks, state) = better;
                    next += group.len();
                    failures = 0;
                    break;
                }
                if group.len() > 1 {
                    batch = group.len() / 2;
                    break;
                }
                next += 1;
                failures += 1;
                let many = state.fit.space.size() > EXHAUSTIVE_REMOVAL_SIZE;
                if failures == MAX_FAILED_REMOVALS && (many || self.criterion == Criterion::Bias) {
                    return Ok(state);
                }
            }
        }
        Ok(state)
    }

    /// The fit on fewer breakpoints, with unchanged weights.
    fn thinner(&self, state: &State, breaks: &[Vec<f64>; 2]) -> Result<State> {
        let (fit, equation_residual, calm, residuals) =
            self.fit(breaks, &state.judgement.weights, state.calm)?;
        Ok(State {
            fit,
            equation_residual,
            calm,
            residuals,
            judgement: state.judgement.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_points_stay_where_they_tell_something() {
        // A tolerance of three sigma: ten thousand points, where the expected error is nearly least, a hundred
        // thousand, ten million.
        let third = 1.0 / 3.0;
        assert!(refund(third, 0.03) < 1.25 * MIN_REFUND);
        assert!((refund(third, 0.005) - MIN_REFUND).abs() < 1e-12);
        assert!((refund(third, 1e-4) - MAX_NEGLIGIBLE_REFUND).abs() < 1e-12);
        // A million: all together cost what is negligible.
        let (noise, per_point) = (third, 6e-4);
        let worth = refund(noise, per_point) * noise * noise * per_point;
        assert!((worth.sqrt() - NEGLIGIBLE_RMS).abs() < 1e-12);
        // Where noise alone takes points beyond the tolerance; and where there is none.
        assert!((refund(0.5, 0.01) - REFUND_AT_HALF_TOLERANCE).abs() < 1e-12);
        assert!((refund(0.6, 0.01) - MAX_REFUND).abs() < 1e-12);
        assert!(refund(0.0, 0.01).is_finite());
    }
}
