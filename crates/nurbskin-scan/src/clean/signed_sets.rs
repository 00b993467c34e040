//! Disjoint sets whose links may reverse a side, and their minimum spanning forest.
//!
//! Each member stores a parent and one bit: whether its side is opposite to the parent's. Bits add modulo 2 along the
//! path to the root. The forest is built in two stages: within blocks of 2^15 members in spatial order, cheap links in
//! the order of a few cost steps (Kruskal); then rounds in which every set joins along its cheapest link to another
//! set (Borůvka).
//!
//! Sources: R. E. Tarjan 1975 for the sets, with path halving; J. B. Kruskal 1956; O. Borůvka 1926.

use nurbskin_geometry::numeric::parallel::{each, pairs_of_blocks};

/// Members per block, consecutive in spatial order, that one task joins. Derived: a member's number within the block
/// (15 bits) and its side (1 bit) fit into 16 bits.
const SET_BLOCK: usize = 1 << 15;

/// Disjoint sets with one bit per member: whether its side is opposite to that of its root, the smallest member (Tarjan
/// 1975 with path halving; Kruskal's spanning forest).
#[derive(Debug)]
pub(super) struct SignedSets {
    /// The root of each member's set.
    pub(super) roots: Vec<u32>,
    /// Whether each member is turned against its root.
    pub(super) turned: Vec<bool>,
}

/// A link to another set.
#[derive(Clone, Copy, Debug)]
struct Out {
    cost: f64,
    from: u32,
    to: u32,
    turned: bool,
}

/// The sets of one block: the parent of each member, and in the lowest bit whether it is turned against the parent.
struct Block(Vec<u16>);

impl Block {
    fn new(count: usize) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "at most 2^15 members")]
        Self((0..count.min(SET_BLOCK)).map(|k| (k as u16) << 1).collect())
    }

    /// The root of k's set and, in the lowest bit, whether k is turned against it. Halves the path.
    #[inline]
    fn root(&mut self, k: usize) -> u16 {
        let mut side = 0;
        let mut k = k;
        loop {
            let up = self.0[k];
            let parent = usize::from(up >> 1);
            if parent == k {
                return up ^ side;
            }
            let above = self.0[parent];
            if usize::from(above >> 1) != parent {
                self.0[k] = above ^ (up & 1);
            }
            side ^= self.0[k] & 1;
            k = usize::from(self.0[k] >> 1);
        }
    }

    #[inline]
    fn join(&mut self, k: usize, j: usize, turned: bool) {
        let (a, b) = (self.root(k), self.root(j));
        let (low, high) = (a.min(b) >> 1, a.max(b) >> 1);
        if low != high {
            self.0[usize::from(high)] = low << 1 | ((a ^ b) & 1) ^ u16::from(turned);
        }
    }
}

impl SignedSets {
    /// The sets of a minimum spanning forest over the links of each of `count` members. `judge` returns the cost of a
    /// link and whether it turns the side; `None` excludes the link. First, links within a block are joined in
    /// ascending `steps` of cost, up to the last step; within a step the order is arbitrary. Then all other links are
    /// joined by cost. O(n), and O(m log m) for the m members that still have a link to another set.
    pub(super) fn spanning<I: Iterator<Item = usize>>(
        count: usize,
        steps: &[f64],
        links: impl Fn(usize) -> I + Sync,
        judge: impl Fn(usize, usize) -> Option<(f64, bool)> + Sync,
    ) -> Self {
        let mut sets = Self {
            roots: vec![0; count],
            turned: vec![false; count],
        };
        // 1. Inside blocks.
        let within = |block: usize, roots: &mut [u32], turned: &mut [bool]| {
            let base = block * SET_BLOCK;
            let mut block = Block::new(roots.len());
            let mut later: Vec<Vec<(u16, u16, bool)>> = vec![Vec::new(); steps.len()];
            for k in 0..roots.len() {
                let mut root = block.root(k) >> 1;
                for j in links(base + k) {
                    let j = j.wrapping_sub(base);
                    if j >= roots.len() || root == block.root(j) >> 1 {
                        continue;
                    }
                    let Some((cost, turned)) = judge(base + k, base + j) else {
                        continue;
                    };
                    match steps.iter().position(|&step| cost <= step) {
                        Some(0) => {
                            block.join(k, j, turned);
                            root = block.root(k) >> 1;
                        }
                        #[expect(clippy::cast_possible_truncation, reason = "less than 2^15")]
                        Some(step) => later[step].push((k as u16, j as u16, turned)),
                        None => {}
                    }
                }
            }
            for (k, j, turned) in later.into_iter().flatten() {
                block.join(usize::from(k), usize::from(j), turned);
            }
            for (k, (root, turned)) in roots.iter_mut().zip(turned).enumerate() {
                let found = block.root(k);
                #[expect(clippy::cast_possible_truncation, reason = "at most 2^32 points")]
                let first = base as u32;
                *root = first + u32::from(found >> 1);
                *turned = found & 1 == 1;
            }
        };
        pairs_of_blocks(
            &mut sets.roots,
            SET_BLOCK,
            &mut sets.turned,
            SET_BLOCK,
            within,
        );
        // 2. Between sets: in each round every set joins along its cheapest link (Boruvka 1926).
        let mut open: Vec<u32> = (0..u32::MAX).take(count).collect();
        let mut cheapest = vec![u32::MAX; count];
        loop {
            let found = sets.links_out(&open, &links, &judge);
            if found.is_empty() {
                return sets;
            }
            let better = |a: u32, b: u32| {
                let key = |at: u32| found.get(at as usize).map(|l| (l.cost, l.from, l.to));
                match (key(a), key(b)) {
                    (Some(a), Some(b)) => {
                        a.0.total_cmp(&b.0)
                            .then((a.1, a.2).cmp(&(b.1, b.2)))
                            .is_lt()
                    }
                    (a, _) => a.is_some(),
                }
            };
            for (at, link) in (0_u32..).zip(&found) {
                for end in [link.from, link.to] {
                    let best = &mut cheapest[sets.roots[end as usize] as usize];
                    if better(at, *best) {
                        *best = at;
                    }
                }
            }
            let is_best = |at: u32, link: &Out| {
                [link.from, link.to]
                    .map(|end| cheapest[sets.roots[end as usize] as usize])
                    .contains(&at)
            };
            let chosen: Vec<Out> = (0_u32..)
                .zip(&found)
                .filter(|&(at, link)| is_best(at, link))
                .map(|(_, link)| *link)
                .collect();
            for link in &found {
                for end in [link.from, link.to] {
                    cheapest[sets.roots[end as usize] as usize] = u32::MAX;
                }
            }
            for link in chosen {
                sets.join(link.from as usize, link.to as usize, link.turned);
            }
            sets.flatten();
            open.clear();
            open.extend(found.iter().map(|link| link.from));
        }
    }

