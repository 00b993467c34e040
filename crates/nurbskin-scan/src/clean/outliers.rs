//! Points that do not belong to the surface.

use super::elements::{Element, Elements};
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::{median_in_place, quantile_in_place};
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::spatial::neighbours::{Nearest, Neighbours};

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

/// A point and the points of a tree around it.
#[derive(Clone, Copy)]
pub(super) struct Around<'a> {
    pub(super) point: DVec3,
    /// Its place in the tree, if it is one of its points.
    pub(super) place: Option<usize>,
    /// The places of its neighbours.
    pub(super) near: &'a [u32],
    /// Mean distance to them.
    pub(super) reach: f64,
    /// Distance to their mean, in reaches.
    pub(super) one_sided: f64,
}

/// Tells outliers: points that are isolated (mean distance to their neighbours against the neighbours' own) and off the
/// surface (distance to the planes of their neighbours). The thresholds are ratios and hold at any density:
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
/// The last four do not hold against a mesh, which says that the point belongs there.
pub(super) struct Judge<'a> {
    tree: &'a Neighbours,
    elements: &'a Elements,
    /// The mean distance to the neighbours of most points.
    everywhere: f64,
}

impl<'a> Judge<'a> {
    /// By the points of a tree and their elements. O(n).
    pub(super) fn new(tree: &'a Neighbours, elements: &'a Elements) -> Self {
        let mut all: Vec<f64> = elements.of.iter().map(|e| e.reach).collect();
        Self {
            tree,
            elements,
            everywhere: median_in_place(&mut all),
        }
    }

    /// Which points of the tree are outliers. `progress` is advanced by an eighth of their number. O(n).
    pub(super) fn outliers(&self, meshed: &[bool], progress: &dyn Progress) -> Vec<bool> {
        each(self.tree.len(), |k| {
            if (k + 1).is_multiple_of(BLOCK) {
                progress.advance((BLOCK / PER_STEP) as u64);
            }
            self.outlying(&self.around(k), meshed[k])
        })
    }

    /// Whether a point is an outlier; `meshed` if it is the corner of a triangle.
    pub(super) fn outlying(&self, at: &Around, meshed: bool) -> bool {
        let beside = at.one_sided > ABOVE[0];
        if !meshed && beside && (self.alone(at) || (self.above(at) && !self.in_company(at))) {
            return true;
        }
        let apart = self.isolated(at, if meshed { 3.0 } else { 1.6 });
        let astray = !meshed && at.reach > 6.0 * self.everywhere;
        if !apart && !astray {
            return false;
        }
        if apart && !meshed && self.isolated(at, 6.0) {
            return true;
        }
        let off = median(self.heights(at));
        (astray && off > 0.25 * at.reach)
            || (apart && off > 0.6 * at.reach && off > 4.0 * self.roughness(at))
    }

    fn around(&self, k: usize) -> Around<'a> {
        let Element {
            reach, one_sided, ..
        } = self.elements.of[k];
        Around {
            point: self.tree.sorted_points()[k],
            place: Some(k),
            near: self.elements.table.of(k),
            reach,
            one_sided,
        }
    }

    /// The distances of a point from the planes of its neighbours.
    fn heights<'b>(&'b self, at: &Around<'b>) -> impl Iterator<Item = f64> + 'b {
        let (near, point, points) = (at.near, at.point, self.tree.sorted_points());
        near.iter().map(move |&j| {
            let j = j as usize;
            (point - points[j]).dot(self.elements.of[j].normal).abs()
        })
    }

    /// How far the neighbours are from the planes of theirs, in the median.
    fn roughness(&self, at: &Around) -> f64 {
        let off = |&j: &u32| median(self.heights(&self.around(j as usize)));
        median(at.near.iter().map(off))
    }

    /// Whether more than half of the neighbours have others so much closer, if this point is so far from them.
    fn closer_than(&self, at: &Around, distance: f64, times: f64) -> bool {
        let closer = |&&j: &&u32| distance > times * self.elements.of[j as usize].reach;
        2 * at.near.iter().filter(closer).count() > at.near.len()
    }

    fn isolated(&self, at: &Around, times: f64) -> bool {
        self.closer_than(at, at.reach, times)
    }

    fn alone(&self, at: &Around) -> bool {
        let points = self.tree.sorted_points();
        let squares = at.near.iter();
        let squares = squares.map(|&j| at.point.distance_squared(points[j as usize]));
        let nearest = squares.fold(f64::INFINITY, f64::min).sqrt();
        self.closer_than(at, nearest, ALONE)
    }

    fn above(&self, at: &Around) -> bool {
        let (mut few, count) = few(self.heights(at));
        let few = &mut few[..count];
        quantile_in_place(few, 0.25) > ABOVE[0] * at.reach
            && median_in_place(few) > ABOVE[1] * at.reach
            && median_in_place(few) > ROUGH * self.roughness(at)
    }

    /// Points of another wall, unlike one astray, have more of their kind a little farther away.
    fn in_company(&self, at: &Around) -> bool {
        let Some(&nearest) = at.near.first() else {
            return true;
        };
        let normal = self.elements.of[nearest as usize].normal;
        let height = median(self.heights(at));
        let mut around = Nearest::default();
        let points = self.tree.sorted_points();
        self.tree.search(at.point, COMPANY, &mut around, |j| {
            Some(j as usize) != at.place
        });
        let level = |j: &u32| {
            let h = (points[*j as usize] - at.point).dot(normal);
            h.abs() < 0.5 * height
        };
        around.indices().filter(level).count() >= 2
    }
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
