//! The order of steps of a fit.
//!
//! ```text
//! start ─▶ relax ─▶ follow the points ─▶ (knots, 2 steps) until within tolerance ─▶ finish: jumps weigh more ─▶ Fitted
//! ```
//!
//! `adapt` repeats the first two over layouts with smaller faces where the shape asks for them.
//!
//! Many points are thinned until the end; knots that only all of them ask for are added there. Source: ours, docs/network.md.

use super::lines::LineSamples;
use super::network::number;
use super::refine::{Limits, refine};
use super::state::{Fit, SOFTER, Weights, thinned};
use super::{FitOptions, Target};
use crate::layout::Layout;
use nurbskin_geometry::numeric::bias::{Allowed, LEAST_TOLD};
use nurbskin_geometry::numeric::statistics::normal_tail;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result};
use std::ops::Range;

/// Weights while the layout relaxes; bending and evenness decay with each step.
/// Trial: on the six scans of docs/network.md. With an evenness of 0.03 and no decay a head has
/// 312 faces of which 9 fold, for 266 and 7.
const RELAX: Weights = Weights {
    bending: 0.1,
    even: 1.0,
    jump: 1e-2,
    gluing: 1e-3,
    stars: 1e-3,
    per_span: 2,
    along_normals: false,
};
/// Weights while knots are added.
/// Trial: as above. Without evenness aorta folds, with ten times as much banana takes a third more control points.
const REFINE: Weights = Weights {
    bending: 1e-3,
    even: 1e-2,
    jump: 1e-2,
    gluing: 3e-4,
    stars: 3e-4,
    per_span: 2,
    along_normals: false,
};
/// Weights at the end.
/// Trial: as above.
const FINISH: Weights = Weights {
    bending: 1e-3,
    even: 3e-2,
    jump: 1e-1,
    gluing: 1e-4,
    stars: 1e-4,
    per_span: 4,
    along_normals: false,
};
/// Factor of bending from one of these steps to the next. Dimensionless.
/// Trial: as above; not varied.
const BENDING_DECAY: f64 = 0.5;
/// The same of evenness. Trial: 0.6, 0.7 and 1 on head, bunny, fandisk and aorta: with 0.7 and 1 there are more faces.
const EVEN_DECAY: f64 = 0.6;
/// Steps of the parts of the schedule. Counts.
/// Trial: as above.
const RELAX_STEPS: usize = 8;
/// Trial: with 1 in the rounds that add at most 3 %, a face and a head intersect themselves that do not with 2.
const STEPS_PER_ROUND: usize = 2;
/// Trial: 6 on banana, aorta, bottle, fandisk and bunny gives the same control points, and jumps a sixth smaller at most.
const FINISH_STEPS: usize = 4;
/// The first of these move all unknowns all ways, the others along the normals where no face is stiff. Count.
/// Trial: on aorta, bottle and bunny: jumps and control points stay as they are, bunny takes 16 s for 27. With one way in the second
/// step of each round bunny has 16 147 control points for 14 500, with one way in all steps 18 476.
const FREE_STEPS: usize = 2;
/// More of the last steps while a face folds or an edge jumps. Count.
/// Guard: by then the fairness of such a face has grown a hundredfold.
const UNFOLD_STEPS: usize = 6;
/// Quantile of the distances from which on a foot is sought all over while the network relaxes.
/// Trial: not recorded; feet that lag behind are among the farthest.
const DOUBTFUL: f64 = 0.98;
/// Most rounds of refinement. Count.
/// Guard: bounds the time. The last [`WHOLE_ROUNDS`] of them halve all spans that are too wide.
const MOST_ROUNDS: usize = 12;
/// Share of the points beyond the tolerance, of that before a round, above which a round gains too little to go on.
/// Trial: not recorded.
const STALLED: f64 = 0.8;
/// Control points that a round adds, as a share of all, up to which it may have stalled.
/// Trial: not recorded.
const FEW_MORE: f64 = 0.03;
/// Once enough points are within the tolerance, the share of the others that a round may leave outside for a further one to pay.
/// Dimensionless. Trial: on the six scans of docs/network.md.
const PAYS: f64 = 0.6;
/// The control points that such a round may add, as a share of those before it. Dimensionless. Trial: as [`PAYS`].
const COSTS: f64 = 0.1;
/// Share of the points of a noisy scan that may be outliers.
/// Derived: the share that a tolerance leaves out by default.
const OUTLIERS: f64 = 0.005;
/// Largest weight of a point near the tolerance or beyond it, and the ratio of the tolerance to the distance from which on a
/// weight grows.
/// Trial: on banana, bunny and fandisk. Source: C. Lawson's algorithm for the least maximum.
const MOST_LAWSON: f64 = 16.0;
const LAWSON_FROM: f64 = 1.2;
/// Share of the points beyond the tolerance below which these pull harder while knots are added.
/// Trial: 0, 0.02, 0.1, 0.3 and 1 on banana, aorta, bottle, fandisk and bunny. With 0 the bottle takes 3788 control points, with
/// 0.1 3632, with 0.3 3493, always within for at least 99.98 %; with 1 bunny takes 7 % more than with 0.3.
const PULL_FROM: f64 = 0.3;
/// Part of the distance of 98 % of the points that makes a cell ask for knots, in the first rounds. Dimensionless.
/// Trial: 0.5 and 0.25, 0.8 and 0.4, 1 and 0.5 on the scans above, a drill, a mug and a double torus. With the first aorta takes 3463
/// control points, with the second 2881, all within; with the third 2663, and a jump of 0.56 degrees for 0.12.
const COARSE_PART: f64 = 0.8;
/// The same part in the rounds after them. Dimensionless. Trial: as [`COARSE_PART`].
const FINE_PART: f64 = 0.4;
/// Where no tolerance was requested, the last rounds add knots for the farthest points, this many times as many as are still missing:
/// the surface comes closer to those around them, too. Dimensionless.
/// Trial: with 4, 2, 1, 0.5, 0.25 and 0.12 a bunny takes 12 227, 11 789, 9873, 8361, 7335 and 6781 control points, with 4, 1, 0.5 and 0.25
/// a can 4956, 4550, 4924 and 4677; a bust, a vessel and a bottle gain 4, 2 and 0 %. The less, the more rounds.
const LAST_POINTS: f64 = 0.25;
/// Last rounds of refinement, which add knots for all points beyond the aim. Count.
/// Guard: with rounds for a part of these points the fit might run out of rounds.
const WHOLE_ROUNDS: usize = 4;
/// Rounds that count as the first. Count. Trial: not varied.
const COARSE_ROUNDS: usize = 3;
/// Points that are fitted until the end, where there are more. Count.
/// Trial: not recorded; some 60 for each control point of a face.
const MOST_POINTS: usize = 60_000;
/// Steps over all points at the end, where they were thinned. Count.
/// Trial: not recorded.
const LAST_STEPS: usize = 3;
/// Noise, as a share of the tolerance, from which on cells are judged by their mean, too.
/// Trial: as `NOISE_SHARE` of single surfaces. With 0.3 a double torus of a million points, whose noise is 0.25 tolerances, had 48
/// biased regions.
const NOISY: f64 = 0.1;
/// The same where no tolerance was requested. Dimensionless.
/// Derived: an aim that noise sets is three times the noise, a ratio of 1/3; a tenth less leaves room for parts whose noise differs.
const NOISY_AIM: f64 = 0.3;

