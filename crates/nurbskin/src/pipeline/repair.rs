//! Points that must not take part: how an ordered scan keeps its order without them, and which ones a robust fit found.

use glam::DVec3;
use nurbskin_fit::fit::approximate::Approximation;
use nurbskin_geometry::spatial::neighbours::Neighbours;
use nurbskin_scan::normals::plane_axes;
use nurbskin_scan::{Organisation, Scan};
use std::ops::Range;

/// More points in a row than this are a hole: filling it would be an invention.
const LONGEST_FILLED: usize = 3;
/// A point that is this many median gaps off the place where its row leads makes the scan worth searching for outliers.
const JUMP: f64 = 1.5;
/// More points without weight than this share are a surface that does not fit, and not outliers.
const MOST_LOST: f64 = 0.05;
/// A point that the fit lost is an outlier if at most so many of its [`NEIGHBOURS`] were lost, too.
const MOST_NEIGHBOURS_LOST: usize = 2;
const NEIGHBOURS: usize = 8;
/// Neighbours are looked for within so many spacings first.
const AROUND: f64 = 4.0;
/// Outliers lie off the surface by more standard deviations than this, ...
const LOST_SIGMAS: f64 = 5.0;
/// ... and by more than this share of the spacing: less may be a feature between two points.
const LOST_SPACINGS: f64 = 0.6;
/// Neighbours with this ratio of the variances across and along a plane lie on none: of points anywhere it is 0.35, of a
/// sheet that of the squares of noise and spacing.
const SWARM: f64 = 0.1;
/// A step of this many median gaps leads away from a row.
const SPIKE: f64 = 2.0;

/// The indices of the points in each row of an ordered scan; none for other scans.
pub(super) fn rows(scan: &Scan) -> Vec<Vec<usize>> {
    match &scan.organisation {
        Organisation::Grid(layout) => layout
            .cells
            .chunks(layout.count_u.max(1))
            .map(|row| row.iter().flatten().map(|&k| k as usize).collect())
            .collect(),
        Organisation::Rows(lengths) => lengths
            .iter()
            .scan(0, |first, &length| {
                *first += length;
                Some((*first - length..*first).collect())
            })
            .collect(),
        Organisation::Unordered | Organisation::Mesh(_) => Vec::new(),
    }
}

/// The scan with the masked points replaced by what the cubics through their neighbours in the row say, so that an
/// array stays one; `None` if there is nothing to replace. Points at the ends of rows and in gaps of more than three
/// become not finite: there is nothing to go by.
pub(super) fn filled(scan: &Scan, masked: &[bool]) -> Option<Scan> {
    if !masked.contains(&true) {
        return None;
    }
    let mut filled = Scan {
        points: scan.points.clone(),
        organisation: scan.organisation.clone(),
        ..Scan::default()
    };
    for row in rows(scan) {
        for gap in gaps(&row, masked) {
            let inside = gap.start > 0 && gap.end < row.len() && gap.len() <= LONGEST_FILLED;
            let before = (0..gap.start).rev().filter(|&p| !masked[row[p]]).take(2);
            let after = (gap.end..row.len()).filter(|&p| !masked[row[p]]).take(2);
            let known: Vec<usize> = before.chain(after).collect();
            for place in gap {
                filled.points[row[place]] = if inside {
                    let at = |p: usize| (p as f64, scan.points[row[p]]);
                    lagrange(
                        &known.iter().map(|&p| at(p)).collect::<Vec<_>>(),
                        place as f64,
                    )
                } else {
                    DVec3::NAN
                };
            }
        }
    }
    Some(filled)
}

/// The runs of masked places of a row.
fn gaps(row: &[usize], masked: &[bool]) -> Vec<Range<usize>> {
    let mut gaps: Vec<Range<usize>> = Vec::new();
    for (place, _) in row.iter().enumerate().filter(|(_, k)| masked[**k]) {
        match gaps.last_mut() {
            Some(gap) if gap.end == place => gap.end += 1,
            _ => gaps.push(place..place + 1),
        }
    }
    gaps
}

/// The polynomial through the values at distinct places, at `x`.
fn lagrange(known: &[(f64, DVec3)], x: f64) -> DVec3 {
    let weight = |a: usize| -> f64 {
        let others = known.iter().enumerate().filter(|(b, _)| *b != a);
        others
            .map(|(_, (place, _))| (x - place) / (known[a].0 - place))
            .product()
    };
    (0..known.len()).map(|a| known[a].1 * weight(a)).sum()
}

/// Whether a point of an ordered scan lies where its row does not lead. O(n).
pub(super) fn has_jumps(scan: &Scan) -> bool {
    rows(scan).iter().any(|row| {
        let row: Vec<DVec3> = row
            .iter()
            .map(|&k| scan.points[k])
            .filter(|p| p.is_finite())
            .collect();
        let mut steps: Vec<f64> = row.windows(2).map(|w| w[0].distance(w[1])).collect();
        let limit = JUMP * nurbskin_geometry::numeric::statistics::median_in_place(&mut steps);
        let straight = |a: DVec3, b: DVec3, c: DVec3| (a - 2.0 * b + c).length() > 2.0 * limit;
        limit > 0.0
            && (row.windows(5).any(|w| {
                let led = (4.0 * (w[1] + w[3]) - w[0] - w[4]) / 6.0;
                w[2].distance(led) > limit
            }) || row.windows(3).any(|w| straight(w[0], w[1], w[2])))
    })
}

