//! Points that do not belong to the surface.

use super::blocks::each;
use super::elements::Elements;
use super::neighbours::{Nearest, Neighbours};
use crate::numeric::statistics::{median_in_place, quantile_in_place};
use crate::progress::Progress;

/// The nearest neighbour of a lone point is so many times as far as the neighbours' own mean distance.
const ALONE: f64 = 1.75;
/// Distance of a lone point from the planes of three quarters, and of half, of its neighbours, in its mean distance.
const ABOVE: [f64; 2] = [0.35, 0.5];
/// The same in the distances of the neighbours from each other's planes, in the median.
const ROUGH: f64 = 8.0;

/// Points after which progress is told, ...
const BLOCK: usize = 2048;
/// ... by a step for so many of them.
const PER_STEP: usize = 8;
/// Neighbours among which a point of a surface finds others at its height.
const COMPANY: usize = 48;

/// Which points, in spatial order, are outliers: isolated (mean distance to their neighbours against the neighbours'
/// own) and off the surface (distance to the planes of their neighbours). The thresholds are ratios and hold at any
/// density:
/// * 1.6 times as isolated (a mesh's corner: 3 times), 4 times as far off as its neighbours are from each other's
///   planes, and off by more than 0.6 of its mean distance, which on a surface would mean that it bends by a right
///   angle between two points;
/// * 6 times as isolated as its neighbours, wherever it is;
/// * 6 times as isolated as most points of the scan, and off by a quarter of its mean distance: one of a swarm whose
///   members excuse each other;
/// * alone: its nearest neighbour is 1.75 times as far as that one's and the others' own neighbours are, as it is
///   beyond a rim; or
/// * alone above the surface: on one side of its neighbours, off the planes of nearly all of them, and 8 times as far
///   as they are from each other's, though its distance to them is not unusual. A point on a sharp edge lies in the
///   planes of some of its neighbours, at a blunt tip these lie as far off themselves, and a point of another wall is
///   not the only one at its height.
///
/// The last four do not hold against a mesh, which says that the point belongs there. `progress` is advanced by an eighth
/// of the points. O(n).
pub(super) fn outliers(
    tree: &Neighbours,
    elements: &Elements,
    meshed: &[bool],
    progress: &dyn Progress,
) -> Vec<bool> {
    let points = tree.sorted_points();
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
    let alone = |k: usize| {
        let nearest = near(k).map(|j| points[k].distance_squared(points[j]));
        let nearest = nearest.fold(f64::INFINITY, f64::min).sqrt();
        2 * near(k).filter(|&j| nearest > ALONE * of[j].reach).count() > table.count()
    };
    let above = |k: usize| {
        let distance = of[k].reach;
        let (mut few, count) =
            few(near(k).map(|j| (points[k] - points[j]).dot(of[j].normal).abs()));
        let few = &mut few[..count];
        of[k].one_sided > ABOVE[0]
            && quantile_in_place(few, 0.25) > ABOVE[0] * distance
            && median_in_place(few) > ABOVE[1] * distance
            && median_in_place(few) > ROUGH * median(near(k).map(off))
    };
    // Points of another wall, unlike one astray, have more of their kind a little farther away.
    let in_company = |k: usize| {
        let Some(normal) = near(k).next().map(|j| of[j].normal) else {
            return true;
        };
        let height = off(k);
        let mut around = Nearest::default();
        tree.search(points[k], COMPANY, &mut around, |j| j as usize != k);
        let level = |j: &u32| {
            let h = (points[*j as usize] - points[k]).dot(normal);
            h.abs() < 0.5 * height
        };
        around.indices().filter(level).count() >= 2
    };
    let judge = |k: usize| {
        let (distance, meshed) = (of[k].reach, meshed[k]);
        if !meshed && of[k].one_sided > ABOVE[0] && (alone(k) || (above(k) && !in_company(k))) {
            return true;
        }
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
    each(points.len(), |k| {
        if (k + 1).is_multiple_of(BLOCK) {
            progress.advance((BLOCK / PER_STEP) as u64);
        }
        judge(k)
    })
}

/// The median of a few values.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let (mut few, count) = few(values);
    median_in_place(&mut few[..count])
}

/// A few values and their number.
fn few(values: impl Iterator<Item = f64>) -> ([f64; 32], usize) {
    let mut few = [0.0; 32];
    let mut count = 0;
    for (place, value) in few.iter_mut().zip(values) {
        *place = value;
        count += 1;
    }
    (few, count)
}
