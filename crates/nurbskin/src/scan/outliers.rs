//! Points that do not belong to the surface.

use super::blocks::each;
use super::elements::Elements;
use crate::numeric::statistics::median_in_place;
use glam::DVec3;

/// Which points, in spatial order, are outliers: isolated (mean distance to their neighbours against the neighbours'
/// own) and off the surface (distance to the planes of their neighbours). The thresholds are ratios and hold at any
/// density:
/// * 1.6 times as isolated (a mesh's corner: 3 times), 4 times as far off as its neighbours are from each other's
///   planes, and off by more than 0.6 of its mean distance, which on a surface would mean that it bends by a right
///   angle between two points;
/// * 6 times as isolated as its neighbours, wherever it is; or
/// * 6 times as isolated as most points of the scan, and off by a quarter of its mean distance: one of a swarm whose
///   members excuse each other.
///
/// The last two do not hold against a mesh, which says that the point belongs there. O(n).
pub(super) fn outliers(points: &[DVec3], elements: &Elements, meshed: &[bool]) -> Vec<bool> {
    let (of, table) = (&elements.of, &elements.table);
    let everywhere = median_in_place(&mut of.iter().map(|e| e.reach).collect::<Vec<_>>());
    let near = |k: usize| table.of(k).iter().map(|&j| j as usize);
    let off = |k: usize| median(near(k).map(|j| (points[k] - points[j]).dot(of[j].normal).abs()));
    // Whether more than half of the neighbours are that much less isolated.
    let isolated = |k: usize, times: f64| {
        2 * near(k)
            .filter(|&j| of[k].reach > times * of[j].reach)
            .count()
            > table.count()
    };
    let judge = |k: usize| {
        let (distance, meshed) = (of[k].reach, meshed[k]);
        let apart = isolated(k, if meshed { 3.0 } else { 1.6 });
        let astray = !meshed && distance > 6.0 * everywhere;
        if !apart && !astray {
            return false;
        }
        if apart && !meshed && isolated(k, 6.0) {
            return true;
        }
        let off_here = off(k);
        (astray && off_here > 0.25 * distance)
            || (apart && off_here > 0.6 * distance && off_here > 4.0 * median(near(k).map(off)))
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
