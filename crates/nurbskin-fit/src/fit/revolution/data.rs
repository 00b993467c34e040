//! The points of a surface of revolution as the fit sees them: along the profile, around the axis, and off it.

use crate::chart::revolution::{ProfileCurve, ProfileEnd, Revolution, Sample, Target};
use nurbskin_geometry::DVec2;
use nurbskin_geometry::numeric::statistics::{SIGMA_PER_MAD, median_in_place};
use nurbskin_geometry::{DVec3, Result};

/// Points on which the profile is fitted and the decision rests, at most.
pub(super) const POINTS: usize = 60_000;
/// Means along the profile that stand for the points while knots are chosen, at most.
const MEANS: usize = 400;
/// Distances beyond so many sigma (and a tolerance) are outliers.
const OUT: f64 = 6.0;
/// Part of a spacing by which a dense profile may be off where it bends.
pub(super) const SLACK: f64 = 0.2;
/// Width of the rows over which a profile is judged by itself, in spacings.
const ROW: f64 = 2.0;

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
    /// A sample of so many points.
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
        // A profile that is not yet good enough must not lose its points.
        let slack = SLACK * self.spacing;
        for (w, e) in self.weights.iter_mut().zip(&self.offsets) {
            *w = if e.abs() <= OUT * self.sigma + tolerance + slack {
                let scale = 3.0 * self.sigma + tolerance + slack;
                (1.0 + (e / scale).powi(2)).powi(-2)
            } else {
                0.0
            };
        }
    }

    /// Width of the rows of points over which a profile is judged.
    pub(super) fn row(&self) -> f64 {
        ROW * self.spacing
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

    /// The offsets less the median of their row, which another profile could make zero.
    pub(super) fn about_rows(&self, curve: &ProfileCurve) -> Vec<f64> {
        let domain = curve.knots().domain();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to 1..=4000"
        )]
        let count = ((domain.1 - domain.0) / self.row()).clamp(1.0, 4000.0) as usize;
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
        let mut found: Vec<[Option<usize>; 2]> = vec![[None; 2]; MEANS];
        for k in (0..self.s.len()).filter(|&k| self.weights[k] > 0.0) {
            let [least, most] = &mut found[self.piece(k, domain, MEANS)];
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

    /// Means over short pieces of the profile: of the offsets from `curve`, put back on it.
    pub(super) fn means(&self, curve: &ProfileCurve) -> Vec<Target> {
        let domain = curve.knots().domain();
        let count = MEANS.min(self.points.len() / 4).max(1);
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
        let knots = crate::chart::revolution::knots_over(breaks, dense.knots().is_periodic())?;
        let mut curve = ProfileCurve::fit(&knots, targets, ends, Some(dense))?;
        let mut targets = targets.to_vec();
        for round in 0..Self::ROUNDS {
            for t in &mut targets {
                t.s = curve.foot_in(t.at, t.s, 1);
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
