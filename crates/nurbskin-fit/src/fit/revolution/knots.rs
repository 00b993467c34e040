//! Knots of the profile: as few as the points allow.
//!
//! ```text
//! noise:  score = max over cells of |mean e| / (0.2 T + 3.5 σ / √n),   and rms ≤ 0.05 T for the whole profile
//! exact:  score = max |e| / (0.95 T)
//! ```
//!
//! Spans with scores above 1 are halved until none is left. Then knots move to where they lower the sum of squares
//! most, and those that are not needed are removed, in turn. Ours.

use super::data::Fit;
use crate::chart::revolution::{ProfileCurve, ProfileEnd, Target};
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result};

/// Mean offset of a cell of noisy points that is allowed beyond noise, in tolerances.
/// Derived: as in the approximation.
const MEAN_BIAS_SHARE: f64 = 0.2;
/// Standard errors of the mean that are allowed besides.
/// Derived: as in the approximation.
const MEAN_BIAS_ERRORS: f64 = 3.5;
/// Fewest cells per span. Count.
/// Derived: three, so that an error that changes its sign within the span does not average out.
const MIN_CELLS_PER_SPAN: usize = 3;
/// Most cells per span. Count.
/// Guard: bounds the memory.
const MAX_CELLS_PER_SPAN: f64 = 500.0;
/// Least weight of a cell, in points, whose mean is judged.
/// Derived: as in the approximation.
const MIN_CELL_WEIGHT: f64 = 5.0;
/// Root mean square error of the whole profile of noisy points, in tolerances.
/// Trial: on the simulated pot; against 0.06 the largest error fell from 0.085 to 0.081 mm over 20 seeds with the same
/// 126 control points.
const PROFILE_RMS_SHARE: f64 = 0.05;
/// Standard deviations by which the sum of squares may exceed its expectation.
/// Derived: by chance one normal variable in 44 exceeds it.
const POOL_DEVIATIONS: f64 = 2.0;
/// Most rounds of halving spans. Count.
/// Guard: ends a search that does not converge.
const MAX_HALVING_ROUNDS: usize = 24;
/// Spans above which the halving ends. Count.
/// Guard: as many as there are means to fit.
const MAX_PROFILE_SPANS: usize = 400;
/// Share of the worst score above which a span is halved in the same round. Dimensionless.
/// Trial: not recorded. A bad span makes its neighbours bad, so that others wait.
const HALVED_SCORE_SHARE: f64 = 0.3;
/// Largest distance of exact points, in tolerances.
/// Guard: leaves room for the points that the profile was not fitted to.
const MAX_DISTANCE_SHARE: f64 = 0.95;
/// Sweeps of moving knots, each with smaller steps. Count.
/// Derived: one for each entry of [`KNOT_STEP_SHARES`].
const KNOT_SWEEPS: usize = 3;
/// Steps of a knot in each sweep, as shares of the distance to its neighbour. Dimensionless.
/// Trial: not recorded.
const KNOT_STEP_SHARES: [f64; 3] = [0.3, 0.15, 0.08];

/// The targets of a profile fit and its tolerances.
pub(super) struct Aim<'a> {
    /// Points, or means of points with the number of points as weight.
    pub(super) targets: &'a [Target],
    pub(super) ends: [ProfileEnd; 2],
    /// A dense profile through all targets.
    pub(super) dense: &'a ProfileCurve,
    pub(super) tolerance: f64,
    /// Standard deviation of one point; `None` without noise, when the largest distance counts.
    pub(super) sigma: Option<f64>,
    /// Largest width of a cell.
    pub(super) widest: f64,
}

