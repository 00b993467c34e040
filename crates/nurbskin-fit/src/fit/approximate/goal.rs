//! A tolerance that was asked for, and how far a surface is from it, as the verdict on the points will see it.

use super::problem::{Known, Problem, State};
use crate::fit::approximate::is_noise;
use nurbskin_geometry::numeric::bias::{Allowed, Placed, bias};
use nurbskin_geometry::numeric::parallel::each_light;
use nurbskin_geometry::numeric::statistics::{normal_exceeded, quantile_in_place};
use nurbskin_geometry::nurbs::closest::ClosestPoint;
use nurbskin_geometry::{DVec3, Result};

/// Part of the points that may miss the goal that the search does not use: it measures to the whole surface, and where that
/// is trimmed a verdict finds some points farther off. A guard.
const RESERVE: f64 = 0.02;
/// Multiple of the share that may be beyond the goal up to which the points that seem too far are measured again, certified:
/// of more, certified distances would not leave few enough.
const DOUBTFUL: f64 = 2.0;
/// The least such share. A guard where no point may be beyond.
const LEAST_DOUBTFUL: f64 = 1e-3;
/// A point without weight that is alone and farther off than this many standard deviations of the noise is an outlier, as it
/// is to the pipeline (`surfacing::outliers::lost`), which leaves it out, ...
const LOST_SIGMAS: f64 = 5.0;
/// ... if it is also farther off than this many spacings: less may be a feature between two points.
const LOST_SPACINGS: f64 = 0.6;

/// Part of what a verdict allows a region to be off that the search allows: the verdict cuts its regions a little elsewhere.
const CAREFUL: f64 = 0.9;
/// A goal that noise sets leaves this much more room than the noise takes: its own measure is off by a few per cent. For 99.5 %
/// it is three standard deviations, as with what a fit aims at by itself.
const ROOM: f64 = 1.07;

/// A tolerance that was asked for, and how many of the points must keep it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    /// Largest distance between a point and the surface, in the unit of the points.
    pub tolerance: f64,
    /// Share of the points that must be within it, above 0 and up to 1.
    pub within: f64,
}

/// How far a surface is from its goal.
#[derive(Clone, Debug)]
pub(super) struct Reach {
    /// Distance within which the demanded share of the points lies, in the tolerance.
    pub(super) distance: f64,
    /// Share of the points that are farther off than the tolerance.
    pub(super) beyond: f64,
    /// Root mean square distance.
    pub(super) rms: f64,
    /// The samples that are farther off.
    pub(super) far: Vec<usize>,
    /// Whether as many are within as must be and, where noise takes a part of the tolerance, no region is biased.
    pub(super) reached: bool,
    /// Whether a region is biased, which a verdict will hold against the surface.
    pub(super) biased: bool,
}

impl Problem<'_> {
    /// The goal, or the closest one that the noise of the points leaves to any surface: below that, all tolerances ask for
    /// the same.
    pub(super) fn within_reach(&self, goal: Goal) -> Goal {
        let (Known::Given(sigma) | Known::Estimated(sigma)) = self.noise;
        // All of n points are within where less than half a point is not.
        let beyond = (1.0 - goal.within).max(0.5 / self.own.max(1) as f64);
        Goal {
            tolerance: goal
                .tolerance
                .max(ROOM * normal_exceeded(0.5 * beyond) * sigma),
            ..goal
        }
    }

    /// Whether a state reaches the goal.
    pub(super) fn reaches(&self, state: &State, goal: Goal) -> Result<bool> {
        Ok(self.reach(state, goal)?.reached)
    }

    /// The caller's points that count for a tolerance: not those that are outliers to the pipeline.
    pub(super) fn counted(&self, state: &State, tolerance: f64) -> Vec<usize> {
        let area = self.size[0] * self.size[1];
        let spacing = (area / self.samples.measured().max(1) as f64).sqrt();
        let limit = tolerance
            .max(LOST_SIGMAS * self.measure(state).sigma)
            .max(LOST_SPACINGS * spacing);
        let far =
            |k: usize| state.judgement.weights[k] <= 0.0 && state.residuals[k].signed.abs() > limit;
        let counts = |k: &usize| {
            (self.samples.original[*k] as usize) < self.own
                && !(far(*k) && self.neighbourhoods.is_alone(*k, far))
        };
        (0..state.residuals.len()).filter(counts).collect()
    }

    /// Whether a verdict will hold a region of these points against a state that keeps the goal.
    pub(super) fn is_biased(&self, state: &State, points: &[usize], goal: Goal) -> bool {
        let placed: Vec<Placed> = points
            .iter()
            .map(|&k| {
                let r = &state.residuals[k];
                Placed {
                    face: 0,
                    u: r.foot.x,
                    v: r.foot.y,
                    signed: r.distance.copysign(r.signed),
                }
            })
            .collect();
        let sigma = self.measure(state).sigma;
        let mut allowed = Allowed::in_verdicts(goal.tolerance, sigma, goal.within, placed.len());
        allowed.offset *= CAREFUL;
        bias(&placed, allowed).biased > 0
    }

    /// How far a state is from the goal, as the verdict on the points will see it.
    pub(super) fn reach(&self, state: &State, goal: Goal) -> Result<Reach> {
        let sigma = self.measure(state).sigma;
        let points = self.counted(state, goal.tolerance);
        let mut off: Vec<f64> = points
            .iter()
            .map(|&k| state.residuals[k].distance)
            .collect();
        if off.is_empty() {
            return Ok(Reach {
                distance: 0.0,
                beyond: 0.0,
                rms: 0.0,
                far: Vec::new(),
                reached: true,
                biased: false,
            });
        }
        let allowed = (1.0 - RESERVE) * (1.0 - goal.within);
        // Feet are found from near the parameters: what seems too far may be nearer elsewhere.
        let far: Vec<usize> = (0..off.len())
            .filter(|&i| off[i] > goal.tolerance)
            .collect();
        let doubtful = (DOUBTFUL * allowed).max(LEAST_DOUBTFUL);
        if far.len() as f64 <= doubtful * off.len() as f64
            && (far.len() as f64 > allowed * off.len() as f64 || !self.unseen.is_empty())
        {
            let surface = state.fit.surface(|p| p)?;
            let closest = ClosestPoint::new(&surface)?;
            let distance = |p: DVec3| closest.closest(p).distance;
            let nearer = each_light(far.len(), |i| distance(self.samples.points[points[far[i]]]));
            for (&i, d) in far.iter().zip(nearer) {
                off[i] = off[i].min(d);
            }
            off.extend(each_light(self.unseen.len(), |i| {
                distance(self.samples.scaled(self.unseen[i]))
            }));
        }
        let far = far
            .into_iter()
            .filter(|&i| off[i] > goal.tolerance)
            .map(|i| points[i])
            .collect();
        let beyond = off.iter().filter(|&&d| d > goal.tolerance).count() as f64 / off.len() as f64;
        let rms = (off.iter().map(|d| d * d).sum::<f64>() / off.len() as f64).sqrt();
        let distance = if allowed <= 0.0 {
            off.iter().copied().fold(0.0, f64::max)
        } else {
            quantile_in_place(&mut off, 1.0 - allowed)
        } / goal.tolerance;
        let shared = beyond <= allowed;
        let mut biased = false;
        if shared {
            biased = self.is_biased(state, &points, goal);
        }
        Ok(Reach {
            distance,
            beyond,
            rms,
            far,
            reached: shared && !(biased && is_noise(sigma, goal.tolerance)),
            biased,
        })
    }
}
