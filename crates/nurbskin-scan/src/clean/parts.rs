//! Connected parts of a scan.
//!
//! Points are joined to neighbours no farther than 2.5 times the geometric mean of both points' mean neighbour
//! distances. At the rims of all parts but the largest, a point also joins another part if both points continue each
//! other's plane (height at most half of the distance), so that gaps in the sampling do not take a surface apart.
//! Parts of a mesh are those of its triangles. Source: ours.

use super::elements::Elements;
use super::faced::OPPOSED_COSINE;
use super::signed_sets::SignedSets;
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::spatial::neighbours::{Nearest, Neighbours};

/// Largest distance between two points of one part, in mean neighbour distances (the geometric mean of those of both
/// points). On an even surface that is 3.7 spacings, between rims 5. Trial: not recorded. Smaller values take sparse
/// surfaces apart; larger ones join separate parts.
const PART_GAP_RATIO: f64 = 2.5;
/// Upper limit for the mean neighbour distance in that rule, in its median over the scan: larger ones belong to a swarm
/// of outliers. Trial: not recorded.
const MAX_PART_REACH: f64 = 4.0;
/// Nearest points that a rim point of a part searches for a continuation on another part. At a rim, where they lie on
/// one side, they extend over some 5.5 spacings (48 points in a half disc). Trial: not recorded. Fewer do not reach
/// across the gap of 5 spacings that [`PART_GAP_RATIO`] allows.
const RIM_SEARCH_NEIGHBOURS: usize = 48;
/// Distance from a point to the mean of its neighbours, in its mean neighbour distance, above which the point is at a
/// rim. About 0.1 within a sheet and 0.6 at its rim. Trial: not recorded.
const PART_RIM_ASYMMETRY: f64 = 0.25;
/// Largest height of either point above the plane of the other, as a share of their distance (30°), for one part to
/// continue the other. Trial: not recorded. A larger slope joins walls that merely pass each other.
const CONTINUATION_SLOPE: f64 = 0.5;

/// The connected part of each point.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Parts {
    /// Number of the part of each point; part 0 is the largest.
    pub of: Vec<u32>,
    /// Points in each part, descending.
    pub sizes: Vec<usize>,
}

impl Parts {
    /// Number of parts.
    #[must_use]
    pub fn count(&self) -> usize {
        self.sizes.len()
    }

    /// Number of parts that hold at least this fraction of the points of the largest; the others are scraps.
    #[must_use]
    pub fn count_above(&self, fraction: f64) -> usize {
        let largest = self.sizes.first().copied().unwrap_or(0) as f64;
        let above = |&&size: &&usize| size as f64 >= fraction * largest;
        self.sizes.iter().filter(above).count()
    }

    /// Connected parts of points in spatial order. Neighbours are joined if their distance is at most 2.5 times the
    /// mean distance of neighbours nearby. At the rims of parts, points that continue each other's plane are joined as
    /// well. A point that is not alive has a part of its own without size. O(n).
    #[must_use]
    pub(super) fn by_distance(
        tree: &Neighbours,
        elements: &Elements,
        alive: &(dyn Fn(usize) -> bool + Sync),
    ) -> Self {
        let (points, of) = (tree.sorted_points(), &elements.of);
        let mut all: Vec<f64> = (0..of.len())
            .filter(|&k| alive(k))
            .map(|k| of[k].reach)
            .collect();
        let most = MAX_PART_REACH * median_in_place(&mut all);
        drop(all);
        let reach = |k: usize, j: usize| (of[k].reach * of[j].reach).sqrt().min(most);
        // 1. Neighbours.
        let links = |k: usize| {
            let row = if alive(k) { elements.table.of(k) } else { &[] };
            row.iter().map(|&j| j as usize).filter(|&j| alive(j))
        };
        let judge = |k: usize, j: usize| {
            let near = points[k].distance(points[j]) <= PART_GAP_RATIO * reach(k, j);
            near.then_some((0.0, false))
        };
        let mut sets = SignedSets::spanning(points.len(), &[0.0], links, judge);
        // 2. Rims of all parts but the largest.
        let (number, count) = sets.numbered();
        let mut sizes = vec![0_usize; count];
        for k in (0..points.len()).filter(|&k| alive(k)) {
            sizes[number[k] as usize] += 1;
        }
        let largest = (0..count).max_by_key(|&part| (sizes[part], std::cmp::Reverse(part)));
        let rim = |&k: &usize| {
            alive(k) && Some(number[k] as usize) != largest && of[k].one_sided > PART_RIM_ASYMMETRY
        };
        let rims: Vec<usize> = (0..points.len()).filter(rim).collect();
        let across = each(rims.len(), |r| {
            let k = rims[r];
            let mut near = Nearest::default();
            tree.search(points[k], RIM_SEARCH_NEIGHBOURS, &mut near, |j| {
                alive(j as usize)
            });
            let continues = |j: &u32| {
                let j = *j as usize;
                let offset = points[j] - points[k];
                let [rise, fall] = [k, j].map(|at| offset.dot(of[at].normal).abs());
                // Walls that meet at a sharp edge look to opposite sides: there one of the two planes suffices.
                let round = elements.faced && of[k].normal.dot(of[j].normal) < OPPOSED_COSINE;
                let height = if round {
                    rise.min(fall)
                } else {
                    rise.max(fall)
                };
                number[j] != number[k]
                    && offset.length() <= PART_GAP_RATIO * reach(k, j)
                    && height <= CONTINUATION_SLOPE * offset.length()
            };
            near.indices().find(continues)
        });
        for (k, j) in rims.into_iter().zip(across) {
            if let Some(j) = j {
                sets.join(k, j as usize, false);
            }
        }
        sets.flatten();
        let (number, count) = sets.numbered();
        Self::numbered(number, count, alive)
    }

