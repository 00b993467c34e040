//! A tube along a trefoil knot.
//!
//! The axis is the torus knot c(t) = ((R + a cos 3t) cos 2t, (R + a cos 3t) sin 2t, a sin 3t), and the surface is the
//! set of points at the tube's radius from it. The tube is thinner than the curve's radius of curvature and than half
//! the distance of its strands, so the closest point of the tube is that of the axis, moved by the radius.

use glam::DVec3;
use nurbskin_geometry::math;
use std::f64::consts::TAU;
use std::sync::OnceLock;

/// Radius of the tube, mm; by design.
pub(super) const RADIUS: f64 = 7.0;
/// Radius of the torus that the knot winds on, mm; by design.
const RING: f64 = 40.0;
/// Section radius of that torus, mm; by design.
const SECTION: f64 = 16.0;
/// Samples of the axis where a search starts. Guard: 2.5 mm apart, where the curve turns by less than 5 degrees.
const SAMPLES: usize = 256;
/// Most steps of Newton's method. Guard: 4 or 5 suffice from a sample.
const MAX_STEPS: usize = 30;

/// c, c' and c'' at t.
fn axis(t: f64) -> [DVec3; 3] {
    let (s2, c2) = math::sin_cos(2.0 * t);
    let (s3, c3) = math::sin_cos(3.0 * t);
    let r = [
        RING + SECTION * c3,
        -3.0 * SECTION * s3,
        -9.0 * SECTION * c3,
    ];
    let (e, de, dde) = (
        DVec3::new(c2, s2, 0.0),
        DVec3::new(-2.0 * s2, 2.0 * c2, 0.0),
        DVec3::new(-4.0 * c2, -4.0 * s2, 0.0),
    );
    let z = SECTION * DVec3::Z;
    [
        r[0] * e + s3 * z,
        r[1] * e + r[0] * de + 3.0 * c3 * z,
        r[2] * e + 2.0 * r[1] * de + r[0] * dde - 9.0 * s3 * z,
    ]
}

/// The closest point of the axis, one of several where they are equally far.
pub(super) fn on_axis(point: DVec3) -> DVec3 {
    static TABLE: OnceLock<Vec<DVec3>> = OnceLock::new();
    let table = TABLE.get_or_init(|| (0..SAMPLES).map(|k| axis(at(k))[0]).collect());
    // Squared distances of the samples; every local minimum that could hold the closest point is refined.
    let step = TAU / SAMPLES as f64 * 2.0 * (RING + SECTION) * 1.1;
    let mut squares = [0.0; SAMPLES];
    let mut least = f64::INFINITY;
    for (square, sample) in squares.iter_mut().zip(table) {
        *square = sample.distance_squared(point);
        least = least.min(*square);
    }
    let most = (least.sqrt() + step).powi(2);
    let mut best = (f64::INFINITY, DVec3::ZERO);
    for (k, &square) in squares.iter().enumerate() {
        let [before, after] = [k + SAMPLES - 1, k + 1].map(|k| squares[k % SAMPLES]);
        if square > most || square > before || square > after {
            continue;
        }
        let foot = refine(point, at(k));
        let distance = foot.distance_squared(point);
        if distance < best.0 {
            best = (distance, foot);
        }
    }
    best.1
}

/// The closest point of the tube; a point of the axis gets any of its circle.
pub(super) fn closest(point: DVec3) -> DVec3 {
    let foot = on_axis(point);
    foot + RADIUS * (point - foot).normalize_or(DVec3::Z)
}

fn at(k: usize) -> f64 {
    k as f64 / SAMPLES as f64 * TAU
}

/// Newton's method for (c - p) · c' = 0, within a sample's width of its start.
fn refine(point: DVec3, start: f64) -> DVec3 {
    let width = TAU / SAMPLES as f64;
    let mut t = start;
    for _ in 0..MAX_STEPS {
        let [c, d, dd] = axis(t);
        let gradient = (c - point).dot(d);
        let full = d.length_squared() + (c - point).dot(dd);
        let slope = if full > 0.0 { full } else { d.length_squared() };
        let next = (t - gradient / slope).clamp(start - width, start + width);
        let moved = (next - t).abs();
        t = next;
        if moved < 1e-15 {
            break;
        }
    }
    axis(t)[0]
}
