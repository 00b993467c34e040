//! Triangulation of a closed polygon in space.
//!
//! Dynamic programming: the least area over the corners i..j is `min_k A(i, k) + A(k, j) + |triangle i k j|`. Polygons
//! of more than 90 corners first lose their sharpest corners (ears).
//!
//! Source: G. Klincsek, *Minimal triangulations of polygonal domains*, Annals of Discrete Mathematics 9, 1980.

use super::{fair, refine};
use glam::DVec3;
use nurbskin_geometry::math;

/// Corners to which a polygon is cut down, sharpest first, before its triangulation of least area is computed. Guard:
/// that takes O(corners³), some 1e5 areas.
const MAX_OPTIMAL_CORNERS: usize = 90;

/// Triangles over a polygon; its corners come first.
#[derive(Debug)]
pub(super) struct Patch {
    pub(super) points: Vec<DVec3>,
    /// Number of corners of the polygon.
    pub(super) rim: usize,
    /// Wound along the polygon.
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Patch {
    /// A fair patch; `joined` states which pairs of corners have an edge outside of it that is no side of the polygon.
    pub(super) fn over(rim: Vec<DVec3>, joined: &dyn Fn(usize, usize) -> bool) -> Self {
        let mut patch = Self {
            rim: rim.len(),
            triangles: triangulate(&rim, joined).unwrap_or_default(),
            points: rim,
        };
        if patch.triangles.is_empty() {
            patch.fan();
        }
        if patch.rim > 4 {
            refine::refine(&mut patch, joined);
        }
        fair::stretch(&mut patch);
        patch
    }

    /// A fan around the mean of all corners, which needs no edge between corners.
    fn fan(&mut self) {
        let count = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        let middle = self.points.iter().sum::<DVec3>() / self.points.len().max(1) as f64;
        self.points.push(middle);
        self.triangles = (0..self.rim)
            .map(|k| [k, (k + 1) % self.rim, self.rim].map(count))
            .collect();
    }

    /// The area of all triangles.
    pub(super) fn area(&self) -> f64 {
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|k| self.points[k as usize]);
            0.5 * (b - a).cross(c - a).length()
        };
        self.triangles.iter().map(area).sum()
    }
}

/// A triangulation of a polygon without further vertices; `None` if every one has an edge that is `joined`.
fn triangulate(rim: &[DVec3], joined: &dyn Fn(usize, usize) -> bool) -> Option<Vec<[u32; 3]>> {
    if rim.len() < 3 {
        return None;
    }
    if rim.len() == 3 {
        return Some(vec![[0, 1, 2]]);
    }
    let (mut triangles, left) = clip_ears(rim, joined);
    triangles.extend(least_area(rim, &left, joined)?);
    Some(triangles)
}

/// Cuts the sharpest corners off until [`MAX_OPTIMAL_CORNERS`] remain. Returns the triangles and the remaining corners.
fn clip_ears(rim: &[DVec3], joined: &dyn Fn(usize, usize) -> bool) -> (Vec<[u32; 3]>, Vec<usize>) {
    let mut left: Vec<usize> = (0..rim.len()).collect();
    let mut triangles = Vec::new();
    if left.len() <= MAX_OPTIMAL_CORNERS {
        return (triangles, left);
    }
    let normal: DVec3 = (0..rim.len())
        .map(|k| (rim[k] - rim[0]).cross(rim[(k + 1) % rim.len()] - rim[0]))
        .sum();
    // The interior angle, 0 to 2 pi, as seen from the side of the normal.
    let angle = |a: usize, b: usize, c: usize| {
        let (p, q) = (rim[a] - rim[b], rim[c] - rim[b]);
        let angle = math::angle_between(p, q);
        let reflex = q.cross(p).dot(normal) < 0.0;
        match (reflex, joined(a, c)) {
            (_, true) => f64::INFINITY,
            (true, _) => std::f64::consts::TAU - angle,
            _ => angle,
        }
    };
    let around = |left: &[usize], k: usize| {
        let n = left.len();
        (left[(k + n - 1) % n], left[k], left[(k + 1) % n])
    };
    let at = |left: &[usize], k: usize| {
        let (a, b, c) = around(left, k);
        angle(a, b, c)
    };
    let mut angles: Vec<f64> = (0..left.len()).map(|k| at(&left, k)).collect();
    let count = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    while left.len() > MAX_OPTIMAL_CORNERS {
        let sharpest = (0..left.len()).min_by(|&j, &k| angles[j].total_cmp(&angles[k]));
        let Some(k) = sharpest.filter(|&k| angles[k].is_finite()) else {
            break;
        };
        let (a, b, c) = around(&left, k);
        triangles.push([a, b, c].map(count));
        left.remove(k);
        angles.remove(k);
        for k in [(k + left.len() - 1) % left.len(), k % left.len()] {
            angles[k] = at(&left, k);
        }
    }
    (triangles, left)
}

/// The triangulation of least area of the polygon through these corners (G. Klincsek, *Minimal triangulations of
/// polygonal domains*, Annals of Discrete Mathematics 9, 1980). O(corners^3).
fn least_area(
    rim: &[DVec3],
    corners: &[usize],
    joined: &dyn Fn(usize, usize) -> bool,
) -> Option<Vec<[u32; 3]>> {
    let n = corners.len();
    let place = |k: usize| rim[corners[k]];
    let mut least = vec![0.0_f64; n * n];
    let mut via = vec![0_usize; n * n];
    for step in 2..n {
        for i in 0..n - step {
            let j = i + step;
            let mut best = (f64::INFINITY, 0);
            let closing = step == n - 1;
            if closing || !joined(corners[i], corners[j]) {
                for k in i + 1..j {
                    let area = (place(k) - place(i)).cross(place(j) - place(i)).length();
                    let sum = area + least[i * n + k] + least[k * n + j];
                    if sum < best.0 {
                        best = (sum, k);
                    }
                }
            }
            (least[i * n + j], via[i * n + j]) = best;
        }
    }
    if !least[n - 1].is_finite() {
        return None;
    }
    let mut triangles = Vec::with_capacity(n - 2);
    let mut open = vec![(0, n - 1)];
    while let Some((i, j)) = open.pop() {
        if j - i < 2 {
            continue;
        }
        let k = via[i * n + j];
        let number = |k: usize| u32::try_from(corners[k]).unwrap_or(u32::MAX);
        triangles.push([i, k, j].map(number));
        open.extend([(i, k), (k, j)]);
    }
    Some(triangles)
}
