//! Knots that are not needed are taken out again.

use super::adapt::{Criterion, Measure, OUTLIER_WEIGHT, fewest_breaks, knot_use, respaced};
use super::knot_placement::{MOST_SPANS, placed};
use super::problem::{Problem, State};
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::bias::{ALL_WITHIN, Allowed, Placed, bias};
use nurbskin_geometry::numeric::parallel::each;

/// Variances by which the sum of squares may rise per control point taken out, see [`Problem::refund`]: where the noise is half
/// of the tolerance, and falling with this power of its share. By trial on the pot of docs/scattered.md, which has that share:
/// some 18 variances leave 135 control points, 7 leave 170. At a third, what fits aim at where noise sets their aim, hardly more
/// than [`SMALLEST_REFUND`] is left.
const FIRM_REFUND: f64 = 16.4;
/// The power of the share with which the refund falls: with it a third of the tolerance keeps 13 % of what half of it has.
const SOFTER: i32 = 5;
/// The largest.
const LARGEST_REFUND: f64 = 19.2;
/// Twice the variance that a control point takes in: with that the expected error is least (C. L. Mallows, Some comments on
/// `C_p`, 1973). Less than the price of a control point, so that local errors do not come back.
const SMALLEST_REFUND: f64 = 2.0;
/// Variance of the surface, in squares of the tolerance, from which on the refund is the largest; below it falls with that
/// power.
const NOISY: f64 = 0.0013;
const FALL: i32 = 3;
/// Root mean square error, in tolerances, that all control points together may be worth where the points know the surface far
/// better than that.
const NEGLIGIBLE: f64 = 0.017;
/// Largest refund for that.
const MOST_NEGLIGIBLE: f64 = 12.0;
/// Windows of cells may become so many times as bad as they are or may be.
const LEEWAY: f64 = 2.0;
/// Part of the points that may lie beyond a tolerance that is met.
const MISSED: f64 = 0.002;
/// Variances that a control point costs where numbers of knots are chosen by what the surface tells, at first, at least and
/// in refunds; that much less each time the points disagree; and so often.
const FIRST_PRICE: f64 = 6.0;
const FIRST_REFUNDS: f64 = 1.6;
const CHEAPER: f64 = 0.8;
const TRIALS: usize = 15;
/// So many knots in a row that cannot be taken out end the search.
const FAILURES: usize = 10;
/// Knots that are taken out together, at most; where that does not do, half of them are tried.
const LARGEST_BATCH: usize = 16;
/// Knots whose removal is tried at once, each alone.
const AHEAD: usize = 2;
/// A net so large is not searched to the last knot.
const MANY: usize = 2000;

/// How bad a surface with fewer knots may be.
pub(super) struct Limit {
    measure: Measure,
    /// Worst scores of single cells and of windows.
    allowed: [f64; 2],
    /// What may count against it.
    shortfall: usize,
    /// Variances by which the sum of squares may rise per control point taken out.
    refund: f64,
}

/// Whether noise takes no point beyond the tolerance.
fn all_within(measure: &Measure) -> bool {
    measure.tolerance >= ALL_WITHIN * measure.sigma
}

/// The refund for noise in tolerances and so many control points per point.
fn refund(noise: f64, per_point: f64) -> f64 {
    let variance = noise * noise * per_point;
    let share = (variance / NOISY).min(1.0).powi(FALL);
    let largest = (FIRM_REFUND * (2.0 * noise).powi(SOFTER)).min(LARGEST_REFUND);
    let negligible = (NEGLIGIBLE * NEGLIGIBLE / variance).min(MOST_NEGLIGIBLE);
    (largest * share).max(negligible).max(SMALLEST_REFUND)
}

