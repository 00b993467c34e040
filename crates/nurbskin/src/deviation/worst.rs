//! The places of largest deviation, separated from each other.
//!
//! A list of the largest deviations alone would show one spot many times. The selection therefore keeps a least
//! distance between places.

use super::measure::PointDeviation;
use glam::DVec3;

/// Number of places.
const MANY: usize = 10;
/// Least distance between places, as a share of the diagonal.
const APART: f64 = 0.03;
/// Number of points that are sorted first, which nearly always suffices.
const FIRST: usize = 4096;

/// Indices of the ten points of largest distance that are at least 3 % of `diagonal` apart; the worst first, and the
/// lower index first among equal distances. O(n) on average.
#[must_use]
pub fn worst(points: &[DVec3], deviation: &[PointDeviation], diagonal: f64) -> Vec<usize> {
    let count = points.len().min(deviation.len());
    let uppers = deviation.iter().map(|d| d.upper);
    let mut order: Vec<(f64, usize)> = uppers.zip(0..count).collect();
    let worse = |a: &(f64, usize), b: &(f64, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
    let mut chosen: Vec<usize> = Vec::new();
    let mut from = 0;
    let mut size = FIRST;
    while from < count && chosen.len() < MANY {
        let to = count.min(from + size);
        if let Some(rest) = order.get_mut(from..) {
            if to < count {
                rest.select_nth_unstable_by(to - from, worse);
            }
            if let Some(next) = rest.get_mut(..to - from) {
                next.sort_unstable_by(worse);
            }
        }
        for &(_, k) in order.get(from..to).unwrap_or_default() {
            let apart = |&c: &usize| points[c].distance(points[k]) >= APART * diagonal;
            if chosen.len() < MANY && chosen.iter().all(apart) {
                chosen.push(k);
            }
        }
        (from, size) = (to, 8 * size);
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::super::measure::Place;
    use super::*;

    #[test]
    fn the_worst_are_apart() {
        let points: Vec<DVec3> = (0..1000)
            .map(|k| DVec3::new(f64::from(k), 0.0, 0.0))
            .collect();
        let of = |k: usize| PointDeviation {
            lower: 0.0,
            upper: k as f64 / 1000.0,
            side: 1.0,
            u: 0.0,
            v: 0.0,
            face: 0,
            place: Place::Interior,
        };
        let deviation: Vec<PointDeviation> = (0..1000).map(of).collect();
        let expected: Vec<usize> = (0..10).map(|k| 999 - 30 * k).collect();
        assert_eq!(worst(&points, &deviation, 1000.0), expected);
        assert_eq!(worst(&points[..3], &deviation[..3], 0.0), [2, 1, 0]);
        assert!(worst(&[], &[], 1.0).is_empty());
    }
}
