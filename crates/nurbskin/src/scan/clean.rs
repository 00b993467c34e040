//! Points that cannot be used are found, counted and named; what remains gets normals, spacing and noise.

use super::blocks::{each, gather};
use super::distinct::{Distinct, distinct, meshed, refuse_few, refuse_line};
use super::elements::Elements;
use super::followers::Sample;
use super::morton::crowded_box;
use super::neighbours::Neighbours;
use super::noise::noise_of_elements;
use super::noise_lines::noise_by_order;
use super::outliers::Judge;
use super::parts::Parts;
use super::sides::{face, triangles_between};
use super::simulate::Random;
use super::{Organisation, Reason, Rejected, Scan};
use crate::numeric::statistics::median_in_place;
use crate::progress::Progress;
use crate::{Error, Result};
use glam::DVec3;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Fewer points than this are not searched for outliers: who belongs cannot be told.
const FEWEST_FOR_OUTLIERS: usize = 50;
/// Points that lie apart from all others and are no more than this are outliers too: none of them has a
/// neighbourhood of its own.
const SWARM: usize = 16;

/// A sample of so many points of a cloud without order tells what there is to learn of it.
const PLENTY: usize = 250_000;
/// The fewest that a sample is made of because of noise.
const FEWEST_IN_SAMPLE: f64 = 2000.0;
/// Noise above this part of the spacing makes neighbourhoods, which reach 2.3 spacings far, as thick as they are wide: such
/// balls say nothing of planes, and too little of the noise.
const BALL: f64 = 0.5;
/// The noise, as far as it is known, is brought down to this part of the spacing.
const FLAT: f64 = 0.4;
/// Points, next to each other in spatial order, that are thinned alike.
const RUN: usize = 256;
/// So large a part of such runs may stay as they are.
const FEW_BALLS: f64 = 0.01;
/// Times that a sample is thinned; of balls the noise is found at half its size at first.
const ROUNDS: usize = 4;
/// What grows by more than so with the size of the neighbourhoods, at a time and in all, is no noise.
const RISE: [f64; 2] = [2.0, 4.0];

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
    /// The side of the square that one point stands for, in the median: on a square grid its step.
    pub spacing: f64,
    /// Standard deviation of the noise along the normal; zero where there are too few points to tell.
    pub noise: f64,
    /// The places, ascending, of the points that all this was learnt from: a sample of clouds without order that have
    /// many points, or points closer than the noise is wide. The others take after those next to them. Empty if all
    /// points were examined.
    pub sample: Vec<u32>,
    /// The separate pieces of the scan.
    pub parts: Parts,
}

