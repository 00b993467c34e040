//! Outliers among the points that a robust fit gave no weight.
//!
//! ```text
//! far:      weight 0  and  |d| > max(T, 5 σ, 0.6 spacing)
//! outlier:  far, and at most 2 of its 8 nearest neighbours are far
//! ```
//!
//! A group of far points is a feature that the surface misses, unless it is a loose swarm without a plane. More than 5
//! % of far points mean that the surface does not fit, and no outliers. Ours.

use glam::DVec3;
use nurbskin_fit::fit::approximate::{Approximation, OUTLIER_SIGMAS, OUTLIER_SPACINGS};
use nurbskin_geometry::spatial::neighbours::Neighbours;
use nurbskin_scan::normals::plane_axes;

/// Share of far points without weight above which the surface does not fit, and none of them is an outlier.
/// Trial: not recorded.
const MAX_OUTLIER_SHARE: f64 = 0.05;
/// Most of the [`OUTLIER_NEIGHBOURS`] of an outlier that are far off, too. Count.
/// Trial: not recorded. Larger groups are features that the surface misses.
const MAX_FAR_NEIGHBOURS: usize = 2;
/// Nearest neighbours of a far point that are examined. Count.
/// Trial: not recorded. The first ring of a square grid has as many.
const OUTLIER_NEIGHBOURS: usize = 8;
/// Radius, in spacings, within which neighbours are first searched; a far point whose neighbours lie beyond it is in a
/// sparse region.
/// Guard: on a surface it holds some fifty points.
const NEIGHBOUR_REACH: f64 = 4.0;
/// Ratio of the least to the middle variance of the neighbours above which they lie on no plane. Dimensionless.
/// Trial: not recorded. Of points anywhere it is 0.35, of a sheet that of the squares of noise and spacing.
const MIN_SWARM_THICKNESS: f64 = 0.1;

/// The residuals and weights of a robust fit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Robust<'a> {
    /// Signed distance of each to the surface.
    pub(super) residuals: &'a [f64],
    /// Weight of each, where the fit has them.
    pub(super) weights: Option<&'a [f64]>,
    /// Standard deviation of the points that count.
    pub(super) sigma: f64,
}

impl<'a> From<&'a Approximation> for Robust<'a> {
    fn from(fit: &'a Approximation) -> Self {
        Self {
            residuals: &fit.residuals,
            weights: Some(&fit.weights),
            sigma: fit.sigma,
        }
    }
}

/// Whether each point is an outlier: without weight, off the surface by more than the tolerance, five standard
/// deviations and 0.6 spacings, and isolated among its neighbours, or off by four spacings in a loose swarm. A dense or
/// planar group of such points is a missed feature.
pub(super) fn lost(points: &[DVec3], fit: &Robust, tolerance: f64, spacing: f64) -> Vec<bool> {
    let limit = tolerance
        .max(OUTLIER_SIGMAS * fit.sigma)
        .max(OUTLIER_SPACINGS * spacing);
    let weightless = |k: usize| {
        fit.weights
            .is_none_or(|w| w.get(k).is_some_and(|&w| w <= 0.0))
    };
    let far: Vec<bool> = (0..)
        .zip(fit.residuals)
        .map(|(k, residual)| residual.abs() > limit && weightless(k))
        .collect();
    let count = far.iter().filter(|f| **f).count();
    if count == 0 || count as f64 > MAX_OUTLIER_SHARE * points.len() as f64 {
        return vec![false; points.len()];
    }
    // Few points have a far one nearby; where these do not contain all its neighbours, all points are searched.
    let reach = NEIGHBOUR_REACH * spacing;
    let around = around(points, &far, reach);
    let nearby: Vec<DVec3> = around.iter().map(|&k| points[k as usize]).collect();
    let tree = Neighbours::new(&nearby);
    let mut all: Option<Neighbours> = None;
    let mut alone = |k: usize| {
        let mut near: Vec<u32> = tree.nearest(points[k], OUTLIER_NEIGHBOURS + 1);
        for j in &mut near {
            *j = around[*j as usize];
        }
        let farthest = near.last().map(|&j| points[j as usize].distance(points[k]));
        if near.len() <= OUTLIER_NEIGHBOURS || farthest.is_none_or(|d| d > reach) {
            let tree = all.get_or_insert_with(|| Neighbours::new(points));
            near = tree.nearest(points[k], OUTLIER_NEIGHBOURS + 1);
            let farthest = near.last().map(|&j| points[j as usize].distance(points[k]));
            if farthest.is_none_or(|d| d > reach) {
                // A swarm has no plane; a sparsely scanned feature has one.
                let (values, _) = plane_axes(near.iter().map(|&j| points[j as usize]));
                if values[0] > MIN_SWARM_THICKNESS * values[1] && fit.residuals[k].abs() > reach {
                    return true;
                }
            }
        }
        let lost = near.iter().filter(|&&j| j as usize != k && far[j as usize]);
        lost.count() <= MAX_FAR_NEIGHBOURS
    };
    (0..points.len()).map(|k| far[k] && alone(k)).collect()
}

