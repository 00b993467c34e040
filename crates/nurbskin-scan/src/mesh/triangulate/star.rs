//! The Delaunay star of each point in its tangent plane.
//!
//! The star is dual to the Voronoi cell of the point: an octagon in the tangent plane is clipped by the half-planes `x
//! · t ≤ ½ (|d|² + w - w_j)` of the neighbours on the same sheet, with d the offset to a neighbour, t that offset
//! turned into the plane at equal length, and w the weights of the sites. Consecutive neighbours around the cell and
//! the point make a triangle.
//!
//! Source: Gopi, Krishnan and Silva 2000 (DOI 10.1111/1467-8659.00439).

use super::sites::Sites;
use super::{MAX_CIRCUMRADIUS, SITE_CHUNK};
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::math;
use nurbskin_geometry::progress::Progress;
use rayon::prelude::*;

/// Numbers of nearest neighbours examined in turn where the first 24 do not enclose the Voronoi cell of a point. Trial:
/// not recorded.
const WIDER_NEIGHBOUR_COUNTS: [usize; 2] = [48, 96];
/// Circumradius of the octagon that a cell begins with, in the largest circumradius of a triangle. Derived: more than 1
/// / cos 22.5° = 1.082, so that the octagon contains the disc of all admissible corners.
const OCTAGON_RADIUS: f64 = 1.1;
/// Distance, in the radius of the cell, beyond which no neighbour cuts the cell. Derived: the bisector of a neighbour
/// lies half-way; 5 % allow for the weights of the sites.
const CUTTING_DISTANCE: f64 = 2.1;

/// A triangle, and the number of its corners with it in their star.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vote {
    /// Corners, ascending.
    pub(super) triangle: [u32; 3],
    pub(super) count: u8,
}