impl Aim<'_> {
    fn fit(&self, breaks: &[f64]) -> Result<Fit> {
        Fit::new(self.targets, breaks, self.ends, self.dense)
    }

    /// The score of each span: its error relative to the allowed one.
    fn scores(&self, fit: &Fit, breaks: &[f64]) -> Vec<f64> {
        let spans = breaks.len() - 1;
        let mut scores = vec![0.0_f64; spans];
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to MIN_CELLS_PER_SPAN..=500"
        )]
        let cells = |span: usize| {
            let narrow = (breaks[span + 1] - breaks[span]) / self.widest;
            narrow
                .ceil()
                .clamp(MIN_CELLS_PER_SPAN as f64, MAX_CELLS_PER_SPAN) as usize
        };
        let mut sums: Vec<Vec<[f64; 2]>> = (0..spans).map(|k| vec![[0.0; 2]; cells(k)]).collect();
        for ((&s, &e), t) in fit.feet.iter().zip(&fit.offsets).zip(self.targets) {
            let span = breaks.partition_point(|&b| b <= s).clamp(1, spans) - 1;
            if self.sigma.is_none() {
                scores[span] = scores[span].max(e.abs() / (MAX_DISTANCE_SHARE * self.tolerance));
                continue;
            }
            let width = breaks[span + 1] - breaks[span];
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a fraction of the cells"
            )]
            let cell = (((s - breaks[span]) / width).clamp(0.0, 0.999_999)
                * sums[span].len() as f64) as usize;
            let sum = &mut sums[span][cell];
            sum[0] += t.weight;
            sum[1] += t.weight * e;
        }
        if let Some(sigma) = self.sigma {
            for (score, cells) in scores.iter_mut().zip(&sums) {
                for &[weight, sum] in cells.iter().filter(|cell| cell[0] >= MIN_CELL_WEIGHT) {
                    let allowed =
                        MEAN_BIAS_SHARE * self.tolerance + MEAN_BIAS_ERRORS * sigma / weight.sqrt();
                    *score = score.max((sum / weight).abs() / allowed);
                }
            }
            self.pool(fit, breaks, sigma, &mut scores);
        }
        scores
    }

    /// Raises the scores of the spans that make the overall error too large: the excess of the sum of squares over its
    /// expectation, with two standard deviations allowed, is error of the profile.
    fn pool(&self, fit: &Fit, breaks: &[f64], sigma: f64, scores: &mut [f64]) {
        let spans = scores.len();
        let mut excess = vec![0.0; spans];
        let mut total = 0.0;
        for ((&s, &e), t) in fit.feet.iter().zip(&fit.offsets).zip(self.targets) {
            let span = breaks.partition_point(|&b| b <= s).clamp(1, spans) - 1;
            excess[span] += t.weight * e * e - sigma * sigma;
            total += t.weight;
        }
        let count = self.targets.len() as f64;
        let allowed = (PROFILE_RMS_SHARE * self.tolerance).powi(2) * total
            + POOL_DEVIATIONS * (2.0 * count).sqrt() * sigma * sigma;
        let ratio = excess.iter().sum::<f64>() / allowed;
        let most = excess.iter().copied().fold(0.0, f64::max);
        if ratio > 1.0 {
            for (score, e) in scores.iter_mut().zip(&excess) {
                *score = score.max(ratio.sqrt() * (e / most).max(0.0).sqrt());
            }
        }
    }

    fn worst(&self, fit: &Fit, breaks: &[f64]) -> f64 {
        self.scores(fit, breaks).into_iter().fold(0.0, f64::max)
    }

    /// The profile with few control points that is good enough everywhere, or the best one found; and whether it is
    /// good enough.
    pub(super) fn reach(&self, progress: &dyn Progress) -> Result<(ProfileCurve, bool)> {
        // 1. Halve spans that are not good enough.
        let (a, b) = self.dense.knots().domain();
        let first = if self.dense.knots().is_periodic() {
            4
        } else {
            1
        };
        let mut breaks: Vec<f64> = (0..=first)
            .map(|k| a + (b - a) * f64::from(k) / f64::from(first))
            .collect();
        let mut best: Option<(Vec<f64>, Fit, f64)> = None;
        for _ in 0..MAX_HALVING_ROUNDS {
            progress.check()?;
            let Ok(fit) = self.fit(&breaks) else { break };
            let scores = self.scores(&fit, &breaks);
            let worst = scores.iter().copied().fold(0.0, f64::max);
            if best.as_ref().is_none_or(|(_, _, w)| worst < *w) {
                best = Some((breaks.clone(), fit, worst));
            }
            if worst <= 1.0 || breaks.len() > MAX_PROFILE_SPANS {
                break;
            }
            // The worst spans first: a bad span makes its neighbours bad.
            let mut next = Vec::with_capacity(2 * breaks.len());
            for (w, &score) in breaks.windows(2).zip(&scores) {
                next.push(w[0]);
                if score > 1.0 && score > HALVED_SCORE_SHARE * worst {
                    next.push(0.5 * (w[0] + w[1]));
                }
            }
            next.push(b);
            breaks = next;
        }
        let Some((mut breaks, mut fit, worst)) = best else {
            return Err(Error::NoSolution(
                "no profile goes through the points".into(),
            ));
        };
        if worst > 1.0 {
            return Ok((fit.curve, false));
        }
        // 2. Move knots to better places and remove those that are not needed, in turn.
        loop {
            progress.check()?;
            self.settle(&mut breaks, &mut fit, 0);
            let Some((fewer, better)) = self.without_one(&breaks) else {
                break;
            };
            (breaks, fit) = (fewer, better);
        }
        for sweep in 1..KNOT_SWEEPS {
            self.settle(&mut breaks, &mut fit, sweep);
        }
        Ok((fit.curve, true))
    }

    /// Moves each inner knot a little either way while that lowers the sum of squares and stays good enough.
    fn settle(&self, breaks: &mut Vec<f64>, fit: &mut Fit, sweep: usize) {
        let mut squares = fit.squares(self.targets);
        let share = KNOT_STEP_SHARES[sweep.min(2)];
        for k in 1..breaks.len() - 1 {
            for side in [-1.0, 1.0] {
                let room = if side < 0.0 {
                    breaks[k] - breaks[k - 1]
                } else {
                    breaks[k + 1] - breaks[k]
                };
                let mut trial = breaks.clone();
                trial[k] += side * share * room;
                let Ok(moved) = self.fit(&trial) else {
                    continue;
                };
                let lower = moved.squares(self.targets);
                if lower < squares && self.worst(&moved, &trial) <= 1.0 {
                    (*breaks, *fit, squares) = (trial, moved, lower);
                    break;
                }
            }
        }
    }

    /// The fit without the knot that is missed least, if it is still good enough.
    fn without_one(&self, breaks: &[f64]) -> Option<(Vec<f64>, Fit)> {
        let fewest = if self.dense.knots().is_periodic() {
            4
        } else {
            2
        };
        if breaks.len() <= fewest {
            return None;
        }
        let mut best: Option<(f64, Vec<f64>, Fit)> = None;
        for k in 1..breaks.len() - 1 {
            let mut trial = breaks.to_vec();
            trial.remove(k);
            let Ok(fit) = self.fit(&trial) else { continue };
            let squares = fit.squares(self.targets);
            if best.as_ref().is_none_or(|(b, _, _)| squares < *b) && self.worst(&fit, &trial) <= 1.0
            {
                best = Some((squares, trial, fit));
            }
        }
        best.map(|(_, breaks, fit)| (breaks, fit))
    }
}