    /// The cheapest link of each of the `open` members to another set, without those that have none.
    fn links_out<I: Iterator<Item = usize>>(
        &self,
        open: &[u32],
        links: &(impl Fn(usize) -> I + Sync),
        judge: &(impl Fn(usize, usize) -> Option<(f64, bool)> + Sync),
    ) -> Vec<Out> {
        let of_part = |part: usize| {
            let part = &open[part * SET_BLOCK..open.len().min((part + 1) * SET_BLOCK)];
            let mut found: Vec<Out> = Vec::new();
            for &from in part {
                let k = from as usize;
                let mut best: Option<Out> = None;
                for j in links(k).filter(|&j| self.roots[k] != self.roots[j]) {
                    if let Some((cost, turned)) = judge(k, j)
                        && best.is_none_or(|best| cost < best.cost)
                    {
                        #[expect(clippy::cast_possible_truncation, reason = "at most 2^32 points")]
                        let to = j as u32;
                        best = Some(Out {
                            cost,
                            from,
                            to,
                            turned,
                        });
                    }
                }
                found.extend(best);
            }
            found
        };
        each(open.len().div_ceil(SET_BLOCK), of_part).concat()
    }

    /// The root of k's set and whether k is turned against it. Halves the path.
    fn root(&mut self, mut k: usize) -> (usize, bool) {
        let mut side = false;
        loop {
            let parent = self.roots[k] as usize;
            if parent == k {
                return (k, side);
            }
            let above = self.roots[parent];
            if above as usize != parent {
                self.turned[k] ^= self.turned[parent];
                self.roots[k] = above;
            }
            side ^= self.turned[k];
            k = self.roots[k] as usize;
        }
    }

    /// Joins the sets of k and j.
    pub(super) fn join(&mut self, k: usize, j: usize, turned: bool) {
        let (a, of_a) = self.root(k);
        let (b, of_b) = self.root(j);
        if a != b {
            let (low, high) = (a.min(b), a.max(b));
            #[expect(clippy::cast_possible_truncation, reason = "at most 2^32 points")]
            let low = low as u32;
            self.roots[high] = low;
            self.turned[high] = of_a ^ of_b ^ turned;
        }
    }

    /// Makes the root the parent of every member, after joining.
    pub(super) fn flatten(&mut self) {
        for k in 0..self.roots.len() {
            // Parents have smaller numbers, and are flat already.
            let parent = self.roots[k] as usize;
            self.turned[k] ^= parent != k && self.turned[parent];
            self.roots[k] = self.roots[parent];
        }
    }

    /// Numbers the sets from 0 in the order of their roots. Returns the number of each member's set, and the number of
    /// sets. The sets must be flat.
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
        let count = 3 * SET_BLOCK + 77;
        let paint = |k: usize| (k * k / 7).is_multiple_of(3);
        let links = |k: usize| [(k * 7 + 3) % count, (k + count - 5) % count].into_iter();
        let judge = |k: usize, j: usize| Some(((k % 3) as f64, paint(k) != paint(j)));
        let sets = SignedSets::spanning(count, &[0.5, 1.5], links, judge);
        let (numbers, sets_count) = sets.numbered();
        assert_eq!(sets_count, 1);
        assert!(numbers.iter().all(|&n| n == 0));
        for k in 0..count {
            assert_eq!(sets.turned[k], paint(k) != paint(0));
        }
    }
}