/// The triangles of all stars, those with most votes first, then by circumradius.
pub(super) fn votes(sites: &Sites, progress: &dyn Progress) -> Result<Vec<Vote>> {
    let count = sites.points.len();
    let chunks = count.div_ceil(SITE_CHUNK);
    let of_chunk = |chunk: usize| -> Result<Vec<[u32; 3]>> {
        progress.check()?;
        let mut cell = Cell::default();
        let mut found = Vec::with_capacity(6 * SITE_CHUNK);
        for k in (0..u32::MAX)
            .take(count)
            .skip(chunk * SITE_CHUNK)
            .take(SITE_CHUNK)
        {
            cell.star(sites, k, &mut found);
        }
        Ok(found)
    };
    let lists: Vec<Vec<[u32; 3]>> = (0..chunks)
        .into_par_iter()
        .map(of_chunk)
        .collect::<Result<_>>()?;
    let mut all = lists.concat();
    all.sort_unstable();
    let mut votes: Vec<(u8, f64, [u32; 3])> = all
        .chunk_by(|a, b| a == b)
        .filter(|equal| equal.len() > 1)
        .map(|equal| {
            let triangle = equal[0];
            let [a, b, c] = triangle.map(|k| sites.points[k as usize]);
            let count = if equal.len() > 2 { 3 } else { 2 };
            (count, circumradius(a, b, c), triangle)
        })
        .collect();
    votes.sort_unstable_by(|a, b| b.0.cmp(&a.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    let vote = |(count, _, triangle)| Vote { triangle, count };
    Ok(votes.into_iter().map(vote).collect())
}

/// Radius of the circle through three points; infinite on a line.
pub(super) fn circumradius(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let (u, v) = (b - a, c - a);
    let sides = u.length() * v.length() * (c - b).length();
    0.5 * sides / u.cross(v).length()
}

/// No neighbour: marks a side of the first polygon. Guard: any index beyond the points does.
const NO_NEIGHBOUR: u32 = u32::MAX;

/// A corner of a cell and the neighbour beyond the side from here to the next corner.
#[derive(Clone, Copy, Debug)]
struct Corner {
    at: DVec2,
    beyond: u32,
}

/// The Voronoi cell of a point in its tangent plane.
#[derive(Debug, Default)]
struct Cell {
    corners: Vec<Corner>,
    /// For clipping.
    spare: Vec<Corner>,
}

impl Cell {
    /// Appends the triangles of the star of `point`, corners ascending.
    fn star(&mut self, sites: &Sites, point: u32, found: &mut Vec<[u32; 3]>) {
        let k = point as usize;
        let row = sites.table.of(k);
        // The largest spacing on the same sheet nearby limits the triangles.
        let widest = row
            .iter()
            .map(|&j| j as usize)
            .filter(|&j| sites.same_sheet(k, j));
        let limit = MAX_CIRCUMRADIUS
            * widest
                .map(|j| sites.spacing[j])
                .fold(sites.spacing[k], f64::max);
        if !(limit > 0.0 && limit.is_finite()) {
            return;
        }
        let mut complete = self.cut(sites, k, row, limit);
        for count in WIDER_NEIGHBOUR_COUNTS {
            if complete || sites.table.count() + 1 >= sites.points.len() {
                break;
            }
            let row = sites.tree.nearest(sites.points[k], count + 1);
            complete = self.cut(sites, k, &row, limit);
        }
        let mut before = self.corners.last().map_or(NO_NEIGHBOUR, |c| c.beyond);
        for corner in &self.corners {
            let after = corner.beyond;
            if before != NO_NEIGHBOUR && after != NO_NEIGHBOUR && corner.at.length() <= limit {
                let mut triangle = [point, before, after];
                triangle.sort_unstable();
                let [a, b, c] = triangle.map(|k| k as usize);
                let spacing = sites.spacing[a].max(sites.spacing[b]).max(sites.spacing[c]);
                let [p, q, r] = [a, b, c].map(|k| sites.points[k]);
                if circumradius(p, q, r) <= MAX_CIRCUMRADIUS * spacing {
                    found.push(triangle);
                }
            }
            before = after;
        }
    }

    /// Cuts the cell of point `k` with the neighbours `row`, nearest first. Returns `false` if neighbours beyond these
    /// might cut it further within `limit`.
    fn cut(&mut self, sites: &Sites, k: usize, row: &[u32], limit: f64) -> bool {
        let (origin, normal) = (sites.points[k], sites.normals[k]);
        let (across, along) = normal.any_orthonormal_pair();
        self.corners.clear();
        for corner in 0..8_u8 {
            let angle = std::f64::consts::FRAC_PI_4 * f64::from(corner);
            self.corners.push(Corner {
                at: math::unit_vector(angle) * (OCTAGON_RADIUS * limit),
                beyond: NO_NEIGHBOUR,
            });
        }
        let mut reach = self.reach(limit);
        let mut distance = 0.0;
        for &j in row {
            let at = j as usize;
            let d = sites.points[at] - origin;
            distance = d.length();
            if distance > CUTTING_DISTANCE * reach {
                return true;
            }
            if at == k || !sites.same_sheet(k, at) {
                continue;
            }
            // Turned into the plane about the origin, at equal distance.
            let flat = DVec2::new(d.dot(across), d.dot(along));
            let flat = flat * (distance / flat.length().max(f64::MIN_POSITIVE));
            let offset = 0.5 * (distance * distance + sites.weights[k] - sites.weights[at]);
            if self.clip(flat, offset, j) {
                reach = self.reach(limit);
            }
        }
        distance > 2.0 * reach
    }

    /// Radius of the cell, at most `limit`.
    fn reach(&self, limit: f64) -> f64 {
        let far = self.corners.iter().map(|c| c.at.length_squared());
        far.fold(0.0, f64::max).sqrt().min(limit)
    }

    /// Clips the cell to the half-plane x . `towards` <= `offset`. Returns whether anything was cut off.
    fn clip(&mut self, towards: DVec2, offset: f64, neighbour: u32) -> bool {
        let side = |c: &Corner| c.at.dot(towards) - offset;
        if self.corners.iter().all(|c| side(c) <= 0.0) {
            return false;
        }
        self.spare.clear();
        for (k, corner) in self.corners.iter().enumerate() {
            let next = &self.corners[(k + 1) % self.corners.len()];
            let (here, there) = (side(corner), side(next));
            if here <= 0.0 {
                self.spare.push(*corner);
            }
            if (here <= 0.0) != (there <= 0.0) {
                self.spare.push(Corner {
                    at: corner.at + (next.at - corner.at) * (here / (here - there)),
                    // Where the polygon leaves the half-plane, the new side begins; where it enters, the old one
                    // continues.
                    beyond: if here <= 0.0 {
                        neighbour
                    } else {
                        corner.beyond
                    },
                });
            }
        }
        std::mem::swap(&mut self.corners, &mut self.spare);
        true
    }
}
