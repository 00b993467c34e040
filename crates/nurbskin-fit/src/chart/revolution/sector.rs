//! How far around the axis the data reach.

use super::axis::Axis;
use glam::DVec3;
use std::f64::consts::TAU;

/// Part of the usual number of points below which a range of angles counts as empty.
const SPARSE: f64 = 0.15;
/// A gap is at least this wide, in radians and in spacings.
const GAP: [f64; 2] = [0.1, 4.0];

/// The angles about an axis that a scan covers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sector {
    /// Direction of the angle 0, perpendicular to the axis.
    pub start: DVec3,
    /// How far it reaches counter-clockwise about the axis, in radians; a whole turn is exactly 2 pi.
    pub sweep: f64,
}

impl Sector {
    /// Whether it is a whole turn.
    #[must_use]
    pub fn whole(&self) -> bool {
        self.sweep >= TAU
    }
    /// The angle of a point, counter-clockwise from the start, in [0, 2 pi); for a sector what lies before the start
    /// is negative.
    #[must_use]
    pub fn angle(&self, axis: &Axis, p: DVec3) -> f64 {
        let (_, across) = axis.split(p);
        let y = axis.direction.cross(self.start);
        let angle = across.dot(y).atan2(across.dot(self.start)).rem_euclid(TAU);
        // Half of what is missing lies on either side.
        if !self.whole() && angle > 0.5 * (self.sweep + TAU) {
            angle - TAU
        } else {
            angle
        }
    }
}

/// The sector of these points, all of which are on the surface: a whole turn unless there is a gap from one end of the
/// profile to the other.
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
    // 1. Points per range of angles; a range holds about 30, and is at least a spacing wide.
    let finest = TAU * radius / spacing.max(f64::MIN_POSITIVE);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to 16..=180"
    )]
    let bins = (points.len() as f64 / 30.0).min(finest).clamp(16.0, 180.0) as usize;
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
    // 2. The longest run of empty ranges, around the circle.
    let empty = |k: usize| (counts[k % bins] as f64) < SPARSE * usual;
    let (mut longest, mut from, mut run) = (0, 0, 0);
    for k in 0..2 * bins {
        run = if empty(k) { run + 1 } else { 0 };
        if run > longest && run <= bins {
            (longest, from) = (run, k + 1 - run);
        }
    }
    let gap = longest as f64 * width;
    if longest == 0 || longest == bins || gap < GAP[0].max(GAP[1] * spacing / radius) {
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
    let (sin, cos) = (middle + first).sin_cos();
    Sector {
        start: cos * x + sin * axis.direction.cross(x),
        sweep: last - first,
    }
}
