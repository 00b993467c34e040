//! The points of a scan for display, at most a fixed number.
//!
//! The selection keeps the points of largest deviation and an even sample of the others, so that outliers stay visible.

use super::document::{Packed, Points};
use super::{Measured, place, small};
use crate::deviation::measure::{Place, PointDeviation};
use glam::DVec3;
use nurbskin_scan::mesh::subset::subset;

/// Largest number of displayed points.
const MOST: usize = 200_000;
/// Number of points of largest deviation that are always displayed.
const WORST: usize = 2_000;
/// Largest share of rejected points: one in this many.
const REJECTED: usize = 4;

/// Indices of the displayed points, ascending: those of largest deviation and an even sample of the others.
fn chosen(scan: &Measured, most: usize) -> Vec<usize> {
    let count = scan.points.len();
    if count <= most {
        return (0..count).collect();
    }
    let mut keep = vec![false; count];
    if let Some(deviation) = scan.deviation {
        let mut order: Vec<usize> = (0..count.min(deviation.len())).collect();
        let worse = |&a: &usize, &b: &usize| {
            let by_distance = deviation[b].upper.total_cmp(&deviation[a].upper);
            by_distance.then(a.cmp(&b))
        };
        let many = WORST.min(most / 2).min(order.len());
        if many < order.len() {
            order.select_nth_unstable_by(many, worse);
        }
        for &k in order.get(..many).unwrap_or_default() {
            keep[k] = true;
        }
    }
    let open = most.saturating_sub(keep.iter().filter(|k| **k).count());
    let others = subset(scan.points, open, |k| {
        !keep[k] && scan.points[k].is_finite()
    });
    for k in others {
        keep[k as usize] = true;
    }
    (0..count).filter(|&k| keep[k]).collect()
}

fn state(scan: &Measured, k: usize, deviation: Option<&PointDeviation>) -> u8 {
    if scan.held_out.get(k) == Some(&true) {
        return 2;
    }
    match deviation.map(|d| d.place) {
        Some(Place::FreeEdge) => 1,
        _ => 0,
    }
}

/// One point of the page.
struct Shown {
    index: u32,
    position: [f32; 3],
    deviation: f32,
    parameters: [f32; 2],
    face: u32,
    state: u8,
}

/// The points relative to `origin`.
pub(super) fn points(scan: &Measured, origin: DVec3) -> Points {
    let rejected: Vec<(u32, DVec3)> = scan
        .rejected
        .iter()
        .copied()
        .filter(|(_, p)| p.is_finite())
        .collect();
    let step = rejected.len().div_ceil(MOST / REJECTED).max(1);
    let mut shown: Vec<Shown> = rejected
        .iter()
        .step_by(step)
        .map(|&(index, p)| Shown {
            index,
            position: place(p - origin),
            deviation: f32::NAN,
            parameters: [f32::NAN; 2],
            face: 0,
            state: 3,
        })
        .collect();
    let used = chosen(scan, MOST - shown.len());
    shown.extend(used.into_iter().map(|k| {
        let d = scan.deviation.and_then(|d| d.get(k));
        Shown {
            index: scan.index(k),
            position: place(scan.points[k] - origin),
            deviation: d.map_or(f32::NAN, |d| small(d.signed())),
            parameters: d.map_or([f32::NAN; 2], |d| [small(d.u), small(d.v)]),
            face: d.map_or(0, |d| d.face),
            state: state(scan, k, d),
        }
    }));
    shown.sort_by_key(|s| s.index);
    let measured = scan.deviation.is_some();
    Points {
        shown: shown.len(),
        total: scan.points.len() + rejected.len(),
        positions: Packed::floats(shown.iter().map(|s| s.position)),
        deviation: measured.then(|| Packed::floats(shown.iter().map(|s| [s.deviation]))),
        index: Packed::integers(shown.iter().map(|s| [s.index])),
        parameters: measured.then(|| Packed::floats(shown.iter().map(|s| s.parameters))),
        faces: measured.then(|| Packed::integers(shown.iter().map(|s| [s.face]))),
        state: Packed(shown.iter().map(|s| s.state).collect()),
    }
}
