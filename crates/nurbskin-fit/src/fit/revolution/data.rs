//! The points of a surface of revolution in its coordinates: place s along the profile, angle, and offset from the
//! profile.
//!
//! ```text
//! w = (1 + (e / (3 σ + T + slack))²)⁻²   for |e| ≤ 6 σ + T + slack,   else 0
//! ```
//!
//! While knots are chosen, means of up to 400 short pieces of the profile stand for the points; for exact points the
//! extremes of each piece. [`Fit`] alternates between fitting a curve and projecting these targets to it. Ours.

use crate::chart::revolution::{ProfileCurve, ProfileEnd, Revolution, Sample, Target};
use nurbskin_geometry::DVec2;
use nurbskin_geometry::numeric::statistics::{SIGMA_PER_MAD, median_in_place};
use nurbskin_geometry::{DVec3, Result};

/// Points, at most, to which the profile is fitted and on which the decision rests. Count.
/// Guard: bounds the time; errors fall with the root of the number.
pub(super) const MAX_SAMPLE_POINTS: usize = 60_000;
/// Means along the profile, at most, that stand for the points while knots are chosen. Count.
/// Guard: bounds the time of each trial; 1500 was used before.
const MAX_PROFILE_MEANS: usize = 400;
/// Fewest points per mean, on average. Count.
/// Guard: a mean of fewer is a point.
const POINTS_PER_MEAN: usize = 4;
/// Most rows along the profile. Count.
/// Guard: bounds the memory.
const MAX_ROWS: f64 = 4000.0;
/// Distance in sigma, plus a tolerance and the slack, beyond which a point is an outlier.
/// Derived: one normal error in 500 million exceeds 6 sigma.
const PROFILE_REJECTION_SIGMAS: f64 = 6.0;
/// Distance in sigma, plus a tolerance and the slack, at which a point has a quarter of its weight.
/// Trial: not recorded.
const PROFILE_WEIGHT_SIGMAS: f64 = 3.0;
/// Distance, in spacings, by which a dense profile may be off where it bends.
/// Trial: on scans with sharp bends, whose points were lost without it.
pub(super) const BEND_SLACK: f64 = 0.2;
/// Width of the rows of points over which a profile is judged, in spacings.
/// Trial: not recorded. Narrower rows hold few points.
const ROW_WIDTH: f64 = 2.0;

/// Points with their places.
pub(super) struct Data {
    pub(super) points: Vec<DVec3>,
    /// (radius, height) of each.
    pub(super) flat: Vec<DVec2>,
    /// Place along the profile; NaN for points without one.
    pub(super) s: Vec<f64>,
    /// Angle around the axis, in radians.
    pub(super) angles: Vec<f64>,
    /// Signed distance from the profile; infinite for points without a place.
    pub(super) offsets: Vec<f64>,
    /// Robust weights.
    pub(super) weights: Vec<f64>,
    /// Standard deviation of the offsets.
    pub(super) sigma: f64,
    /// Side of the square that one of these points represents.
    pub(super) spacing: f64,
}

impl Data {
    /// From a sample of `of_points` points.
    pub(super) fn new(
        sample: &Sample,
        of_points: usize,
        found: &Revolution,
        spacing: f64,
        tolerance: f64,
    ) -> Self {
        let share = of_points as f64 / sample.points.len().max(1) as f64;
        let s = found.locate(&sample.points, &sample.normals);
        let angle = |&p: &DVec3| found.sector.angle(&found.axis, p);
        let mut this = Self {
            flat: sample
                .points
                .iter()
                .map(|&p| found.axis.radius_height(p))
                .collect(),
            angles: sample.points.iter().map(angle).collect(),
            offsets: vec![f64::INFINITY; s.len()],
            weights: vec![0.0; s.len()],
            sigma: 0.0,
            spacing: spacing * share.sqrt(),
            points: sample.points.clone(),
            s,
        };
        this.measure(&found.profile, tolerance);
        this
    }

    /// Whether point k has a place on the profile.
    pub(super) fn on(&self, k: usize) -> bool {
        self.s[k].is_finite()
    }

    /// Feet, offsets and weights with respect to `curve`.
    pub(super) fn measure(&mut self, curve: &ProfileCurve, tolerance: f64) {
        for (k, &q) in self.flat.iter().enumerate() {
            if self.s[k].is_finite() {
                self.s[k] = curve.foot(q, self.s[k]);
                self.offsets[k] = curve.offset(q, self.s[k]).0;
            }
        }
        let finite = self.offsets.iter().filter(|e| e.is_finite());
        let mut absolute: Vec<f64> = finite.map(|e| e.abs()).collect();
        let sigma = SIGMA_PER_MAD * median_in_place(&mut absolute);
        self.sigma = if sigma.is_finite() { sigma } else { 0.0 };
        // A coarse profile must not lose its points.
        let slack = BEND_SLACK * self.spacing;
        for (w, e) in self.weights.iter_mut().zip(&self.offsets) {
            *w = if e.abs() <= PROFILE_REJECTION_SIGMAS * self.sigma + tolerance + slack {
                let scale = PROFILE_WEIGHT_SIGMAS * self.sigma + tolerance + slack;
                (1.0 + (e / scale).powi(2)).powi(-2)
            } else {
                0.0
            };
        }
    }

