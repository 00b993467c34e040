//! The smallest rectangle around flat points.

use glam::DVec2;

/// Part of the points at each end of a direction that a gap may cut off.
const END_POINTS: f64 = 0.002;
/// A gap that cuts them off, as part of the direction's extent.
const END_GAP: f64 = 0.02;

/// Smallest and largest of `values`, without the few that a gap separates from the rest.
pub(super) fn robust_ends(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a small part of a count"
    )]
    let few = ((END_POINTS * n as f64) as usize).min(n / 4);
    let gap = END_GAP * (values[n - 1] - values[0]);
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

/// The convex hull, counter-clockwise, without points on its sides (A. M. Andrew 1979, DOI
/// 10.1016/0020-0190(79)90072-3).
pub(super) fn convex_hull(points: &[DVec2]) -> Vec<DVec2> {
    let mut sorted = points.to_vec();
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

/// Direction of the longer side of the smallest rectangle around a convex polygon; one of its sides lies on the
/// rectangle (Freeman & Shapira 1975, DOI 10.1145/360881.360919). O(h^2) for h corners, of which a scan's hull has
/// few.
pub(super) fn smallest_rectangle(hull: &[DVec2]) -> DVec2 {
    let mut best = (f64::INFINITY, DVec2::X);
    for (k, a) in hull.iter().enumerate() {
        let b = hull[(k + 1) % hull.len()];
        let Some(side) = (b - a).try_normalize() else {
            continue;
        };
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
        if length * width < best.0 {
            let long = if length >= width { side } else { side.perp() };
            best = (length * width, long);
        }
    }
    best.1
}
