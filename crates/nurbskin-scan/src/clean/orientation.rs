//! Which side of the normals is outside.

use super::elements::Element;
use super::signed_sets::SignedSets;
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::spatial::neighbours::NeighbourTable;

/// Neighbours of a point that carry the side on.
const LINKS: usize = 10;
/// Links that cost no more (normals within 8 to 23 degrees) leave little doubt, and need no exact order.
const STEPS: [f64; 4] = [0.01, 0.02, 0.04, 0.08];

/// What a link between two points says of their sides.
struct Link {
    /// 0 if their normals are those of a circular arc through both; more the less they are, and the less the link
    /// runs along the surface.
    cost: f64,
    /// Whether one of the normals must be turned.
    turned: bool,
}

/// The second normal should be the first one's mirror image in the plane half-way: so it is on a circular arc, even
/// on one that turns back as the rim of a thin wall does (Koenig & Gumhold 2009, *Consistent propagation of normal
/// orientations in point clouds*).
fn link(points: &[DVec3], elements: &[Element], k: usize, j: usize) -> Link {
    let along = points[j] - points[k];
    let (a, b) = (elements[k].normal, elements[j].normal);
    let (rise, fall) = (a.dot(along), b.dot(along));
    // Different points are not at one place.
    let part = 1.0 / along.length_squared().max(f64::MIN_POSITIVE);
    let agreement = a.dot(b) - 2.0 * rise * fall * part;
    Link {
        cost: 1.0 - agreement.abs() + 0.5 * (rise * rise + fall * fall) * part,
        turned: agreement < 0.0,
    }
}

/// Turns the normals of points in spatial order so that neighbours agree: along a minimum spanning forest of the
/// links (Hoppe et al. 1992); then each connected region as a whole so that it encloses a positive volume, which for an open
/// one is reckoned from its middle: most of it then looks outward. O(n).
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
        let row = &row[..row.len().min(LINKS)];
        row.iter().map(|&j| j as usize).filter(|&j| alive(j))
    };
    let judge = |k: usize, j: usize| Some(cost_and_turn(points, seen, k, j));
    let sets = SignedSets::spanning(points.len(), &STEPS, links, judge);
    for (element, turned) in elements.iter_mut().zip(&sets.turned) {
        if *turned {
            element.normal = -element.normal;
        }
    }
    // 2. The middle of each region, by area, and the volume seen from there.
    let (region, count) = sets.numbered();
    drop(sets);
    turn_outward(points, elements, &region, count, alive);
}

/// What a link between two points costs, and whether it turns.
pub(super) fn cost_and_turn(
    points: &[DVec3],
    elements: &[Element],
    k: usize,
    j: usize,
) -> (f64, bool) {
    let found = link(points, elements, k, j);
    (found.cost, found.turned)
}

/// Turns each of `count` regions so that it encloses a positive volume, seen from its middle. O(n).
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

/// Sides said by normals that came with the points (zero where not known). Each point takes the side that most of
/// its neighbourhood says, if what they say is consistent: where neighbouring normals contradict each other at more
/// than a twentieth of the links, they were never oriented, and `false` is returned.
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
        for j in near(k).take(4).filter(|_| alive(k)) {
            let same = seen[k].normal.dot(seen[j].normal);
            let said = given[k].dot(seen[k].normal) * given[j].dot(seen[j].normal);
            if same.abs() > 0.7 && said.abs() > 0.1 {
                links += 1;
                against += u32::from(said * same < 0.0);
            }
        }
        (u64::from(links), u64::from(against))
    });
    let (links, against) = counts.iter().fold((0, 0), |(a, b), (c, d)| (a + c, b + d));
    if links == 0 || against * 20 > links {
        return false;
    }
    let turned = each(elements.len(), |k| {
        let mut vote = 2.0 * given[k].dot(seen[k].normal);
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
