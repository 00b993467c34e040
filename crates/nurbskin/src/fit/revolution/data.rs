//! The points of a surface of revolution as the fit sees them: along the profile, around the axis, and off it.

use crate::DVec2;
use crate::chart::revolution::{ProfileCurve, ProfileEnd, Revolution, Sample, Target};
use crate::numeric::statistics::{SIGMA_PER_MAD, median_in_place};
use crate::{DVec3, Result};

/// Points on which the profile is fitted and the decision rests, at most.
const POINTS: usize = 60_000;
/// Means along the profile that stand for the points while knots are chosen, at most.
const MEANS: usize = 1500;
/// Distances beyond so many sigma (and a tolerance) are outliers.
const OUT: f64 = 6.0;

/// Points with their places.
pub(super) struct Data {
    pub(super) points: Vec<DVec3>,
    /// (radius, height) of each.
    pub(super) flat: Vec<DVec2>,
    /// Place along the profile; NaN for points that are on no place.
    pub(super) s: Vec<f64>,
    /// Angle around the axis, in radians.
    pub(super) angles: Vec<f64>,
    /// Distance from the profile, signed; infinite for points that are on no place.
    pub(super) offsets: Vec<f64>,
    /// Robust weights.
    pub(super) weights: Vec<f64>,
    /// Standard deviation of the offsets.
    pub(super) sigma: f64,
    /// The side of the square that one of these points stands for.
    pub(super) spacing: f64,
}

impl Data {
    pub(super) fn new(
        points: &[DVec3],
        normals: &[DVec3],
        found: &Revolution,
        spacing: f64,
        tolerance: f64,
    ) -> Self {
        let sample = Sample::new(points, normals, POINTS);
        let share = points.len() as f64 / sample.points.len().max(1) as f64;
        let s = found.locate(&sample.points, &sample.normals);
        let angle = |&p: &DVec3| found.sector.angle(&found.axis, p);
        let mut this = Self {
            flat: sample.points.iter().map(|&p| found.axis.radius_height(p)).collect(),
            angles: sample.points.iter().map(angle).collect(),
            offsets: vec![f64::INFINITY; s.len()],
            weights: vec![0.0; s.len()],
            sigma: 0.0,
            spacing: spacing * share.sqrt(),
            points: sample.points,
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
        for (w, e) in self.weights.iter_mut().zip(&self.offsets) {
            *w = if e.abs() <= OUT * self.sigma + tolerance {
                let scale = 3.0 * self.sigma + tolerance;
                (1.0 + (e / scale).powi(2)).powi(-2)
            } else {
                0.0
            };
        }
    }

    /// The points that count, as targets.
    pub(super) fn targets(&self) -> Vec<Target> {
        let all = self.flat.iter().zip(&self.s).zip(&self.weights);
        all.filter(|(_, w)| **w > 0.0)
            .map(|((&at, &s), &weight)| Target { at, s, weight })
            .collect()
    }

    /// Means over short pieces of the profile: of the offsets from `curve`, put back on it.
    pub(super) fn means(&self, curve: &ProfileCurve) -> Vec<Target> {
        let (a, b) = curve.knots().domain();
        let count = MEANS.min(self.points.len() / 4).max(1);
        let mut sums = vec![[0.0; 3]; count];
        for k in 0..self.s.len() {
            if self.weights[k] > 0.0 {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "feet are in the domain"
                )]
                let bin = ((self.s[k] - a) / (b - a) * count as f64) as usize;
                let sum = &mut sums[bin.min(count - 1)];
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

/// A curve over `breaks` that is nearest to the targets across the profile, starting from `dense`; with the targets'
/// feet on it and their distances.
pub(super) struct Fit {
    pub(super) curve: ProfileCurve,
    pub(super) feet: Vec<f64>,
    pub(super) offsets: Vec<f64>,
}

impl Fit {
    /// Rounds of placing the points along the curve anew.
    const ROUNDS: usize = 3;

    pub(super) fn new(
        targets: &[Target],
        breaks: &[f64],
        ends: [ProfileEnd; 2],
        dense: &ProfileCurve,
    ) -> Result<Self> {
        let knots =
            crate::chart::revolution::knots_over(breaks, dense.knots().is_periodic())?;
        let mut curve = ProfileCurve::fit(&knots, targets, ends, Some(dense))?;
        let mut targets = targets.to_vec();
        for round in 0..Self::ROUNDS {
            for t in &mut targets {
                t.s = curve.foot(t.at, t.s);
            }
            if round + 1 < Self::ROUNDS {
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
