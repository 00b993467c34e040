//! Removal of folds and self-intersections from a fit by stiffer cells.
//!
//! Beside a ragged rim, or over a narrow strip of the domain without points, little determines the slopes of a surface,
//! and small noise can turn it over. There the stiffness of the cells grows step by step:
//!
//! ```text
//! s ← max(4 s, 10⁻³) in a folded cell,   max(2 s, 10⁻³ / 2) beside it,   until n · n₀ ≥ 0.15 |n|
//! ```
//!
//! while the root mean square distance rises by at most 3 % (folds), or 50 % (self-intersections). Ours.

use super::least_error::Candidate;
use super::problem::{Problem, State};
use crate::fit::approximate::{Crossing, Facing};
use crate::fit::least_squares::foot_points::normals;
use crate::fit::least_squares::samples::Residual;
use nurbskin_geometry::{DVec2, DVec3, Error, Result};

/// Most fits with stiffer cells that take out folds. Count.
/// Guard: after ten a cell is stiffer by a factor of 4^9.
const MAX_UNFOLD_STEPS: usize = 10;
/// Such fits in a row without fewer folds that end the attempt. Count.
/// Trial: not recorded.
const MAX_VAIN_STEPS: usize = 4;
/// Steps of stiffening per fit where a surface intersects itself. Count.
/// Guard: the search for intersections takes longer than a fit.
const CROSSING_STEPS_PER_FIT: usize = 2;
/// Most fits with stiffer cells against self-intersections. Count.
/// Derived: after six a cell is stiffer by a factor of 4^11, and nothing changes any more.
const MAX_CROSSING_FITS: usize = 6;
/// Factor by which the root mean square distance may rise until a surface no longer intersects itself. Dimensionless.
/// Trial: on the scans of docs/real-scans.md and their variants. It is more than folds may cost, since a CAD system
/// cannot use such a surface.
const MAX_CROSSING_RMS_RISE: f64 = 1.5;
/// The same factor where only a few stiff cells are off. Dimensionless.
/// Trial: on the scans of docs/real-scans.md and their variants.
const MAX_LOCAL_CROSSING_RMS_RISE: f64 = 2.5;
/// Factor by which the distance of 95 % of the points may rise in that case. Dimensionless.
/// Trial: on the scans of docs/real-scans.md and their variants.
const MAX_CROSSING_P95_RISE: f64 = 1.25;
/// First stiffness of a cell that folds, where 1 makes it bend as little as a cell in a gap between points.
/// Dimensionless.
/// Guard: so small that the first steps cost nothing; the next ones multiply it.
const FIRST_STIFFNESS: f64 = 1e-3;
/// Factor of the stiffness of such a cell in a step. Dimensionless.
/// Trial: not recorded.
const STIFFNESS_FACTOR: f64 = 4.0;
/// Factor of the stiffness of the cells around it in a step. Dimensionless.
/// Derived: the root of [`STIFFNESS_FACTOR`].
const NEIGHBOUR_STIFFNESS_FACTOR: f64 = 2.0;
/// Factor by which the root mean square distance may rise for fewer folds. Dimensionless.
/// Trial: on meshes with ragged rims, of which the car panel had 0.07 % folded and the mustard body 0.005 %.
const MAX_UNFOLD_RMS_RISE: f64 = 1.03;
/// Cosine of the angle between the normal and its intended direction below which a place counts as folded.
/// Dimensionless.
/// Guard: above 0, at which the surface folds, since it is only sampled.
const FOLD_COSINE: f64 = 0.15;
/// Share of the places inside a scan above which those that face the wrong way are features of the scan, too narrow for
/// the knots.
/// Trial: not recorded.
const FEATURE_FOLD_SHARE: f64 = 1e-3;
/// Samples above which folds and intersections are left alone. Count.
/// Guard: each fit takes a second or more, and so many points leave hardly a strip bare.
const UNFOLD_MAX_SAMPLES: usize = 500_000;

