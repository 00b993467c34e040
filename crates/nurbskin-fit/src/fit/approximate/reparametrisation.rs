//! Parameter correction: points move towards the places of the surface that are nearest to them, and the surface is
//! fitted again.
//!
//! A rough chart costs accuracy that no number of knots buys back. But feet also follow noise, and on steep features
//! they run into each other: a step is at most a fifth of a span long, is not taken where neighbouring points would change
//! places, and only counts if the fit is better for it.
//!
//! Source: J. Hoschek, Intrinsic parametrization for approximation, CAGD 5 (1988) 27-31; the over-relaxation is ours.

use super::problem::{Problem, State};
use crate::fit::least_squares::samples::{Cells, Residual, Samples, cell_number};
use nurbskin_geometry::{DVec2, Result};

/// Part of the way to the foot that a point goes: beyond it, as the surface will give way by about half.
const RELAXATION: f64 = 1.6;
/// Longest step, in spans.
const LONGEST: f64 = 0.2;
/// Points per cell in which a step must not turn neighbours over.
const NEIGHBOURS: f64 = 8.0;
/// Smallest factor by which a step may shrink areas.
const LEAST_AREA: f64 = 0.2;
/// Part by which a step must lower the mean squared distance.
const LEAST_GAIN: f64 = 0.01;

/// Samples with corrected parameters and the fit to them.
pub(super) struct Corrected {
    pub(super) samples: Samples,
    pub(super) state: State,
}

impl Problem<'_> {
    /// One correction and a refit on the same knots; `None` if that is no better.
    pub(super) fn correct(&self, state: &State) -> Result<Option<Corrected>> {
        let mut steps = self.steps(state, RELAXATION);
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
        let better = after < (1.0 - LEAST_GAIN) * before && self.holds(state, &next);
        Ok(better.then_some(Corrected {
            samples,
            state: next,
        }))
    }

    /// The way of each sample in the domain; none for outliers.
    fn steps(&self, state: &State, factor: f64) -> Vec<DVec2> {
        let closed = self.topology.closed();
        let space = &state.fit.space;
        let clip = LONGEST;
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

    /// Sets the steps of the points to zero in cells that they would fold or crush.
    fn stop_folds(&self, steps: &mut [DVec2]) {
        let bins = (self.samples.len() as f64 / NEIGHBOURS).max(1.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to 1..=4096"
        )]
        let count = |ratio: f64| (bins * ratio).sqrt().clamp(1.0, 4096.0) as usize;
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

/// Whether the map of these points to their new places, the best affine one, turns over or shrinks areas too much.
fn shrinks(parameters: &[DVec2], steps: &[DVec2], members: &[u32]) -> bool {
    let n = members.len() as f64;
    if n < 4.0 {
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
    if determinant <= 1e-9 * xx * yy {
        return false;
    }
    // Slopes of the steps along x and y.
    let (ax, ay) = (
        (yy * sx - xy * sy) / determinant,
        (xx * sy - xy * sx) / determinant,
    );
    (1.0 + ax.x) * (1.0 + ay.y) - ay.x * ax.y < LEAST_AREA
}
