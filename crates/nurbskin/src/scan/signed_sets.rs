//! Disjoint sets of points in spatial order, joined by links that may reverse a side.

use super::blocks::{each, pairs_of_blocks};

/// Points per block, in spatial order, that one task joins.
const BLOCK: usize = 1 << 15;

/// Disjoint sets whose members know whether they are turned against their root, the smallest of them (Tarjan 1975 with
/// path halving; Kruskal's spanning forest).
#[derive(Debug)]
pub(super) struct SignedSets {
    /// The root of each member's set.
    pub(super) roots: Vec<u32>,
    /// Whether each member is turned against its root.
    pub(super) turned: Vec<bool>,
}

/// A part of the sets, whose members are numbered from `base`.
struct Slice<'a> {
    base: usize,
    parents: &'a mut [u32],
    turned: &'a mut [bool],
}

impl Slice<'_> {
    /// The root of k's set and whether k is turned against it.
    fn root(&mut self, k: usize) -> (usize, bool) {
        let (mut k, mut side) = (k - self.base, false);
        loop {
            let parent = self.parents[k] as usize - self.base;
            if parent == k {
                return (k, side);
            }
            let above = self.parents[parent] as usize - self.base;
            if above != parent {
                self.turned[k] ^= self.turned[parent];
                self.parents[k] = self.parents[parent];
            }
            side ^= self.turned[k];
            k = self.parents[k] as usize - self.base;
        }
    }

    fn join(&mut self, k: usize, j: usize, turned: bool) {
        let (a, of_a) = self.root(k);
        let (b, of_b) = self.root(j);
        if a != b {
            let (low, high) = (a.min(b), a.max(b));
            self.parents[high] = self.parents[low];
            self.turned[high] = of_a ^ of_b ^ turned;
        }
    }
}

impl SignedSets {
    /// The sets of a minimum spanning forest over the links from each of `count` members. `judge` gives the cost of a
    /// link and whether it turns; `None` leaves it out. Links that cost at most `free` and are inside a block go first,
    /// all others by ascending cost. O(n log n) of the links left then, which are few.
    pub(super) fn spanning<I: Iterator<Item = usize>>(
        count: usize,
        free: f64,
        links: impl Fn(usize) -> I + Sync,
        judge: impl Fn(usize, usize) -> Option<(f64, bool)> + Sync,
    ) -> Self {
        let mut sets = Self {
            roots: (0..u32::MAX).take(count).collect(),
            turned: vec![false; count],
        };
        // 1. What is free inside blocks.
        let within = |block: usize, parents: &mut [u32], turned: &mut [bool]| {
            let base = block * BLOCK;
            let range = base..base + parents.len();
            let mut slice = Slice {
                base,
                parents,
                turned,
            };
            for k in range.clone() {
                for j in links(k).filter(|j| range.contains(j)) {
                    match judge(k, j) {
                        Some((cost, turned)) if cost <= free => slice.join(k, j, turned),
                        _ => {}
                    }
                }
            }
        };
        pairs_of_blocks(&mut sets.roots, BLOCK, &mut sets.turned, BLOCK, within);
        sets.flatten();
        // 2. All links between different sets, by cost.
        let between = |block: usize| {
            let mut open = Vec::new();
            for k in block * BLOCK..count.min((block + 1) * BLOCK) {
                for j in links(k).filter(|&j| sets.roots[k] != sets.roots[j]) {
                    if let Some((cost, turned)) = judge(k, j) {
                        #[expect(clippy::cast_possible_truncation, reason = "at most 2^32 points")]
                        open.push((cost, turned, k as u32, j as u32));
                    }
                }
            }
            open
        };
        let mut open = each(count.div_ceil(BLOCK), between).concat();
        open.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, turned, k, j) in open {
            sets.join(k as usize, j as usize, turned);
        }
        sets.flatten();
        sets
    }

    /// Joins the sets of k and j.
    pub(super) fn join(&mut self, k: usize, j: usize, turned: bool) {
        let mut all = Slice {
            base: 0,
            parents: &mut self.roots,
            turned: &mut self.turned,
        };
        all.join(k, j, turned);
    }

    /// Makes every member point at its root, after joining.
    pub(super) fn flatten(&mut self) {
        for k in 0..self.roots.len() {
            // Parents come before, and are flat already.
            let parent = self.roots[k] as usize;
            self.turned[k] ^= parent != k && self.turned[parent];
            self.roots[k] = self.roots[parent];
        }
    }

    /// The sets numbered from 0 in the order of their roots: the number of each member's set, and of sets. The sets
    /// must be flat.
    pub(super) fn numbered(&self) -> (Vec<u32>, usize) {
        let mut numbers = vec![0_u32; self.roots.len()];
        let mut count = 0;
        for (k, &root) in self.roots.iter().enumerate() {
            if root as usize == k {
                numbers[k] = count;
                count += 1;
            } else {
                numbers[k] = numbers[root as usize];
            }
        }
        (numbers, count as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A long ring in random pieces: members a step apart disagree or not by a rule, as if painted.
    #[test]
    fn sides_follow_the_links() {
        let count = 3 * BLOCK + 77;
        let paint = |k: usize| (k * k / 7).is_multiple_of(3);
        let links = |k: usize| [(k * 7 + 3) % count, (k + count - 5) % count].into_iter();
        let judge = |k: usize, j: usize| Some(((k % 3) as f64, paint(k) != paint(j)));
        let sets = SignedSets::spanning(count, 0.5, links, judge);
        let (numbers, sets_count) = sets.numbered();
        assert_eq!(sets_count, 1);
        assert!(numbers.iter().all(|&n| n == 0));
        for k in 0..count {
            assert_eq!(sets.turned[k], paint(k) != paint(0));
        }
    }
}
