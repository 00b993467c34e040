//! Examination of a scan, or of a sample of it: all steps of cleaning that need the neighbours of a point.
//!
//! Order: local planes; given normals; outliers, and the local planes near them again without them; connected parts,
//! of which those of at most 16 points are outliers too; orientation; spacing (the median over all points) and noise.
//! Source: ours.

use super::distinct::{Distinct, meshed, refuse_few, refuse_line};
use super::elements::Elements;
use super::faced::believed;
use super::opposite::mend;
use super::outliers::Judge;
use super::parts::Parts;
use super::sides::{face, triangles_between};
use crate::clean::noise::lines::noise_by_order;
use crate::clean::noise::noise_of_elements;
use crate::clean::{CleanOptions, Steps};
use crate::{Organisation, Scan};
use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::parallel::{each, gather};
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::spatial::morton::crowded_box;
use nurbskin_geometry::spatial::neighbours::Neighbours;

/// Smallest scan that is searched for outliers. Trial: not recorded. Below it, 16 neighbours are a third of the scan,
/// and isolation has no reference.
const MIN_POINTS_FOR_OUTLIERS: usize = 50;
/// Largest detached part that is rejected as outliers. Derived: with the 16 neighbours of each point, no point of such
/// a part has a neighbourhood within the part.
const MAX_SWARM_POINTS: usize = 16;

/// The result of the examination of a scan, or of a sample of it, in spatial order.
pub(super) struct Examined {
    pub(super) tree: Neighbours,
    pub(super) elements: Elements,
    /// Outliers.
    pub(super) dead: Vec<bool>,
    /// Index in spatial order of each point of the scan; `u32::MAX` for points that are not used.
    pub(super) place: Vec<u32>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) parts: Parts,
    pub(super) spacing: f64,
    pub(super) noise: f64,
}

/// Absolute cosine (60°) between the plane normals found before and after thinning of scan lines, above which the
/// earlier one replaces the later one: it rests on denser lines. Trial: not recorded. Below it one of the two is wrong,
/// and it is not known which.
const CORRECTION_COSINE: f64 = 0.5;

/// Prior knowledge about the points.
#[derive(Clone, Copy)]
pub(super) enum Known<'a> {
    Nothing,
    /// The points lie on lines.
    Lines,
    /// The points are a thinned sample of lines that were examined before, with these ranks; denser lines gave better
    /// planes.
    Denser(&'a Examined, &'a [u32]),
}

impl Known<'_> {
    /// Replaces the normals of points with these ranks by those found on the denser lines.
    fn correct(self, elements: &mut Elements, ranks: &[u32]) {
        let Known::Denser(examined, before) = self else {
            return;
        };
        let mut known = before.iter().zip(&examined.elements.of);
        for (element, rank) in elements.of.iter_mut().zip(ranks) {
            if let Some((_, better)) = known.find(|(before, _)| *before == rank)
                && better.gap > 0.0
                && better.gap.is_finite()
                && better.normal.dot(element.normal).abs() > CORRECTION_COSINE
            {
                element.normal = better.normal;
            }
        }
    }
}

/// Examines the points of these ranks in spatial order.
pub(super) fn examine(
    scan: &Scan,
    distinct: &Distinct,
    ranks: &[u32],
    known: Known<'_>,
    options: &CleanOptions,
    progress: &Steps,
) -> Result<Examined> {
    let order = gather(&distinct.order, ranks);
    let tree = Neighbours::of_sorted(gather(&scan.points, &order));
    progress.reach(15);
    // A line with a few stray points is refused before it costs more time.
    let [low, high] = crowded_box(tree.sorted_points());
    let crowd = |p: &DVec3| p.cmpge(low).all() && p.cmple(high).all();
    let crowd = tree.sorted_points().iter().copied().filter(crowd);
    if 2 * crowd.clone().count() > tree.len() {
        refuse_line(crowd)?;
    }
    progress.check()?;
    // 1. Local planes; outliers; local planes near these without them.
    let mut elements = Elements::new(&tree, matches!(known, Known::Lines), progress)?;
    known.correct(&mut elements, ranks);
    let given = believed(scan, &order, &tree, &elements);
    if let Some(given) = &given {
        elements.face(&tree, given, &|_| true);
    }
    progress.check()?;
    progress.reach(55);
    let meshed = meshed(&scan.organisation, distinct, &order);
    let search = options.outliers && tree.len() >= MIN_POINTS_FOR_OUTLIERS;
    let mut dead = vec![false; tree.len()];
    if search {
        dead = Judge::new(&tree, &elements).outliers(&meshed, progress);
        elements.without(&tree, &dead);
        known.correct(&mut elements, ranks);
        if let Some(given) = &given {
            elements.face(&tree, given, &|j| !dead[j as usize]);
        }
    }
    progress.reach(65);
    progress.check()?;
    // 2. Parts; small detached groups are outliers.
    let mut place = places(scan, &order, &dead);
    let triangles = triangles_between(
        &scan.organisation,
        &distinct.merged,
        &place,
        tree.sorted_points(),
    );
    let mut parts = parts_of(&tree, &elements, &triangles, &dead);
    if search {
        let most = (MAX_SWARM_POINTS * ranks.len() / distinct.order.len()).max(1);
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
    // 3. Orientation, spacing and noise.
    let alive = |k: usize| !dead[k];
    let points = tree.sorted_points();
    face(scan, &place, points, &mut elements, &triangles, &alive);
    if matches!(scan.organisation, Organisation::Unordered) && !elements.faced {
        mend(&tree, &mut elements, &parts, &alive);
    }
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

/// Index of each point of the scan in this order; `u32::MAX` for points that are not in it or are outliers.
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