    /// Connected parts of a mesh; points without a triangle belong to the part of the nearest point with one.
    #[must_use]
    pub(super) fn by_triangles(
        tree: &Neighbours,
        triangles: &[[u32; 3]],
        alive: &(dyn Fn(usize) -> bool + Sync),
    ) -> Self {
        let points = tree.sorted_points();
        let mut union = DisjointSets::new(points.len());
        let mut met = vec![false; points.len()];
        for &[a, b, c] in triangles {
            union.join(a as usize, b as usize);
            union.join(a as usize, c as usize);
            for k in [a, b, c] {
                met[k as usize] = true;
            }
        }
        let loose: Vec<usize> = (0..points.len()).filter(|&k| alive(k) && !met[k]).collect();
        let nearest = each(loose.len(), |l| {
            let mut near = Nearest::default();
            let met = |j: u32| alive(j as usize) && met[j as usize];
            tree.search(points[loose[l]], 1, &mut near, met);
            near.indices().next()
        });
        for (k, near) in loose.into_iter().zip(nearest) {
            if let Some(near) = near {
                union.join(k, near as usize);
            }
        }
        let mut number = vec![u32::MAX; points.len()];
        let mut of = vec![0_u32; points.len()];
        let mut count = 0;
        for (k, part) in of.iter_mut().enumerate() {
            let root = union.root(k);
            if number[root] == u32::MAX {
                number[root] = count;
                count += 1;
            }
            *part = number[root];
        }
        Self::numbered(of, count as usize, alive)
    }

    /// Counts the points of the parts again after some were rejected.
    pub(super) fn recount(&mut self, alive: &dyn Fn(usize) -> bool) {
        let count = self.of.iter().max().map_or(0, |&part| part as usize + 1);
        *self = Self::numbered(std::mem::take(&mut self.of), count, alive);
    }

    /// Numbers the parts by size; of equal ones, the first in spatial order comes first.
    fn numbered(mut of: Vec<u32>, count: usize, alive: &dyn Fn(usize) -> bool) -> Self {
        let mut sizes = vec![0_usize; count];
        for k in (0..of.len()).filter(|&k| alive(k)) {
            sizes[of[k] as usize] += 1;
        }
        let mut by_size: Vec<usize> = (0..count).collect();
        by_size.sort_by_key(|&part| std::cmp::Reverse(sizes[part]));
        let mut number = vec![0_u32; count];
        for (k, &part) in (0_u32..).zip(&by_size) {
            number[part] = k;
        }
        for part in &mut of {
            *part = number[*part as usize];
        }
        let sizes = by_size.iter().map(|&part| sizes[part]);
        let sizes = sizes.take_while(|&size| size > 0).collect();
        Self { of, sizes }
    }

    /// The parts of the points at these indices, which may repeat.
    pub(super) fn reordered(&self, places: &[u32]) -> Self {
        let of = places.iter().map(|&k| self.of[k as usize]).collect();
        Self::numbered(of, self.count(), &|_| true)
    }
}
