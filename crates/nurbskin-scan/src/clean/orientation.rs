//! Orientation of normals: neighbours agree, and each connected region encloses a positive volume.
//!
//! The normal b at q should be the mirror image of a at p in the plane half-way between them, as on a circular arc.
//! With d = q - p:
//!
//! ```text
//! agreement = a·b - 2 (a·d)(b·d) / d²
//! cost      = 1 - |agreement| + ½ ((a·d)² + (b·d)²) / d²
//! ```
//!
//! The sign of the agreement carries the side along a minimum spanning forest of the costs. Each region is then turned
//! so that Σ h² (p - c)·n > 0, with h the spacing and c the centroid of the region.
//!
//! Sources: Hoppe et al. 1992 (DOI 10.1145/133994.134011) for the spanning tree; S. Koenig, S. Gumhold, *Consistent
//! propagation of normal orientations in point clouds*, VMV 2009, for the mirror image. The vote of given normals is
//! ours.

use super::elements::Element;
use super::signed_sets::SignedSets;
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::spatial::neighbours::NeighbourTable;

/// Nearest neighbours of a point that become links of the graph along which sides spread. Trial: not recorded. Fewer
/// links leave more separate regions; more links cost time and cross gaps.
const LINKS_PER_POINT: usize = 10;
/// Link costs in ascending steps; links up to a step are joined in any order within it. On a plane, cost 1 - cos θ
/// corresponds to angles between the normals of 8° (0.01) to 23° (0.08), which leave little doubt about the side.
/// Trial: not recorded. Larger costs would join doubtful links out of order; smaller ones leave more links to the
/// slower rounds between sets.
const LINK_COST_STEPS: [f64; 4] = [0.01, 0.02, 0.04, 0.08];
/// Nearest neighbours of a point with which the given normals are tested for consistency. Trial: not recorded.
const VOTING_NEIGHBOURS: usize = 4;
/// Absolute cosine (45°) between two plane normals above which the pair can be tested. Trial: not recorded. A smaller
/// value would test pairs across edges, where the sign of the product means nothing.
const PARALLEL_COSINE: f64 = 0.7;
/// Least product of the cosines between given and plane normals at both points: below it the given normals do not tell
/// a side. Trial: not recorded.
const MIN_SIDE_PRODUCT: f64 = 0.1;
/// The given normals are rejected if more than one tested pair in this many is contradictory (5 %). Trial: not
/// recorded. Normals that were never oriented contradict each other at half of the pairs.
const TESTS_PER_CONTRADICTION: u64 = 20;
/// Weight of a point's own given normal in the vote about its side; each neighbour has weight 1. Trial: not recorded.
const OWN_SIDE_WEIGHT: f64 = 2.0;

/// The relation between the sides of two neighbours.
struct Link {
    /// 0 if the normals are those of a circular arc through both points; the cost grows with the deviation from it and
    /// with the angle between the link and the surface.
    cost: f64,
    /// Whether the normals are on different sides.
    turned: bool,
}

/// The second normal should be the mirror image of the first in the plane half-way, as on a circular arc. This holds
/// even on an arc that turns back, as at the rim of a thin wall (Koenig & Gumhold 2009, *Consistent propagation of
/// normal orientations in point clouds*).
fn link(points: &[DVec3], elements: &[Element], k: usize, j: usize) -> Link {
    let along = points[j] - points[k];
    let (a, b) = (elements[k].normal, elements[j].normal);
    let (rise, fall) = (a.dot(along), b.dot(along));
    // Distinct points have a positive distance; the limit guards against underflow.
    let part = 1.0 / along.length_squared().max(f64::MIN_POSITIVE);
    let agreement = a.dot(b) - 2.0 * rise * fall * part;
    Link {
        cost: 1.0 - agreement.abs() + 0.5 * (rise * rise + fall * fall) * part,
        turned: agreement < 0.0,
    }
}

