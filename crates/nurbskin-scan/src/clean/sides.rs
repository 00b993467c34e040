//! What the organisation of a scan says of its surface: triangles, lines, and which side is outside.

use super::elements::Elements;
use super::orientation::{orient, side_with};
use crate::normals::{line_normals, mesh_normals};
use crate::{Organisation, Scan};
use glam::DVec3;

/// By how much of a cosine a plane may differ from the order of the points before that overrules it.
const TRUST: f64 = 0.5;

/// Turns the normals of the elements outward. Which side that is, is said by the mesh, the order of the points or the
/// file, in this order, as far as they do not contradict themselves, and otherwise found. A mesh also gives the normal
/// itself, and order corrects a plane that goes astray: a mesh knows its own surface better than neighbours that may
/// lie on another wall.
///
/// `place` holds the place of each point of the scan.
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
    let known = |n: &DVec3| n.is_finite() && n.length_squared() > 0.25;
    if winding_agrees(points, triangles) {
        let given = mesh_normals(points, triangles);
        for (element, given) in of.iter_mut().zip(&given).filter(|(_, given)| known(given)) {
            element.normal = *given;
        }
        // Points without a triangle take the side of those near.
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
            if element.normal.dot(*given).abs() < TRUST {
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

/// The lines of constant v of an ordered scan, as places among the used points; none for other scans.
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

/// Whether the triangles around most vertices face the same way.
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
    // Half of the area cancels only where a vertex is a needle or its triangles disagree.
    let (mut count, mut disagree) = (0_usize, 0_usize);
    for (sum, total) in met {
        count += 1;
        disagree += usize::from(sum.length() < 0.3 * total);
    }
    count > 0 && disagree * 20 < count
}

/// The mesh's triangles by place among the used points, without those that lost a corner or have no area.
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
