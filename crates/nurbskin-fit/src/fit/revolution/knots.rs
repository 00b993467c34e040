//! Knots of the profile: as few as the points allow.

use super::data::Fit;
use crate::chart::revolution::{ProfileCurve, ProfileEnd, Target};
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result};

/// Share of the tolerance that the mean over a cell may be off, with noise.
const SHARE: f64 = 0.2;
/// Standard errors that the mean over a cell may be off besides.
const ERRORS: f64 = 3.5;
/// Cells per span.
const CELLS: usize = 3;
/// Root mean square error of the whole profile, in tolerances, with noise.
const MEAN_SQUARE: f64 = 0.05;
/// Rounds of cutting spans at most.
const ROUNDS: usize = 24;
/// Spans at most.
const SPANS: usize = 400;
/// Share of the tolerance, without noise, that the largest distance may take.
const FILL: f64 = 0.95;
/// Sweeps of moving knots.
const SWEEPS: usize = 3;

/// What a profile is fitted to, and how well.
pub(super) struct Aim<'a> {
    /// Points, or means of points with the number of points as weight.
    pub(super) targets: &'a [Target],
    pub(super) ends: [ProfileEnd; 2],
    /// A profile that follows everything.
    pub(super) dense: &'a ProfileCurve,
    pub(super) tolerance: f64,
    /// Standard deviation of one point; `None` without noise, when the largest distance counts.
    pub(super) sigma: Option<f64>,
    /// Most that a cell may be wide.
    pub(super) widest: f64,
}

impl Aim<'_> {
    fn fit(&self, breaks: &[f64]) -> Result<Fit> {
        Fit::new(self.targets, breaks, self.ends, self.dense)
    }

    /// For each span how far it is off, as a multiple of what is allowed.
    fn scores(&self, fit: &Fit, breaks: &[f64]) -> Vec<f64> {
        let spans = breaks.len() - 1;
        let mut scores = vec![0.0_f64; spans];
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to CELLS..=500"
        )]
        let cells = |span: usize| {
            let narrow = (breaks[span + 1] - breaks[span]) / self.widest;
            narrow.ceil().clamp(CELLS as f64, 500.0) as usize
        };
        let mut sums: Vec<Vec<[f64; 2]>> = (0..spans).map(|k| vec![[0.0; 2]; cells(k)]).collect();
        for ((&s, &e), t) in fit.feet.iter().zip(&fit.offsets).zip(self.targets) {
            let span = breaks.partition_point(|&b| b <= s).clamp(1, spans) - 1;
            if self.sigma.is_none() {
                scores[span] = scores[span].max(e.abs() / (FILL * self.tolerance));
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
                for &[weight, sum] in cells.iter().filter(|cell| cell[0] >= 5.0) {
                    let allowed = SHARE * self.tolerance + ERRORS * sigma / weight.sqrt();
                    *score = score.max((sum / weight).abs() / allowed);
                }
            }
            self.pool(fit, breaks, sigma, &mut scores);
        }
        scores
    }

    /// Raises the scores of the spans that make the whole worse than it may be: what the sum of squares exceeds its
    /// expectation by, twice its standard deviation allowed, is error of the profile.
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
        let allowed = (MEAN_SQUARE * self.tolerance).powi(2) * total
            + 2.0 * (2.0 * count).sqrt() * sigma * sigma;
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

    /// The profile with few control points that is good enough everywhere, or the best one there is; and whether it is
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
        for _ in 0..ROUNDS {
            progress.check()?;
            let Ok(fit) = self.fit(&breaks) else { break };
            let scores = self.scores(&fit, &breaks);
            let worst = scores.iter().copied().fold(0.0, f64::max);
            if best.as_ref().is_none_or(|(_, _, w)| worst < *w) {
                best = Some((breaks.clone(), fit, worst));
            }
            if worst <= 1.0 || breaks.len() > SPANS {
                break;
            }
            // The worst spans first: a bad span makes its neighbours bad.
            let mut next = Vec::with_capacity(2 * breaks.len());
            for (w, &score) in breaks.windows(2).zip(&scores) {
                next.push(w[0]);
                if score > 1.0 && score > 0.3 * worst {
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
        // 2. Move knots to where they help most, and take out those that are not needed, in turn.
        loop {
            progress.check()?;
            self.settle(&mut breaks, &mut fit, 0);
            let Some((fewer, better)) = self.without_one(&breaks) else {
                break;
            };
            (breaks, fit) = (fewer, better);
        }
        for sweep in 1..SWEEPS {
            self.settle(&mut breaks, &mut fit, sweep);
        }
        Ok((fit.curve, true))
    }

    /// Moves each inner knot a little either way while that lowers the sum of squares and stays good enough.
    fn settle(&self, breaks: &mut Vec<f64>, fit: &mut Fit, sweep: usize) {
        let mut squares = fit.squares(self.targets);
        let share = [0.3, 0.15, 0.08][sweep.min(2)];
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

    /// The same with one knot less, the one that is missed least, if the rest is still good enough.
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
