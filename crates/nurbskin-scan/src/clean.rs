//! Cleaning of a scan: which points lie on a surface, and their normals, spacing, noise and parts.
//!
//! Idea: every decision rests on the 16 nearest neighbours of a point, their least-squares plane, and ratios of
//! distances, which hold at any density and in any unit. No model of the shape is used. The steps are: distinct points
//! (`distinct`), a sample of large clouds (`sampling`), local planes (`elements`), outliers (`outliers`), connected
//! parts (`parts`), orientation (`sides`, `orientation`, `opposite`), noise ([`noise`]), and the points outside the
//! sample (`followers`).
//!
//! Sources: H. Hoppe et al., *Surface reconstruction from unorganized points*, SIGGRAPH 1992 (DOI
//! 10.1145/133994.134011) for local planes and their orientation along a minimum spanning forest; the outlier rules,
//! the sampling and the noise estimate are ours.

mod distinct;
pub(crate) mod elements;
mod examined;
mod faced;
mod followers;
pub mod noise;
mod opposite;
mod orientation;
mod outliers;
mod parts;
mod sampling;
pub(crate) mod sides;
mod signed_sets;
mod split;

use super::{Reason, Rejected, Scan};
use crate::clean::distinct::{distinct, refuse_few};
use crate::clean::elements::Elements;
use crate::clean::examined::Examined;
use crate::clean::followers::Sample;
use crate::clean::outliers::Judge;
pub use crate::clean::parts::Parts;
use crate::clean::sampling::{Sampled, sampled};
pub use crate::clean::split::Scrap;
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::{each, gather};
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result, Unit};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Options of [`clean`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CleanOptions {
    /// Whether outliers are rejected (true).
    pub outliers: bool,
}

impl Default for CleanOptions {
    fn default() -> Self {
        Self { outliers: true }
    }
}

/// The usable points of a scan, with normals, spacing, noise and parts. All lists except `rejected` and `triangles` are
/// in the order of `used`, which ascends.
#[derive(Clone, Debug)]
pub struct CleanScan {
    /// Index in the scan of each used point.
    pub used: Vec<u32>,
    /// The used points.
    pub points: Vec<DVec3>,
    /// The rejected points and the reasons, by ascending index.
    pub rejected: Vec<Rejected>,
    /// Unit normals. Neighbours agree on the side, and each region encloses a positive volume, measured from its
    /// centroid if it is open.
    pub normals: Vec<DVec3>,
    /// Triangles between used points, by index in `points`: those of a mesh, with duplicate points merged, without
    /// triangles that lost a corner or their area. Empty for other scans.
    pub triangles: Vec<[u32; 3]>,
    /// Median side of the square that one point represents: on a square grid its step. Where points lie on dense lines,
    /// it is nearly the distance between the lines: the scan does not resolve anything smaller.
    pub spacing: f64,
    /// Approximate number of such squares on the surface: the number of points, unless they lie on lines.
    pub squares: usize,
    /// Unit of the lengths, for messages.
    pub unit: Unit,
    /// Standard deviation of the noise along the normal; zero if there are too few points to measure it.
    pub noise: f64,
    /// Indices in `points`, ascending, of the sample from which normals, spacing and noise were computed. A sample is
    /// taken of unordered clouds that have many points, points closer than the noise is wide, or points on dense lines;
    /// the other points follow a sample point nearby. Empty if all points were examined.
    pub sample: Vec<u32>,
    /// The connected parts of the scan.
    pub parts: Parts,
}

impl CleanScan {
    /// Indices in `points`, ascending, of those of the given points of the scan that are used. O(n).
    fn places_of(&self, indices: &[u32]) -> Vec<u32> {
        let most = indices.iter().max().map_or(0, |&most| most as usize + 1);
        let mut wanted = vec![false; most];
        for &index in indices {
            wanted[index as usize] = true;
        }
        let places = (0_u32..).zip(&self.used);
        let places = places.filter(|(_, index)| wanted.get(**index as usize) == Some(&true));
        places.map(|(place, _)| place).collect()
    }

    /// Whether the points lie on dense lines, so that there are fewer [`squares`](Self::squares) than points.
    #[must_use]
    pub fn is_on_lines(&self) -> bool {
        self.squares < self.points.len()
    }

    /// Number of points rejected for this reason.
    #[must_use]
    pub fn rejected_for(&self, reason: Reason) -> usize {
        self.rejected.iter().filter(|r| r.reason == reason).count()
    }
}

/// Finds the usable points of `scan`, and advances `progress` by their number and that of the others.
///
/// 1. Points that are not finite (or beyond 1e90), and exact duplicates of earlier ones, are rejected; the pole lines
///    of a grid are not duplicates.
/// 2. A point is an outlier if it is isolated (farther from its neighbours than they are from theirs) and off the
///    surface of its neighbours, or so isolated that no surface can be meant, or alone above the planes of nearly all
///    its neighbours. Groups of up to 16 points apart from all others are outliers, too.
/// 3. Normals, spacing, noise and connected parts are computed from the others. Normals that came with a cloud, if they
///    are those of the surface, separate its walls and determine the outward side.
///
/// All this is computed from a random sample of unordered clouds with half a million points or more. Where the noise is
/// wider than half of the spacing, the sample is thinned until the noise is 0.4 of the spacing; dense scan lines are
/// thinned until they are no more than three times as dense along as across. Each of the other points then follows a
/// sample point nearby, unless it is an outlier relative to it. Details, and lines of such clouds, closer than two
/// sample points are not separated; 500 sample points lie along the side of a square scan.
///
/// The result does not depend on the order of the points, except that the first of equal points is used. O(n log n),
/// about 3 us per examined point and 0.5 us per other point on one thread; 200 bytes per point beside the scan.
///
/// [`Error::Invalid`] if too few points are left, or all of them lie on one spot or one line: these are not surfaces,
/// whereas a flat scan is. [`Error::Cancelled`] if `progress` is cancelled.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_geometry::progress::Silent;
/// use nurbskin_scan::{Reason, Scan};
/// use nurbskin_scan::clean::{CleanOptions, clean};
/// let mut points: Vec<DVec3> = (0..400)
///     .map(|k| DVec3::new(f64::from(k % 20), f64::from(k / 20), 0.0))
///     .collect();
/// points.push(points[3]);
/// points.push(DVec3::NAN);
/// points.push(DVec3::new(4.5, 4.5, 60.0));
/// let scan = Scan { points, ..Scan::default() };
/// let clean = clean(&scan, &CleanOptions::default(), &Silent)?;
/// assert_eq!(clean.points.len(), 400);
/// let why: Vec<Reason> = clean.rejected.iter().map(|r| r.reason).collect();
/// assert_eq!(why, [Reason::Duplicate, Reason::NonFinite, Reason::Outlier]);
/// assert!((clean.spacing - 1.0).abs() < 0.05);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
pub fn clean(scan: &Scan, options: &CleanOptions, progress: &dyn Progress) -> Result<CleanScan> {
    if u32::try_from(scan.points.len()).is_err() {
        return Err(Error::Unsupported(format!(
            "{} points are more than the 4 294 967 295 that can be numbered; thin the scan",
            scan.points.len()
        )));
    }
    let steps = Steps {
        progress,
        total: scan.points.len() as u64,
        done: AtomicU64::new(0),
        paused: AtomicBool::new(false),
    };
    let progress = &steps;
    let mut rejected = Vec::new();
    // 1. The finite, distinct points in spatial order, so that nothing below depends on their order in the file.
    let distinct = distinct(scan, &mut rejected);
    refuse_few(scan, distinct.order.len())?;
    progress.check()?;
    // 2. Normals, parts, spacing and noise, from a sample as dense as is useful.
    let all = distinct.order.len();
    let Sampled {
        examined,
        ranks,
        lined,
    } = sampled(scan, &distinct, options, progress)?;
    // 3. The same for all points.
    let Examined {
        tree,
        elements,
        dead,
        mut place,
        triangles,
        parts,
        spacing,
        noise,
    } = examined;
    let mut spacing = spacing;
    let living = dead.iter().filter(|&&dead| !dead).count();
    if ranks.len() < all {
        let judge = options.outliers.then(|| Judge::new(&tree, &elements));
        let points = gather(&scan.points, &distinct.order);
        let sample = Sample {
            ranks: &ranks,
            tree: &tree,
            elements: &elements,
            dead: &dead,
            judge: judge.as_ref(),
        };
        let leaders = sample.leaders(&points, progress)?;
        if !lined {
            spacing = sample.spacing(&leaders);
        }
        for (&index, &leader) in distinct.order.iter().zip(&leaders) {
            place[index as usize] = leader;
        }
    }
    progress.check()?;
    progress.reach(95);
    let reason = Reason::Outlier;
    let outlying = distinct.order.iter().map(|&k| k as usize);
    let outlying = outlying.filter(|&index| place[index] == u32::MAX);
    rejected.extend(outlying.map(|index| Rejected { index, reason }));
    rejected.sort_unstable_by_key(|r| r.index);
    for &k in &distinct.copies {
        place[k as usize] = place[distinct.merged[k as usize] as usize];
    }
    let sample = if ranks.len() < all {
        gather(&distinct.order, &ranks)
    } else {
        Vec::new()
    };
    drop((distinct, dead, tree, ranks));
    let mut found = in_file_order(scan, &place, elements, &triangles, parts, rejected);
    found.sample = found.places_of(&sample);
    (found.spacing, found.noise) = (spacing, noise);
    found.squares = if lined { living } else { found.points.len() };
    progress.reach(100);
    Ok(found)
}

/// Progress in points of the scan. Cleaning visits the points several times: each long loop advances by its share of a
/// point, and [`reach`](Self::reach) makes up for the work between the loops.
pub(super) struct Steps<'a> {
    progress: &'a dyn Progress,
    total: u64,
    done: AtomicU64,
    paused: AtomicBool,
}

