//! Test whether given normals determine the side of the surface.
//!
//! Normals of random sides have, in one plane, points of both sides beside each other. Walls that lie close together,
//! or meet at a sharp edge, have both sides in the same directions. A point is contradictory if most of its neighbours
//! of the other side have no neighbour of its own side within 45° of their direction; above 10 % of such points no
//! side is used. Source: ours.

use super::sites::by_index;
use glam::DVec3;
use nurbskin_geometry::spatial::neighbours::NeighbourTable;

/// Absolute cosine (60°) between the normals of two points that lie beside each other. Trial: not recorded.
const BESIDE_COSINE: f64 = 0.5;
/// Largest height of either of two such points above the plane of the other, as a share of their distance (17°). Trial:
/// not recorded. A larger slope takes the two walls of a thin part for one plane.
const BESIDE_SLOPE: f64 = 0.3;
/// Cosine (45°) above which two neighbours lie in the same direction from a point. Trial: not recorded.
const SAME_DIRECTION_COSINE: f64 = 0.7;
/// Share of the points with contradictory sides above which no side is used. Trial: not recorded. Normals of random
/// sides contradict each other at most points.
const MAX_TORN_SHARE: f64 = 0.1;

/// Whether the normal of each point determines its side. It does not if, in one plane, points of the opposite side lie
/// around the point in directions without points of its own side. Walls that lie close together, or meet at a sharp
/// edge, have points of both sides in the same directions. O(n).
pub(super) fn known(points: &[DVec3], normals: &[DVec3], table: &NeighbourTable) -> Vec<bool> {
    let torn = by_index(points.len(), |k| {
        let beside = |same_side: bool| {
            let row = table.of(k).iter().map(|&j| j as usize);
            row.filter_map(move |j| {
                let way = (points[j] - points[k]).normalize_or_zero();
                let same = normals[k].dot(normals[j]);
                let rise = way.dot(normals[k]).abs().max(way.dot(normals[j]).abs());
                let counts =
                    rise <= BESIDE_SLOPE && same.abs() > BESIDE_COSINE && (same > 0.0) == same_side;
                counts.then_some(way)
            })
        };
        let (mut others, mut covered) = (0, 0);
        for way in beside(false) {
            others += 1;
            covered += u32::from(beside(true).any(|own| own.dot(way) > SAME_DIRECTION_COSINE));
        }
        2 * covered < others
    });
    let count = torn.iter().filter(|torn| **torn).count();
    if count as f64 > MAX_TORN_SHARE * points.len() as f64 {
        return vec![false; points.len()];
    }
    torn.into_iter().map(|torn| !torn).collect()
}
