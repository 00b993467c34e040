//! Nearest neighbours.

mod batch;

use super::morton::spatial_order;
use crate::numeric::parallel::{each, pairs_of_blocks};
pub use batch::Scratch;
use glam::DVec3;
use std::ops::Range;

/// Points per leaf, consecutive ones of the spatial order: their coordinates fill three cache lines. Results do not depend on it.
pub(crate) const LEAF: usize = 8;
/// Children per node. Results do not depend on it.
pub(crate) const FAN: usize = 4;
/// Points that one task answers in a row; fixed, so that results do not depend on the number of threads, and a
/// multiple of [`LEAF`].
const CHUNK: usize = 2048;

/// A tree of boxes over points, built once and asked often. Leaves hold consecutive points of the Morton order and
/// four nodes make one of the next level, so that building is sorting and uneven density, equal, collinear and
/// coplanar points do no harm. Answers do not depend on how it was built: of equally far points those of lower index
/// come first.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_geometry::spatial::neighbours::Neighbours;
/// let line: Vec<DVec3> = (0..10).map(|i| DVec3::X * f64::from(i)).collect();
/// let near = Neighbours::new(&line).nearest(DVec3::X * 3.2, 3);
/// assert_eq!(near, [3, 4, 2]);
/// ```
#[derive(Clone, Debug)]
pub struct Neighbours {
    /// The points in spatial order.
    pub(crate) points: Vec<DVec3>,
    /// The index of each of them; empty if they were given in this order.
    indices: Vec<u32>,
    /// Boxes of the leaves, of four leaves each, and so on up to a single one.
    pub(crate) levels: Vec<Vec<Bounds>>,
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    /// Lower corner.
    pub(crate) low: DVec3,
    /// Upper corner.
    pub(crate) high: DVec3,
}

impl Bounds {
    const NOTHING: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
    };
    fn with(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }
    /// Least squared distance of two boxes, or of a box and a point.
    #[inline]
    pub(crate) fn distance_squared(&self, low: DVec3, high: DVec3) -> f64 {
        let gap = (self.low - high).max(low - self.high).max(DVec3::ZERO);
        gap.length_squared()
    }
}

/// Squared distance and index of a point.
pub(crate) type Candidate = (f64, u32);

/// The nearest points met so far, nearest first; of equally far ones that of lower index.
#[derive(Clone, Debug, Default)]
pub struct Nearest {
    most: usize,
    /// The nearest candidates so far, nearest first.
    pub items: Vec<Candidate>,
}

impl Nearest {
    /// Empties the list, which then keeps the nearest `most`.
    pub(crate) fn reset(&mut self, most: usize) {
        self.most = most;
        self.items.clear();
    }
    /// The squared distance that a further point must not exceed.
    #[inline]
    fn bound(&self) -> f64 {
        if self.items.len() < self.most {
            f64::INFINITY
        } else {
            self.items[self.most - 1].0
        }
    }
    /// Keeps a candidate if it is among the nearest.
    #[inline]
    pub(crate) fn offer(&mut self, candidate: Candidate) {
        let before = |other: &Candidate| {
            candidate.0 < other.0 || (candidate.0 <= other.0 && candidate.1 < other.1)
        };
        let mut at = self.items.len();
        if at == self.most {
            at -= 1;
            if !before(&self.items[at]) {
                return;
            }
        } else {
            self.items.push(candidate);
        }
        let items = &mut self.items[..=at];
        while at > 0 && before(&items[at - 1]) {
            items[at] = items[at - 1];
            at -= 1;
        }
        items[at] = candidate;
    }
    /// The indices of the points kept.
    pub fn indices(&self) -> impl Iterator<Item = u32> + '_ {
        self.items.iter().map(|&(_, index)| index)
    }
}