impl Problem<'_> {
    /// Removes as many folds as possible from the candidate, by at most twenty fits; none where nothing folds. Folds
    /// inside the scan are removed only if none remains there and the rims get no more.
    ///
    /// Then removes self-intersections, where the caller can find them. Returns whether none was found in the end.
    pub(super) fn unfold(&self, candidate: &mut Candidate) -> Result<bool> {
        if self.samples.len() > UNFOLD_MAX_SAMPLES {
            return Ok(true);
        }
        let stiff = self.unfolded(candidate)?;
        self.uncross(candidate, stiff)
    }

    /// Removes folds; returns the stiffness of each cell.
    fn unfolded(&self, candidate: &mut Candidate) -> Result<Vec<f64>> {
        let [columns, rows] = candidate.state.fit.space.spans();
        let stiff = vec![0.0; columns * rows];
        if self.facing.is_empty() {
            return Ok(stiff);
        }
        let at: Vec<DVec2> = self.facing.iter().map(|f| f.parameters).collect();
        let folded = |state: &State| -> Vec<&Facing> {
            let turned = normals(&state.fit, &at);
            let pairs = self.facing.iter().zip(turned);
            let wrong = |(f, n): &(&Facing, DVec3)| n.dot(f.normal) < FOLD_COSINE * n.length();
            pairs.filter(wrong).map(|(f, _)| f).collect()
        };
        let at_rims = |state: &State| {
            let mut folded = folded(state);
            folded.retain(|f| !f.inside);
            folded
        };
        if folded(&candidate.state).is_empty() {
            return Ok(stiff);
        }
        let judged = candidate.state.judgement.weights.clone();
        let mut task = Task {
            weights: candidate.raised.as_ref().unwrap_or(&judged),
            // A met goal must stay met.
            met: self.meets(&candidate.state)?,
            dearest: 0.0,
            stiff,
        };
        task.dearest = MAX_UNFOLD_RMS_RISE * MAX_UNFOLD_RMS_RISE * task.squares(&candidate.state);
        let mut state = self.stiffened(candidate.state.clone(), &mut task, &at_rims)?;
        let all = self.facing.iter().filter(|f| f.inside).count();
        let (inside, rims) = apart(&folded(&state));
        if inside > 0 && (inside as f64) < FEATURE_FOLD_SHARE * all as f64 {
            let next = self.stiffened(state.clone(), &mut task, &folded)?;
            let (still_inside, at_rims) = apart(&folded(&next));
            if still_inside == 0 && at_rims <= rims {
                state = next;
            }
        }
        if task.stiff.iter().any(|&stiff| stiff > 0.0) {
            let round = self.round(&state, &self.marks(&state));
            candidate.history.push(round);
            candidate.state = state;
        }
        Ok(task.stiff)
    }

    /// Stiffens the cells where the surface intersects itself, until it does not. The candidate stays unchanged where
    /// that does not help, costs too much or misses the goal.
    fn uncross(&self, candidate: &mut Candidate, mut stiff: Vec<f64>) -> Result<bool> {
        let Some(Crossing(places_of)) = self.crossing else {
            return Ok(true);
        };
        let judged = candidate.state.judgement.weights.clone();
        let weights = candidate.raised.as_ref().unwrap_or(&judged);
        let squares = |state: &State| weighted_squares(&state.residuals, weights);
        let before = squares(&candidate.state);
        let dear = |factor: f64, squares: f64| squares > factor * factor * before;
        let farthest = MAX_CROSSING_P95_RISE * self.level(&candidate.state);
        // A met goal must stay met; without a goal the cost decides.
        let mut met = None;
        let mut state = candidate.state.clone();
        for step in 0..=MAX_CROSSING_FITS {
            let surface = state.fit.surface(|p| self.samples.restore(p))?;
            let Some(places) = places_of(&surface) else {
                return Ok(false);
            };
            if places.is_empty() {
                if step > 0 {
                    candidate
                        .history
                        .push(self.round(&state, &self.marks(&state)));
                    candidate.state = state;
                }
                return Ok(true);
            }
            if step == MAX_CROSSING_FITS {
                break;
            }
            for _ in 0..CROSSING_STEPS_PER_FIT {
                self.stiffen(&mut stiff, places.iter().copied(), &state);
            }
            let problem = Problem {
                stiff: Some(&stiff),
                ..*self
            };
            let calm = state.calm;
            let (fit, equation_residual, residuals) =
                match problem.fit(&candidate.breaks, weights, calm) {
                    Ok((fit, equation_residual, _, residuals)) => {
                        (fit, equation_residual, residuals)
                    }
                    // There is a surface without it.
                    Err(Error::NoSolution(_)) => return Ok(false),
                    Err(other) => return Err(other),
                };
            state = State {
                judgement: self.judge(&residuals),
                fit,
                equation_residual,
                calm,
                residuals,
            };
            let met = match met {
                Some(met) => met,
                None => *met.insert(self.goal.is_some() && self.meets(&candidate.state)?),
            };
            let is_dear = match met {
                true => !self.meets(&state)?,
                false => {
                    let squares = squares(&state);
                    dear(MAX_LOCAL_CROSSING_RMS_RISE, squares)
                        || dear(MAX_CROSSING_RMS_RISE, squares) && self.level(&state) > farthest
                }
            };
            if is_dear {
                return Ok(false);
            }
        }
        Ok(false)
    }

    /// Whether the goal is reached; without one, whether the criterion is met.
    fn meets(&self, state: &State) -> Result<bool> {
        match self.goal {
            Some(goal) => self.reaches(state, self.within_reach(goal)),
            None => Ok(self.marks(state).iter().all(|marks| marks.worst <= 1.0)),
        }
    }

    /// The state with the fewest folded places, as listed by `folded`, that stiffer cells achieve; the stiffness is
    /// kept in the task.
    fn stiffened<'f>(
        &self,
        state: State,
        task: &mut Task<'_>,
        folded: &impl Fn(&State) -> Vec<&'f Facing>,
    ) -> Result<State> {
        let mut left = folded(&state);
        let mut fewest = left.len();
        let mut best = state;
        let mut stiff = task.stiff.clone();
        let mut vain = 0;
        for _ in 0..MAX_UNFOLD_STEPS {
            if left.is_empty() || vain == MAX_VAIN_STEPS {
                break;
            }
            self.stiffen(&mut stiff, left.iter().map(|f| f.parameters), &best);
            let problem = Problem {
                stiff: Some(&stiff),
                ..*self
            };
            // Stiffness of a few cells must not change the fairness of the rest.
            let (breaks, calm) = (&best.fit.space.breaks, best.calm);
            let (fit, equation_residual, residuals) = match problem.fit(breaks, task.weights, calm)
            {
                Ok((fit, equation_residual, _, residuals)) => (fit, equation_residual, residuals),
                // There is a surface without it.
                Err(Error::NoSolution(_)) => break,
                Err(other) => return Err(other),
            };
            let next = State {
                judgement: self.judge(&residuals),
                fit,
                equation_residual,
                calm,
                residuals,
            };
            left = folded(&next);
            vain += 1;
            let dear = task.squares(&next) > task.dearest
                || task.met && !self.meets(&next)?
                || !self.holds(&best, &next);
            if left.len() < fewest && !dear {
                (fewest, vain) = (left.len(), 0);
                best = next;
                task.stiff.clone_from(&stiff);
            }
        }
        Ok(best)
    }

    /// Stiffens the cells of these places, and their neighbours less.
    fn stiffen(&self, stiff: &mut [f64], places: impl Iterator<Item = DVec2>, state: &State) {
        let space = &state.fit.space;
        let spans = space.spans();
        let closed = self.topology.closed();
        let before = stiff.to_vec();
        for at in places {
            let cell = [space.span(0, at.x), space.span(1, at.y)];
            let around = [0, 1].map(|d| around(cell[d], spans[d], closed[d]));
            for b in around[1].into_iter().flatten() {
                for a in around[0].into_iter().flatten() {
                    let k = b * spans[0] + a;
                    let next = match [a, b] == cell {
                        true => (STIFFNESS_FACTOR * before[k]).max(FIRST_STIFFNESS),
                        false => (NEIGHBOUR_STIFFNESS_FACTOR * before[k])
                            .max(NEIGHBOUR_STIFFNESS_FACTOR / STIFFNESS_FACTOR * FIRST_STIFFNESS),
                    };
                    stiff[k] = stiff[k].max(next);
                }
            }
        }
    }
}

