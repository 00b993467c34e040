//! The worst places.

use super::Measured;
use super::document::Worst;
use crate::cad::Model;
use crate::deviation::measure::{Place, PointDeviation};
use glam::DVec3;

/// How many are told.
const MANY: usize = 10;
/// They are apart from each other by at least this share of the diagonal.
const APART: f64 = 0.03;
/// The first this many are sorted at first, which is nearly always enough.
const FIRST: usize = 4096;

/// The points of largest distance, apart from each other, the worst first; of equally far ones that of the lower index.
pub(super) fn worst(
    scan: &Measured,
    deviation: &[PointDeviation],
    model: &Model,
    origin: DVec3,
    diagonal: f64,
) -> Vec<Worst> {
    let count = scan.points.len().min(deviation.len());
    let mut order: Vec<usize> = (0..count).collect();
    let worse = |&a: &usize, &b: &usize| {
        let by_distance = deviation[b].upper.total_cmp(&deviation[a].upper);
        by_distance.then(a.cmp(&b))
    };
    let mut chosen: Vec<usize> = Vec::new();
    let mut from = 0;
    let mut size = FIRST;
    while from < count && chosen.len() < MANY {
        let to = count.min(from + size);
        if let Some(rest) = order.get_mut(from..) {
            if to < count {
                rest.select_nth_unstable_by(to - from, worse);
            }
            if let Some(next) = rest.get_mut(..to - from) {
                next.sort_unstable_by(worse);
            }
        }
        for &k in order.get(from..to).unwrap_or_default() {
            let apart = |&c: &usize| scan.points[c].distance(scan.points[k]) >= APART * diagonal;
            if chosen.len() < MANY && chosen.iter().all(apart) {
                chosen.push(k);
            }
        }
        (from, size) = (to, 8 * size);
    }
    let told = |k: usize| {
        let d = &deviation[k];
        let surface = model.faces().get(d.face as usize).map(|face| &face.surface);
        let foot = surface.map_or(scan.points[k], |surface| surface.point(d.u, d.v));
        Worst {
            index: scan.index(k),
            point: (scan.points[k] + origin).to_array(),
            foot: (foot + origin).to_array(),
            deviation: d.signed(),
            u: d.u,
            v: d.v,
            face: d.face,
            state: match d.place {
                Place::Interior => "interior",
                Place::FreeEdge => "free_edge",
            },
        }
    };
    chosen.into_iter().map(told).collect()
}
