//! Whether normals say which side of the surface is which.

use super::sites::by_index;
use glam::DVec3;
use nurbskin_geometry::spatial::neighbours::NeighbourTable;

/// Cosine between normals of points that lie beside each other.
const ALIKE: f64 = 0.5;
/// Two points lie beside each other if their chord leaves both planes by no more than this part of its length.
const FLAT: f64 = 0.3;
/// Cosine between two directions, 45 degrees, in which points lie on the same side of a third one.
const TOWARDS: f64 = 0.7;
/// Part of the points where sides contradict each other, from which on none is believed.
const TORN: f64 = 0.1;

/// Whether the normal of each point says on which side it looks. It does not where normals are of either side: where,
/// in one plane, points of one side lie beside a point and those of the other opposite. Walls that lie close together,
/// or meet at a sharp edge, have both in the same directions. O(n).
pub(super) fn known(points: &[DVec3], normals: &[DVec3], table: &NeighbourTable) -> Vec<bool> {
    let torn = by_index(points.len(), |k| {
        let beside = |same_side: bool| {
            let row = table.of(k).iter().map(|&j| j as usize);
            row.filter_map(move |j| {
                let way = (points[j] - points[k]).normalize_or_zero();
                let same = normals[k].dot(normals[j]);
                let rise = way.dot(normals[k]).abs().max(way.dot(normals[j]).abs());
                let counts = rise <= FLAT && same.abs() > ALIKE && (same > 0.0) == same_side;
                counts.then_some(way)
            })
        };
        let (mut others, mut covered) = (0, 0);
        for way in beside(false) {
            others += 1;
            covered += u32::from(beside(true).any(|own| own.dot(way) > TOWARDS));
        }
        2 * covered < others
    });
    let count = torn.iter().filter(|torn| **torn).count();
    if count as f64 > TORN * points.len() as f64 {
        return vec![false; points.len()];
    }
    torn.into_iter().map(|torn| !torn).collect()
}
