//! Test that every part of a surface of revolution holds points.
//!
//! ```text
//! part fails if  expected ≥ 8  and  count < 0.05 expected,   expected = points · area(part) / area(surface)
//! ```
//!
//! Residuals cannot judge a part of the surface without points, where only the spline determines the profile. Such a
//! part is no result of the scan. Parts are overlapping pieces of the profile, its spans and ends, and sectors. Ours.

use super::data::Data;
use crate::chart::revolution::ProfileCurve;
use std::f64::consts::TAU;

/// Length of the pieces of the profile that must hold points, in spacings; they overlap by half.
/// Trial: not recorded.
const PIECE_LENGTH: f64 = 5.0;
/// Length of the pieces at open ends, in spacings.
/// Trial: not recorded. It bounds how far a surface goes on past its points.
const END_PIECE_LENGTH: f64 = 2.0;
/// Sectors that must hold points. Count.
/// Trial: not recorded. Of a whole turn each has 11 degrees.
const SUPPORT_SECTORS: usize = 32;
/// Share of the expected number of points below which a piece is without support. Dimensionless.
/// Trial: not recorded. Densities of scans vary, by far less than this.
const MIN_DENSITY_SHARE: f64 = 0.05;
/// Expected number of points of a piece from which on it must hold some. Count.
/// Derived: by chance a piece with 8 expected points is empty once in 3000.
const MIN_EXPECTED_POINTS: f64 = 8.0;
/// Share of the points that may lie beyond the ends of the profile. Dimensionless.
/// Trial: not recorded.
const MAX_SHARE_PAST_ENDS: f64 = 0.01;
/// Chords per span of the profile for the area. Count.
/// Guard: the area is right to a per cent or better.
const CHORDS_PER_SPAN: u32 = 16;
/// Distance in sigma, plus a tolerance and half a spacing, up to which a point is on the surface.
/// Derived: the limit of outliers.
const ON_SURFACE_SIGMAS: f64 = 6.0;
/// The part of that distance in spacings.
/// Derived: half of a spacing, by which an end may be cut.
const ON_SURFACE_SPACINGS: f64 = 0.5;
/// Most pieces. Count.
/// Guard: bounds the time.
const MAX_PIECES: f64 = 4000.0;

/// A piece of the profile, between two parameters, and what to call it.
type Piece = (f64, f64, &'static str);

/// The part of the surface over `curve` without points, if any: a span or another piece of the profile, one of its
/// ends, or a sector. Only points on the surface count; the expected number is the mean density times the area of the
/// part. O(n log n).
pub(super) fn objection(
    data: &Data,
    curve: &ProfileCurve,
    sweep: f64,
    tolerance: f64,
) -> Option<String> {
    // 1. The places of the points that are on the surface, not beyond an end of it.
    let near = tolerance + ON_SURFACE_SIGMAS * data.sigma + ON_SURFACE_SPACINGS * data.spacing;
    let on = |k: &usize| {
        data.weights[*k] > 0.0 && curve.derivatives(data.s[*k])[0].distance(data.flat[*k]) <= near
    };
    let held: Vec<usize> = (0..data.s.len()).filter(on).collect();
    let kept = data.weights.iter().filter(|w| **w > 0.0).count();
    if (kept - held.len()) as f64 > MAX_SHARE_PAST_ENDS * kept as f64 {
        let part = 100.0 * (kept - held.len()) as f64 / kept as f64;
        return Some(format!(
            "{part:.1} % of the points lie beyond the ends of the profile"
        ));
    }
    let mut places: Vec<f64> = held.iter().map(|&k| data.s[k]).collect();
    places.sort_by(f64::total_cmp);
    // 2. The pieces of the profile, and the number of points that each should hold.
    let (a, b) = curve.knots().domain();
    let density = held.len() as f64 / area(curve, sweep, a, b).max(f64::MIN_POSITIVE);
    for (from, to, name) in pieces(curve, data.spacing) {
        let expected = density * area(curve, sweep, from, to);
        let count = places.partition_point(|&s| s <= to) - places.partition_point(|&s| s < from);
        if expected >= MIN_EXPECTED_POINTS && (count as f64) < MIN_DENSITY_SHARE * expected {
            return Some(format!(
                "{name} at {:.0} % of the profile holds {count} points where {expected:.0} are to be expected",
                50.0 * (from + to - 2.0 * a) / (b - a)
            ));
        }
    }
    // 3. Sectors.
    let expected = held.len() as f64 / SUPPORT_SECTORS as f64;
    let mut counts = [0_usize; SUPPORT_SECTORS];
    for &k in &held {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the sectors"
        )]
        let sector = (data.angles[k] / sweep * SUPPORT_SECTORS as f64)
            .clamp(0.0, SUPPORT_SECTORS as f64 - 1.0) as usize;
        counts[sector] += 1;
    }
    let (sector, count) = counts.iter().copied().enumerate().min_by_key(|c| c.1)?;
    (expected >= MIN_EXPECTED_POINTS && (count as f64) < MIN_DENSITY_SHARE * expected).then(|| {
        format!(
            "the sector at {:.0} degrees holds {count} points where {expected:.0} are to be expected",
            (sector as f64 + 0.5) / SUPPORT_SECTORS as f64 * sweep.to_degrees()
        )
    })
}

/// Area of the surface over a piece of the profile.
fn area(curve: &ProfileCurve, sweep: f64, from: f64, to: f64) -> f64 {
    // A long piece has as many chords per length as a short one.
    let (a, b) = curve.knots().domain();
    let spans = curve.knots().distinct_count() as f64 * (to - from) / (b - a);
    let chords = f64::from(CHORDS_PER_SPAN) * spans.ceil().max(1.0);
    let at = |k: f64| curve.derivatives((from + (to - from) * k / chords).min(b))[0];
    let mut sum = 0.0;
    let mut before = at(0.0);
    let mut k = 0.0;
    while k < chords {
        k += 1.0;
        // At its end a closed profile is evaluated as at its start.
        let next = at(k);
        sum += 0.5 * (before.x + next.x).max(0.0) * before.distance(next);
        before = next;
    }
    sweep.min(TAU) * sum
}

/// The pieces of the profile that must hold points.
fn pieces(curve: &ProfileCurve, spacing: f64) -> Vec<Piece> {
    let (a, b) = curve.knots().domain();
    let breaks = curve.knots().breakpoints();
    let mut all: Vec<Piece> = Vec::new();
    if !curve.knots().is_periodic() {
        let long = (END_PIECE_LENGTH * spacing).min(b - a);
        all.push((a, a + long, "the end"));
        all.push((b - long, b, "the end"));
    }
    let steps = ((b - a) / (0.5 * PIECE_LENGTH * spacing))
        .clamp(2.0, MAX_PIECES)
        .floor();
    let mut k = 0.0;
    while k + 2.0 <= steps {
        let at = |k: f64| a + (b - a) * k / steps;
        all.push((at(k), at(k + 2.0), "the piece"));
        k += 1.0;
    }
    for w in breaks.windows(2).filter(|w| w[1] > w[0]) {
        all.push((w[0], w[1], "the span"));
    }
    all
}
