//! Relaxation: a layout with little stretch.
//!
//! Round by round, the factor f of each vertex is divided by its stretch, and the weighted equations of [`Harmonic`]
//! are solved anew:
//!
//! ```text
//! f_a  ->  f_a / s_a        w_ab √(f_a f_b)
//! ```
//!
//! Weights stay positive, so that little folds. A round is kept if it lowers the stretch by 0.3 % and folds next to
//! nothing.
//!
//! Source: S. Yoshizawa, A. Belyaev and H.-P. Seidel, *A fast and simple stretch-minimizing mesh parameterization*,
//! 2004, DOI 10.1109/SMI.2004.1314516. Teeth of ragged rims, even spacing and the return to the last sound state are
//! ours.

use super::harmonic::Harmonic;
use super::layout::{Setup, Surface, folded, lengths, pieces, twice_area};
use super::ragged::{bounds, hold, soften};
use super::spread::evenly;
use super::stretch::Stretch;
use glam::DVec2;
use nurbskin_geometry::Result;
use nurbskin_geometry::progress::Progress;
use rayon::join;

/// Relative residual to which the equations are solved: where one layout is all, in every round, and in the end. Guard:
/// the first two only choose a direction; the last is what conjugate gradients reach.
const SOLVE_ACCURACY: [f64; 3] = [1e-3, 1e-4, 1e-10];
/// Most rounds that lay ragged rims anew. Guard: teeth at folds halve each time and are gone in the last round.
const TOOTH_ROUNDS: usize = 6;
/// Least relative decrease of the stretch that keeps a round. Trial: not recorded. A smaller one spends rounds on
/// nothing, a larger one stops early.
const MIN_STRETCH_GAIN: f64 = 0.003;
/// Largest share of the triangles that a round may fold where it lowers the stretch. Trial: in the meshes of clouds of
/// a head these are one to four slivers in its pockets; with 0 the relaxation ended after a round.
pub(crate) const MAX_NEW_FOLDS: f64 = 2e-4;
/// Largest ratio of stretches at which the last state without such folds replaces a final one with them. Trial: not
/// recorded.
const MAX_SOUND_STRETCH: f64 = 1.2;
/// Passes that space the lines evenly, each on the result of the one before. Trial: not recorded; the two directions
/// influence each other.
const SPREAD_PASSES: usize = 2;

/// A mesh in its domain.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// In 0..1 in open directions, except for the tips of ragged rims; in whole turns without limits in closed ones.
    pub(super) places: Vec<DVec2>,
    pub(super) size: [f64; 2],
    pub(super) stretch: Stretch,
    pub(super) folded: f64,
}

/// Lays out the vertices, with at most `rounds` rounds after the first layout.
pub(super) fn lay_out(
    surface: &Surface<'_>,
    setup: &mut Setup,
    start: Vec<DVec2>,
    rounds: usize,
    progress: &dyn Progress,
) -> Result<Layout> {
    let mut relaxation = Relaxation::new(
        surface,
        setup,
        start,
        SOLVE_ACCURACY[usize::from(rounds > 0)],
    );
    if rounds == 0 {
        return Ok(relaxation.best);
    }
    relaxation.set_teeth(setup);
    for _ in 0..rounds {
        progress.check()?;
        if !relaxation.advance(setup) {
            break;
        }
    }
    Ok(relaxation.finished(setup))
}

/// A layout that is being relaxed.
///
/// The weights start as clamped cotangents and are lowered, round by round, where the surface is stretched over too
/// little of the domain (Yoshizawa, Belyaev & Seidel 2004, DOI 10.1109/SMI.2004.1314516). They stay positive, so that
/// little folds. Lines are spaced evenly after each round. A round that folds more than a few triangles or brings no
/// gain is discarded.
pub(super) struct Relaxation<'a> {
    surface: &'a Surface<'a>,
    harmonic: Harmonic,
    raw: Vec<DVec2>,
    factors: Vec<f64>,
    best: Layout,
    /// The last state without more folds than the first, if `best` has more.
    sound: Option<Sound>,
    accuracy: f64,
}

/// A state of a relaxation.
struct Sound {
    raw: Vec<DVec2>,
    factors: Vec<f64>,
    held: Vec<[Option<f64>; 2]>,
    folded: f64,
}

