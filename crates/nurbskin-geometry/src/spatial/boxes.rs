//! Boxes under a binary tree, and which of them overlap.

use crate::numeric::parallel::{both, each};
use glam::DVec3;

/// Items of a subtree that is built on one core. Count. Guard: some milliseconds of work; results do not depend on it.
const SMALL: usize = 1 << 12;
/// Levels of pairs of nodes that are divided before the cores share them. Count.
/// Guard: up to 2816 pairs, so that the cores end together; results do not depend on the number of threads.
const TASK_LEVELS: usize = 9;

#[derive(Clone, Copy, Debug, Default)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// The second child, the first follows its parent; for a leaf, the item.
    next: usize,
    leaf: bool,
}

/// A tree over boxes.
#[derive(Debug, Default)]
pub struct Tree {
    nodes: Vec<Node>,
}

impl Tree {
    /// O(n log n), on all cores.
    pub fn new(boxes: &[[DVec3; 2]]) -> Self {
        let mut order: Vec<usize> = (0..boxes.len()).collect();
        // A binary tree has one node fewer than twice its leaves.
        let mut nodes = vec![Node::default(); (2 * boxes.len()).saturating_sub(1)];
        if !order.is_empty() {
            build(boxes, &mut order, &mut nodes, 0);
        }
        Self { nodes }
    }

    /// Calls `f` with every pair of items whose boxes overlap, until it says false.
    pub fn pairs(&self, mut f: impl FnMut(usize, usize) -> bool) {
        let mut stack = if self.nodes.is_empty() {
            Vec::new()
        } else {
            vec![(0, 0)]
        };
        let mut goes_on = true;
        while goes_on && let Some(pair) = stack.pop() {
            self.divide(pair, |part| stack.push(part), |a, b| goes_on = f(a, b));
        }
    }

    /// What `f` finds for the pairs of items whose boxes overlap, in an order that depends on the boxes alone. On all
    /// cores; O(n log n) where few boxes overlap, and memory for what is found.
    pub fn filter_pairs<R: Send>(&self, f: impl Fn(usize, usize) -> Option<R> + Sync) -> Vec<R> {
        let mut tasks = Vec::from_iter((!self.nodes.is_empty()).then_some((0, 0)));
        for _ in 0..TASK_LEVELS {
            let mut parts = Vec::new();
            for pair in tasks {
                let is_last = self.nodes[pair.0].leaf && self.nodes[pair.1].leaf;
                match is_last {
                    true => parts.push(pair),
                    false => self.divide(pair, |part| parts.push(part), |_, _| {}),
                }
            }
            tasks = parts;
        }
        let found = each(tasks.len(), |k| {
            let (mut found, mut stack) = (Vec::new(), vec![tasks[k]]);
            while let Some(pair) = stack.pop() {
                self.divide(pair, |part| stack.push(part), |a, b| found.extend(f(a, b)));
            }
            found
        });
        found.into_iter().flatten().collect()
    }

    /// Divides a pair of nodes into pairs of their children, or into two items if their boxes overlap; into nothing if those of the
    /// nodes do not.
    #[inline]
    fn divide(
        &self,
        (a, b): (usize, usize),
        mut part: impl FnMut((usize, usize)),
        mut items: impl FnMut(usize, usize),
    ) {
        let (one, two) = (&self.nodes[a], &self.nodes[b]);
        if a == b {
            if !one.leaf {
                let (x, y) = (a + 1, one.next);
                part((x, y));
                part((y, y));
                part((x, x));
            }
            return;
        }
        if one.low.cmpgt(two.high).any() || two.low.cmpgt(one.high).any() {
            return;
        }
        let size = |node: &Node| (node.high - node.low).length_squared();
        if one.leaf && two.leaf {
            items(one.next, two.next);
        } else if two.leaf || !one.leaf && size(one) >= size(two) {
            part((one.next, b));
            part((a + 1, b));
        } else {
            part((a, two.next));
            part((a, b + 1));
        }
    }
}

/// Builds the tree over some items into `nodes`, of which the first has the number `at`.
fn build(boxes: &[[DVec3; 2]], items: &mut [usize], nodes: &mut [Node], at: usize) {
    let all = items.iter().map(|&k| boxes[k]);
    let [low, high] = all.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[a, b], [c, d]| {
        [a.min(c), b.max(d)]
    });
    let half = items.len() / 2;
    let leaf = half == 0;
    nodes[0] = Node {
        low,
        high,
        next: if leaf { items[0] } else { at + 2 * half },
        leaf,
    };
    if leaf {
        return;
    }
    let axis = (high - low).max_position();
    let middle = |k: &usize| boxes[*k][0][axis] + boxes[*k][1][axis];
    // The number breaks ties, so that the tree does not depend on how the median is found.
    items.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
    let is_small = items.len() <= SMALL;
    let (first, second) = items.split_at_mut(half);
    let (before, behind) = nodes[1..].split_at_mut(2 * half - 1);
    let mut one = || build(boxes, first, before, at + 1);
    let mut two = || build(boxes, second, behind, at + 2 * half);
    if is_small {
        one();
        two();
    } else {
        both(one, two);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_those_whose_boxes_overlap() {
        // A chain of boxes that overlap the next one or two; of 10 000, two cores build a half each.
        for count in [0_u32, 1, 2, 3, 300, 10_000] {
            let at = |k: u32| 10.0 * (f64::from(k) * 0.618).sin();
            let boxes: Vec<[DVec3; 2]> = (0..count)
                .map(|k| DVec3::new(f64::from(k), at(k), at(3 * k)))
                .map(|low| [low, low + DVec3::new(2.6, 12.0, 12.0)])
                .collect();
            let tree = Tree::new(&boxes);
            let sorted = |mut pairs: Vec<(usize, usize)>| {
                pairs.sort_unstable();
                pairs
            };
            let mut one_by_one = Vec::new();
            tree.pairs(|a, b| {
                one_by_one.push((a.min(b), a.max(b)));
                true
            });
            let shared = tree.filter_pairs(|a, b| Some((a.min(b), a.max(b))));
            let overlap = |&(a, b): &(usize, usize)| {
                boxes[a][0].cmple(boxes[b][1]).all() && boxes[b][0].cmple(boxes[a][1]).all()
            };
            let n = boxes.len();
            let near = (0..n).flat_map(|a| (a + 1..n.min(a + 4)).map(move |b| (a, b)));
            let expected: Vec<(usize, usize)> = near.filter(overlap).collect();
            assert_eq!(sorted(one_by_one), expected);
            assert_eq!(sorted(shared), expected);
        }
    }
}
