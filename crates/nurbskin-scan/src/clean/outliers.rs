//! Outliers: points that are isolated and off the surface of their neighbours.
//!
//! For a point p with neighbours `q_j`, their unit normals `n_j`, and `m_j` the mean distance of `q_j` to its own
//! neighbours:
//!
//! ```text
//! reach     m = mean_j |q_j - p|                  height    h = median_j |(p - q_j) · n_j|
//! isolated(t):  m > t m_j for more than half of j     roughness r = median_j h(q_j)
//! ```
//!
//! All thresholds are ratios and hold at any density. A point must be isolated and off the surface, or so isolated
//! that no surface can be meant; see [`Judge`] for the five rules. Source: ours.

use super::elements::{Element, Elements};
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::{median_in_place, quantile_in_place};
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::spatial::neighbours::{Nearest, Neighbours};

/// Distance from a lone point to its nearest neighbour, in mean neighbour distances (reaches) of the neighbours: at a
/// larger ratio to more than half of them the point is isolated, as it is beyond a rim. Trial: not recorded. A smaller
/// ratio rejects rim points of uneven scans, a larger one leaves stray points just beyond a rim.
const LONE_NEIGHBOUR_RATIO: f64 = 1.75;
/// Distance from a point to the mean of its neighbours, in its mean neighbour distance, above which the neighbours lie
/// on one side of it. About 0.1 within a sheet and 0.6 at its rim. Trial: not recorded.
const RIM_ASYMMETRY: f64 = 0.35;
/// Lower quartile and median of the heights of a lone point above the planes of its neighbours, in its own mean
/// neighbour distance. Trial: not recorded. Smaller values reject points on sharp edges, which lie in the planes of
/// some of their neighbours.
const LONE_HEIGHT_QUARTILES: [f64; 2] = [0.35, 0.5];
/// Median height of a lone point above the planes of its neighbours, in units of their roughness (their median height
/// above the planes of their own neighbours). Trial: not recorded. A smaller ratio rejects the points of blunt tips,
/// whose neighbours are as rough.
const LONE_ROUGHNESS_RATIO: f64 = 8.0;
/// Ratio of a point's mean neighbour distance to that of more than half of its neighbours, above which it is isolated.
/// The point is an outlier only if it is also off the surface ([`OFF_SURFACE_HEIGHT`]). Trial: not recorded.
const OUTLIER_ISOLATION: f64 = 1.6;
/// The same ratio for a corner of a triangle: the mesh states that the point belongs to the surface. Trial: not
/// recorded.
const VERTEX_ISOLATION: f64 = 3.0;
/// Median height of an isolated point above the planes of its neighbours, in its mean neighbour distance, above which
/// it is off the surface. Derived: on a surface, this height would mean a bend of a right angle between two points.
const OFF_SURFACE_HEIGHT: f64 = 0.6;
/// The same height in units of the neighbours' roughness. Trial: not recorded. A smaller ratio rejects points of rough
/// surfaces.
const OFF_SURFACE_ROUGHNESS: f64 = 4.0;
/// Ratio of a point's mean neighbour distance to that of more than half of its neighbours, above which it is an outlier
/// at any height. Trial: not recorded.
const CERTAIN_ISOLATION: f64 = 6.0;
/// Ratio of a point's mean neighbour distance to the median over the scan, above which it may belong to a loose swarm
/// of outliers. The points of a swarm are not isolated from each other. Trial: not recorded.
const SWARM_REACH: f64 = 6.0;
/// Median height of such a point above the planes of its neighbours, in its mean neighbour distance, above which it is
/// an outlier. Trial: not recorded. A smaller value rejects sparse regions of the surface.
const SWARM_HEIGHT: f64 = 0.25;

/// Points between two reports of progress. Guard: rare enough to cost nothing, and at some microseconds per point
/// frequent enough for a smooth bar.
const PROGRESS_BLOCK: usize = 2048;
/// Points per step of progress: the search for outliers advances the bar by an eighth of the points. Guard: it only
/// shares out the bar among the stages.
const PROGRESS_DIVISOR: usize = 8;
/// Capacity of the stack buffer for the values of one neighbourhood. Guard: any capacity of at least 16 neighbours
/// does; values beyond it would be ignored.
const SMALL_BUFFER: usize = 32;
/// Nearest points among which a point of another wall finds points of its own height. Trial: not recorded. With fewer
/// points, the wall that is nearer can fill the neighbourhood.
const COMPANY_NEIGHBOURS: usize = 48;
/// Difference in height, as a share of the point's own height, up to which two points have the same height. Trial: not
/// recorded.
const COMPANY_HEIGHT: f64 = 0.5;
/// Fewest points of the same height that make another wall. Trial: not recorded. With one, a pair of outliers would
/// pass for a wall.
const MIN_COMPANY: usize = 2;

/// A point and its neighbours in a tree.
#[derive(Clone, Copy)]
pub(super) struct Around<'a> {
    pub(super) point: DVec3,
    /// Its index in the tree, if it is one of its points.
    pub(super) place: Option<usize>,
    /// The indices of its neighbours.
    pub(super) near: &'a [u32],
    /// Mean distance to the neighbours.
    pub(super) reach: f64,
    /// Distance to the mean of the neighbours, in reaches.
    pub(super) one_sided: f64,
}

