//! The places of largest deviation, as the page lists them.
//!
//! The selection is that of [`crate::deviation::worst`]. Each place has its point, foot point, signed deviation and
//! face.

use super::Measured;
use super::document::Worst;
use crate::deviation::measure::{Place, PointDeviation};
use crate::deviation::worst::worst as worst_of;
use glam::DVec3;
use nurbskin_cad::Model;

/// The points of largest distance, separated from each other, the worst first; the lower index first among equal
/// distances.
pub(super) fn worst(
    scan: &Measured,
    deviation: &[PointDeviation],
    model: &Model,
    origin: DVec3,
    diagonal: f64,
) -> Vec<Worst> {
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
    worst_of(scan.points, deviation, diagonal)
        .into_iter()
        .map(told)
        .collect()
}
