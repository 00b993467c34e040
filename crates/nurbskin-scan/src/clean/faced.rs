//! Neighbourhoods by given normals: the neighbours whose normals look to the same side.
//!
//! The normals of the file, or those of the local planes turned towards the scanner, are used if they pass a test on a
//! sample of probes: `|cos| > 0.7` between normal and plane at four fifths of the probes, and at most a twentieth of
//! the pairs on one wall that look to opposite sides. Neighbours with `n_p · n_q ≤ -0.25` (105°) then lie on another
//! wall and are replaced. Source: ours.

use super::elements::{Element, Elements, NEIGHBOURS, isolation, offsets, spacing_of};
use crate::normals::plane_through;
use crate::{Organisation, Scan};
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::{each, gather};
use nurbskin_geometry::spatial::neighbours::{Nearest, Neighbours};

/// Cosine of the angle between two normals (105°) beyond which their points lie on different walls. Trial: not
/// recorded. At -0.25 the faces of a box (90°) still meet with a margin of 15° for noise; a value near -1 would miss
/// walls that are not parallel.
pub(super) const OPPOSED_COSINE: f64 = -0.25;
/// Points on which the given normals are tested. Guard: bounds the time of the test; a share found on 4000 points has a
/// standard error below 0.8 %.
const NORMAL_PROBES: usize = 4000;
/// Most nearest points of one wall through which the test lays a plane. Trial: not recorded.
const NORMAL_PLANE_POINTS: usize = 12;
/// Nearest points whose normals are compared with that of a probe. Trial: not recorded. Twice [`NORMAL_PLANE_POINTS`]:
/// on a thin wall half of the neighbours lie on the other side.
const NORMAL_TEST_NEIGHBOURS: usize = 24;
/// Fewest points of one wall through which the test lays a plane. Guard: a plane takes three points, two more average
/// its noise.
const MIN_NORMAL_PLANE_POINTS: usize = 5;
/// Absolute cosine (45°) above which a given normal agrees with a plane or with another normal. Trial: not recorded.
const NORMAL_AGREEMENT_COSINE: f64 = 0.7;
/// Share of the probes whose given normal must agree with the plane. Trial: not recorded. Not all can agree: estimated
/// normals are wrong at edges and on thin walls with few points.
const MIN_AGREEING_SHARE: f64 = 0.8;
/// Largest height of either point above the plane of the other, as a share of their distance (12°), for the pair to lie
/// on one wall. Trial: not recorded.
const SAME_WALL_SLOPE: f64 = 0.2;
/// Largest share of the pairs on one wall whose normals may look to opposite sides. Trial: not recorded. Normals that
/// were never oriented do so at half of the pairs.
const MAX_CONTRARY_SHARE: f64 = 0.05;
/// Absolute cosine between a plane normal and the line of sight (78°) below which the scanner does not determine the
/// side, and the neighbours vote. Trial: not recorded.
const GRAZING_COSINE: f64 = 0.2;
/// Weight of the point's own line of sight in that vote; each neighbour has a weight up to 1. Trial: not recorded.
const GRAZING_VOTE: f64 = 0.5;
/// Leaves of the search tree that are visited for neighbours on the same wall. Guard: bounds the time of a search that
/// finds none nearby; the point then keeps its first neighbours.
const FACED_SEARCH_LEAVES: usize = 200;
/// Absolute cosine (60°) between the plane normal and the given normal of a point below which the given normal replaces
/// the plane's. Trial: not recorded.
const MISLED_PLANE_COSINE: f64 = 0.5;

/// The unit normals of the file in spatial order (zero where it has none), or those of the local planes turned towards
/// the scanner, if they are the normals of the surface and consistently oriented; `None` otherwise.
pub(super) fn believed(
    scan: &Scan,
    order: &[u32],
    tree: &Neighbours,
    elements: &Elements,
) -> Option<Vec<DVec3>> {
    // The triangles of a mesh give better normals.
    if matches!(scan.organisation, Organisation::Mesh(_)) {
        return None;
    }
    of_file(scan, order, tree).or_else(|| {
        let given = towards_scanner(scan, order, tree, elements)?;
        are_normals(tree, &given).then_some(given)
    })
}

/// The normals of the local planes, turned towards the scanner. Where the line of sight is nearly tangential, the
/// neighbours vote.
fn towards_scanner(
    scan: &Scan,
    order: &[u32],
    tree: &Neighbours,
    elements: &Elements,
) -> Option<Vec<DVec3>> {
    if scan.viewpoints.is_empty() {
        return None;
    }
    let points = tree.sorted_points();
    let along = each(order.len(), |k| {
        let place = scan.seen_from(order[k] as usize);
        let sight = place.map_or(DVec3::ZERO, |place| place - points[k]);
        elements.of[k].normal.dot(sight.normalize_or_zero())
    });
    let is_clear = |k: usize| along[k].abs() > GRAZING_COSINE;
    Some(each(order.len(), |k| {
        let own = elements.of[k].normal;
        let side = if is_clear(k) {
            along[k]
        } else {
            let row = elements.table.of(k).iter().map(|&j| j as usize);
            let votes = row.filter(|&j| is_clear(j));
            let vote = |j: usize| elements.of[j].normal.dot(own) * along[j].signum();
            GRAZING_VOTE * along[k] + votes.map(vote).sum::<f64>()
        };
        if side < 0.0 { -own } else { own }
    }))
}

