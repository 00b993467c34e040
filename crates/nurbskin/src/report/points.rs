//! The points of a scan for display, at most a fixed number.
//!
//! The selection keeps the points of largest deviation and an even sample of the others, so that outliers stay visible.

use super::document::{Packed, Points};
use super::{DEVIATION_STEP, Measured, step_of_parameters, step_of_places, step_of_values};
use crate::deviation::measure::{Place, PointDeviation, Unused};
use glam::DVec3;
use nurbskin_scan::mesh::subset::subset;
use nurbskin_scan::{Reason, Records};

/// Largest number of displayed points.
const MOST: usize = 200_000;
/// Largest number of empty cells of range grids for which the page has lines in its CSV. Count. A guard: they take four bytes
/// each here and in the browser.
const MOST_EMPTY: usize = 2_000_000;
/// Number of points of largest deviation that are always displayed.
const WORST: usize = 2_000;
/// Largest share of points that are not used: one in this many.
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

fn state(scan: &Measured, k: usize, deviation: Option<&PointDeviation>) -> u32 {
    if scan.held_out.get(k) == Some(&true) {
        return 2;
    }
    match deviation.map(|d| d.place) {
        Some(Place::FreeEdge) => 1,
        _ => 0,
    }
}

/// The state of a point that is not used; `None` for one without a place.
fn state_of(unused: &Unused) -> Option<u32> {
    match unused.reason {
        Reason::Outlier => Some(3),
        Reason::LeftOut => Some(4),
        Reason::Duplicate => Some(5),
        Reason::NonFinite => None,
    }
}

/// One point of the page.
struct Shown<'a> {
    index: u32,
    position: DVec3,
    deviation: Option<&'a PointDeviation>,
    state: u32,
}

/// The points relative to `origin`, of a scan on a part of this size.
pub(super) fn points(scan: &Measured, origin: DVec3, diagonal: f64) -> Points {
    let finite = |p: &&Unused| p.point.is_finite();
    let unused: Vec<&Unused> = scan.unused.iter().filter(finite).collect();
    let step = unused.len().div_ceil(MOST / REJECTED).max(1);
    let mut shown: Vec<Shown> = unused
        .iter()
        .step_by(step)
        .filter_map(|point| {
            Some(Shown {
                index: scan.record(point.index),
                position: point.point - origin,
                deviation: point.deviation.as_ref(),
                state: state_of(point)?,
            })
        })
        .collect();
    let used = chosen(scan, MOST - shown.len());
    shown.extend(used.into_iter().map(|k| {
        let d = scan.deviation.and_then(|d| d.get(k));
        Shown {
            index: scan.index(k),
            position: scan.points[k] - origin,
            deviation: d,
            state: state(scan, k, d),
        }
    }));
    shown.sort_by_key(|s| s.index);
    let measured = scan.deviation.is_some();
    let total = scan.points.len() + unused.len();
    let absent = scan.unused.iter().filter(|p| !p.point.is_finite());
    let signed = |s: &Shown| s.deviation.map_or(f64::NAN, PointDeviation::signed);
    let foot = |s: &Shown| s.deviation.map_or([f64::NAN; 2], |d| [d.u, d.v]);
    let face = |s: &Shown| s.deviation.map_or(0, |d| d.face);
    let step = step_of_places(shown.iter().map(|s| &s.position), diagonal);
    let deviations = || {
        let step = step_of_values(shown.iter().map(signed), DEVIATION_STEP);
        Packed::floats(shown.iter().map(|s| [signed(s)]), step)
    };
    let feet = || {
        let step = step_of_parameters(shown.iter().flat_map(foot));
        Packed::floats(shown.iter().map(foot), step)
    };
    Points {
        shown: shown.len(),
        total,
        positions: Packed::floats(shown.iter().map(|s| s.position.to_array()), step),
        deviation: measured.then(deviations),
        index: Packed::integers(shown.iter().map(|s| [s.index])),
        parameters: measured.then(feet),
        faces: measured.then(|| Packed::integers(shown.iter().map(|s| [face(s)]))),
        state: Packed::integers(shown.iter().map(|s| [s.state])),
        not_finite: if shown.len() == total
            && scan.records.map_or(0, Records::empty_count) <= MOST_EMPTY
        {
            let empty = scan.records.map(Records::empty).into_iter().flatten();
            let absent = absent.map(|p| scan.record(p.index));
            let mut absent: Vec<u32> = absent.chain(empty).collect();
            absent.sort_unstable();
            Packed::integers(absent.into_iter().map(|record| [record]))
        } else {
            Packed::default()
        },
    }
}
