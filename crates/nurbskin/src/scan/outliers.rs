//! Points that do not belong to the surface.

use super::Organisation;
use super::neighbours::NeighbourTable;
use super::normals::plane_normals;
use crate::numeric::statistics::median_in_place;
use glam::DVec3;

/// Which points are outliers: isolated (mean distance to their neighbours against the neighbours' own) and off the
/// surface (distance to the planes of their neighbours). The thresholds are ratios and hold at any density:
/// * 1.6 times as isolated (a mesh's corner: 3 times), 4 times as far off as its neighbours are from each other's planes, and off by more than
///   0.6 of its mean distance, which on a surface would mean that it bends by a right angle between two points; or
/// * 6 times as isolated, wherever it is, unless a mesh says that it belongs there.
pub(super) fn outliers(points: &[DVec3], table: &NeighbourTable, meshed: &[bool]) -> Vec<bool> {
    let normals = plane_normals(points, table, table.count());
    let near = |k: usize| table.of(k).iter().map(|&j| j as usize);
    let median = |values: &mut dyn Iterator<Item = f64>| {
        let mut values: Vec<f64> = values.collect();
        median_in_place(&mut values)
    };
    let measure = |k: usize| {
        let distance = near(k).map(|j| points[k].distance(points[j])).sum::<f64>();
        let off = median(&mut near(k).map(|j| (points[k] - points[j]).dot(normals[j]).abs()));
        (distance / table.count() as f64, off)
    };
    let measured: Vec<(f64, f64)> = each(points.len(), measure);
    let judge = |k: usize| {
        let (distance, off) = measured[k];
        let usual = median(&mut near(k).map(|j| measured[j].0));
        let usual_off = median(&mut near(k).map(|j| measured[j].1));
        let isolated = if meshed[k] { 3.0 } else { 1.6 };
        let apart = distance > isolated * usual && off > 4.0 * usual_off && off > 0.6 * distance;
        apart || (distance > 6.0 * usual && !meshed[k])
    };
    each(points.len(), judge)
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
