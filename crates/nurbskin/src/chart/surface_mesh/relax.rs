//! The inside of a domain with little stretch.

use super::harmonic::Harmonic;
use super::layout::{Setup, Surface, folded, lengths, twice_area};
use super::ragged::{bounds, hold, soften};
use super::spread::evenly;
use super::stretch::Stretch;
use crate::Result;
use crate::numeric::tasks::join;
use crate::progress::Progress;
use glam::DVec2;

/// To which part of the residual equations are solved: while poles are sought, round by round, and in the end.
const ACCURACY: [f64; 3] = [1e-3, 1e-4, 1e-10];
/// Times that ragged rims are laid anew.
const TRIALS: usize = 6;
/// A round must lower the stretch by this part.
const WORTH: f64 = 0.003;
/// Times that the lines are spaced anew, each time by what is left.
const SPREADS: usize = 2;

/// A mesh in its domain.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// In 0..1 where the domain is open, but for the tips of ragged rims; in whole turns anywhere where it is closed.
    pub(super) places: Vec<DVec2>,
    pub(super) size: [f64; 2],
    pub(super) stretch: Stretch,
    pub(super) folded: f64,
}

/// Lays out the vertices in at most `rounds` rounds after the first.
///
/// The weights start as clamped cotangents and are lowered round by round where the surface is stretched over too little
/// of the domain (as Yoshizawa, Belyaev & Seidel 2004, DOI 10.1109/SMI.2004.1314516), which keeps them positive, so that
/// nothing folds; lines are spaced evenly after each. A round that folds a triangle or brings nothing is not kept.
pub(super) fn lay_out(
    surface: &Surface<'_>,
    setup: &mut Setup,
    start: Vec<DVec2>,
    rounds: usize,
    progress: &dyn Progress,
) -> Result<Layout> {
    let mut raw = start;
    let mut factors = vec![1.0; surface.points.len()];
    let mut harmonic = Harmonic::new(surface, setup);
    let accuracy = ACCURACY[usize::from(rounds > 0)];
    harmonic.solve(setup, &factors, &mut raw, accuracy);
    if setup.closed[1] && twice_area(surface, setup, &raw) < 0.0 {
        turn_round(setup, &mut raw);
        harmonic.turn_round();
    }
    let mut best = finish(surface, setup, &raw);
    if rounds == 0 {
        return Ok(best);
    }
    // Teeth as far out as folds nothing.
    for trial in 1..=TRIALS {
        if setup.teeth.is_empty() {
            break;
        }
        hold(surface, setup, &raw);
        harmonic.solve(setup, &factors, &mut raw, accuracy);
        best = finish(surface, setup, &raw);
        let enough = trial > 1 && best.folded == 0.0;
        if enough || (trial > 1 && !soften(surface, setup, &raw, trial + 2 >= TRIALS)) {
            break;
        }
    }
    for _ in 0..rounds {
        progress.check()?;
        let next_factors: Vec<f64> = factors
            .iter()
            .zip(&best.stretch.at)
            .map(|(f, s)| f / s)
            .collect();
        let before = setup.held.clone();
        hold(surface, setup, &raw);
        let mut next_raw = raw.clone();
        harmonic.solve(setup, &next_factors, &mut next_raw, accuracy);
        let next = finish(surface, setup, &next_raw);
        if next.stretch.whole > (1.0 - WORTH) * best.stretch.whole || next.folded > best.folded {
            setup.held = before;
            break;
        }
        (raw, factors, best) = (next_raw, next_factors, next);
    }
    harmonic.solve(setup, &factors, &mut raw, ACCURACY[2]);
    Ok(finish(surface, setup, &raw))
}

/// Lines spaced evenly, and what that gives.
fn finish(surface: &Surface<'_>, setup: &Setup, raw: &[DVec2]) -> Layout {
    let mut places = raw.to_vec();
    for axis in [0, 1] {
        let [low, high] = bounds(setup, axis);
        if (low, high) != (0.0, 1.0) {
            for p in &mut places {
                p[axis] = (p[axis] - low) / (high - low);
            }
        }
    }
    for _ in 0..SPREADS {
        let maps = join(
            || evenly(surface, setup, &places, 0),
            || evenly(surface, setup, &places, 1),
        );
        for p in &mut places {
            *p = DVec2::new(maps.0.at(p.x), maps.1.at(p.y));
        }
    }
    let (folded, (size, stretch)) = join(
        || folded(surface, setup, &places),
        || {
            let size = lengths(surface, setup, &places);
            (size, Stretch::measure(surface, setup, &places, size))
        },
    );
    Layout {
        places,
        size,
        stretch,
        folded,
    }
}

/// The other way round in v.
fn turn_round(setup: &mut Setup, places: &mut [DVec2]) {
    for j in &mut setup.jumps {
        j[1] = -j[1];
    }
    for p in places {
        p.y = -p.y;
    }
}
