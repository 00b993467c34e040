//! A bounding volume hierarchy with four children per node, in single precision rounded outwards.

use glam::{DVec3, Vec4};

/// A child index with this bit is a leaf.
pub(crate) const LEAF: u32 = 1 << 31;
/// No child.
const EMPTY: u32 = u32::MAX;
/// Children of a node.
const WIDTH: usize = 4;

/// A node: the boxes of its children, and where they are.
#[derive(Clone, Debug)]
pub struct Node {
    /// The lower corners of the children's boxes, axis by axis, and the upper ones; inside out where there is no child.
    low: [Vec4; 3],
    high: [Vec4; 3],
    child: [u32; WIDTH],
}

impl Node {
    const NOTHING: Self = Self {
        low: [Vec4::INFINITY; 3],
        high: [Vec4::NEG_INFINITY; 3],
        child: [EMPTY; WIDTH],
    };

    /// Squared distances of a box to those of the children.
    #[inline(always)]
    fn distances(&self, from: [f32; 3], to: [f32; 3]) -> Vec4 {
        let outside = |axis: usize| {
            let (below, above) = (self.low[axis] - to[axis], from[axis] - self.high[axis]);
            below.max(above).max(Vec4::ZERO)
        };
        let (x, y, z) = (outside(0), outside(1), outside(2));
        x * x + y * y + z * z
    }

    /// Whether each of the children is no farther than a limit, bit by bit.
    #[inline(always)]
    fn near(distances: Vec4, limit: f32) -> u32 {
        distances.cmple(Vec4::splat(limit)).bitmask()
    }
}

/// Boxes `[low, high]` of leaves, arranged as a tree of depth `log_4 n` by splitting at medians.
pub fn build(boxes: &[[DVec3; 2]]) -> Vec<Node> {
    let Ok(count) = u32::try_from(boxes.len()) else {
        return Vec::new();
    };
    let mut order: Vec<u32> = (0..count).collect();
    let mut nodes = Vec::with_capacity(boxes.len() / 2 + 1);
    grow(boxes, &mut order, &mut nodes);
    nodes
}

/// Adds the node over `items`, then its children; returns its index.
fn grow(boxes: &[[DVec3; 2]], items: &mut [u32], nodes: &mut Vec<Node>) -> u32 {
    let index = nodes.len();
    nodes.push(Node::NOTHING);
    let (first, second) = halves(boxes, items);
    let ((a, b), (c, d)) = (halves(boxes, first), halves(boxes, second));
    for (lane, part) in [a, b, c, d].into_iter().enumerate() {
        let Some(&first) = part.first() else { continue };
        let mut around = boxes[first as usize];
        for &i in part.iter() {
            around[0] = around[0].min(boxes[i as usize][0]);
            around[1] = around[1].max(boxes[i as usize][1]);
        }
        let child = if part.len() == 1 {
            LEAF | first
        } else {
            grow(boxes, part, nodes)
        };
        let node = &mut nodes[index];
        node.child[lane] = child;
        let [low, high] = around.map(|corner| corner.to_array());
        for ((node_low, node_high), (low, high)) in node
            .low
            .iter_mut()
            .zip(&mut node.high)
            .zip(low.into_iter().zip(high))
        {
            #[expect(
                clippy::cast_possible_truncation,
                reason = "rounded outwards right away"
            )]
            let (low, high) = (low as f32, high as f32);
            node_low[lane] = low.next_down();
            node_high[lane] = high.next_up();
        }
    }
    u32::try_from(index).unwrap_or(EMPTY)
}

/// Two halves at the median of the box centres along the axis on which they spread most.
fn halves<'a>(boxes: &[[DVec3; 2]], items: &'a mut [u32]) -> (&'a mut [u32], &'a mut [u32]) {
    if items.len() < 2 {
        return items.split_at_mut(items.len());
    }
    let centre = |i: u32| boxes[i as usize][0] + boxes[i as usize][1];
    let (low, high) = items
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &i| {
            (low.min(centre(i)), high.max(centre(i)))
        });
    let spread = high - low;
    let axis = if spread.x >= spread.y && spread.x >= spread.z {
        0
    } else if spread.y >= spread.z {
        1
    } else {
        2
    };
    let middle = items.len() / 2;
    // The index breaks ties, so that the tree does not depend on the selection algorithm.
    items.select_nth_unstable_by(middle, |&a, &b| {
        centre(a)[axis].total_cmp(&centre(b)[axis]).then(a.cmp(&b))
    });
    items.split_at_mut(middle)
}

