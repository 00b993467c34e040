//! Parameter correction: points move towards their foot points, and the surface is fitted again.
//!
//! ```text
//! t ← t + 1.6 (foot - t),   |step| ≤ 0.2 span
//! ```
//!
//! A rough chart costs accuracy that no number of knots recovers. But foot points also follow noise, and on steep
//! features they run into each other. So a step is at most a fifth of a span long, is not taken where it would fold the
//! chart, and only counts if the refitted mean square falls by 1 %.
//!
//! Source: J. Hoschek, Intrinsic parametrization for approximation, CAGD 5 (1988) 27-31; over-relaxation and guards are
//! ours.

use super::problem::{Problem, State};
use crate::fit::least_squares::samples::{Cells, Residual, Samples, cell_number};
use nurbskin_geometry::{DVec2, Result};

/// Length of the step of a parameter, in ways to the foot point. Dimensionless.
/// Trial: not recorded. Above 1, since the surface gives way to the points by about half.
const OVER_RELAXATION: f64 = 1.6;
/// Longest step of a parameter, in spans.
/// Trial: 0.5 was used before. Longer steps slide points along the surface and fold the chart at borders and features.
const MAX_CORRECTION_STEP: f64 = 0.2;
/// Mean number of points of a cell in which a step must not fold the chart. Count.
/// Guard: enough for the three unknowns of an affine map, and few enough to be local.
const FOLD_CELL_POINTS: f64 = 8.0;
/// Fewest points of a cell whose affine map is estimated. Count.
/// Derived: three determine it.
const MIN_FOLD_POINTS: f64 = 4.0;
/// Determinant of the second moments of a cell, relative to their product, up to which its points count as collinear.
/// Dimensionless.
/// Guard: far above rounding.
const COLLINEAR: f64 = 1e-9;
/// Most cells along a direction. Count.
/// Guard: bounds the memory for extreme ratios of the sides.
const MAX_FOLD_CELLS: f64 = 4096.0;
/// Smallest factor by which a step may change the area of a cell in the domain. Dimensionless.
/// Guard: above 0, at which the map folds.
const MIN_AREA_RATIO: f64 = 0.2;
/// Relative fall of the mean squared distance that a correction must bring. Dimensionless.
/// Trial: in prototypes on a noisy face unguarded corrections raised the rms from 0.010 to 0.031.
const MIN_CORRECTION_GAIN: f64 = 0.01;

/// Samples with corrected parameters and the fit to them.
pub(super) struct Corrected {
    pub(super) samples: Samples,
    pub(super) state: State,
}

impl Problem<'_> {
    /// One correction and a fit on the same knots; `None` if the result is no better.
    pub(super) fn correct(&self, state: &State) -> Result<Option<Corrected>> {
        let mut steps = self.steps(state, OVER_RELAXATION);
        self.stop_folds(&mut steps);
        let samples = self.moved(&steps);
        let problem = Problem {
            samples: &samples,
            ..*self
        };
        let next = problem.advance(&state.fit.space.breaks, state)?;
        let (mut before, mut after) = (0.0, 0.0);
        for k in 0..samples.len() {
            let w = state.judgement.weights[k].min(next.judgement.weights[k]);
            before += w * state.residuals[k].distance.powi(2);
            after += w * next.residuals[k].distance.powi(2);
        }
        let better = after < (1.0 - MIN_CORRECTION_GAIN) * before && self.holds(state, &next);
        Ok(better.then_some(Corrected {
            samples,
            state: next,
        }))
    }

    /// The step of each sample in the domain; zero for outliers.
    fn steps(&self, state: &State, factor: f64) -> Vec<DVec2> {
        let closed = self.topology.closed();
        let space = &state.fit.space;
        let clip = MAX_CORRECTION_STEP;
        let longest = |d: usize, t: f64| {
            let a = space.span(d, t);
            clip * (space.breaks[d][a + 1] - space.breaks[d][a])
        };
        let step = |k: usize| {
            let t = self.samples.parameters[k];
            let Residual { foot, .. } = state.residuals[k];
            if state.judgement.weights[k] <= 0.0 {
                return DVec2::ZERO;
            }
            let along = |d: usize| {
                let way = foot[d] - t[d];
                let way = if closed[d] { way - way.round() } else { way };
                let most = longest(d, t[d]);
                (factor * way).clamp(-most, most)
            };
            DVec2::new(along(0), along(1))
        };
        (0..self.samples.len()).map(step).collect()
    }

    /// Sets the steps to zero in cells that they would fold or compress.
    fn stop_folds(&self, steps: &mut [DVec2]) {
        let bins = (self.samples.len() as f64 / FOLD_CELL_POINTS).max(1.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to 1..=4096"
        )]
        let count = |ratio: f64| (bins * ratio).sqrt().clamp(1.0, MAX_FOLD_CELLS) as usize;
        let counts = [
            count(self.size[0] / self.size[1]),
            count(self.size[1] / self.size[0]),
        ];
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "parameters lie in 0..=1"
        )]
        let place = |t: f64, n: usize| ((t * n as f64) as usize).min(n - 1);
        let number: Vec<u32> = self
            .samples
            .parameters
            .iter()
            .map(|t| cell_number(place(t.x, counts[0]) + counts[0] * place(t.y, counts[1])))
            .collect();
        let cells = Cells::new(counts[0] * counts[1], &number);
        for cell in 0..cells.len() {
            let members = cells.samples(cell);
            if shrinks(&self.samples.parameters, steps, members) {
                for &k in members {
                    steps[k as usize] = DVec2::ZERO;
                }
            }
        }
    }

    /// The samples moved by these steps.
    fn moved(&self, steps: &[DVec2]) -> Samples {
        let closed = self.topology.closed();
        let mut samples = self.samples.clone();
        for (t, step) in samples.parameters.iter_mut().zip(steps) {
            let settle = |t: f64, d: usize| match closed[d] {
                true => t - t.floor(),
                false => t.clamp(0.0, 1.0),
            };
            let there = *t + *step;
            *t = DVec2::new(settle(there.x, 0), settle(there.y, 1));
        }
        samples
    }
}

/// Whether the best affine map of these points to their new places reverses or shrinks areas too much.
fn shrinks(parameters: &[DVec2], steps: &[DVec2], members: &[u32]) -> bool {
    let n = members.len() as f64;
    if n < MIN_FOLD_POINTS {
        return false;
    }
    let mean = |of: &[DVec2]| members.iter().fold(DVec2::ZERO, |s, &k| s + of[k as usize]) / n;
    let (middle, step) = (mean(parameters), mean(steps));
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    let (mut sx, mut sy) = (DVec2::ZERO, DVec2::ZERO);
    for &k in members {
        let t = parameters[k as usize] - middle;
        let s = steps[k as usize] - step;
        xx += t.x * t.x;
        xy += t.x * t.y;
        yy += t.y * t.y;
        sx += t.x * s;
        sy += t.y * s;
    }
    let determinant = xx * yy - xy * xy;
    if determinant <= COLLINEAR * xx * yy {
        return false;
    }
    // Slopes of the steps along x and y.
    let (ax, ay) = (
        (yy * sx - xy * sy) / determinant,
        (xx * sy - xy * sx) / determinant,
    );
    (1.0 + ax.x) * (1.0 + ay.y) - ay.x * ax.y < MIN_AREA_RATIO
}
