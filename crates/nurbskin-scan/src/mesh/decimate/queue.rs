//! Edge collapse in order of cost.
//!
//! A binary heap holds the edges with the versions of their ends; a collapse raises the versions, so that older
//! entries are recognised and skipped. Edges around the remaining vertex are entered again with their new costs.
//!
//! Source: Garland and Heckbert 1997.

use super::{EDGES_PER_CHECK, Work};
use crate::mesh::manifold::{NONE, after, before};
use nurbskin_geometry::Result;
use nurbskin_geometry::progress::Progress;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Most rounds of the queue: edges that could not collapse in their turn may do so once others have. Guard: a round
/// that removes nothing ends the loop before.
const MAX_QUEUE_ROUNDS: usize = 8;

/// An edge with its cost, and the versions of its ends at that time.
#[derive(Clone, Copy)]
struct Offer {
    cost: f64,
    ends: [u32; 2],
    versions: [u32; 2],
}

impl Ord for Offer {
    /// Reversed, so that the heap yields the cheapest edge first.
    fn cmp(&self, other: &Self) -> Ordering {
        let by_cost = other.cost.total_cmp(&self.cost);
        by_cost.then(other.ends.cmp(&self.ends))
    }
}
impl PartialOrd for Offer {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Offer {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Offer {}

/// Collapses edges, cheapest first, until at most `wanted` vertices remain or no edge can collapse. O(n log n).
pub(super) fn best_first(work: &mut Work, wanted: usize, progress: &dyn Progress) -> Result<()> {
    let mut versions = vec![0_u32; work.points.len()];
    for _ in 0..MAX_QUEUE_ROUNDS {
        if work.corners.vertices <= wanted {
            break;
        }
        let before = work.corners.vertices;
        round(work, wanted, &mut versions, progress)?;
        if work.corners.vertices == before {
            break;
        }
    }
    Ok(())
}

fn round(
    work: &mut Work,
    wanted: usize,
    versions: &mut [u32],
    progress: &dyn Progress,
) -> Result<()> {
    let offer = |work: &Work, side: u32, versions: &[u32]| {
        let ends = work.corners.ends(side);
        Offer {
            cost: work.price(side).0,
            ends,
            versions: ends.map(|k| versions[k as usize]),
        }
    };
    let edges = work.corners.edges();
    let mut heap: BinaryHeap<Offer> = edges.map(|side| offer(work, side, versions)).collect();
    let mut fan = Vec::new();
    let mut asked = 0;
    while let Some(best) = heap.pop() {
        asked += 1;
        if asked % EDGES_PER_CHECK == 0 {
            progress.check()?;
        }
        let now = best.ends.map(|k| versions[k as usize]);
        let Some(side) = (now == best.versions)
            .then(|| side_between(work, best.ends, &mut fan))
            .flatten()
        else {
            continue;
        };
        let [left, gone] = work.corners.ends(side);
        let (_, place) = work.price(side);
        if !work.collapse(side, place) {
            continue;
        }
        versions[left as usize] += 1;
        versions[gone as usize] += 1;
        if work.corners.vertices <= wanted {
            break;
        }
        work.corners.fan(left, &mut fan);
        for &side in &fan {
            heap.push(offer(work, side, versions));
            // The last edge of a border vertex has no side that starts there.
            let last = before(side);
            if work.corners.other(last) == NONE {
                heap.push(offer(work, last, versions));
            }
        }
    }
    Ok(())
}

/// The side from the first of these vertices to the second, or a border side from the second to the first.
fn side_between(work: &Work, [a, b]: [u32; 2], fan: &mut Vec<u32>) -> Option<u32> {
    for [from, to] in [[a, b], [b, a]] {
        work.corners.fan(from, fan);
        let found = fan.iter().find(|&&s| work.corners.start(after(s)) == to);
        if found.is_some() {
            return found.copied();
        }
    }
    None
}