impl Neighbours {
    /// A tree over finite points, at most 2^32 - 1; others are left out. O(n log n).
    #[must_use]
    pub fn new(points: &[DVec3]) -> Self {
        let indices = spatial_order(points, |p| p.is_finite());
        let sorted = each(indices.len(), |k| points[indices[k] as usize]);
        Self::build(sorted, indices)
    }

    /// A tree over points that are in spatial order already. O(n).
    pub fn of_sorted(points: Vec<DVec3>) -> Self {
        Self::build(points, Vec::new())
    }

    fn build(points: Vec<DVec3>, indices: Vec<u32>) -> Self {
        let around = |points: &[DVec3]| {
            points.iter().fold(Bounds::NOTHING, |bounds, &p| {
                bounds.with(Bounds { low: p, high: p })
            })
        };
        let count = points.len().div_ceil(LEAF);
        let mut below = each(count, |leaf| {
            around(&points[leaf * LEAF..points.len().min((leaf + 1) * LEAF)])
        });
        let mut levels = Vec::new();
        while below.len() > 1 {
            let above = below
                .chunks(FAN)
                .map(|four| four.iter().fold(Bounds::NOTHING, |all, b| all.with(*b)))
                .collect();
            levels.push(std::mem::replace(&mut below, above));
        }
        levels.push(below);
        Self {
            points,
            indices,
            levels,
        }
    }

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The points in spatial order.
    pub fn sorted_points(&self) -> &[DVec3] {
        &self.points
    }

    /// Indices of the `count` points nearest to `query`, nearest first; all points if there are fewer. O(log n), a
    /// few microseconds.
    #[must_use]
    pub fn nearest(&self, query: DVec3, count: usize) -> Vec<u32> {
        let mut found = Nearest::default();
        self.search(query, count, &mut found, |_| true);
        found.indices().collect()
    }

    /// For each point the `count` nearest other points, nearest first; `count` is cut to the number of others.
    /// About 1 us each for `count` = 16.
    #[must_use]
    pub fn table(&self, count: usize) -> NeighbourTable {
        let count = count.min(self.len().saturating_sub(1));
        let mut sorted = vec![0_u32; count * self.len()];
        let mut nothing = vec![(); self.len()];
        pairs_of_blocks(
            &mut sorted,
            CHUNK * count,
            &mut nothing,
            CHUNK,
            |chunk, rows, part| {
                let start = chunk * CHUNK;
                let mut rows = rows.chunks_exact_mut(count);
                self.search_range(
                    start..start + part.len(),
                    count,
                    &mut Scratch::default(),
                    |_, near| {
                        if let Some(row) = rows.next() {
                            for (cell, index) in row.iter_mut().zip(near.indices()) {
                                *cell = index;
                            }
                        }
                    },
                );
            },
        );
        if self.indices.is_empty() || count == 0 {
            return NeighbourTable {
                count,
                indices: sorted,
            };
        }
        let mut indices = vec![0_u32; sorted.len()];
        for (row, &index) in sorted.chunks_exact(count).zip(&self.indices) {
            let start = index as usize * count;
            indices[start..start + count].copy_from_slice(row);
        }
        NeighbourTable { count, indices }
    }

    /// The places of the points of a leaf.
    pub(crate) fn places(&self, leaf: usize) -> Range<usize> {
        leaf * LEAF..self.points.len().min((leaf + 1) * LEAF)
    }