/// Turns the normals of points in spatial order so that neighbours agree, along a minimum spanning forest of the links
/// (Hoppe et al. 1992). Then turns each connected region so that it encloses a positive volume, measured from its
/// centroid if it is open: most of it then looks outward. O(n).
pub(super) fn orient(
    points: &[DVec3],
    elements: &mut [Element],
    table: &NeighbourTable,
    alive: &(dyn Fn(usize) -> bool + Sync),
) {
    // 1. Neighbours agree.
    let seen: &[Element] = elements;
    let links = |k: usize| {
        let row = if alive(k) { table.of(k) } else { &[] };
        let row = &row[..row.len().min(LINKS_PER_POINT)];
        row.iter().map(|&j| j as usize).filter(|&j| alive(j))
    };
    let judge = |k: usize, j: usize| Some(cost_and_turn(points, seen, k, j));
    let sets = SignedSets::spanning(points.len(), &LINK_COST_STEPS, links, judge);
    for (element, turned) in elements.iter_mut().zip(&sets.turned) {
        if *turned {
            element.normal = -element.normal;
        }
    }
    // 2. The centroid of each region, weighted by area, and the volume measured from it.
    let (region, count) = sets.numbered();
    drop(sets);
    turn_outward(points, elements, &region, count, alive);
}

/// Cost of a link between two points, and whether it turns the side.
pub(super) fn cost_and_turn(
    points: &[DVec3],
    elements: &[Element],
    k: usize,
    j: usize,
) -> (f64, bool) {
    let found = link(points, elements, k, j);
    (found.cost, found.turned)
}

/// Turns each of `count` regions so that it encloses a positive volume, measured from its centroid. O(n).
pub(super) fn turn_outward(
    points: &[DVec3],
    elements: &mut [Element],
    region: &[u32],
    count: usize,
    alive: &(dyn Fn(usize) -> bool + Sync),
) {
    let living = || (0..points.len()).filter(|&k| alive(k));
    let mut middles = vec![(DVec3::ZERO, 0.0_f64); count];
    for k in living() {
        let middle = &mut middles[region[k] as usize];
        let area = elements[k].spacing.powi(2);
        middle.0 += area * points[k];
        middle.1 += area;
    }
    let mut volumes = vec![0.0_f64; count];
    for k in living() {
        let (sum, weight) = middles[region[k] as usize];
        let from = points[k] - sum / weight.max(f64::MIN_POSITIVE);
        volumes[region[k] as usize] += elements[k].spacing.powi(2) * from.dot(elements[k].normal);
    }
    for (element, &region) in elements.iter_mut().zip(region) {
        if volumes[region as usize] < 0.0 {
            element.normal = -element.normal;
        }
    }
}

/// Takes the sides from given normals (zero where unknown): each point takes the side of the majority of its
/// neighbourhood. Returns `false`, and changes nothing, if the given normals were never oriented: neighbouring ones
/// contradict each other at more than a twentieth of the links.
pub(super) fn side_with(
    elements: &mut [Element],
    table: &NeighbourTable,
    alive: &(dyn Fn(usize) -> bool + Sync),
    given: &[DVec3],
) -> bool {
    let seen: &[Element] = elements;
    let near = |k: usize| {
        table
            .of(k)
            .iter()
            .map(|&j| j as usize)
            .filter(|&j| alive(j))
    };
    let counts = each(elements.len(), |k| {
        let (mut links, mut against) = (0_u32, 0_u32);
        for j in near(k).take(VOTING_NEIGHBOURS).filter(|_| alive(k)) {
            let same = seen[k].normal.dot(seen[j].normal);
            let said = given[k].dot(seen[k].normal) * given[j].dot(seen[j].normal);
            if same.abs() > PARALLEL_COSINE && said.abs() > MIN_SIDE_PRODUCT {
                links += 1;
                against += u32::from(said * same < 0.0);
            }
        }
        (u64::from(links), u64::from(against))
    });
    let (links, against) = counts.iter().fold((0, 0), |(a, b), (c, d)| (a + c, b + d));
    if links == 0 || against * TESTS_PER_CONTRADICTION > links {
        return false;
    }
    let turned = each(elements.len(), |k| {
        let mut vote = OWN_SIDE_WEIGHT * given[k].dot(seen[k].normal);
        for j in near(k) {
            vote += given[j].dot(seen[k].normal).clamp(-1.0, 1.0);
        }
        vote < 0.0
    });
    for (element, turned) in elements.iter_mut().zip(turned) {
        if turned {
            element.normal = -element.normal;
        }
    }
    true
}