/// Bounds and state of unfolding.
struct Task<'a> {
    weights: &'a [f64],
    /// Largest acceptable sum of squares.
    dearest: f64,
    met: bool,
    /// Additional stiffness of each cell.
    stiff: Vec<f64>,
}

impl Task<'_> {
    fn squares(&self, state: &State) -> f64 {
        weighted_squares(&state.residuals, self.weights)
    }
}

/// The weighted sum of squared distances.
fn weighted_squares(residuals: &[Residual], weights: &[f64]) -> f64 {
    let pairs = residuals.iter().zip(weights);
    pairs.map(|(r, w)| w * r.distance.powi(2)).sum()
}

/// The numbers of these inside the scan and at its rims.
fn apart(folded: &[&Facing]) -> (usize, usize) {
    let inside = folded.iter().filter(|f| f.inside).count();
    (inside, folded.len() - inside)
}

/// A span with the ones before and after it, of `count` spans.
fn around(span: usize, count: usize, closed: bool) -> [Option<usize>; 3] {
    let before = span.checked_sub(1).or(closed.then_some(count - 1));
    let after = match span + 1 < count {
        true => Some(span + 1),
        false => closed.then_some(0),
    };
    [before, Some(span), after]
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may stop")]
mod tests {
    use super::around;
    use crate::chart::{Chart, Topology};
    use crate::fit::approximate::{ApproximateOptions, Facing, Guides, approximate_guided};
    use nurbskin_geometry::progress::Silent;
    use nurbskin_geometry::{DVec2, DVec3, NurbsSurface};

    /// A bent sheet with a strip of the domain bare but for a few places that would pull the surface back under itself.
    fn fitted(facing: &[Facing]) -> (NurbsSurface, f64) {
        let parameters: Vec<DVec2> = (0..40 * 38)
            .map(|k| DVec2::new(f64::from(k % 40), f64::from(k / 40)) / 39.0)
            .collect();
        let at = |t: &DVec2| DVec3::new(t.x, t.y, 0.1 * (6.0 * t.x).sin() * (5.0 * t.y).cos());
        let rough = |k: usize| 0.003 * DVec3::Z * (977.0 * k as f64).sin();
        let points: Vec<DVec3> = (0..parameters.len())
            .map(|k| at(&parameters[k]) + rough(k))
            .collect();
        let support: Vec<(DVec3, DVec2)> = (0..3)
            .map(|k| 0.4 + 0.02 * f64::from(k))
            .map(|u| (at(&DVec2::new(u, 0.92)), DVec2::new(u, 1.0)))
            .collect();
        let chart = Chart {
            topology: Topology::Disk,
            parameters,
            size: [1.0, 1.0],
            reason: String::new(),
        };
        let guides = Guides {
            support: &support,
            facing,
            ..Guides::default()
        };
        let options = ApproximateOptions {
            refine: false,
            spans: Some([16, 16]),
            ..ApproximateOptions::new(1e-3)
        };
        let fit = approximate_guided(&points, &chart, &guides, &options, &Silent).unwrap();
        let squares: f64 = fit.residuals.iter().map(|r| r * r).sum();
        (fit.surface, (squares / points.len() as f64).sqrt())
    }

    #[test]
    fn a_fold_is_taken_out_at_a_small_cost() {
        let facing: Vec<Facing> = (0..21 * 21)
            .map(|k| Facing {
                parameters: DVec2::new(f64::from(k % 21), f64::from(k / 21)) / 20.0,
                normal: DVec3::Z,
                inside: false,
            })
            .collect();
        let folded = |surface: &NurbsSurface| {
            let turned = |f: &&Facing| normal(surface, f.parameters).z < 0.0;
            facing.iter().filter(turned).count()
        };
        let (as_it_is, before) = fitted(&[]);
        let (mended, after) = fitted(&facing);
        assert!(folded(&as_it_is) > 0);
        assert_eq!(folded(&mended), 0);
        assert!(after < 1.035 * before, "{after} {before}");
    }

    /// `S_u x S_v` by differences.
    fn normal(surface: &NurbsSurface, t: DVec2) -> DVec3 {
        let along = |step: DVec2| {
            let ends = [t - step, t + step].map(|t| t.clamp(DVec2::ZERO, DVec2::ONE));
            surface.point(ends[1].x, ends[1].y) - surface.point(ends[0].x, ends[0].y)
        };
        along(DVec2::new(1e-6, 0.0)).cross(along(DVec2::new(0.0, 1e-6)))
    }

    #[test]
    fn neighbours_wrap_round_where_closed() {
        assert_eq!(around(0, 4, false), [None, Some(0), Some(1)]);
        assert_eq!(around(0, 4, true), [Some(3), Some(0), Some(1)]);
        assert_eq!(around(3, 4, true), [Some(2), Some(3), Some(0)]);
        assert_eq!(around(3, 4, false), [Some(2), Some(3), None]);
    }
}
