//! Histogram of the signed deviations of all points.
//!
//! The intervals are symmetric about zero. With a tolerance they reach beyond it, and it is the edge of two of them;
//! without one they cover the range of the colours of the page. Points beyond them are only counted.

use super::document::Histogram;
use crate::deviation::measure::PointDeviation;
use nurbskin_geometry::numeric::statistics::quantile_in_place;

/// Number of intervals without a tolerance; odd, so that zero is in the middle of one.
const INTERVALS: usize = 101;
/// Range as a multiple of the 95th percentile, which is the limit of the colours: they fill most of the width, and the
/// few points far beyond are only counted. The limit of the colours lies just inside the edge between two intervals,
/// the 84th and the 85th, so that no interval mixes two colours.
const BEYOND: f64 = 101.0 / 66.99;
/// Range as a multiple of the larger of tolerance and 95th percentile.
const BESIDE: f64 = 1.5;
/// Intervals within the 95th percentile, as far as the largest number of intervals allows.
const WITHIN: f64 = 20.0;
/// Most intervals on either side of the middle one with a tolerance. Guard: no screen shows more.
const MOST: f64 = 200.0;

/// The intervals of a histogram: the upper limit of the range, and their number, which is odd.
fn intervals(common: f64, tolerance: Option<f64>) -> (f64, usize) {
    let usable = |x: &f64| *x > 0.0 && x.is_finite();
    let tolerance = tolerance.filter(usable);
    if let Some(limit) = tolerance {
        // The tolerance is the edge of two intervals, so that no interval mixes what is within and what is not: it is
        // k + 1/2 of them, the range j + 1/2.
        let range = BESIDE * common.max(limit);
        let most = (MOST * limit / range - 0.5).floor();
        let k = (WITHIN * limit / common - 0.5).round().min(most).max(0.0);
        let width = limit / (k + 0.5);
        let j = (range / width).ceil();
        if j <= MOST {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "between 1 and 200"
            )]
            return ((j + 0.5) * width, 2 * j as usize + 1);
        }
        // The tolerance would vanish in the middle interval.
    }
    // Nearly all points lie on the surface, so any width is suitable.
    let high = Some(BEYOND * common).filter(usable);
    (high.unwrap_or(1.0), INTERVALS)
}

/// The histogram of the signed deviations of all `points`; `None` without any. O(n).
pub(super) fn histogram(points: &[PointDeviation], tolerance: Option<f64>) -> Option<Histogram> {
    if points.is_empty() {
        return None;
    }
    let mut sizes: Vec<f64> = points.iter().map(|p| p.upper).collect();
    let common = quantile_in_place(&mut sizes, 0.95);
    let (high, count) = intervals(common, tolerance);
    let mut found = Histogram {
        low: -high,
        high,
        counts: vec![0; count],
        below: 0,
        above: 0,
    };
    for point in points {
        let signed = point.signed();
        let at = (signed / high + 1.0) / 2.0 * count as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the limits it is small and positive"
        )]
        let slot = found.counts.get_mut((at.max(0.0) as usize).min(count - 1));
        match slot {
            _ if signed < -high => found.below += 1,
            _ if signed > high => found.above += 1,
            Some(count) => *count += 1,
            None => {}
        }
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deviation::measure::Place;

    fn of(signed: f64) -> PointDeviation {
        PointDeviation {
            lower: signed.abs(),
            upper: signed.abs(),
            side: if signed < 0.0 { -1.0 } else { 1.0 },
            u: 0.0,
            v: 0.0,
            face: 0,
            place: Place::Interior,
        }
    }

    #[test]
    fn every_point_is_counted_once() {
        let points: Vec<PointDeviation> = (-500..=500)
            .map(|k| of(f64::from(k) / 500.0))
            .chain([of(30.0), of(-20.0), of(-25.0)])
            .collect();
        let found = histogram(&points, None).unwrap();
        assert!((found.high - BEYOND * 0.95).abs() < 0.01);
        assert_eq!((found.below, found.above), (2, 1));
        let sum: u64 = found.counts.iter().sum();
        assert_eq!(sum + found.below + found.above, points.len() as u64);
        // Symmetric, and evenly filled if not empty.
        let reversed: Vec<u64> = found.counts.iter().rev().copied().collect();
        assert_eq!(found.counts, reversed);
        // A few points far away do not spread the axis.
        let far: Vec<PointDeviation> = points.iter().copied().chain([of(1e3); 20]).collect();
        let found = histogram(&far, None).unwrap();
        assert!((found.high - BEYOND * 0.97).abs() < 0.03);
        assert_eq!(found.above, 21);
        let alike = histogram(&[of(2.0), of(-2.0)], None).unwrap();
        assert_eq!([alike.counts[17], alike.counts[83]], [1, 1]);
        let all_zero = histogram(&[of(0.0), of(0.0)], None).unwrap();
        assert_eq!(all_zero.counts[INTERVALS / 2], 2);
        assert!(histogram(&[], None).is_none());
    }

    #[test]
    fn the_tolerance_is_an_edge_of_intervals() {
        let points: Vec<PointDeviation> = (-500..=500).map(|k| of(f64::from(k) / 500.0)).collect();
        for tolerance in [0.05, 0.1, 0.7, 1.0, 1.3, 4.0, 30.0] {
            let found = histogram(&points, Some(tolerance)).unwrap();
            let count = found.counts.len();
            assert!(count % 2 == 1 && count <= 401, "{count}");
            let width = 2.0 * found.high / count as f64;
            let edge = tolerance / width - 0.5;
            assert!((edge - edge.round()).abs() < 1e-6, "{tolerance}: {edge}");
            let reach = found.high / tolerance.max(0.95);
            assert!((1.4..3.0).contains(&reach), "{tolerance}: {reach}");
            let sum: u64 = found.counts.iter().sum();
            assert_eq!(sum + found.below + found.above, 1001);
            // Counted within the tolerance: as many as there are, up to those at the edge itself.
            let inside = |k: usize| ((k as f64 + 0.5) * width - found.high).abs() < tolerance;
            let within: u64 = (0..count)
                .filter(|&k| inside(k))
                .map(|k| found.counts[k])
                .sum();
            let exact = points.iter().filter(|p| p.upper <= tolerance).count() as u64;
            assert!(within.abs_diff(exact) <= 2, "{tolerance}: {within} {exact}");
        }
        // Without a deviation it is still in view; where it is next to nothing, it gives way.
        let none = histogram(&[of(0.0)], Some(2.0)).unwrap();
        assert!(none.high > 2.0 && none.counts.len() <= 401);
        let tiny = histogram(&points, Some(1e-4)).unwrap();
        assert_eq!(tiny.counts.len(), INTERVALS);
    }
}
