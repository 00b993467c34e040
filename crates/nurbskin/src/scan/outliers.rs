//! Points that do not belong to the surface.

use super::Organisation;
use super::neighbours::NeighbourTable;
use super::normals::plane_normals;
use crate::numeric::statistics::median_in_place;
use glam::DVec3;

/// Which points are outliers: isolated (mean distance to their neighbours against the neighbours' own) and off the
/// surface (distance to the planes of their neighbours). The thresholds are ratios and hold at any density:
/// * 1.6 times as isolated (a mesh's corner: 3 times), 4 times as far off as its neighbours are from each other's
///   planes, and off by more than 0.6 of its mean distance, which on a surface would mean that it bends by a right
///   angle between two points;
/// * 6 times as isolated as its neighbours, wherever it is; or
/// * 6 times as isolated as most points of the scan, and off by a quarter of its mean distance: one of a swarm whose
///   members excuse each other.
///
/// The last two do not hold against a mesh, which says that the point belongs there.
pub(super) fn outliers(points: &[DVec3], table: &NeighbourTable, meshed: &[bool]) -> Vec<bool> {
    let normals = plane_normals(points, table, table.count());
    let measure = |k: usize| {
        let near = || table.of(k).iter().map(|&j| j as usize);
        let distance = near().map(|j| points[k].distance(points[j])).sum::<f64>();
        let off = median(near().map(|j| (points[k] - points[j]).dot(normals[j]).abs()));
        (distance / table.count() as f64, off)
    };
    let measured: Vec<(f64, f64)> = each(points.len(), measure);
    let everywhere = median_in_place(&mut measured.iter().map(|m| m.0).collect::<Vec<_>>());
    let judge = |k: usize| {
        let (distance, off) = measured[k];
        let near = || table.of(k).iter().map(|&j| measured[j as usize]);
        let usual = median(near().map(|m| m.0));
        let usual_off = median(near().map(|m| m.1));
        let isolated = if meshed[k] { 3.0 } else { 1.6 };
        let apart = distance > isolated * usual && off > 4.0 * usual_off && off > 0.6 * distance;
        let astray = distance > 6.0 * everywhere && off > 0.25 * distance;
        apart || (!meshed[k] && (astray || distance > 6.0 * usual))
    };
    each(points.len(), judge)
}

/// The median of a few values.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut few = [0.0; 32];
    let mut count = 0;
    for (place, value) in few.iter_mut().zip(values) {
        *place = value;
        count += 1;
    }
    median_in_place(&mut few[..count])
}

/// Whether each point, in the given order, is a corner of a triangle.
pub(super) fn meshed(organisation: &Organisation, merged: &[u32], order: &[u32]) -> Vec<bool> {
    let mut corner = vec![false; merged.len()];
    if let Organisation::Mesh(triangles) = organisation {
        for k in triangles.iter().flatten() {
            if let Some(&first) = merged.get(*k as usize) {
                corner[first as usize] = true;
            }
        }
    }
    order.iter().map(|&k| corner[k as usize]).collect()
}

/// f of each index below `count`, in order.
fn each<T: Send>(count: usize, f: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        (0..count).into_par_iter().map(f).collect()
    }
    #[cfg(not(feature = "parallel"))]
    (0..count).map(f).collect()
}
