//! A requested tolerance, and the distance of a surface from it as the verdict will measure it.
//!
//! ```text
//! reached:  share of |d| > T  ≤  (1 - 0.02) (1 - within),   and no biased region where σ ≥ 0.1 T
//! within reach:  T ≥ 1.07 σ Φ⁻¹(1 - (1 - within) / 2)
//! ```
//!
//! Below the second bound all goals are equivalent, since noise alone exceeds them. Ours.

use super::problem::{Known, Problem, State};
use crate::fit::approximate::is_noise;
use nurbskin_geometry::numeric::bias::{Allowed, Placed, bias};
use nurbskin_geometry::numeric::parallel::each_light;
use nurbskin_geometry::numeric::statistics::{normal_exceeded, quantile_in_place};
use nurbskin_geometry::nurbs::closest::ClosestPoint;
use nurbskin_geometry::{DVec3, Result};

/// Share of the points that may miss the goal that the search leaves unused. Dimensionless.
/// Guard: the search measures to the whole surface; where that is trimmed a verdict finds some points farther off.
const SEARCH_RESERVE: f64 = 0.02;
/// Multiple of the allowed share beyond the goal up to which the points that seem too far are measured again with
/// certified distances. Dimensionless.
/// Guard: of more, certified distances would not leave few enough.
const CERTIFY_UP_TO: f64 = 2.0;
/// Least such share of the points.
/// Guard: for goals that allow no point beyond.
const MIN_CERTIFIED_SHARE: f64 = 1e-3;
/// Standard deviations of the noise beyond which a point without weight that is alone in its neighbourhood is an
/// outlier: for the search for a goal, and for whoever leaves such points out after the fit.
/// Derived: one normal error in 1.7 million exceeds 5 sigma.
pub const OUTLIER_SIGMAS: f64 = 5.0;
/// Spacings beyond which such a point must lie, too.
/// Trial: not recorded. A smaller deviation may be a feature between two points.
pub const OUTLIER_SPACINGS: f64 = 0.6;

/// Share of the bias that a verdict allows a region which the search allows. Dimensionless.
/// Guard: the verdict cuts its regions a little elsewhere.
const BIAS_MARGIN: f64 = 0.9;
/// Factor of a goal that noise sets over the distance that noise takes. Dimensionless.
/// Guard: the measure of the noise is off by a few per cent. For 99.5 % of the points it makes three standard
/// deviations, as the aim of a fit.
const NOISE_GOAL_ROOM: f64 = 1.07;

/// A requested tolerance, and the share of the points that must keep it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    /// Largest distance between a point and the surface, in the unit of the points.
    pub tolerance: f64,
    /// Share of the points that must be within it, above 0 and up to 1.
    pub within: f64,
}

/// Distance of a surface from its goal.
#[derive(Clone, Debug)]
pub(super) struct Reach {
    /// Distance that the demanded share of the points keeps, in units of the tolerance.
    pub(super) distance: f64,
    /// Share of the points that are farther off than the tolerance.
    pub(super) beyond: f64,
    /// Root mean square distance.
    pub(super) rms: f64,
    /// The samples beyond the tolerance.
    pub(super) far: Vec<usize>,
    /// Whether enough points are within and, where noise takes a share of the tolerance, no region is biased.
    pub(super) reached: bool,
    /// Whether a region is biased, to which a verdict will object.
    pub(super) biased: bool,
}

impl Problem<'_> {
    /// The goal, or the closest one that noise allows any surface to reach, to which all tighter goals are equivalent.
    pub(super) fn within_reach(&self, goal: Goal) -> Goal {
        let (Known::Given(sigma) | Known::Estimated(sigma)) = self.noise;
        // Half a point of n is the resolution of a share.
        let beyond = (1.0 - goal.within).max(0.5 / self.own.max(1) as f64);
        Goal {
            tolerance: goal
                .tolerance
                .max(NOISE_GOAL_ROOM * normal_exceeded(0.5 * beyond) * sigma),
            ..goal
        }
    }

    /// Whether a state reaches the goal.
    pub(super) fn reaches(&self, state: &State, goal: Goal) -> Result<bool> {
        Ok(self.reach(state, goal)?.reached)
    }

    /// The points of the caller that count for a tolerance: all but the outliers of the pipeline.
    pub(super) fn counted(&self, state: &State, tolerance: f64) -> Vec<usize> {
        let area = self.size[0] * self.size[1];
        let spacing = (area / self.samples.measured().max(1) as f64).sqrt();
        let limit = tolerance
            .max(OUTLIER_SIGMAS * self.measure(state).sigma)
            .max(OUTLIER_SPACINGS * spacing);
        let far =
            |k: usize| state.judgement.weights[k] <= 0.0 && state.residuals[k].signed.abs() > limit;
        let counts = |k: &usize| {
            (self.samples.original[*k] as usize) < self.own
                && !(far(*k) && self.neighbourhoods.is_alone(*k, far))
        };
        (0..state.residuals.len()).filter(counts).collect()
    }

    /// Whether a verdict will object to a region of these points although the state keeps the goal.
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
        allowed.offset *= BIAS_MARGIN;
        bias(&placed, allowed).biased > 0
    }

    /// Distance of a state from the goal, as the verdict on the points will measure it.
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
        let allowed = (1.0 - SEARCH_RESERVE) * (1.0 - goal.within);
        // Foot points are found near the parameters; the nearest place may lie elsewhere.
        let far: Vec<usize> = (0..off.len())
            .filter(|&i| off[i] > goal.tolerance)
            .collect();
        let doubtful = (CERTIFY_UP_TO * allowed).max(MIN_CERTIFIED_SHARE);
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