/// Fits a relaxed network to the points.
pub(super) fn run(fit: &mut Fit, target: &Target, options: &FitOptions) -> Result<()> {
    let tolerance = options.tolerance;
    let some = thinned(target.points, MOST_POINTS);
    fit.follow(target, &some);
    let pulls = pulls_harder(target, tolerance);
    refined(fit, target, options, SOFTER, 0..MOST_ROUNDS)?;
    for step in 0..FINISH_STEPS + UNFOLD_STEPS {
        let bad = finish(fit, tolerance, pulls, step)?;
        if step + 1 >= FINISH_STEPS && !bad {
            break;
        }
    }
    if some.len() < target.points.len() {
        let all: Vec<u32> = (0..number(target.points.len())).collect();
        fit.follow(target, &all);
        // The first rounds are long over.
        let options = FitOptions {
            most_folding: 1.0,
            ..*options
        };
        // A face that was bad once stays stiff.
        refined(fit, target, &options, 1.0, 0..MOST_ROUNDS)?;
        for _ in 0..LAST_STEPS {
            finish(fit, tolerance, pulls, FINISH_STEPS)?;
        }
    }
    fit.finish_feet(tolerance);
    Ok(())
}

/// Further steps like the last ones, after weights have changed.
pub(super) fn resumed(
    fit: &mut Fit,
    target: &Target,
    options: &FitOptions,
    steps: usize,
) -> Result<()> {
    let tolerance = options.tolerance;
    let pulls = pulls_harder(target, tolerance);
    for _ in 0..steps {
        finish(fit, tolerance, pulls, FINISH_STEPS)?;
    }
    fit.finish_feet(tolerance);
    Ok(())
}

