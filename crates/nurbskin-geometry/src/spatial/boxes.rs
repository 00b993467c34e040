//! Boxes under a binary tree, and which of them overlap.

use glam::DVec3;

#[derive(Clone, Copy, Debug)]
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
    /// O(n log n).
    pub fn new(boxes: &[[DVec3; 2]]) -> Self {
        let mut order: Vec<usize> = (0..boxes.len()).collect();
        let mut tree = Self::default();
        if !order.is_empty() {
            tree.build(boxes, &mut order);
        }
        tree
    }

    fn build(&mut self, boxes: &[[DVec3; 2]], items: &mut [usize]) {
        let all = items.iter().map(|&k| boxes[k]);
        let [low, high] = all.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[a, b], [c, d]| {
            [a.min(c), b.max(d)]
        });
        let at = self.nodes.len();
        self.nodes.push(Node {
            low,
            high,
            next: items[0],
            leaf: items.len() == 1,
        });
        if items.len() == 1 {
            return;
        }
        let axis = (high - low).max_position();
        let middle = |k: &usize| boxes[*k][0][axis] + boxes[*k][1][axis];
        let half = items.len() / 2;
        // The number breaks ties, so that the tree does not depend on how the median is found.
        items.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
        let (first, second) = items.split_at_mut(half);
        self.build(boxes, first);
        self.nodes[at].next = self.nodes.len();
        self.build(boxes, second);
    }

    /// Calls `f` with every pair of items whose boxes overlap, until it says false.
    pub fn pairs(&self, mut f: impl FnMut(usize, usize) -> bool) {
        let mut stack = if self.nodes.is_empty() {
            Vec::new()
        } else {
            vec![(0, 0)]
        };
        while let Some((a, b)) = stack.pop() {
            let (one, two) = (&self.nodes[a], &self.nodes[b]);
            if a == b {
                if !one.leaf {
                    let (x, y) = (a + 1, one.next);
                    stack.extend([(x, y), (y, y), (x, x)]);
                }
                continue;
            }
            if one.low.cmpgt(two.high).any() || two.low.cmpgt(one.high).any() {
                continue;
            }
            let size = |node: &Node| (node.high - node.low).length_squared();
            if one.leaf && two.leaf {
                if !f(one.next, two.next) {
                    return;
                }
            } else if two.leaf || !one.leaf && size(one) >= size(two) {
                stack.extend([(one.next, b), (a + 1, b)]);
            } else {
                stack.extend([(a, two.next), (a, b + 1)]);
            }
        }
    }
}