/// Points of an ordered scan, other than the masked ones, that are far from both their neighbours in the row while
/// these are near each other; at the ends of rows far from the only one.
pub(super) fn spikes(scan: &Scan, masked: &[bool]) -> Vec<usize> {
    let mut found = Vec::new();
    for row in rows(scan) {
        let row: Vec<usize> = row.into_iter().filter(|&k| !masked[k]).collect();
        let step = |a: usize, b: usize| scan.points[row[a]].distance(scan.points[row[b]]);
        let mut steps: Vec<f64> = (1..row.len()).map(|p| step(p - 1, p)).collect();
        let limit = SPIKE * nurbskin_geometry::numeric::statistics::median_in_place(&mut steps);
        let last = row.len().saturating_sub(1);
        if row.len() < 4 || limit <= 0.0 {
            continue;
        }
        let spike = |p: usize| match p {
            0 => step(0, 1) > limit && step(1, 2) <= limit,
            _ if p == last => step(p - 1, p) > limit && step(p - 2, p - 1) <= limit,
            _ => {
                step(p - 1, p) > limit
                    && step(p, p + 1) > limit
                    && step(p - 1, p + 1) <= 1.5 * limit
            }
        };
        found.extend((0..row.len()).filter(|&p| spike(p)).map(|p| row[p]));
    }
    found
}

/// What a robust fit says of its points.
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

/// The points that a robust fit gave no weight, off the surface by more than the tolerance, five standard deviations
/// and 0.6 spacings, each alone among its neighbours, or off by four spacings in a loose swarm: outliers, where a group of
/// such points that lie closely or in a plane would be a feature missed.
pub(super) fn lost(points: &[DVec3], fit: &Robust, tolerance: f64, spacing: f64) -> Vec<bool> {
    let limit = tolerance
        .max(LOST_SIGMAS * fit.sigma)
        .max(LOST_SPACINGS * spacing);
    let weightless = |k: usize| {
        fit.weights
            .is_none_or(|w| w.get(k).is_some_and(|&w| w <= 0.0))
    };
    let far: Vec<bool> = (0..)
        .zip(fit.residuals)
        .map(|(k, residual)| residual.abs() > limit && weightless(k))
        .collect();
    let count = far.iter().filter(|f| **f).count();
    if count == 0 || count as f64 > MOST_LOST * points.len() as f64 {
        return vec![false; points.len()];
    }
    // Few points have a far one nearby; where these do not hold all its neighbours, all points are asked.
    let reach = AROUND * spacing;
    let around = around(points, &far, reach);
    let nearby: Vec<DVec3> = around.iter().map(|&k| points[k as usize]).collect();
    let tree = Neighbours::new(&nearby);
    let mut all: Option<Neighbours> = None;
    let mut alone = |k: usize| {
        let mut near: Vec<u32> = tree.nearest(points[k], NEIGHBOURS + 1);
        for j in &mut near {
            *j = around[*j as usize];
        }
        let farthest = near.last().map(|&j| points[j as usize].distance(points[k]));
        if near.len() <= NEIGHBOURS || farthest.is_none_or(|d| d > reach) {
            let tree = all.get_or_insert_with(|| Neighbours::new(points));
            near = tree.nearest(points[k], NEIGHBOURS + 1);
            let farthest = near.last().map(|&j| points[j as usize].distance(points[k]));
            if farthest.is_none_or(|d| d > reach) {
                // A swarm has no plane; a sparsely scanned feature has one.
                let (values, _) = plane_axes(near.iter().map(|&j| points[j as usize]));
                if values[0] > SWARM * values[1] && fit.residuals[k].abs() > reach {
                    return true;
                }
            }
        }
        let lost = near.iter().filter(|&&j| j as usize != k && far[j as usize]);
        lost.count() <= MOST_NEIGHBOURS_LOST
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
    use nurbskin_scan::GridLayout;

    fn parabola() -> Scan {
        let point = |k: i32| {
            DVec3::new(
                f64::from(k % 8),
                f64::from(k / 8),
                f64::from((k % 8).pow(3)),
            )
        };
        Scan {
            points: (0..24).map(point).collect(),
            organisation: Organisation::Grid(GridLayout::complete(8, 3).unwrap()),
            ..Scan::default()
        }
    }

    #[test]
    fn gaps_are_filled_by_cubics_and_ends_are_not() {
        let scan = parabola();
        let mut masked = vec![false; 24];
        assert!(filled(&scan, &masked).is_none());
        // Inside, two in a row, an end, and too many.
        for k in [3, 11, 12, 7, 17, 18, 19, 20] {
            masked[k] = true;
        }
        let filled = filled(&scan, &masked).unwrap();
        for k in 0..24 {
            match k {
                7 | 17..=20 => assert!(filled.points[k].is_nan()),
                _ => assert!(filled.points[k].distance(scan.points[k]) < 1e-9, "{k}"),
            }
        }
    }

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

    #[test]
    fn jumps_are_seen() {
        let mut scan = parabola();
        for (k, point) in scan.points.iter_mut().enumerate() {
            point.z = 0.1 * ((k % 8) as f64).powi(2);
        }
        assert!(!has_jumps(&scan));
        for k in [0, 4, 7] {
            let mut scan = scan.clone();
            scan.points[k].z += 9.0;
            assert!(has_jumps(&scan), "{k}");
            assert_eq!(spikes(&scan, &[false; 24]), [k]);
        }
    }
}