/// One more round of refinement and further steps like the last ones, in which the points beyond the tolerance pull harder. Points whose
/// weight is less than `at_first` get no knots; as many more of the other points must be within the tolerance as there are such points
/// beyond it. Returns false where these are more than may miss it; the fit is of no use then.
pub(super) fn closer(
    fit: &mut Fit,
    target: &Target,
    options: &FitOptions,
    at_first: &[f64],
) -> Result<bool> {
    let excused = fit.excuse(at_first, options.tolerance);
    if excused > 1.0 - options.share_within {
        return Ok(false);
    }
    let options = FitOptions {
        share_within: options.share_within + excused,
        most_folding: 1.0,
        ..*options
    };
    refined(fit, target, &options, 1.0, MOST_ROUNDS - 1..MOST_ROUNDS)?;
    resumed(fit, target, &options, LAST_STEPS)?;
    Ok(true)
}

/// Whether points near the tolerance or beyond it pull harder: not where noise leaves no decision on the tolerance.
fn pulls_harder(target: &Target, tolerance: f64) -> bool {
    tolerance >= LEAST_TOLD * target.noise
}

/// Whether cells are judged by the mean of their points.
fn is_noisy(target: &Target, options: &FitOptions) -> bool {
    let share = if options.requested { NOISY } else { NOISY_AIM };
    target.noise > share * options.tolerance
}

/// A network relaxed over the mesh of the target.
///
/// # Errors
/// [`Error::Invalid`] for a layout of another mesh; [`Error::NoSolution`]; [`Error::Cancelled`].
pub(super) fn relaxed<'a>(
    target: &Target<'a>,
    layout: &Layout,
    tolerance: f64,
    progress: &'a dyn Progress,
) -> Result<Fit<'a>> {
    if layout.start.len() != target.mesh.points.len() {
        return Err(Error::invalid(
            "the layout must have a place for each vertex of the mesh",
        ));
    }
    let mut fit = Fit::start(target, layout, progress)?;
    let mut weights = RELAX;
    for _ in 0..RELAX_STEPS {
        let limit = fit.quantile(DOUBTFUL);
        fit.step(&weights, limit)?;
        fit.judge_free_faces();
        weights.even *= EVEN_DECAY;
        weights.bending *= BENDING_DECAY;
    }
    fit.say("relaxed", tolerance);
    Ok(fit)
}

/// One round of refinement of a relaxed network.
///
/// # Errors
/// [`Error::NoSolution`] where more faces fold or jump after it than the options allow; [`Error::Cancelled`].
pub(super) fn first_round(mut fit: Fit, target: &Target, options: &FitOptions) -> Result<()> {
    let some = thinned(target.points, MOST_POINTS);
    fit.follow(target, &some);
    refined(&mut fit, target, options, SOFTER, 0..1)
}