impl<'a> Relaxation<'a> {
    /// The first layout, with equations solved to `accuracy`.
    fn new(surface: &'a Surface<'a>, setup: &mut Setup, start: Vec<DVec2>, accuracy: f64) -> Self {
        let mut raw = start;
        let factors = vec![1.0; surface.points.len()];
        let mut harmonic = Harmonic::new(surface, setup);
        harmonic.solve(setup, &factors, &mut raw, accuracy);
        if setup.closed[1] && twice_area(surface, setup, &raw) < 0.0 {
            turn_round(setup, &mut raw);
            harmonic.turn_round();
        }
        let best = finish(surface, setup, &raw);
        Self {
            surface,
            harmonic,
            raw,
            factors,
            best,
            sound: None,
            accuracy,
        }
    }

    /// The first layout of a relaxation that is continued by [`Self::advance`].
    pub(super) fn begun(surface: &'a Surface<'a>, setup: &mut Setup, start: Vec<DVec2>) -> Self {
        Self::new(surface, setup, start, SOLVE_ACCURACY[1])
    }

    /// The stretch so far.
    pub(super) fn stretch(&self) -> &Stretch {
        &self.best.stretch
    }

    /// Moves teeth as far out as possible without folds.
    fn set_teeth(&mut self, setup: &mut Setup) {
        for trial in 1..=TOOTH_ROUNDS {
            if setup.teeth.is_empty() {
                break;
            }
            hold(self.surface, setup, &self.raw);
            let (factors, accuracy) = (&self.factors, self.accuracy);
            self.harmonic.solve(setup, factors, &mut self.raw, accuracy);
            self.best = finish(self.surface, setup, &self.raw);
            let enough = trial > 1 && self.best.folded == 0.0;
            if enough
                || (trial > 1 && !soften(self.surface, setup, &self.raw, trial + 2 >= TOOTH_ROUNDS))
            {
                break;
            }
        }
    }

    /// One round; `false` if it was discarded, and further rounds would be as well.
    pub(super) fn advance(&mut self, setup: &mut Setup) -> bool {
        let pairs = self.factors.iter().zip(&self.best.stretch.at);
        let factors: Vec<f64> = pairs.map(|(f, s)| f / s).collect();
        let before = setup.held.clone();
        hold(self.surface, setup, &self.raw);
        let mut raw = self.raw.clone();
        self.harmonic
            .solve(setup, &factors, &mut raw, self.accuracy);
        let next = finish(self.surface, setup, &raw);
        if next.stretch.whole > (1.0 - MIN_STRETCH_GAIN) * self.best.stretch.whole
            || next.folded > self.best.folded.max(MAX_NEW_FOLDS)
        {
            setup.held = before;
            return false;
        }
        let sound = self.sound.as_ref().map_or(self.best.folded, |s| s.folded);
        if next.folded <= sound {
            self.sound = None;
        } else if self.sound.is_none() {
            self.sound = Some(Sound {
                raw: self.raw.clone(),
                factors: self.factors.clone(),
                held: before,
                folded: self.best.folded,
            });
        }
        (self.raw, self.factors, self.best) = (raw, factors, next);
        true
    }

    /// The final layout, with its equations solved to full accuracy.
    pub(super) fn finished(mut self, setup: &mut Setup) -> Layout {
        self.harmonic
            .solve(setup, &self.factors, &mut self.raw, SOLVE_ACCURACY[2]);
        let last = finish(self.surface, setup, &self.raw);
        let Some(mut sound) = self.sound.filter(|sound| last.folded > sound.folded) else {
            return last;
        };
        let held = std::mem::replace(&mut setup.held, sound.held);
        self.harmonic
            .solve(setup, &sound.factors, &mut sound.raw, SOLVE_ACCURACY[2]);
        let layout = finish(self.surface, setup, &sound.raw);
        if layout.folded < last.folded
            && layout.stretch.whole <= MAX_SOUND_STRETCH * last.stretch.whole
        {
            return layout;
        }
        setup.held = held;
        last
    }
}

/// Spaces the lines evenly and measures the layout.
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
    for _ in 0..SPREAD_PASSES {
        let pieces = pieces(surface, setup, &places);
        let maps = join(
            || evenly(&pieces, 0, setup.closed[0]),
            || evenly(&pieces, 1, setup.closed[1]),
        );
        for p in &mut places {
            *p = DVec2::new(maps.0.at(p.x), maps.1.at(p.y));
        }
    }
    let pieces = pieces(surface, setup, &places);
    let size = lengths(&pieces);
    Layout {
        stretch: Stretch::measure(surface, &pieces, size),
        folded: folded(&pieces),
        places,
        size,
    }
}

/// Reverses the direction of v.
fn turn_round(setup: &mut Setup, places: &mut [DVec2]) {
    for j in &mut setup.jumps {
        j[1] = -j[1];
    }
    for p in places {
        p.y = -p.y;
    }
}
