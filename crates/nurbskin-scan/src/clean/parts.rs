//! The separate pieces of a scan.

use super::elements::Elements;
use super::faced::OPPOSED;
use super::signed_sets::SignedSets;
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::spatial::neighbours::{Nearest, Neighbours};

/// Mean distances to the neighbours (the geometric mean of those of both points) over which points belong together: on
/// an even surface 3.7 spacings, between rims 5.
const NEAR: f64 = 2.5;
/// The mean distance to the neighbours that counts at most, in that of most points: farther ones are a swarm's.
const SPARSE: f64 = 4.0;
/// Neighbours that the rim of a piece looks at: on one side of it they reach some 5.5 spacings far.
const ACROSS: usize = 48;
/// How far the mean of the neighbours is off at a rim, in their mean distance.
const ONE_SIDED: f64 = 0.25;

/// Which separate piece each point belongs to.
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

    /// Pieces of points in spatial order that are farther apart than the points within them: neighbours are joined
    /// if they are no more than 2.5 times as far apart as neighbours are on the average; so are, at the rims of pieces, points that continue each
    /// other's plane. Points that are not alive have a part of their own each, without size. O(n).
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
        let most = SPARSE * median_in_place(&mut all);
        drop(all);
        let reach = |k: usize, j: usize| (of[k].reach * of[j].reach).sqrt().min(most);
        // 1. Neighbours.
        let links = |k: usize| {
            let row = if alive(k) { elements.table.of(k) } else { &[] };
            row.iter().map(|&j| j as usize).filter(|&j| alive(j))
        };
        let judge = |k: usize, j: usize| {
            let near = points[k].distance(points[j]) <= NEAR * reach(k, j);
            near.then_some((0.0, false))
        };
        let mut sets = SignedSets::spanning(points.len(), &[0.0], links, judge);
        // 2. Rims of all pieces but the largest.
        let (number, count) = sets.numbered();
        let mut sizes = vec![0_usize; count];
        for k in (0..points.len()).filter(|&k| alive(k)) {
            sizes[number[k] as usize] += 1;
        }
        let largest = (0..count).max_by_key(|&part| (sizes[part], std::cmp::Reverse(part)));
        let rim = |&k: &usize| {
            alive(k) && Some(number[k] as usize) != largest && of[k].one_sided > ONE_SIDED
        };
        let rims: Vec<usize> = (0..points.len()).filter(rim).collect();
        let across = each(rims.len(), |r| {
            let k = rims[r];
            let mut near = Nearest::default();
            tree.search(points[k], ACROSS, &mut near, |j| alive(j as usize));
            let continues = |j: &u32| {
                let j = *j as usize;
                let offset = points[j] - points[k];
                let [rise, fall] = [k, j].map(|at| offset.dot(of[at].normal).abs());
                // Walls that meet at a sharp edge look opposite ways: there one plane leads to the other.
                let round = elements.faced && of[k].normal.dot(of[j].normal) < OPPOSED;
                let height = if round {
                    rise.min(fall)
                } else {
                    rise.max(fall)
                };
                number[j] != number[k]
                    && offset.length() <= NEAR * reach(k, j)
                    && height <= 0.5 * offset.length()
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

    /// Pieces of a mesh; points without a triangle belong to the piece of the nearest point that has one.
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

    /// Counts again: some points are no longer alive.
    pub(super) fn recount(&mut self, alive: &dyn Fn(usize) -> bool) {
        let count = self.of.iter().max().map_or(0, |&part| part as usize + 1);
        *self = Self::numbered(std::mem::take(&mut self.of), count, alive);
    }

    /// Numbers the parts by size, of equals the one met first.
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

    /// The parts of the points at these places, which may repeat.
    pub(super) fn reordered(&self, places: &[u32]) -> Self {
        let of = places.iter().map(|&k| self.of[k as usize]).collect();
        Self::numbered(of, self.count(), &|_| true)
    }
}