/// The points within `reach` of one of the `far` points, and others nearby, ascending.
fn around(points: &[DVec3], far: &[bool], reach: f64) -> Vec<u32> {
    let cell = |p: DVec3| (p / reach).floor();
    let by = |a: &DVec3, b: &DVec3| {
        let order = a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y));
        order.then(a.z.total_cmp(&b.z))
    };
    let mut cells: Vec<DVec3> = Vec::new();
    for (&p, _) in points.iter().zip(far).filter(|(_, far)| **far) {
        for k in 0..27_i32 {
            let step = DVec3::new(f64::from(k % 3), f64::from(k / 3 % 3), f64::from(k / 9));
            // Zero is added to make -0 and 0 the same.
            cells.push(cell(p) + step - DVec3::ONE + DVec3::ZERO);
        }
    }
    cells.sort_unstable_by(by);
    cells.dedup();
    let near = |p: DVec3| {
        let cell = cell(p) + DVec3::ZERO;
        cells.binary_search_by(|other| by(other, &cell)).is_ok()
    };
    let numbered = (0..u32::MAX).zip(points);
    let near = numbered.filter(|&(_, &p)| near(p));
    near.map(|(k, _)| k).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_are_alone_among_all_points() {
        // A dense sheet, a sparse one, and points off them: one over each, and a group.
        let sheet = |n: i32, step: f64, at: f64| {
            let point = move |k: i32| DVec3::new(f64::from(k % n), f64::from(k / n), 0.0) * step;
            (0..n * n).map(move |k| point(k) + DVec3::X * at)
        };
        let mut points: Vec<DVec3> = sheet(40, 1.0, -100.0).chain(sheet(9, 7.0, 100.0)).collect();
        let on = points.len();
        points.extend([DVec3::new(-80.3, 20.2, 2.0), DVec3::new(121.0, 20.0, 2.0)]);
        points.extend(sheet(3, 1.0, -70.0).map(|p| p + 3.0 * DVec3::Z));
        // A swarm, and as sparse a feature.
        let swarm = points.len();
        let (across, up) = (
            [5, 0, 9, 3, 11, 7, 1, 10, 4, 8, 2, 6],
            [3, 9, 0, 7, 11, 2, 5, 10, 1, 8, 4, 6],
        );
        points.extend((0..12).map(|k| {
            let along = 300.0 + 2.0 * k as f64;
            DVec3::new(
                f64::from(across[k]) * 2.0 - 90.0,
                along,
                f64::from(up[k]) * 2.0 + 20.0,
            )
        }));
        points.extend(sheet(4, 6.0, 300.0).map(|p| p + 40.0 * DVec3::Z));
        let residuals: Vec<f64> = points.iter().map(|p| p.z).collect();
        let robust = Robust {
            residuals: &residuals,
            weights: None,
            sigma: 0.1,
        };
        let found = lost(&points, &robust, 0.5, 1.0);
        let places: Vec<usize> = (0..points.len()).filter(|&k| found[k]).collect();
        let swarm: Vec<usize> = (swarm..swarm + 12).collect();
        assert_eq!(places, [&[on, on + 1], &swarm[..]].concat());
    }
}
