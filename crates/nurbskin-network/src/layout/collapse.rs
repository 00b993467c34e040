//! Which arcs collapse: all short ones, or those whose collapse makes cells and corners more regular.
//!
//! The score of a collapse is the change of penalties for cells that have not four corners and for corners that have
//! not four arcs (three at borders), plus 4 (l/h - 0.3) for an arc of length l and typical sides h. Arcs with
//! negative scores collapse, best first.

use super::NONE;
use super::arcs::Polygons;
use super::grow::Front;
use super::surface::index;
use std::collections::BinaryHeap;

/// Length of smooth arcs that collapse, in typical sides of a cell. Trial: prototype; with 0.3 bunny has 141 faces in
/// place of 182 at the same cells.
const SHORT: f64 = 0.3;
/// The same for hard arcs. Trial: prototype.
const SHORT_HARD: f64 = 0.2;
/// Below this length a collapse may leave a cell with three corners, or is wanted whatever its score. Trial: prototype.
const VERY_SHORT: f64 = 0.15;
/// Greatest length of smooth and hard arcs that collapse by score. Trial: six scans; with 0.6 and 0.35 there are a tenth more
/// extraordinary vertices (fandisk 35 for 18).
const LONGEST: [f64; 2] = [0.9, 0.5];
/// Weight of the length in the score. Trial: prototype.
const LENGTH_WEIGHT: f64 = 4.0;
/// Bonus of a very short arc. Guard: more than any sum of penalties.
const FORCED: f64 = 100.0;

/// Penalty of a cell with k corners. Trial: prototype.
fn cell_penalty(k: usize) -> f64 {
    match k {
        0..=2 => FORCED,
        3 => 1.5,
        4 => 0.0,
        5 => 1.0,
        _ => 2.0 + (k - 6) as f64,
    }
}

/// Penalty of a corner with `arcs` arcs where `target` would be regular. Trial: prototype.
fn corner_penalty(arcs: usize, target: usize) -> f64 {
    let over = arcs.saturating_sub(target) as f64;
    let under = target.saturating_sub(arcs) as f64;
    if over > 1.0 {
        1.5 * over - 0.5
    } else {
        over + under
    }
}

/// Collapses the arcs that are short compared with `side`, a typical side of a cell; shortest first.
pub(crate) fn short(polygons: &mut Polygons, side: f64) {
    let mut order: Vec<u32> = (0..index(polygons.arcs.len())).collect();
    order.sort_by(|a, b| {
        let [x, y] = [a, b].map(|k| polygons.arcs[*k as usize].length);
        x.total_cmp(&y).then(a.cmp(b))
    });
    for k in order {
        let arc = &polygons.arcs[k as usize];
        let hard = arc.kind.is_hard();
        if arc.length > side * if hard { SHORT_HARD } else { SHORT } {
            continue;
        }
        let least = if arc.length < VERY_SHORT * side { 3 } else { 4 };
        if let Some(corners) = polygons.collapsible(k, least) {
            polygons.collapse(k, corners);
        }
    }
}

/// Collapses arcs by score, best first, for cells whose typical side is `side`.
pub(crate) fn by_score(polygons: &mut Polygons, side: f64) {
    let mut heap: BinaryHeap<Front> = (0..index(polygons.arcs.len()))
        .filter_map(|k| score(polygons, k, side).map(|(s, _)| Front(s, k)))
        .collect();
    while let Some(Front(before, k)) = heap.pop() {
        let Some((now, corners)) = score(polygons, k, side) else {
            continue;
        };
        if now > before {
            heap.push(Front(now, k));
            continue;
        }
        polygons.collapse(k, corners);
        // The neighbours have new scores.
        let cells = polygons.arcs[k as usize].cells;
        let mut near: Vec<u32> = polygons.arcs_at(corners[0]).collect();
        for cell in cells.into_iter().filter(|c| *c != NONE) {
            for (arc, _) in polygons.left(cell as usize) {
                near.extend(
                    polygons
                        .corners_of(arc)
                        .into_iter()
                        .flat_map(|c| polygons.arcs_at(c)),
                );
            }
        }
        near.sort_unstable();
        near.dedup();
        for arc in near {
            if let Some((s, _)) = score(polygons, arc, side) {
                heap.push(Front(s, arc));
            }
        }
    }
}

/// The score of a collapse, if it is possible and negative, with the corner that stays and the one that goes.
fn score(polygons: &Polygons, k: u32, side: f64) -> Option<(f64, [u32; 2])> {
    let arc = &polygons.arcs[k as usize];
    let hard = arc.kind.is_hard();
    if arc.gone || arc.length > side * LONGEST[usize::from(hard)] {
        return None;
    }
    let corners = polygons.collapsible(k, 3)?;
    if polygons.would_pinch(k) {
        return None;
    }
    let mut score = LENGTH_WEIGHT * (arc.length / side - SHORT);
    for &cell in arc.cells.iter().filter(|c| **c != NONE) {
        let count = polygons.corners(cell);
        score += cell_penalty(count - 1) - cell_penalty(count);
    }
    let valences = corners.map(|c| polygons.arcs_at(c).count());
    let hards = corners.map(|c| polygons.hard_count(c));
    let joined = (hards[0] + hards[1]).saturating_sub(if hard { 2 } else { 0 });
    let open = corners.map(|c| polygons.is_open(c));
    let target = |open: bool, hard: usize| match (open, hard) {
        (true, _) => hard.max(3),
        (false, _) => hard.max(if hard > 2 { 3 } else { 4 }),
    };
    score += corner_penalty(
        (valences[0] + valences[1]).saturating_sub(2),
        target(open[0] || open[1], joined),
    );
    for k in 0..2 {
        score -= corner_penalty(valences[k], target(open[k], hards[k]));
    }
    if arc.length < VERY_SHORT * side {
        score -= FORCED;
    }
    (score < 0.0).then_some((score, corners))
}