impl Steps<'_> {
    /// Pauses the bar during work of unknown length.
    pub(super) fn pause(&self, paused: bool) {
        self.paused.store(paused, Ordering::Relaxed);
    }

    /// Advances to this percentage of the whole, if progress is not there yet.
    pub(super) fn reach(&self, percent: u64) {
        if self.paused.load(Ordering::Relaxed) {
            return;
        }
        let missing =
            (percent * self.total / 100).saturating_sub(self.done.load(Ordering::Relaxed));
        if missing > 0 {
            self.advance(missing);
        }
    }
}

impl Progress for Steps<'_> {
    fn stage(&self, name: &'static str, steps: Option<u64>) {
        self.progress.stage(name, steps);
    }
    fn advance(&self, steps: u64) {
        if !self.paused.load(Ordering::Relaxed) {
            self.done.fetch_add(steps, Ordering::Relaxed);
            self.progress.advance(steps);
        }
    }
    fn warn(&self, message: &str) {
        self.progress.warn(message);
    }
    fn cancelled(&self) -> bool {
        self.progress.cancelled()
    }
}

/// Returns the results in the order of the file.
fn in_file_order(
    scan: &Scan,
    place: &[u32],
    elements: Elements,
    triangles: &[[u32; 3]],
    parts: Parts,
    rejected: Vec<Rejected>,
) -> CleanScan {
    let Elements { of, table, .. } = elements;
    drop(table);
    let used: Vec<u32> = (0_u32..)
        .zip(place)
        .filter(|(_, place)| **place != u32::MAX)
        .map(|(index, _)| index)
        .collect();
    let by_index = gather(place, &used);
    let mut to = vec![0_u32; of.len()];
    for (k, &from) in (0_u32..).zip(&by_index) {
        to[from as usize] = k;
    }
    CleanScan {
        points: gather(&scan.points, &used),
        rejected,
        normals: each(by_index.len(), |k| of[by_index[k] as usize].normal),
        triangles: triangles
            .iter()
            .map(|t| t.map(|k| to[k as usize]))
            .collect(),
        spacing: 0.0,
        squares: 0,
        unit: scan.unit,
        noise: 0.0,
        sample: Vec::new(),
        parts: parts.reordered(&by_index),
        used,
    }
}

#[cfg(test)]
mod tests;
