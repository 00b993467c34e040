//! The points of a dense cloud beside the sample of it that was examined.

use super::elements::{Elements, NEIGHBOURS, isolation, offsets};
use super::outliers::{Around, Judge};
use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::spatial::neighbours::{Nearest, Neighbours};

/// A point so near to one of the sample, along its plane and across, in spacings, follows it without further search.
const NEAR: [f64; 2] = [1.5, 0.75];
/// Distance across a plane counts so much more than along it, so that a point follows one of its own wall.
const ACROSS: f64 = 4.0;
/// So many times the neighbours of the nearest one are asked, too.
const HOPS: usize = 1;
/// Points of the sample, next to each other in spatial order, that are as dense a sample of all.
const RUN: usize = 256;
/// Points between two questions whether to go on: a fraction of a second.
const BATCH: usize = 1 << 18;

/// A sample of points in spatial order, and what is known of it.
pub(super) struct Sample<'a> {
    /// Ranks of its points among all, ascending.
    pub(super) ranks: &'a [u32],
    /// Its points.
    pub(super) tree: &'a Neighbours,
    pub(super) elements: &'a Elements,
    /// Those that are outliers.
    pub(super) dead: &'a [bool],
    /// Who tells outliers among the other points; none are where there is nobody.
    pub(super) judge: Option<&'a Judge<'a>>,
}

impl Sample<'_> {
    /// For each of all points, in spatial order, the place in the sample of the one that it follows; the largest number
    /// for outliers. O(n), about 0.5 us per point.
    pub(super) fn leaders(&self, points: &[DVec3], progress: &dyn Progress) -> Result<Vec<u32>> {
        // The last of the sample that is not after each point; the first where there is none.
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
            let count = BATCH.min(points.len() - start);
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

    /// The side of the square that one of all points stands for, in the median, by those that they follow.
    pub(super) fn spacing(&self, leaders: &[u32]) -> f64 {
        // The roots of the parts of the points that runs of the sample are.
        let all = leaders.len();
        let roots: Vec<f64> = (self.ranks.chunks(RUN).enumerate())
            .map(|(run, ranks)| {
                let first = ranks.first().map_or(0, |&rank| rank as usize);
                let next = self.ranks.get((run + 1) * RUN);
                let next = next.map_or(all, |&rank| rank as usize);
                (ranks.len() as f64 / (next - first).max(1) as f64).sqrt()
            })
            .collect();
        // Outliers follow nobody.
        let mut spacings = each(all, |k| match leaders[k] {
            u32::MAX => f64::INFINITY,
            leader => self.elements.of[leader as usize].spacing * roots[leader as usize / RUN],
        });
        spacings.retain(|spacing| spacing.is_finite());
        median_in_place(&mut spacings)
    }

    /// The place in the sample of the point that another one follows, which comes after the `before`-th of the sample in
    /// spatial order: one of that, the next and their neighbours, or of the neighbours of the nearest of these, or, if it is
    /// not near one of them, of all.
    fn leader(&self, point: DVec3, before: u32) -> u32 {
        let after = (before as usize + 1 < self.tree.len()).then_some(before + 1);
        let ends = [before, after.unwrap_or(before)];
        let rows = ends.iter();
        let rows = rows.flat_map(|&end| self.elements.table.of(end as usize));
        let mut nearest = self.nearest(point, ends.iter().chain(rows).copied());
        for hop in 0..=HOPS {
            let Some(j) = nearest else { break };
            if self.is_near(point, j) {
                return j;
            }
            if hop < HOPS {
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

    /// The nearest of some of the sample that are no outliers, distance across their planes counting more; of equally far
    /// ones that of lower place.
    fn nearest(&self, point: DVec3, some: impl Iterator<Item = u32>) -> Option<u32> {
        let alive = some.filter(|&j| !self.dead[j as usize]);
        let measured = alive.map(|j| {
            let (offset, across) = self.seen(point, j);
            let square = offset.length_squared() + (ACROSS * ACROSS - 1.0) * across * across;
            (square, j)
        });
        let nearest = measured.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        nearest.map(|(_, j)| j)
    }

    fn is_near(&self, point: DVec3, j: u32) -> bool {
        let (offset, across) = self.seen(point, j);
        let spacing = self.elements.of[j as usize].spacing;
        offset.length() < NEAR[0] * spacing && across.abs() < NEAR[1] * spacing
    }

    /// Where a point is from one of the sample, and how far from its plane.
    fn seen(&self, point: DVec3, j: u32) -> (DVec3, f64) {
        let offset = point - self.tree.sorted_points()[j as usize];
        (offset, offset.dot(self.elements.of[j as usize].normal))
    }
}
