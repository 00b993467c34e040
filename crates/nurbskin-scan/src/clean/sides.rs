//! Outward side of the normals by the organisation of a scan: triangles, lines or given normals.
//!
//! The first source that does not contradict itself determines the side: the winding of the mesh, the order of the
//! points on lines, the normals of the file or the place of the scanner; otherwise `orientation` finds it. Source:
//! ours.

use super::elements::Elements;
use super::orientation::{orient, side_with};
use crate::normals::{line_normals, mesh_normals};
use crate::{Organisation, Scan};
use glam::DVec3;

/// Absolute cosine (60°) between the plane normal of a point and its normal by the order of the points, below which the
/// latter replaces the former. Trial: not recorded. A larger value would replace good planes by differences of noisy
/// neighbours; a smaller one keeps planes across two walls.
const LINE_NORMAL_COSINE: f64 = 0.5;
/// Squared length that separates unit normals from zero ones, which stand for unknown. Guard: any value between 0 and 1
/// does.
const UNIT_OR_ZERO: f64 = 0.25;
/// Length of the sum of the vector areas around a vertex, as a share of the sum of their lengths, below which the
/// triangles there are wound against each other. Trial: not recorded. Triangles wound alike cancel that far only at a
/// needle.
const CANCELLED_AREA: f64 = 0.3;
/// The winding of a mesh is used if fewer than one vertex in this many (5 %) has triangles wound against each other.
/// Trial: not recorded.
const VERTICES_PER_DISAGREEMENT: usize = 20;

/// Turns the normals of the elements outward. The side is given by the winding of the mesh, the order of the points, or
/// the file, in this order, if that source does not contradict itself; otherwise it is found by propagation. A mesh
/// also gives the normal itself, and the order of points corrects the normal of a plane across two walls: the triangles
/// of a mesh are more reliable than neighbours that may lie on another wall.
///
/// `place` holds the index in spatial order of each point of the scan.
pub(super) fn face(
    scan: &Scan,
    place: &[u32],
    points: &[DVec3],
    elements: &mut Elements,
    triangles: &[[u32; 3]],
    alive: &(dyn Fn(usize) -> bool + Sync),
) {
    let Elements {
        of, table, faced, ..
    } = elements;
    let known = |n: &DVec3| n.is_finite() && n.length_squared() > UNIT_OR_ZERO;
    if winding_agrees(points, triangles) {
        let given = mesh_normals(points, triangles);
        for (element, given) in of.iter_mut().zip(&given).filter(|(_, given)| known(given)) {
            element.normal = *given;
        }
        // Points without a triangle take the side of the nearest vertex.
        let loose: Vec<usize> = (0..of.len())
            .filter(|&k| alive(k) && !known(&given[k]))
            .collect();
        for k in loose {
            let near = table.of(k).iter().find(|&&j| known(&given[j as usize]));
            if near.is_some_and(|&j| of[k].normal.dot(given[j as usize]) < 0.0) {
                of[k].normal = -of[k].normal;
            }
        }
        return;
    }
    let lines = lines(scan, place);
    if !lines.is_empty() {
        let given = line_normals(points, &lines);
        for (element, given) in of.iter_mut().zip(&given).filter(|(_, given)| known(given)) {
            if element.normal.dot(*given).abs() < LINE_NORMAL_COSINE {
                element.normal = *given;
            }
        }
        if side_with(of, table, alive, &given) {
            return;
        }
    }
    if *faced {
        return;
    }
    orient(points, of, table, alive);
}

/// The lines of constant v of an ordered scan, as indices of the used points; none for other scans.
pub(crate) fn lines(scan: &Scan, place: &[u32]) -> Vec<Vec<Option<u32>>> {
    let used = |k: usize| place.get(k).copied().filter(|&p| p != u32::MAX);
    match &scan.organisation {
        Organisation::Grid(grid) if grid.count_u > 0 => grid
            .cells
            .chunks(grid.count_u)
            .map(|row| {
                row.iter()
                    .map(|c| used(c.as_ref().copied()? as usize))
                    .collect()
            })
            .collect(),
        Organisation::Rows(rows) => {
            let mut start = 0_usize;
            rows.iter()
                .map(|&length| {
                    let end = start.saturating_add(length).min(place.len());
                    let line = (start.min(end)..end).map(used).collect();
                    start = end;
                    line
                })
                .collect()
        }
        _ => Vec::new(),
    }
}

/// Whether the triangles around most vertices are wound alike.
fn winding_agrees(points: &[DVec3], triangles: &[[u32; 3]]) -> bool {
    let mut sums = vec![(DVec3::ZERO, 0.0); points.len()];
    for t in triangles {
        let [a, b, c] = t.map(|k| points[k as usize]);
        let area = (b - a).cross(c - a);
        for &k in t {
            sums[k as usize].0 += area;
            sums[k as usize].1 += area.length();
        }
    }
    let met = sums.iter().filter(|(_, total)| *total > 0.0);
    // The vector areas cancel only at a needle, or where triangles are wound against each other.
    let (mut count, mut disagree) = (0_usize, 0_usize);
    for (sum, total) in met {
        count += 1;
        disagree += usize::from(sum.length() < CANCELLED_AREA * total);
    }
    count > 0 && disagree * VERTICES_PER_DISAGREEMENT < count
}

/// The triangles of the mesh by index of the used points, without those that lost a corner or have no area.
pub(super) fn triangles_between(
    organisation: &Organisation,
    merged: &[u32],
    place: &[u32],
    points: &[DVec3],
) -> Vec<[u32; 3]> {
    let Organisation::Mesh(triangles) = organisation else {
        return Vec::new();
    };
    let at = |k: u32| {
        merged
            .get(k as usize)
            .map_or(u32::MAX, |&m| place[m as usize])
    };
    triangles
        .iter()
        .map(|t| t.map(at))
        .filter(|&[a, b, c]| a != u32::MAX && b != u32::MAX && c != u32::MAX)
        .filter(|t| {
            let [a, b, c] = t.map(|k| points[k as usize]);
            (b - a).cross(c - a) != DVec3::ZERO
        })
        .collect()
}