/// Test for outliers: points that are isolated (mean distance to their neighbours against the neighbours' own) and off
/// the surface (distance to the planes of their neighbours). A point is an outlier if it is
/// * isolated by a factor of 1.6 (3 for the corner of a triangle), above the neighbours' planes by 4 times their
///   roughness, and by more than 0.6 of its mean distance, which on a surface would mean a bend of a right angle
///   between two points;
/// * isolated by a factor of 6, at any height;
/// * 6 times as isolated as most points of the scan, and off by a quarter of its mean distance: a point of a swarm,
///   whose members are not isolated from each other;
/// * alone: its nearest neighbour is 1.75 times as far as the neighbours of the neighbours are, as beyond a rim; or
/// * alone above the surface: its neighbours lie on one side, it is off the planes of nearly all of them by 8 times
///   their roughness, and its distance to them is not unusual. Points on a sharp edge lie in the planes of some
///   neighbours, at a blunt tip the neighbours are as rough, and a point of another wall has others at its height.
///
/// The last four rules do not apply to corners of triangles: the mesh states that the point belongs to the surface.
pub(super) struct Judge<'a> {
    tree: &'a Neighbours,
    elements: &'a Elements,
    /// Median reach of the scan.
    everywhere: f64,
}

impl<'a> Judge<'a> {
    /// A test by the points of a tree and their elements. O(n).
    pub(super) fn new(tree: &'a Neighbours, elements: &'a Elements) -> Self {
        let mut all: Vec<f64> = elements.of.iter().map(|e| e.reach).collect();
        Self {
            tree,
            elements,
            everywhere: median_in_place(&mut all),
        }
    }

    /// The outliers among the points of the tree. Advances `progress` by an eighth of their number. O(n).
    pub(super) fn outliers(&self, meshed: &[bool], progress: &dyn Progress) -> Vec<bool> {
        each(self.tree.len(), |k| {
            if (k + 1).is_multiple_of(PROGRESS_BLOCK) {
                progress.advance((PROGRESS_BLOCK / PROGRESS_DIVISOR) as u64);
            }
            self.outlying(&self.around(k), meshed[k])
        })
    }

    /// Whether a point is an outlier; `meshed` if it is the corner of a triangle.
    pub(super) fn outlying(&self, at: &Around, meshed: bool) -> bool {
        let beside = at.one_sided > RIM_ASYMMETRY;
        if !meshed && beside && (self.alone(at) || (self.above(at) && !self.in_company(at))) {
            return true;
        }
        let apart = self.isolated(
            at,
            if meshed {
                VERTEX_ISOLATION
            } else {
                OUTLIER_ISOLATION
            },
        );
        let astray = !meshed && at.reach > SWARM_REACH * self.everywhere;
        if !apart && !astray {
            return false;
        }
        if apart && !meshed && self.isolated(at, CERTAIN_ISOLATION) {
            return true;
        }
        let off = median(self.heights(at));
        (astray && off > SWARM_HEIGHT * at.reach)
            || (apart
                && off > OFF_SURFACE_HEIGHT * at.reach
                && off > OFF_SURFACE_ROUGHNESS * self.roughness(at))
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

    /// Roughness: the median height of the neighbours above the planes of their own neighbours.
    fn roughness(&self, at: &Around) -> f64 {
        let off = |&j: &u32| median(self.heights(&self.around(j as usize)));
        median(at.near.iter().map(off))
    }

    /// Whether `distance` exceeds `times` the mean neighbour distance of more than half of the neighbours.
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
        self.closer_than(at, nearest, LONE_NEIGHBOUR_RATIO)
    }

    fn above(&self, at: &Around) -> bool {
        let (mut few, count) = few(self.heights(at));
        let few = &mut few[..count];
        quantile_in_place(few, 0.25) > LONE_HEIGHT_QUARTILES[0] * at.reach
            && median_in_place(few) > LONE_HEIGHT_QUARTILES[1] * at.reach
            && median_in_place(few) > LONE_ROUGHNESS_RATIO * self.roughness(at)
    }

    /// Whether other points lie at the height of this one a little farther away: it then belongs to another wall.
    fn in_company(&self, at: &Around) -> bool {
        let Some(&nearest) = at.near.first() else {
            return true;
        };
        let normal = self.elements.of[nearest as usize].normal;
        let height = median(self.heights(at));
        let mut around = Nearest::default();
        let points = self.tree.sorted_points();
        self.tree
            .search(at.point, COMPANY_NEIGHBOURS, &mut around, |j| {
                Some(j as usize) != at.place
            });
        let level = |j: &u32| {
            let h = (points[*j as usize] - at.point).dot(normal);
            h.abs() < COMPANY_HEIGHT * height
        };
        around.indices().filter(level).count() >= MIN_COMPANY
    }
}

/// Median of at most 32 values.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let (mut few, count) = few(values);
    median_in_place(&mut few[..count])
}

/// At most 32 values, and their number.
fn few(values: impl Iterator<Item = f64>) -> ([f64; SMALL_BUFFER], usize) {
    let mut few = [0.0; SMALL_BUFFER];
    let mut count = 0;
    for (place, value) in few.iter_mut().zip(values) {
        *place = value;
        count += 1;
    }
    (few, count)
}
