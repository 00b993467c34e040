//! The sector about the axis that a scan covers.
//!
//! A histogram of the points' angles shows the longest run of empty bins. If it is wide enough, the scan covers a
//! sector from the first to the last point outside of the gap; otherwise it covers a whole turn. Since the histogram is
//! over the whole profile, only gaps from one end of the profile to the other open the sector.
//!
//! Source: ours.

use super::axis::Axis;
use glam::DVec3;
use nurbskin_geometry::math;
use std::f64::consts::TAU;

/// Share of the usual number of points of a bin of angles, below which the bin counts as empty. Trial: not recorded.
/// With 0 single outliers bridge a gap; a large share sees gaps where the scan is thin.
const EMPTY_BIN_SHARE: f64 = 0.15;
/// Least width of a gap around the axis, in radians and in spacings at the mean radius. Trial: not recorded. A smaller
/// one opens whole turns at chance gaps between points.
const MIN_GAP: [f64; 2] = [0.1, 4.0];
/// Mean number of points per bin of angles. Derived: the count of a bin then scatters by 1/√30 = 18 %, far from the
/// threshold of an empty one.
const POINTS_PER_BIN: f64 = 30.0;
/// Fewest and most bins of angles around the axis. Guard: 16 still show a gap, more than 180 are finer than the least
/// gap.
const ANGLE_BINS: [f64; 2] = [16.0, 180.0];

/// The angles about an axis that a scan covers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sector {
    /// Direction of the angle 0, perpendicular to the axis.
    pub start: DVec3,
    /// Angle that it covers counter-clockwise about the axis, in radians; a whole turn is exactly 2 pi.
    pub sweep: f64,
}

impl Sector {
    /// Whether it is a whole turn.
    #[must_use]
    pub fn whole(&self) -> bool {
        self.sweep >= TAU
    }
    /// The angle of a point, counter-clockwise from the start, in \[0, 2 pi); negative for points just before the start
    /// of a sector.
    #[must_use]
    pub fn angle(&self, axis: &Axis, p: DVec3) -> f64 {
        let (_, across) = axis.split(p);
        let y = axis.direction.cross(self.start);
        let angle = math::atan2(across.dot(y), across.dot(self.start)).rem_euclid(TAU);
        // Half of the open angle belongs to either side.
        if !self.whole() && angle > 0.5 * (self.sweep + TAU) {
            angle - TAU
        } else {
            angle
        }
    }
}

/// The sector of points on the surface: a whole turn unless a gap reaches from one end of the profile to the other.
pub(super) fn sector(points: &[DVec3], axis: &Axis, spacing: f64) -> Sector {
    let [x, _] = axis.frame();
    let whole = Sector {
        start: x,
        sweep: TAU,
    };
    let mut angles = Vec::with_capacity(points.len());
    let mut radii = 0.0;
    for &p in points {
        radii += axis.split(p).1.length();
        angles.push(whole.angle(axis, p));
    }
    let radius = radii / points.len().max(1) as f64;
    // 1. Points per bin of angles; a bin holds about 30 points and is at least a spacing wide.
    let finest = TAU * radius / spacing.max(f64::MIN_POSITIVE);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to ANGLE_BINS"
    )]
    let bins = (points.len() as f64 / POINTS_PER_BIN)
        .min(finest)
        .clamp(ANGLE_BINS[0], ANGLE_BINS[1]) as usize;
    let width = TAU / bins as f64;
    let bin = |angle: f64| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "angles are in [0, 2 pi)"
        )]
        let k = (angle / width) as usize;
        k.min(bins - 1)
    };
    let mut counts = vec![0_usize; bins];
    for &angle in &angles {
        counts[bin(angle)] += 1;
    }
    let mut sorted: Vec<usize> = counts.iter().copied().filter(|&c| c > 0).collect();
    sorted.sort_unstable();
    let usual = sorted.get(sorted.len() * 2 / 3).copied().unwrap_or(0) as f64;
    // 2. The longest run of empty bins around the circle.
    let empty = |k: usize| (counts[k % bins] as f64) < EMPTY_BIN_SHARE * usual;
    let (mut longest, mut from, mut run) = (0, 0, 0);
    for k in 0..2 * bins {
        run = if empty(k) { run + 1 } else { 0 };
        if run > longest && run <= bins {
            (longest, from) = (run, k + 1 - run);
        }
    }
    let gap = longest as f64 * width;
    if longest == 0 || longest == bins || gap < MIN_GAP[0].max(MIN_GAP[1] * spacing / radius) {
        return whole;
    }
    // 3. The sector from the first to the last point outside of the gap.
    let middle = (from as f64 + 0.5 * longest as f64) * width;
    let edge = 0.5 * gap - 0.5 * width;
    let (mut first, mut last) = (TAU, 0.0_f64);
    for angle in &angles {
        let past = (angle - middle).rem_euclid(TAU);
        if past > edge && past < TAU - edge {
            first = first.min(past);
            last = last.max(past);
        }
    }
    if last <= first {
        return whole;
    }
    let (sin, cos) = math::sin_cos(middle + first);
    Sector {
        start: cos * x + sin * axis.direction.cross(x),
        sweep: last - first,
    }
}