impl CleanScan {
    /// The places of those of some points of the scan that are used, ascending.
    fn places_of(&self, indices: &[u32]) -> Vec<u32> {
        let place = |index: &u32| self.used.binary_search(index).ok();
        let places = indices.iter().filter_map(place);
        let mut places: Vec<u32> = places.filter_map(|k| u32::try_from(k).ok()).collect();
        places.sort_unstable();
        places
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
/// 3. Normals, spacing, noise and separate parts are found among the others.
///
/// Of clouds without order that have half a million points or more, or whose noise is wider than half of their spacing in
/// places, all this is said of a random sample, thinned in such places until the noise is 0.4 of the spacing; each of the
/// other points then follows one of the sample nearby, unless it is an outlier beside it. What is closer than two points
/// of the sample, 500 of which lie along the side of a square scan, is then not told apart.
///
/// The result does not depend on the order of the points, except that of duplicates the first is used.
/// O(n log n), about 3 us per point examined and 0.5 us per other on one thread; 200 bytes per point beside the scan.
///
/// # Errors
/// [`Error::Invalid`] if too few points are left, or all of them lie on one spot or one line: these are not
/// surfaces, whereas a flat scan is. [`Error::Cancelled`] if `progress` says so.
///
/// ```
/// use nurbskin::DVec3;
/// use nurbskin::progress::Silent;
/// use nurbskin::scan::{Reason, Scan, clean::{CleanOptions, clean}};
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
/// # Ok::<(), nurbskin::Error>(())
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
    let loose = matches!(scan.organisation, Organisation::Unordered);
    let mut ranks: Vec<u32> = (0..u32::MAX).take(all).collect();
    if loose && all >= 2 * PLENTY {
        // By chance, here and below: what is chosen evenly in space is evenly above and below the surface, too, and
        // polynomials then find more noise than there is.
        let share = PLENTY as f64 / all as f64;
        let mut chance = Random::new(all as u64);
        ranks.retain(|_| chance.uniform() < share);
    }
    let mut examined = examine(scan, &distinct, &ranks, options, progress)?;
    // How often that is done is not known: the bar waits.
    let first = examined.noise;
    progress.paused.store(true, Ordering::Relaxed);
    for _ in 0..if loose { ROUNDS } else { 0 } {
        let Some(fewer) = examined.without_balls(&ranks) else {
            break;
        };
        match examine(scan, &distinct, &fewer, options, progress) {
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Ok(next) if next.noise <= (RISE[0] * examined.noise).min(RISE[1] * first) => {
                (examined, ranks) = (next, fewer);
            }
            // That is shape.
            _ => break,
        }
    }
    progress.paused.store(false, Ordering::Relaxed);
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
        spacing = sample.spacing(&leaders);
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
    progress.reach(100);
    Ok(found)
}

/// What is known of the points of a scan, or of a sample of them, in spatial order.
struct Examined {
    tree: Neighbours,
    elements: Elements,
    /// Outliers.
    dead: Vec<bool>,
    /// The place of each point of the scan; the largest number for the others.
    place: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    parts: Parts,
    spacing: f64,
    noise: f64,
}

impl Examined {
    /// Those of the points, which have these ranks, that leave the places where they are closer than the noise is wide
    /// with fewer, so that neighbourhoods there become flat; none where few places are such.
    fn without_balls(&self, ranks: &[u32]) -> Option<Vec<u32>> {
        // Runs in spatial order are thinned as a whole: points off the surface have fewer around them, and must not be
        // preferred for it.
        let runs = self.elements.of.chunks(RUN).zip(self.dead.chunks(RUN));
        let squares: Vec<f64> = runs
            .map(|(of, dead)| {
                let living = of.iter().zip(dead).filter(|(_, dead)| !**dead);
                let count = living.clone().count();
                let sum: f64 = living.map(|(e, _)| e.spacing * e.spacing).sum();
                if count > 0 {
                    sum / count as f64
                } else {
                    f64::INFINITY
                }
            })
            .collect();
        let ball = (self.noise / BALL).powi(2);
        let balls = squares.iter().filter(|&&square| square < ball).count();
        if balls as f64 <= FEW_BALLS * squares.len() as f64 {
            return None;
        }
        let wanted = (self.noise / FLAT).powi(2);
        let share = |square: f64| (square / wanted).min(1.0);
        // A part of each run, or of small clouds so much more that enough are left.
        let left: f64 = (ranks.chunks(RUN).zip(&squares))
            .map(|(ranks, &square)| share(square) * ranks.len() as f64)
            .sum();
        let more = (FEWEST_IN_SAMPLE / left.max(1.0)).max(1.0);
        let mut chance = Random::new(ranks.len() as u64);
        let mut fewer = Vec::new();
        for (ranks, square) in ranks.chunks(RUN).zip(squares) {
            let share = more * share(square);
            fewer.extend(ranks.iter().filter(|_| chance.uniform() < share));
        }
        (10 * fewer.len() < 9 * ranks.len()).then_some(fewer)
    }
}

/// Examines the points of these ranks in spatial order.
fn examine(
    scan: &Scan,
    distinct: &Distinct,
    ranks: &[u32],
    options: &CleanOptions,
    progress: &Steps,
) -> Result<Examined> {
    let order = gather(&distinct.order, ranks);
    let tree = Neighbours::of_sorted(gather(&scan.points, &order));
    progress.reach(15);
    // A line, but for a few points astray, is refused before much is made of it.
    let [low, high] = crowded_box(tree.sorted_points());
    let crowd = |p: &DVec3| p.cmpge(low).all() && p.cmple(high).all();
    let crowd = tree.sorted_points().iter().copied().filter(crowd);
    if 2 * crowd.clone().count() > tree.len() {
        refuse_line(crowd)?;
    }
    progress.check()?;
    // 1. Neighbourhoods; outliers; neighbourhoods near them without them.
    let mut elements = Elements::new(&tree, progress)?;
    progress.check()?;
    progress.reach(55);
    let meshed = meshed(&scan.organisation, distinct, &order);
    let search = options.outliers && tree.len() >= FEWEST_FOR_OUTLIERS;
    let mut dead = vec![false; tree.len()];
    if search {
        dead = Judge::new(&tree, &elements).outliers(&meshed, progress);
        elements.without(&tree, &dead);
    }
    progress.reach(65);
    progress.check()?;
    // 2. Parts; swarms are no parts.
    let mut place = places(scan, &order, &dead);
    let triangles = triangles_between(
        &scan.organisation,
        &distinct.merged,
        &place,
        tree.sorted_points(),
    );
    let mut parts = parts_of(&tree, &elements, &triangles, &dead);
    if search {
        let most = (SWARM * ranks.len() / distinct.order.len()).max(1);
        let swarm = |k: usize| {
            let size = parts.sizes.get(parts.of[k] as usize);
            !meshed[k] && size.is_some_and(|&size| size <= most && size < parts.sizes[0])
        };
        let swarms = each(tree.len(), swarm);
        for ((dead, swarm), &index) in dead.iter_mut().zip(&swarms).zip(&order) {
            if *swarm {
                *dead = true;
                place[index as usize] = u32::MAX;
            }
        }
        parts.recount(&|k| !dead[k]);
    }
    let living = || (0..tree.len()).filter(|&k| !dead[k]);
    refuse_few(scan, living().count())?;
    refuse_line(living().map(|k| tree.sorted_points()[k]))?;
    progress.check()?;
    progress.reach(70);
    // 3. Everything else.
    let alive = |k: usize| !dead[k];
    let points = tree.sorted_points();
    face(
        scan,
        &order,
        &place,
        points,
        &mut elements,
        &triangles,
        &alive,
    );
    progress.check()?;
    progress.reach(75);
    let spacing =
        median_in_place(&mut living().map(|k| elements.of[k].spacing).collect::<Vec<_>>());
    let noise = noise_of_elements(&tree, &elements, spacing, &alive);
    let noise = noise_by_order(scan, &place, points, &elements, noise);
    progress.check()?;
    Ok(Examined {
        tree,
        elements,
        dead,
        place,
        triangles,
        parts,
        spacing,
        noise,
    })
}

/// Progress in points of the scan. Cleaning goes through them several times: the long loops advance by the share of a
/// point that they take, and [`reach`](Self::reach) makes up for what is between them.
struct Steps<'a> {
    progress: &'a dyn Progress,
    total: u64,
    done: AtomicU64,
    paused: AtomicBool,
}

impl Steps<'_> {
    /// Up to this percentage of the whole, if it is not there yet.
    fn reach(&self, percent: u64) {
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

/// The place of each point of the scan in this order; the largest number for those that are not in it or dead.
fn places(scan: &Scan, order: &[u32], dead: &[bool]) -> Vec<u32> {
    let mut place = vec![u32::MAX; scan.points.len()];
    for ((k, &index), dead) in (0_u32..).zip(order).zip(dead) {
        if !dead {
            place[index as usize] = k;
        }
    }
    place
}

fn parts_of(
    tree: &Neighbours,
    elements: &Elements,
    triangles: &[[u32; 3]],
    dead: &[bool],
) -> Parts {
    let alive = |k: usize| !dead[k];
    if triangles.is_empty() {
        Parts::by_distance(tree, elements, &alive)
    } else {
        Parts::by_triangles(tree, triangles, &alive)
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
    let Elements { of, table } = elements;
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
        noise: 0.0,
        sample: Vec::new(),
        parts: parts.reordered(&by_index),
        used,
    }
}

#[cfg(test)]
#[path = "clean_tests.rs"]
mod tests;