/// Adds knots until the points are within the tolerance, or the `rounds`, counted from the first one, are over. The fairness of good faces is
/// multiplied by `softer`.
fn refined(
    fit: &mut Fit,
    target: &Target,
    options: &FitOptions,
    softer: f64,
    rounds: Range<usize>,
) -> Result<()> {
    let tolerance = options.tolerance;
    let noisy = is_noisy(target, options);
    let pulls = pulls_harder(target, tolerance);
    let count = target.points.len();
    let allowed = Allowed::in_verdicts(tolerance, target.noise, options.share_within, count);
    let mut before = (f64::INFINITY, 0);
    // Whether the last round added knots for some of the points beyond an aim only, and whether that is of no use.
    let (mut is_partial, mut all) = (false, false);
    for round in rounds {
        let beyond = fit.beyond(tolerance);
        let within = beyond <= 1.0 - options.share_within;
        // If more points lie beyond the tolerance than noise explains, the surface lacks shape there.
        let explained = 1.0 - options.share_within + 2.0 * normal_tail(tolerance / target.noise);
        let by_means = noisy && beyond <= explained;
        let count = fit.network.control_points();
        // The first round beyond the share is tried.
        let pays = options.beyond_share
            && within
            && beyond > 0.0
            && (before.0 > 1.0 - options.share_within
                || beyond <= PAYS * before.0
                    && (count - before.1) as f64 <= COSTS * before.1 as f64);
        let met = !noisy && within && !pays;
        let few = (count - before.1) as f64 <= FEW_MORE * count as f64;
        // The share that may lie beyond an aim is no work to do.
        let outside = match options.requested {
            true => 0.0,
            false => 1.0 - options.share_within,
        };
        let stalled = !by_means && few && beyond - outside > STALLED * (before.0 - outside);
        all |= stalled && is_partial || round + WHOLE_ROUNDS >= MOST_ROUNDS;
        if met || stalled && !is_partial || count >= options.max_control_points {
            break;
        }
        before = (beyond, count);
        let part = if round < COARSE_ROUNDS {
            COARSE_PART
        } else {
            FINE_PART
        };
        // All cells with a point beyond an aim would be twice as many as the last few points need.
        let missing = beyond - (1.0 - options.share_within);
        let last = match !options.requested && !by_means && missing > 0.0 && !all {
            true => fit.quantile((1.0 - LAST_POINTS * missing).max(0.0)),
            false => 0.0,
        };
        let limit = match by_means {
            true => tolerance,
            false => tolerance.max(part * fit.quantile(0.98)),
        };
        let mut added = 0;
        is_partial = false;
        // The farthest points may be where no knot can be added.
        for distance in [limit.max(last), limit] {
            let limits = Limits {
                distance,
                tolerance,
                noise: by_means.then_some(target.noise),
                outliers: if pays { 0.0 } else { OUTLIERS },
                offset: allowed.offset,
                diagonal: fit.diagonal,
                control_points: options.max_control_points,
            };
            if added == 0 {
                let lines: &LineSamples = &fit.lines;
                added = refine(&mut fit.network, &fit.samples, fit.counted, lines, &limits)?;
                is_partial = distance > limit;
            }
        }
        if added == 0 {
            break;
        }
        fit.knots_changed();
        fit.judge_faces(softer);
        // Biased regions lack control points, not better parameters.
        let weights = Weights {
            along_normals: within,
            ..REFINE
        };
        for _ in 0..STEPS_PER_ROUND {
            if pulls && beyond < PULL_FROM {
                pull_harder(fit, tolerance);
            }
            fit.step(&weights, tolerance)?;
        }
        let bad = fit.judge_faces(softer);
        fit.say("refined", tolerance);
        let folding = bad.iter().filter(|bad| **bad).count();
        if round == 0 && folding as f64 > options.most_folding * bad.len() as f64 {
            return Err(Error::NoSolution(format!(
                "{folding} of {} faces fold or jump after the first round",
                bad.len()
            )));
        }
    }
    Ok(())
}

/// One of the last steps: jumps weigh more, and points out of tolerance pull harder. Returns whether a face is bad.
fn finish(fit: &mut Fit, tolerance: f64, pulls: bool, step: usize) -> Result<bool> {
    if pulls {
        pull_harder(fit, tolerance);
    }
    let mut weights = FINISH;
    weights.along_normals = step >= FREE_STEPS;
    if step == 0 {
        weights.jump *= 0.3;
    }
    fit.step(&weights, tolerance)?;
    // A face that was bad once stays stiff.
    let bad = fit.judge_faces(1.0);
    fit.say("smoothed", tolerance);
    Ok(bad.contains(&true))
}

/// Points near the tolerance or beyond it pull harder, the more often the harder.
fn pull_harder(fit: &mut Fit, tolerance: f64) {
    let counted = fit.counted;
    let samples = &mut fit.samples;
    let rows = samples.weights.iter_mut().zip(&samples.distances);
    for ((weight, distance), own) in rows.zip(&fit.weights).take(counted) {
        let pull = LAWSON_FROM * distance / tolerance;
        *weight = (*weight * pull * pull).clamp(*own, MOST_LAWSON * own);
    }
}