fn of_file(scan: &Scan, order: &[u32], tree: &Neighbours) -> Option<Vec<DVec3>> {
    let file = scan.normals.as_ref()?;
    if file.len() != scan.points.len() {
        return None;
    }
    let mut given = gather(file, order);
    for n in &mut given {
        *n = if n.is_finite() {
            n.normalize_or_zero()
        } else {
            DVec3::ZERO
        };
    }
    are_normals(tree, &given).then_some(given)
}

/// Whether given normals agree with the planes through neighbours of the same side, and with each other on one wall.
fn are_normals(tree: &Neighbours, given: &[DVec3]) -> bool {
    let points = tree.sorted_points();
    let step = tree.len().div_ceil(NORMAL_PROBES).max(1);
    let votes = each(tree.len().div_ceil(step), |probe| {
        let k = probe * step;
        if given[k] == DVec3::ZERO {
            return [1_u32, 0, 0, 0];
        }
        let mut near = Nearest::default();
        tree.search(points[k], NORMAL_TEST_NEIGHBOURS, &mut near, |j| {
            j as usize != k
        });
        let (mut pairs, mut contrary) = (0, 0);
        let mut own = [DVec3::ZERO; NORMAL_PLANE_POINTS];
        let mut count = 0;
        for j in near.indices().map(|j| j as usize) {
            let d = points[j] - points[k];
            let same = given[k].dot(given[j]);
            let rise = d.dot(given[k]).abs().max(d.dot(given[j]).abs());
            if same.abs() > NORMAL_AGREEMENT_COSINE && rise <= SAME_WALL_SLOPE * d.length() {
                pairs += 1;
                contrary += u32::from(same < 0.0);
            }
            if same > OPPOSED_COSINE && count < NORMAL_PLANE_POINTS {
                own[count] = d;
                count += 1;
            }
        }
        let agrees = count >= MIN_NORMAL_PLANE_POINTS && {
            let (_, plane) = plane_through(&own[..count]);
            plane.dot(given[k]).abs() > NORMAL_AGREEMENT_COSINE
        };
        [1, u32::from(agrees), pairs, contrary]
    });
    let [asked, agree, pairs, contrary] = votes.iter().fold([0_u64; 4], |sum, vote| {
        std::array::from_fn(|i| sum[i] + u64::from(vote[i]))
    });
    agree as f64 >= MIN_AGREEING_SHARE * asked as f64
        && contrary as f64 <= MAX_CONTRARY_SHARE * pairs as f64
}

impl Elements {
    /// Turns the normals to the side of the given ones. Points with neighbours on a wall that looks to the opposite
    /// side are computed again without these. O(n).
    pub(super) fn face(&mut self, tree: &Neighbours, given: &[DVec3], alive: &dyn Fn(u32) -> bool) {
        self.faced = true;
        let count = self.table.count();
        let (mut near, mut own) = (Nearest::default(), [DVec3::ZERO; NEIGHBOURS]);
        for k in 0..self.of.len() {
            if given[k] == DVec3::ZERO {
                continue;
            }
            let faces = |j: u32| given[k].dot(given[j as usize]) > OPPOSED_COSINE;
            if count == NEIGHBOURS && self.table.of(k).iter().any(|&j| !faces(j)) {
                let point = tree.sorted_points()[k];
                let keep = |j: u32| j as usize != k && faces(j) && alive(j);
                if tree.search_some(point, count, &mut near, FACED_SEARCH_LEAVES, keep)
                    && near.items.len() == count
                {
                    let row = self.table.of_mut(k);
                    for (cell, index) in row.iter_mut().zip(near.indices()) {
                        *cell = index;
                    }
                    offsets(tree.sorted_points(), point, row, &mut own);
                    let (reach, one_sided) = isolation(&own);
                    self.of[k] = Element {
                        normal: plane_through(&own).1,
                        spacing: spacing_of(&near),
                        reach,
                        one_sided,
                        ..self.of[k]
                    };
                }
            }
            let along = self.of[k].normal.dot(given[k]);
            if along.abs() < MISLED_PLANE_COSINE {
                // The plane lies across two walls.
                self.of[k].normal = given[k];
            } else if along < 0.0 {
                self.of[k].normal = -self.of[k].normal;
            }
        }
    }
}
