//! The smallest rectangle around flat points.
//!
//! One side of the smallest rectangle lies on a side of the convex hull (Freeman and Shapira 1975). The hull is
//! Andrew's monotone chain (1979), after the points inside an octagon of extreme points are removed (Akl and Toussaint
//! 1978). For round outlines the smallest rectangle would be chance; the axes of the coordinates are used instead.
//! Stray points beyond a gap do not widen the rectangle.

use glam::DVec2;
use nurbskin_geometry::math;
use std::f64::consts::FRAC_PI_2;

/// Largest share of the points at each end of a direction that a gap may cut off. Trial: not recorded. A larger share
/// cuts off parts of a scan, a smaller one lets stray points widen the rectangle.
const END_POINT_SHARE: f64 = 0.002;
/// Least gap that cuts them off, as a share of the extent along the direction. Trial: not recorded.
const END_GAP_SHARE: f64 = 0.02;
/// Largest ratio of the areas of the largest and the smallest rectangle around a round polygon: that of an ellipse with
/// axes of 1 and 1.2. Trial: in 20 draws, ten thousand points in a circle reach 1.011, three thousand 1.022; the
/// rectangles around a square differ by a factor of 2.
const ROUND_AREA_RATIO: f64 = 1.02;
/// Directions within a right angle for which this is tested. Guard: they are 5.6 degrees apart, and the area of the
/// rectangle varies slowly with the angle.
const ROUND_DIRECTIONS: u32 = 16;

/// Smallest and largest of `values` (at least one), without the few that a gap separates from the rest. O(n).
pub(super) fn robust_ends(mut values: Vec<f64>) -> [f64; 2] {
    let n = values.len();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a small part of a count"
    )]
    let few = ((END_POINT_SHARE * n as f64) as usize).min(n / 4);
    // Only the outermost values must be sorted.
    if few + 1 < n {
        values.select_nth_unstable_by(few, f64::total_cmp);
        values[few + 1..].select_nth_unstable_by(n - 2 * few - 2, f64::total_cmp);
    }
    values[..=few].sort_unstable_by(f64::total_cmp);
    values[n - 1 - few..].sort_unstable_by(f64::total_cmp);
    let gap = END_GAP_SHARE * (values[n - 1] - values[0]);
    let (mut first, mut last) = (0, n - 1);
    for k in 0..few {
        if values[k + 1] - values[k] > gap {
            first = k + 1;
        }
        if values[n - 1 - k] - values[n - 2 - k] > gap {
            last = n - 2 - k;
        }
    }
    [values[first], values[last]]
}

/// The points that may be corners of the convex hull: those outside of the octagon of the extreme points in eight
/// directions. In a large set that leaves few (S. Akl and G. Toussaint 1978, DOI 10.1016/0020-0190(78)90003-0).
fn outer(points: &[DVec2]) -> Vec<DVec2> {
    let directions = [
        DVec2::new(1.0, 0.0),
        DVec2::new(1.0, 1.0),
        DVec2::new(0.0, 1.0),
        DVec2::new(-1.0, 1.0),
        DVec2::new(-1.0, 0.0),
        DVec2::new(-1.0, -1.0),
        DVec2::new(0.0, -1.0),
        DVec2::new(1.0, -1.0),
    ];
    let farthest = directions.map(|d| {
        let farther = |a: &&DVec2, b: &&DVec2| a.dot(d).total_cmp(&b.dot(d));
        points.iter().max_by(farther).copied().unwrap_or_default()
    });
    let inside = |p: &DVec2| {
        let corners = farthest.iter().zip(farthest.iter().cycle().skip(1));
        let mut sides = corners.filter(|(a, b)| a != b);
        sides.all(|(a, b)| (*b - *a).perp_dot(*p - *a) > 0.0)
    };
    let distinct = farthest.iter().any(|p| *p != farthest[0]);
    let kept = |p: &&DVec2| !(distinct && inside(p));
    points.iter().filter(kept).copied().collect()
}

/// The convex hull, counter-clockwise, without points on its sides (A. M. Andrew 1979, DOI
/// 10.1016/0020-0190(79)90072-3).
pub(super) fn convex_hull(points: &[DVec2]) -> Vec<DVec2> {
    let mut sorted = outer(points);
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let half = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..]
                && (b - a).perp_dot(p - b) <= 0.0
            {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut sorted.iter().copied());
    hull.extend(half(&mut sorted.iter().rev().copied()));
    hull
}

/// Direction of the longer side of the smallest rectangle around a convex polygon, one of whose sides lies on the
/// rectangle (Freeman & Shapira 1975, DOI 10.1145/360881.360919). Around a round polygon all rectangles are about
/// equally large and the smallest would be chance: the rectangle along the unit vector `usual` is taken. O(h²) for h
/// corners; the hull of a scan has few.
pub(super) fn smallest_rectangle(hull: &[DVec2], usual: DVec2) -> DVec2 {
    let around = |side: DVec2| {
        let extent = |along: DVec2| {
            let ends = hull
                .iter()
                .map(|p| p.dot(along))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
                    (l.min(x), h.max(x))
                });
            ends.1 - ends.0
        };
        let (length, width) = (extent(side), extent(side.perp()));
        let long = if length >= width { side } else { side.perp() };
        (length * width, long)
    };
    let sides = hull.iter().zip(hull.iter().cycle().skip(1));
    let smallest = sides
        .filter_map(|(a, b)| (*b - *a).try_normalize())
        .map(around)
        .fold((f64::INFINITY, DVec2::X), |best, next| {
            if next.0 < best.0 { next } else { best }
        });
    let turns =
        (0..ROUND_DIRECTIONS).map(|k| FRAC_PI_2 * f64::from(k) / f64::from(ROUND_DIRECTIONS));
    let largest = turns.map(|angle| around(math::unit_vector(angle)).0);
    let is_round = largest.fold(0.0, f64::max) <= ROUND_AREA_RATIO * smallest.0;
    if is_round {
        around(usual).1
    } else {
        smallest.1
    }
}
