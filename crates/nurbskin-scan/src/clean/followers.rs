//! Points of a dense cloud outside its sample: each follows a sample point nearby and takes its normal and part.
//!
//! The sample point j to follow minimises `|d|² + (w² - 1)(d · n_j)²`, with d the offset from it and w = 4: distance
//! across its plane counts more than distance along it, so that points follow their own wall. Candidates are the
//! sample points before and after the point in spatial order, their neighbours, and the neighbours of the best of
//! these; where none is near, the whole sample is searched, and the point may be an outlier. Source: ours.

use super::elements::{Elements, NEIGHBOURS, isolation, offsets};
use super::outliers::{Around, Judge};
use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::spatial::neighbours::{Nearest, Neighbours};

/// Distance from a sample point, and height above its plane, in its spacing, below which a point follows it without
/// further search. Trial: not recorded. Larger limits may follow another wall; smaller ones search the whole sample
/// more often.
const FOLLOWING_DISTANCE: [f64; 2] = [1.5, 0.75];
/// Weight of the height above a plane relative to the distance along it in the choice of the sample point to follow.
/// Trial: not recorded. A smaller weight lets points follow a wall that is close behind their own.
const HEIGHT_WEIGHT: f64 = 4.0;
/// Times that the search moves on to the neighbours of the nearest sample point before it searches the whole sample.
/// Trial: not recorded.
const NEIGHBOUR_HOPS: usize = 1;
/// Consecutive sample points in spatial order over which the density of the sample relative to all points is measured.
/// Trial: not recorded. Shorter runs give a random density, longer ones hide local differences.
const DENSITY_RUN: usize = 256;
/// Points between two tests for cancellation. Guard: a fraction of a second of work.
const LEADER_BATCH: usize = 1 << 18;

/// An examined sample of points in spatial order.
pub(super) struct Sample<'a> {
    /// Ranks of the sample points among all points, ascending.
    pub(super) ranks: &'a [u32],
    /// Its points.
    pub(super) tree: &'a Neighbours,
    pub(super) elements: &'a Elements,
    /// The outliers among them.
    pub(super) dead: &'a [bool],
    /// Test for outliers among the other points; without it none are found.
    pub(super) judge: Option<&'a Judge<'a>>,
}

impl Sample<'_> {
    /// For each point, in spatial order, the index of the sample point that it follows; `u32::MAX` for outliers. O(n),
    /// about 0.5 us per point.
    pub(super) fn leaders(&self, points: &[DVec3], progress: &dyn Progress) -> Result<Vec<u32>> {
        // The last sample point not after each point; the first sample point if there is none.
        let mut before = vec![0_u32; points.len()];
        let ends = self.ranks.iter().skip(1).map(|&rank| rank as usize);
        let mut start = 0;
        for (place, end) in (0_u32..).zip(ends.chain([points.len()])) {
            before[start..end].fill(place);
            start = end;
        }
        let mut leaders = Vec::with_capacity(points.len());
        while leaders.len() < points.len() {
            progress.check()?;
            let start = leaders.len();
            let count = LEADER_BATCH.min(points.len() - start);
            leaders.extend(each(count, |k| {
                let (k, before) = (start + k, before[start + k]);
                if self.ranks[before as usize] as usize == k {
                    let dead = self.dead[before as usize];
                    return if dead { u32::MAX } else { before };
                }
                self.leader(points[k], before)
            }));
        }
        Ok(leaders)
    }

    /// Median side of the square that each point represents, from the spacings of the sample points that they follow.
    pub(super) fn spacing(&self, leaders: &[u32]) -> f64 {
        // Square root of the share of the points that runs of the sample contain.
        let all = leaders.len();
        let roots: Vec<f64> = (self.ranks.chunks(DENSITY_RUN).enumerate())
            .map(|(run, ranks)| {
                let first = ranks.first().map_or(0, |&rank| rank as usize);
                let next = self.ranks.get((run + 1) * DENSITY_RUN);
                let next = next.map_or(all, |&rank| rank as usize);
                (ranks.len() as f64 / (next - first).max(1) as f64).sqrt()
            })
            .collect();
        // Outliers have no leader.
        let mut spacings = each(all, |k| match leaders[k] {
            u32::MAX => f64::INFINITY,
            leader => {
                self.elements.of[leader as usize].spacing * roots[leader as usize / DENSITY_RUN]
            }
        });
        spacings.retain(|spacing| spacing.is_finite());
        median_in_place(&mut spacings)
    }

    /// The index of the sample point that another point follows; `before` is the last sample point before it in spatial
    /// order. Candidates are `before`, the next one, their neighbours, and the neighbours of the nearest of these. If
    /// none is near, the whole sample is searched.
    fn leader(&self, point: DVec3, before: u32) -> u32 {
        let after = (before as usize + 1 < self.tree.len()).then_some(before + 1);
        let ends = [before, after.unwrap_or(before)];
        let rows = ends.iter();
        let rows = rows.flat_map(|&end| self.elements.table.of(end as usize));
        let mut nearest = self.nearest(point, ends.iter().chain(rows).copied());
        for hop in 0..=NEIGHBOUR_HOPS {
            let Some(j) = nearest else { break };
            if self.is_near(point, j) {
                return j;
            }
            if hop < NEIGHBOUR_HOPS {
                let row = self.elements.table.of(j as usize).iter();
                nearest = self.nearest(point, row.chain([&j]).copied());
            }
        }
        let mut found = Nearest::default();
        let alive = |j: u32| !self.dead[j as usize];
        self.tree.search(point, NEIGHBOURS, &mut found, alive);
        let mut near = [0_u32; NEIGHBOURS];
        let near = &mut near[..found.items.len()];
        for (cell, j) in near.iter_mut().zip(found.indices()) {
            *cell = j;
        }
        let mut around = [DVec3::ZERO; NEIGHBOURS];
        let around = &mut around[..near.len()];
        offsets(self.tree.sorted_points(), point, near, around);
        let (reach, one_sided) = isolation(around);
        let at = Around {
            point,
            place: None,
            near,
            reach,
            one_sided,
        };
        if self.judge.is_some_and(|judge| judge.outlying(&at, false)) {
            return u32::MAX;
        }
        self.nearest(point, found.indices()).unwrap_or(u32::MAX)
    }

    /// The nearest of some sample points that are no outliers, where the distance across their planes has a larger
    /// weight; of equally near ones the first.
    fn nearest(&self, point: DVec3, some: impl Iterator<Item = u32>) -> Option<u32> {
        let alive = some.filter(|&j| !self.dead[j as usize]);
        let measured = alive.map(|j| {
            let (offset, across) = self.seen(point, j);
            let square =
                offset.length_squared() + (HEIGHT_WEIGHT * HEIGHT_WEIGHT - 1.0) * across * across;
            (square, j)
        });
        let nearest = measured.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        nearest.map(|(_, j)| j)
    }

    fn is_near(&self, point: DVec3, j: u32) -> bool {
        let (offset, across) = self.seen(point, j);
        let spacing = self.elements.of[j as usize].spacing;
        offset.length() < FOLLOWING_DISTANCE[0] * spacing
            && across.abs() < FOLLOWING_DISTANCE[1] * spacing
    }

    /// Offset of a point from a sample point, and its height above the plane of the sample point.
    fn seen(&self, point: DVec3, j: u32) -> (DVec3, f64) {
        let offset = point - self.tree.sorted_points()[j as usize];
        (offset, offset.dot(self.elements.of[j as usize].normal))
    }
}
