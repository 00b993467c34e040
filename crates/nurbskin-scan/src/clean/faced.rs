//! Neighbourhoods of points that came with normals, or with the place of the scanner: those that look the same way.

use super::elements::{Element, Elements, NEIGHBOURS, isolation, offsets, spacing_of};
use crate::normals::plane_through;
use crate::{Organisation, Scan};
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::{each, gather};
use nurbskin_geometry::spatial::neighbours::{Nearest, Neighbours};

/// Cosine of the angle between two normals, 105 degrees, beyond which their points lie on different walls: those of
/// the faces of a box, give or take their noise, still meet.
pub(super) const OPPOSED: f64 = -0.25;
/// Points that are asked whether the normals can be believed.
const PROBES: usize = 4000;
/// Number of nearest points through which the plane at a place is laid.
const PLANE: usize = 12;
/// Number of nearest points whose sides are compared there.
const NEAREST: usize = 24;
/// Fewest neighbours with a plane of their own.
const FEWEST: usize = 5;
/// A normal agrees with a plane up to 45 degrees, ...
const AGREES: f64 = 0.7;
/// ... and so it must at this part of the points: estimates go astray at edges, and on thin walls that have few.
const BELIEVED: f64 = 0.8;
/// Two points lie on one wall if their chord leaves both planes by no more than this part of its length.
const FLAT: f64 = 0.2;
/// Part of such pairs that may look opposite ways: normals that nobody oriented do so at half of them.
const CONTRARY: f64 = 0.05;
/// Cosine between a normal and the line of sight, 78 degrees, below which it may look to either side.
const GRAZING: f64 = 0.2;
/// Leaves of the tree that are searched for neighbours that look the same way.
const LEAVES: usize = 200;

/// The unit normals that the file gives points in spatial order, zero where it has none, or those of their planes on the side
/// that the scanner saw, if they are those of the surface and say on which side it is; `None` else.
pub(super) fn believed(
    scan: &Scan,
    order: &[u32],
    tree: &Neighbours,
    elements: &Elements,
) -> Option<Vec<DVec3>> {
    // A mesh knows its own surface better.
    if matches!(scan.organisation, Organisation::Mesh(_)) {
        return None;
    }
    of_file(scan, order, tree).or_else(|| {
        let given = towards_scanner(scan, order, tree, elements)?;
        are_normals(tree, &given).then_some(given)
    })
}

/// The normals of the planes of all points, on the side that the scanner saw. Where it hardly saw either, most of the
/// neighbours say which.
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
    let is_clear = |k: usize| along[k].abs() > GRAZING;
    Some(each(order.len(), |k| {
        let own = elements.of[k].normal;
        let side = if is_clear(k) {
            along[k]
        } else {
            let row = elements.table.of(k).iter().map(|&j| j as usize);
            let votes = row.filter(|&j| is_clear(j));
            let vote = |j: usize| elements.of[j].normal.dot(own) * along[j].signum();
            0.5 * along[k] + votes.map(vote).sum::<f64>()
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

/// Whether the planes of those that look the same way agree with the normals, and points of one wall with each other.
fn are_normals(tree: &Neighbours, given: &[DVec3]) -> bool {
    let points = tree.sorted_points();
    let step = tree.len().div_ceil(PROBES).max(1);
    let votes = each(tree.len().div_ceil(step), |probe| {
        let k = probe * step;
        if given[k] == DVec3::ZERO {
            return [1_u32, 0, 0, 0];
        }
        let mut near = Nearest::default();
        tree.search(points[k], NEAREST, &mut near, |j| j as usize != k);
        let (mut pairs, mut contrary) = (0, 0);
        let mut own = [DVec3::ZERO; PLANE];
        let mut count = 0;
        for j in near.indices().map(|j| j as usize) {
            let d = points[j] - points[k];
            let same = given[k].dot(given[j]);
            let rise = d.dot(given[k]).abs().max(d.dot(given[j]).abs());
            if same.abs() > AGREES && rise <= FLAT * d.length() {
                pairs += 1;
                contrary += u32::from(same < 0.0);
            }
            if same > OPPOSED && count < PLANE {
                own[count] = d;
                count += 1;
            }
        }
        let agrees = count >= FEWEST && {
            let (_, plane) = plane_through(&own[..count]);
            plane.dot(given[k]).abs() > AGREES
        };
        [1, u32::from(agrees), pairs, contrary]
    });
    let [asked, agree, pairs, contrary] = votes.iter().fold([0_u64; 4], |sum, vote| {
        std::array::from_fn(|i| sum[i] + u64::from(vote[i]))
    });
    agree as f64 >= BELIEVED * asked as f64 && contrary as f64 <= CONTRARY * pairs as f64
}

impl Elements {
    /// Turns the normals to the side of those given, and examines points again that have neighbours on a wall that
    /// looks the other way, without these. O(n).
    pub(super) fn face(&mut self, tree: &Neighbours, given: &[DVec3], alive: &dyn Fn(u32) -> bool) {
        self.faced = true;
        let count = self.table.count();
        let (mut near, mut own) = (Nearest::default(), [DVec3::ZERO; NEIGHBOURS]);
        for k in 0..self.of.len() {
            if given[k] == DVec3::ZERO {
                continue;
            }
            let faces = |j: u32| given[k].dot(given[j as usize]) > OPPOSED;
            if count == NEIGHBOURS && self.table.of(k).iter().any(|&j| !faces(j)) {
                let point = tree.sorted_points()[k];
                let keep = |j: u32| j as usize != k && faces(j) && alive(j);
                if tree.search_some(point, count, &mut near, LEAVES, keep)
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
            if along.abs() < 0.5 {
                // The plane went astray.
                self.of[k].normal = given[k];
            } else if along < 0.0 {
                self.of[k].normal = -self.of[k].normal;
            }
        }
    }
}
