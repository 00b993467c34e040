//! Points that cannot be used are found, counted and named; what remains gets normals, spacing and noise.

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

/// What [`clean`] may do.
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

/// The usable points of a scan and what was learnt of them. All lists but `rejected` and `triangles` are in the order
/// of `used`, which ascends.
#[derive(Clone, Debug)]
pub struct CleanScan {
    /// Index in the scan of each used point.
    pub used: Vec<u32>,
    /// The used points.
    pub points: Vec<DVec3>,
    /// The others and why, by ascending index.
    pub rejected: Vec<Rejected>,
    /// Unit normals; neighbours agree on the side, and each region encloses a positive volume, reckoned from its middle
    /// if it is open.
    pub normals: Vec<DVec3>,
    /// Triangles between used points, by place in `points`: those of a mesh, duplicates merged, without triangles
    /// that lost a corner or their area. Empty for other scans.
    pub triangles: Vec<[u32; 3]>,
    /// The side of the square that one point stands for, in the median: on a square grid its step. Where points lie on
    /// dense lines it is nearly the distance between these: the scan says nothing of what is smaller.
    pub spacing: f64,
    /// About how many such squares the surface has: as many as points, unless they lie on lines.
    pub squares: usize,
    /// Unit of the lengths, for what is said of them.
    pub unit: Unit,
    /// Standard deviation of the noise along the normal; zero where there are too few points to tell.
    pub noise: f64,
    /// The places, ascending, of the points that all this was learnt from: a sample of clouds without order that have
    /// many points, points closer than the noise is wide, or points on dense lines. The others take after those next to them. Empty if all
    /// points were examined.
    pub sample: Vec<u32>,
    /// The separate pieces of the scan.
    pub parts: Parts,
}

impl CleanScan {
    /// The places of those of some points of the scan that are used, ascending. O(n).
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
///    its neighbours; so is a swarm of up to 16 points apart from all others.
/// 3. Normals, spacing, noise and separate parts are found among the others. Normals that came with a cloud tell its
///    walls apart and which side is outside, if they are those of the surface.
///
/// Of clouds without order that have half a million points or more, or whose noise is wider than half of their spacing in
/// places, all this is said of a random sample, thinned in such places until the noise is 0.4 of the spacing; so it is of
/// clouds whose points lie on lines, thinned until these are no more than three times as dense as they are apart.
/// Each of the other points then follows one of the sample nearby, unless it is an outlier beside it. What is closer than
/// two points of the sample, 500 of which lie along the side of a square scan, is then not told apart, nor are lines of such
/// clouds that are closer than that.
///
/// The result does not depend on the order of the points, except that of duplicates the first is used.
/// O(n log n), about 3 us per point examined and 0.5 us per other on one thread; 200 bytes per point beside the scan.
///
/// # Errors
/// [`Error::Invalid`] if too few points are left, or all of them lie on one spot or one line: these are not
/// surfaces, whereas a flat scan is. [`Error::Cancelled`] if `progress` says so.
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
    // 1. The finite, different points in spatial order, so that nothing below depends on their order in the file.
    let distinct = distinct(scan, &mut rejected);
    refuse_few(scan, distinct.order.len())?;
    progress.check()?;
    // 2. What is learnt of them, from a sample that is as fine as it can be used.
    let all = distinct.order.len();
    let Sampled {
        examined,
        ranks,
        lined,
    } = sampled(scan, &distinct, options, progress)?;
    // 3. What follows for all of them.
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

/// Progress in points of the scan. Cleaning goes through them several times: the long loops advance by the share of a
/// point that they take, and [`reach`](Self::reach) makes up for what is between them.
pub(super) struct Steps<'a> {
    progress: &'a dyn Progress,
    total: u64,
    done: AtomicU64,
    paused: AtomicBool,
}

impl Steps<'_> {
    /// Whether the bar waits: for work of which nobody knows how much there is.
    pub(super) fn pause(&self, paused: bool) {
        self.paused.store(paused, Ordering::Relaxed);
    }

    /// Up to this percentage of the whole, if it is not there yet.
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

/// Puts what was found in the order of the file.
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