    /// Width of the rows of points over which a profile is judged.
    pub(super) fn row(&self) -> f64 {
        ROW_WIDTH * self.spacing
    }

    /// The number of the piece of the profile, of `count`, in which point k lies.
    fn piece(&self, k: usize, (a, b): (f64, f64), count: usize) -> usize {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "feet are in the domain"
        )]
        let piece = ((self.s[k] - a) / (b - a) * count as f64) as usize;
        piece.min(count - 1)
    }

    /// The offsets minus the median of their row, which another profile could remove.
    pub(super) fn about_rows(&self, curve: &ProfileCurve) -> Vec<f64> {
        let domain = curve.knots().domain();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to 1..=4000"
        )]
        let count = ((domain.1 - domain.0) / self.row()).clamp(1.0, MAX_ROWS) as usize;
        let mut rows = vec![Vec::new(); count];
        for k in (0..self.s.len()).filter(|&k| self.on(k)) {
            rows[self.piece(k, domain, count)].push(self.offsets[k]);
        }
        let middles: Vec<f64> = rows.iter_mut().map(|row| median_in_place(row)).collect();
        let rest = |k: usize| {
            if self.on(k) {
                self.offsets[k] - middles[self.piece(k, domain, count)]
            } else {
                f64::INFINITY
            }
        };
        (0..self.s.len()).map(rest).collect()
    }

    /// The points that are farthest off to either side in each short piece of the profile.
    pub(super) fn extremes(&self, curve: &ProfileCurve) -> Vec<Target> {
        let domain = curve.knots().domain();
        let mut found: Vec<[Option<usize>; 2]> = vec![[None; 2]; MAX_PROFILE_MEANS];
        for k in (0..self.s.len()).filter(|&k| self.weights[k] > 0.0) {
            let [least, most] = &mut found[self.piece(k, domain, MAX_PROFILE_MEANS)];
            if least.is_none_or(|l| self.offsets[k] < self.offsets[l]) {
                *least = Some(k);
            }
            if most.is_none_or(|m| self.offsets[k] > self.offsets[m]) {
                *most = Some(k);
            }
        }
        let target = |k: usize| Target {
            at: self.flat[k],
            s: self.s[k],
            weight: 1.0,
        };
        found.into_iter().flatten().flatten().map(target).collect()
    }

    /// Means over short pieces of the profile: of the offsets from `curve`, added to it again.
    pub(super) fn means(&self, curve: &ProfileCurve) -> Vec<Target> {
        let domain = curve.knots().domain();
        let count = MAX_PROFILE_MEANS
            .min(self.points.len() / POINTS_PER_MEAN)
            .max(1);
        let mut sums = vec![[0.0; 3]; count];
        for k in 0..self.s.len() {
            if self.weights[k] > 0.0 {
                let sum = &mut sums[self.piece(k, domain, count)];
                let w = self.weights[k];
                sum[0] += w;
                sum[1] += w * self.s[k];
                sum[2] += w * self.offsets[k];
            }
        }
        sums.iter()
            .filter(|sum| sum[0] > 0.0)
            .map(|&[weight, s, offset]| {
                let s = s / weight;
                let [c, c1, _] = curve.derivatives(s);
                let t = c1.normalize_or(DVec2::Y);
                Target {
                    at: c + offset / weight * DVec2::new(-t.y, t.x),
                    s,
                    weight,
                }
            })
            .collect()
    }
}

/// The least squares curve over `breaks` to the targets across the profile, starting from `dense`; with the foot points
/// and offsets of the targets.
pub(super) struct Fit {
    pub(super) curve: ProfileCurve,
    pub(super) feet: Vec<f64>,
    pub(super) offsets: Vec<f64>,
}

impl Fit {
    /// Rounds of projecting the targets to the curve. Count.
    /// Trial: not recorded.
    const PROJECTION_ROUNDS: usize = 3;

    pub(super) fn new(
        targets: &[Target],
        breaks: &[f64],
        ends: [ProfileEnd; 2],
        dense: &ProfileCurve,
    ) -> Result<Self> {
        let knots = crate::chart::revolution::knots_over(breaks, dense.knots().is_periodic())?;
        let mut curve = ProfileCurve::fit(&knots, targets, ends, Some(dense))?;
        let mut targets = targets.to_vec();
        for round in 0..Self::PROJECTION_ROUNDS {
            for t in &mut targets {
                t.s = curve.foot_in(t.at, t.s, 1);
            }
            if round + 1 < Self::PROJECTION_ROUNDS {
                curve = ProfileCurve::fit(&knots, &targets, ends, Some(&curve))?;
            }
        }
        Ok(Self {
            offsets: targets.iter().map(|t| curve.offset(t.at, t.s).0).collect(),
            feet: targets.iter().map(|t| t.s).collect(),
            curve,
        })
    }

    /// Weighted sum of squares.
    pub(super) fn squares(&self, targets: &[Target]) -> f64 {
        let each = self.offsets.iter().zip(targets);
        each.map(|(e, t)| t.weight * e * e).sum()
    }
}
