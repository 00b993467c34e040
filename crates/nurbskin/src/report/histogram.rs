//! Histogram of the signed deviations of all points.
//!
//! The intervals cover the range of the colours of the page, symmetric about zero. Points beyond it are only counted.

use super::document::Histogram;
use crate::deviation::measure::PointDeviation;
use nurbskin_geometry::numeric::statistics::quantile_in_place;

/// Number of intervals; odd, so that zero is in the middle of one.
const INTERVALS: usize = 101;
/// Range as a multiple of the 95th percentile, which is the limit of the colours: they fill most of the width, and the
/// few points far beyond are only counted. The limit of the colours lies just inside the edge between two intervals,
/// the 84th and the 85th, so that no interval mixes two colours.
const BEYOND: f64 = 101.0 / 66.99;

/// The histogram of the signed deviations of all `points`; `None` without any. O(n).
pub(super) fn histogram(points: &[PointDeviation], tolerance: Option<f64>) -> Option<Histogram> {
    if points.is_empty() {
        return None;
    }
    let mut sizes: Vec<f64> = points.iter().map(|p| p.upper).collect();
    let common = quantile_in_place(&mut sizes, 0.95);
    // Nearly all points lie on the surface, so any width is suitable.
    let high = [common, tolerance.unwrap_or(0.0)]
        .map(|limit| BEYOND * limit)
        .into_iter()
        .find(|high| *high > 0.0 && high.is_finite())
        .unwrap_or(1.0);
    let mut found = Histogram {
        low: -high,
        high,
        counts: vec![0; INTERVALS],
        below: 0,
        above: 0,
    };
    for point in points {
        let signed = point.signed();
        let at = (signed / high + 1.0) / 2.0 * INTERVALS as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the limits it is small and positive"
        )]
        let slot = found
            .counts
            .get_mut((at.max(0.0) as usize).min(INTERVALS - 1));
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
        let found = histogram(&points, Some(0.1)).unwrap();
        assert!((found.high - BEYOND * 0.95).abs() < 0.01);
        assert_eq!((found.below, found.above), (2, 1));
        let sum: u64 = found.counts.iter().sum();
        assert_eq!(sum + found.below + found.above, points.len() as u64);
        // Symmetric, and evenly filled if not empty.
        let reversed: Vec<u64> = found.counts.iter().rev().copied().collect();
        assert_eq!(found.counts, reversed);
        // Neither the tolerance nor a few points far away spread the axis.
        let far: Vec<PointDeviation> = points.iter().copied().chain([of(1e3); 20]).collect();
        let found = histogram(&far, Some(50.0)).unwrap();
        assert!((found.high - BEYOND * 0.97).abs() < 0.03);
        assert_eq!(found.above, 21);
        let alike = histogram(&[of(2.0), of(-2.0)], None).unwrap();
        assert_eq!([alike.counts[17], alike.counts[83]], [1, 1]);
        let all_zero = histogram(&[of(0.0), of(0.0)], None).unwrap();
        assert_eq!(all_zero.counts[INTERVALS / 2], 2);
        assert!(histogram(&[], None).is_none());
    }
}