    /// The index of the point at a place of the spatial order.
    pub(crate) fn index(&self, place: usize) -> u32 {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "there are at most 2^32 - 1 points"
        )]
        self.indices.get(place).copied().unwrap_or(place as u32)
    }

    /// Fills `found` with the `count` points nearest to `query` among those whose index is kept.
    pub fn search(
        &self,
        query: DVec3,
        count: usize,
        found: &mut Nearest,
        keep: impl Fn(u32) -> bool,
    ) {
        self.search_some(query, count, found, usize::MAX, keep);
    }

    /// As [`Self::search`]; gives up, with `false`, when so many leaves were met.
    pub fn search_some(
        &self,
        query: DVec3,
        count: usize,
        found: &mut Nearest,
        mut leaves: usize,
        keep: impl Fn(u32) -> bool,
    ) -> bool {
        found.reset(count);
        if count == 0 || self.is_empty() {
            return true;
        }
        // Nodes still to visit, the nearest last.
        let mut open = vec![(0.0, self.levels.len() - 1, 0_usize)];
        while let Some((square, level, node)) = open.pop() {
            if square > found.bound() {
                continue;
            }
            if level == 0 {
                if leaves == 0 {
                    return false;
                }
                leaves -= 1;
                for place in node * LEAF..self.points.len().min((node + 1) * LEAF) {
                    let (square, index) = (
                        query.distance_squared(self.points[place]),
                        self.index(place),
                    );
                    if square <= found.bound() && keep(index) {
                        found.offer((square, index));
                    }
                }
                continue;
            }
            let start = open.len();
            for child in node * FAN..self.levels[level - 1].len().min((node + 1) * FAN) {
                let square = self.levels[level - 1][child].distance_squared(query, query);
                open.push((square, level - 1, child));
            }
            open[start..].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        }
        true
    }
}

/// The nearest other points of every point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NeighbourTable {
    count: usize,
    indices: Vec<u32>,
}

impl NeighbourTable {
    /// A table of rows of `count` indices.
    pub fn from_rows(count: usize, indices: Vec<u32>) -> Self {
        Self { count, indices }
    }

    /// Neighbours per point.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The neighbours of a point, nearest first.
    #[must_use]
    pub fn of(&self, point: usize) -> &[u32] {
        &self.indices[point * self.count..(point + 1) * self.count]
    }

    /// The row of a point, to write.
    pub fn of_mut(&mut self, point: usize) -> &mut [u32] {
        &mut self.indices[point * self.count..(point + 1) * self.count]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute(points: &[DVec3], query: DVec3, count: usize, except: usize) -> Vec<u32> {
        let mut all: Vec<(f64, u32)> = points
            .iter()
            .enumerate()
            .filter(|&(k, _)| k != except)
            .map(|(k, p)| (query.distance_squared(*p), u32::try_from(k).unwrap()))
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        all.truncate(count);
        all.into_iter().map(|(_, k)| k).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        /// Small integers make ties, duplicates, lines and planes.
        #[test]
        fn agrees_with_brute_force(
            cells in prop::collection::vec((0..9_i32, 0..9_i32, 0..9_i32), 1..200),
            flat in 0..3_u8,
            count in 1..20_usize,
        ) {
            let points: Vec<DVec3> = cells
                .iter()
                .map(|&(x, y, z)| {
                    let keep = |c: i32, level: u8| if flat >= level { 0.0 } else { f64::from(c) };
                    DVec3::new(f64::from(x), keep(y, 2), keep(z, 1))
                })
                .collect();
            let tree = Neighbours::new(&points);
            let table = tree.table(count);
            prop_assert_eq!(table.count(), count.min(points.len() - 1));
            for (k, &point) in points.iter().enumerate() {
                let wanted = brute(&points, point, table.count(), k);
                prop_assert_eq!(table.of(k), &wanted[..]);
            }
            let query = DVec3::new(2.5, 4.5, -1.0);
            prop_assert_eq!(tree.nearest(query, count), brute(&points, query, count, usize::MAX));
        }
    }

    #[test]
    fn few_points() {
        assert!(Neighbours::new(&[]).nearest(DVec3::ZERO, 3).is_empty());
        assert_eq!(Neighbours::new(&[]).table(3).count(), 0);
        assert_eq!(Neighbours::new(&[DVec3::ONE]).table(3).of(0), [0_u32; 0]);
        assert_eq!(
            Neighbours::new(&vec![DVec3::ONE; 5000]).table(4).of(7),
            [0, 1, 2, 3]
        );
    }
}
