//! The points of a dense cloud beside the sample of it that was examined.

use super::blocks::each;
use super::elements::{Elements, NEIGHBOURS, isolation, offsets};
use super::neighbours::{Nearest, Neighbours};
use super::outliers::{Around, Judge};
use glam::DVec3;

/// A point so near to one of the sample, along its plane and across, in spacings, follows it without further search.
const NEAR: [f64; 2] = [1.0, 0.75];
/// Distance across a plane counts so much more than along it, so that a point follows one of its own wall.
const ACROSS: f64 = 4.0;

/// For each point, in spatial order, the place in the tree of the point of the sample that it follows; the largest
/// number for outliers. `ranks` are those of the sample among the points, ascending. Points are compared with those of the sample just before and after them, with their
/// neighbours, and, if they are not near one of these, with the nearest of all. O(n), about .2 us per point.
pub(super) fn leaders(
    points: &[DVec3],
    ranks: &[u32],
    tree: &Neighbours,
    elements: &Elements,
    dead: &[bool],
    judge: Option<&Judge>,
) -> Vec<u32> {
    let sample = tree.sorted_points();
    // Squared distance, with that across the plane of the sample's point counted more, and that point.
    let compare = |point: DVec3, j: u32| {
        let offset = point - sample[j as usize];
        let across = offset.dot(elements.of[j as usize].normal);
        let square = offset.length_squared() + (ACROSS * ACROSS - 1.0) * across * across;
        (square, j)
    };
    let nearest = |point: DVec3, candidates: &mut dyn Iterator<Item = u32>| {
        let all = candidates.filter(|&j| !dead[j as usize]);
        let all = all.map(|j| compare(point, j));
        all.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
    };
    let is_near = |point: DVec3, j: u32| {
        let (offset, element) = (point - sample[j as usize], elements.of[j as usize]);
        offset.length() < NEAR[0] * element.spacing
            && offset.dot(element.normal).abs() < NEAR[1] * element.spacing
    };
    // The place of the last point of the sample that is not after each point; of the first where there is none.
    let mut before = vec![0_u32; points.len()];
    let ends = ranks.iter().skip(1).map(|&rank| rank as usize);
    let mut start = 0;
    for (place, end) in (0_u32..).zip(ends.chain([points.len()])) {
        before[start..end].fill(place);
        start = end;
    }
    each(points.len(), |k| {
        let (point, before) = (points[k], before[k]);
        if ranks[before as usize] as usize == k {
            let dead = dead[before as usize];
            return if dead { u32::MAX } else { before };
        }
        let after = (before as usize + 1 < ranks.len()).then_some(before + 1);
        let ends = [before, after.unwrap_or(before)];
        let rows = ends.iter().flat_map(|&end| elements.table.of(end as usize));
        let mut candidates = ends.iter().chain(rows).copied();
        if let Some((_, j)) = nearest(point, &mut candidates)
            && is_near(point, j)
        {
            return j;
        }
        let mut found = Nearest::default();
        tree.search(point, NEIGHBOURS, &mut found, |j| !dead[j as usize]);
        let near: Vec<u32> = found.indices().collect();
        let mut around = [DVec3::ZERO; NEIGHBOURS];
        let around = &mut around[..near.len()];
        offsets(sample, point, &near, around);
        let (reach, one_sided) = isolation(around);
        let at = Around {
            point,
            place: None,
            near: &near,
            reach,
            one_sided,
        };
        if judge.is_some_and(|judge| judge.outlying(&at, false)) {
            return u32::MAX;
        }
        nearest(point, &mut found.indices()).map_or(u32::MAX, |(_, j)| j)
    })
}