impl Problem<'_> {
    /// Takes out knots as long as the surface stays within its [`Limit`]. Where points have noise, by putting fewer on better
    /// places; else, or if that fails, first by spacing them anew with the same density, which undoes that spans are only
    /// ever halved, then one by one, the least used first.
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

    /// The surface may become as bad as it may be, or as it is, whichever is worse, by single cells and by what a verdict
    /// counts; windows of cells twice as bad where the tolerance is met.
    pub(super) fn limit(&self, state: &State) -> Limit {
        let measure = self.measure(state);
        let worst = self.worst(state, &measure).map(|w| w.max(1.0));
        let shortfall = self.shortfall(state, &measure);
        let may_fall_short = match all_within(&measure) {
            true => MISSED * self.samples.measured() as f64,
            false => 0.0,
        };
        // A tolerance that is missed leaves nothing to give.
        let missed = worst[0] > 1.0 || shortfall as f64 > may_fall_short;
        let (leeway, refund) = if missed {
            (1.0, SMALLEST_REFUND)
        } else {
            (LEEWAY, self.refund(state, &measure))
        };
        Limit {
            measure,
            allowed: [worst[0], leeway * worst[1]],
            shortfall,
            refund,
        }
    }

    /// What a verdict on the points would hold against the surface: points beyond the tolerance, or, where noise alone takes
    /// some of them there, regions that are biased.
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

    /// What a control point taken out may cost, in variances of the noise. It depends on how well the points know the surface:
    /// with N control points through M points its mean variance is sigma^2 N / M.
    ///
    /// Where noise is so wide that it takes points beyond the tolerance, and the variance is a good part of it, an error that
    /// stays below the noise buys a fairer surface with fewer control points. Where the variance is next to nothing, an error of
    /// a hundredth of the tolerance does the same. In between control points stay as long as they bring the surface closer
    /// to the truth.
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
            // The tolerance is missed somewhere; that is no licence to miss it elsewhere.
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

    /// Fewer knots on better places, by what a surface with too many tells: the numbers along u and v that cost least,
    /// control points and error taken together; with less weight on control points where the points disagree.
    fn replace(&self, state: &State, limit: &Limit) -> Result<Option<([Vec<f64>; 2], State)>> {
        let closed = self.topology.closed();
        // One direction alone is not enough to choose from.
        if state
            .fit
            .space
            .breaks
            .iter()
            .any(|b| b.len() - 1 > MOST_SPANS)
        {
            return Ok(None);
        }
        let variance = limit.measure.sigma.powi(2) / self.samples.measured().max(1) as f64;
        let size = state.fit.space.size() as f64;
        let first_price = FIRST_PRICE.max(FIRST_REFUNDS * limit.refund);
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
        let mut price = first_price / CHEAPER;
        for _ in 0..TRIALS {
            price *= CHEAPER;
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

    /// The fewest spans between half of them and all, spaced with the density that they have, direction by direction.
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
        let mut batch = (knots.len() / 8).clamp(1, LARGEST_BATCH);
        let mut next = 0;
        while next < knots.len() {
            // Single knots are tried ahead of what becomes of those before, as most stay.
            let ahead = if batch == 1 { AHEAD } else { 1 };
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
                let many = state.fit.space.size() > MANY;
                if failures == FAILURES && (many || self.criterion == Criterion::Bias) {
                    return Ok(state);
                }
            }
        }
        Ok(state)
    }

    /// The fit on fewer breakpoints, with the weights as they are.
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
        // A tolerance of three sigma: ten thousand points, where the expected error is nearly least, a hundred thousand, ten
        // million.
        let third = 1.0 / 3.0;
        assert!(refund(third, 0.03) < 1.25 * SMALLEST_REFUND);
        assert!((refund(third, 0.005) - SMALLEST_REFUND).abs() < 1e-12);
        assert!((refund(third, 1e-4) - MOST_NEGLIGIBLE).abs() < 1e-12);
        // A million: all together cost what is negligible.
        let (noise, per_point) = (third, 6e-4);
        let worth = refund(noise, per_point) * noise * noise * per_point;
        assert!((worth.sqrt() - NEGLIGIBLE).abs() < 1e-12);
        // Where noise alone takes points beyond the tolerance; and where there is none.
        assert!((refund(0.5, 0.01) - FIRM_REFUND).abs() < 1e-12);
        assert!((refund(0.6, 0.01) - LARGEST_REFUND).abs() < 1e-12);
        assert!(refund(0.0, 0.01).is_finite());
    }
}