/// Squared distance in single precision from which a box can be dropped, for the square of the best distance and the
/// rounding of coordinates to single precision.
#[inline]
pub fn limit(best: f64, slack: f64) -> f32 {
    let r = best.sqrt() + slack;
    // 1e-6 covers the rounding of the few operations that make the squared distance to a box.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounded outwards by the factor"
    )]
    let limit = (r * r * (1.0 + 1e-6)) as f32;
    limit
}

/// Lists the nodes with leaves whose boxes are nearer to the box from `low` to `high` than `limit` says, as for
/// [`visit_near`].
pub(crate) fn blocks_near(
    nodes: &[Node],
    [low, high]: [[f32; 3]; 2],
    limit: f32,
    found: &mut Vec<u32>,
) {
    let mut stack = [0_u32; 64];
    let mut top = 1;
    while top > 0 {
        top -= 1;
        let index = stack[top];
        let Some(node) = nodes.get(index as usize) else {
            continue;
        };
        let mut leaves = false;
        let near = Node::near(node.distances(low, high), limit);
        for (lane, child) in node.child.into_iter().enumerate() {
            if near >> lane & 1 == 0 || child == EMPTY {
                continue;
            }
            if child & LEAF != 0 {
                leaves = true;
            } else if top < stack.len() {
                stack[top] = child;
                top += 1;
            }
        }
        if leaves {
            found.push(index);
        }
    }
}

/// Visits the leaves of these nodes as [`visit_near`] does, in the order of the nodes.
#[inline(always)]
pub(crate) fn visit_blocks(
    nodes: &[Node],
    blocks: &[u32],
    point: [f32; 3],
    mut limit: f32,
    mut visit: impl FnMut(usize) -> f32,
) {
    for node in blocks.iter().filter_map(|&block| nodes.get(block as usize)) {
        let distances = node.distances(point, point);
        let near = Node::near(distances, limit);
        if near == 0 {
            continue;
        }
        let lanes = distances.to_array().into_iter().zip(node.child);
        for (lane, (distance, child)) in lanes.enumerate() {
            let leaf = child & LEAF != 0 && child != EMPTY;
            if near >> lane & 1 == 1 && leaf && distance <= limit {
                limit = visit((child & !LEAF) as usize);
            }
        }
    }
}

/// Visits the leaves whose boxes are nearer than `limit` says (squared, and already with slack for the rounding of
/// `point`), from near to far; `visit` gets the number of a leaf and returns the new limit.
#[inline(always)]
pub fn visit_near(
    nodes: &[Node],
    point: [f32; 3],
    mut limit: f32,
    mut visit: impl FnMut(usize) -> f32,
) {
    // A tree of 2^31 leaves is 16 deep, and each level leaves three children at most.
    let mut stack = [(0.0f32, 0u32); 64];
    let mut top = 1;
    while top > 0 {
        top -= 1;
        let (distance, index) = stack[top];
        if distance > limit {
            continue;
        }
        if index & LEAF != 0 {
            limit = visit((index & !LEAF) as usize);
            continue;
        }
        let Some(node) = nodes.get(index as usize) else {
            continue;
        };
        let distances = node.distances(point, point);
        let near = Node::near(distances, limit);
        if near == 0 {
            continue;
        }
        let base = top;
        let lanes = distances.to_array().into_iter().zip(node.child);
        for (lane, (distance, child)) in lanes.enumerate() {
            if near >> lane & 1 == 0 || child == EMPTY || top >= stack.len() {
                continue;
            }
            // Nearest on top.
            let mut at = top;
            while at > base && stack[at - 1].0 < distance {
                stack[at] = stack[at - 1];
                at -= 1;
            }
            stack[at] = (distance, child);
            top += 1;
        }
    }
}
