//! Fewer triangles for the same surface.

mod corners;
mod quadric;
mod queue;

use super::manifold::{Manifold, NONE, after, before};
use super::repair::surface::borders;
use corners::{Around, Corners};
use glam::DVec3;
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result};
use quadric::Quadric;

/// Sweeps in storage order reduce the mesh to this multiple of the wanted vertices. A queue with the cheapest edge first does
/// the rest: it is slower and places the vertices better.
const SWEPT: usize = 3;
/// A sweep takes edges that cost no more than this part of all edges do: low enough to come near to the best order, high
/// enough for few sweeps.
const CHEAP: f64 = 0.4;
/// So many edges tell what edges cost: their quantiles are right to within 2 %.
const SAMPLE: usize = 2048;
/// A sweep that takes less than this part of the vertices is followed by one that takes any edge; if that takes no more
/// either, sweeping has come to its end.
const STUCK: f64 = 0.02;
/// Cosine of the angle by which a collapse may turn a triangle: less than a right angle, so that none is turned over; 75
/// degrees.
const TURN: f64 = 0.26;
/// Least shape of a triangle that a collapse makes, 1 being equilateral and 0 a line, unless one around was worse before:
/// that of a triangle with two equal sides and an angle of 7 degrees between them.
const SHAPE: f64 = 0.2;
/// Edges between two questions whether to go on.
const CHECK: usize = 1 << 16;

/// A mesh after [`decimate`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decimated {
    /// The same surface of fewer triangles. Each vertex has as its source the least one of the vertices that it stands for.
    pub manifold: Manifold,
    /// For each vertex of the mesh that was decimated the one that stands for it; none if the vertex has no triangle.
    pub into: Vec<Option<u32>>,
}

/// Takes vertices from a mesh by edge collapse until at most `wanted` are left, or until none can go: the genus, the borders
/// and the side that the surface faces stay what they are, and no triangle is turned over.
///
/// Collapses go by the quadric error, and by how evenly they leave the vertices spread; borders are followed as the surface
/// is. Where a mesh has many times the vertices wanted, sweeps that take any cheap edge come before the best edge first.
/// About O(n log n): 1 us per vertex. 300 bytes per vertex. The result depends on the order of vertices and triangles.
///
/// Sources: M. Garland, P. S. Heckbert, *Surface simplification using quadric error metrics*, SIGGRAPH 1997; T. K. Dey, H.
/// Edelsbrunner, S. Guha, D. V. Nekhayev, *Topology preserving edge contraction*, 1999.
///
/// # Errors
/// [`Error::Invalid`] for points that do not exist or are not finite, and for triangles that are no oriented manifold;
/// [`Error::Cancelled`].
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_scan::mesh::Manifold;
/// use nurbskin_scan::mesh::decimate::decimate;
/// use nurbskin_scan::mesh::repair::repair;
/// use nurbskin_geometry::progress::Silent;
/// // A flat square of 51 x 51 points.
/// let points: Vec<DVec3> = (0..51 * 51).map(|k| DVec3::new(f64::from(k % 51), f64::from(k / 51), 0.0)).collect();
/// let cells = (0..50 * 51_u32).filter(|k| k % 51 < 50);
/// let triangles: Vec<[u32; 3]> = cells.flat_map(|k| [[k, k + 1, k + 52], [k, k + 52, k + 51]]).collect();
/// let mesh = repair(&points, &triangles, &Silent)?.manifold;
/// let few = decimate(&mesh, 200, &Silent)?.manifold;
/// assert_eq!(few.points.len(), 200);
/// assert_eq!((few.genus(), few.loops.len()), (0, 1));
/// assert!((few.area() / mesh.area() - 1.0).abs() < 0.01);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
pub fn decimate(mesh: &Manifold, wanted: usize, progress: &dyn Progress) -> Result<Decimated> {
    let usable = |&k: &u32| mesh.points.get(k as usize).is_some_and(|p| p.is_finite());
    if !mesh.triangles.as_flattened().iter().all(usable) {
        return Err(Error::invalid(
            "decimating a mesh needs triangles between finite points",
        ));
    }
    let Some(corners) = Corners::new(&mesh.triangles, mesh.points.len()) else {
        return Err(Error::invalid(
            "decimating needs an oriented manifold; repair the mesh first",
        ));
    };
    progress.check()?;
    let mut work = Work::new(mesh, corners);
    progress.check()?;
    work.sweep_down_to(SWEPT.saturating_mul(wanted), progress)?;
    queue::best_first(&mut work, wanted, progress)?;
    Ok(work.finish(mesh))
}

/// A mesh that is being decimated.
struct Work {
    corners: Corners,
    /// From the middle of the box around them, in parts of its diagonal.
    points: Vec<DVec3>,
    quadrics: Vec<Quadric>,
    /// What each vertex became part of; itself as long as it is there.
    parent: Vec<u32>,
    middle: DVec3,
    size: f64,
    around: Around,
}

impl Work {
    fn new(mesh: &Manifold, corners: Corners) -> Self {
        let [low, high] = bounding_box(&mesh.points);
        let middle = low + 0.5 * (high - low);
        let size = low.distance(high);
        let size = if size > 0.0 && size.is_finite() {
            size
        } else {
            1.0
        };
        let points: Vec<DVec3> = mesh.points.iter().map(|&p| (p - middle) / size).collect();
        let mut quadrics = vec![Quadric::default(); points.len()];
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            let of = |s: usize| points[triangle[s % 3] as usize];
            let third = Quadric::of_triangle([0, 1, 2].map(of));
            for (s, &k) in triangle.iter().enumerate() {
                let mut all = third;
                let next = triangle[(s + 1) % 3] as usize;
                if corners.opposite[3 * t + s] == NONE {
                    let half = Quadric::of_border([s, s + 1, s + 2].map(of));
                    quadrics[next] = quadrics[next].plus(&half);
                    all = all.plus(&half);
                }
                quadrics[k as usize] = quadrics[k as usize].plus(&all);
            }
        }
        Self {
            parent: (0..).take(points.len()).collect(),
            corners,
            points,
            quadrics,
            middle,
            size,
            around: Around::default(),
        }
    }

    /// What it costs to make one vertex of the ends of an edge, and where that belongs. A border keeps its vertices.
    fn price(&self, side: u32) -> (f64, DVec3) {
        let ends = self.corners.ends(side);
        let [a, b] = ends.map(|k| self.points[k as usize]);
        let [p, q] = ends.map(|k| &self.quadrics[k as usize]);
        let both = p.plus(q);
        let place = match ends.map(|k| self.corners.on_border(k)) {
            [true, false] => a,
            [false, true] => b,
            _ => both.least().unwrap_or_else(|| a.midpoint(b)),
        };
        (both.at(place), place)
    }

    /// Makes one vertex of the ends of an edge if nothing speaks against it; the first end is left.
    fn collapse(&mut self, side: u32, place: DVec3) -> bool {
        let mut around = std::mem::take(&mut self.around);
        let may = self.corners.may_collapse(side, &mut around) && self.fits(side, &around, place);
        if may {
            let [left, gone] = self.corners.ends(side);
            let [a, b] = [left, gone].map(|k| k as usize);
            self.corners.collapse(side, &around);
            self.points[a] = place;
            self.quadrics[a] = self.quadrics[a].plus(&self.quadrics[b]);
            self.parent[b] = left;
        }
        self.around = around;
        may
    }

    /// Whether the triangles around an edge stay as they face, and none comes out worse than the worst before, if its ends
    /// move to a place.
    fn fits(&self, side: u32, around: &Around, place: DVec3) -> bool {
        let gone = [side, self.corners.other(side)].map(|s| s / 3);
        let at = |s: u32| self.points[self.corners.start(s) as usize];
        let (mut worst_before, mut worst) = (SHAPE, f64::INFINITY);
        for &s in around.fans.iter().flatten() {
            let (next, last) = (at(after(s)), at(before(s)));
            let (old, shape) = faced([at(s), next, last]);
            worst_before = worst_before.min(shape);
            if gone.contains(&(s / 3)) {
                continue;
            }
            let (new, shape) = faced([place, next, last]);
            worst = worst.min(shape);
            if old.dot(new) < TURN * old.length() * new.length() {
                return false;
            }
        }
        worst >= worst_before
    }

    /// Takes cheap edges in the order of storage until at most so many vertices are left.
    fn sweep_down_to(&mut self, wanted: usize, progress: &dyn Progress) -> Result<()> {
        let mut any = false;
        while self.corners.vertices > wanted {
            let limit = if any { f64::INFINITY } else { self.cheap() };
            let before = self.corners.vertices;
            self.sweep(limit, wanted, progress)?;
            let taken = (before - self.corners.vertices) as f64;
            if taken < STUCK * before as f64 {
                if any {
                    break;
                }
                any = true;
            }
        }
        Ok(())
    }

    /// Collapses edges that cost no more than `limit`, each vertex once at most.
    fn sweep(&mut self, limit: f64, wanted: usize, progress: &dyn Progress) -> Result<()> {
        let mut touched = vec![false; self.points.len()];
        for side in 0..self.corners.vertex.len() {
            if side.is_multiple_of(CHECK) {
                progress.check()?;
            }
            if self.corners.vertices <= wanted {
                break;
            }
            let Some(side) = u32::try_from(side)
                .ok()
                .filter(|&s| self.corners.is_edge(s))
            else {
                continue;
            };
            let ends = self.corners.ends(side).map(|k| k as usize);
            if ends.iter().any(|&k| touched[k]) {
                continue;
            }
            let (cost, place) = self.price(side);
            if cost <= limit && self.collapse(side, place) {
                touched[ends[0]] = true;
            }
        }
        Ok(())
    }

    /// What the cheaper edges cost at most.
    fn cheap(&self) -> f64 {
        let step = (self.corners.triangles * 3 / 2 / SAMPLE).max(1);
        let edges = self.corners.edges().step_by(step);
        let mut costs: Vec<f64> = edges.map(|side| self.price(side).0).collect();
        costs.sort_by(f64::total_cmp);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a part of a count"
        )]
        let at = (CHEAP * costs.len() as f64) as usize;
        costs.get(at).copied().unwrap_or(f64::INFINITY)
    }

    /// The triangles that are left, numbered anew.
    fn finish(mut self, mesh: &Manifold) -> Decimated {
        let corners = &self.corners;
        let mut number = vec![NONE; self.points.len()];
        let mut manifold = Manifold::default();
        for (k, &first) in corners.first.iter().enumerate() {
            if first != NONE {
                number[k] = u32::try_from(manifold.points.len()).unwrap_or(NONE);
                manifold
                    .points
                    .push(self.middle + self.size * self.points[k]);
            }
        }
        let mut place = vec![NONE; corners.vertex.len() / 3];
        for (t, triangle) in corners.vertex.as_chunks::<3>().0.iter().enumerate() {
            if triangle[0] != NONE {
                place[t] = u32::try_from(manifold.triangles.len()).unwrap_or(NONE);
                manifold
                    .triangles
                    .push(triangle.map(|k| number[k as usize]));
            }
        }
        let left = |side: &usize| corners.vertex[*side] != NONE;
        let opposite: Vec<u32> = (0..corners.vertex.len())
            .filter(left)
            .map(|side| match corners.opposite[side] {
                NONE => NONE,
                other => 3 * place[other as usize / 3] + other % 3,
            })
            .collect();
        manifold.loops = borders(&manifold, &opposite);
        let into: Vec<Option<u32>> = (0..self.parent.len())
            .map(|k| Some(number[root(&mut self.parent, k)]).filter(|&k| k != NONE))
            .collect();
        manifold.source = vec![None; manifold.points.len()];
        for (&source, &into) in mesh.source.iter().zip(&into) {
            let Some(own) = into.and_then(|k| manifold.source.get_mut(k as usize)) else {
                continue;
            };
            *own = match (*own, source) {
                (Some(x), Some(y)) => Some(x.min(y)),
                (x, y) => x.or(y),
            };
        }
        Decimated { manifold, into }
    }
}

/// What a vertex is part of now. Near O(1): paths are halved.
fn root(parent: &mut [u32], mut k: usize) -> usize {
    while parent[k] as usize != k {
        parent[k] = parent[parent[k] as usize];
        k = parent[k] as usize;
    }
    k
}

/// The normal of a triangle times twice its area, and its shape: 1 if it is equilateral, 0 if it is a line.
fn faced([a, b, c]: [DVec3; 3]) -> (DVec3, f64) {
    let normal = (b - a).cross(c - a);
    let sides = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
    let shape = 2.0 * 3.0_f64.sqrt() * normal.length() / sides.max(f64::MIN_POSITIVE);
    (normal, shape)
}

#[cfg(test)]
#[allow(clippy::cast_possible_truncation, reason = "small meshes")]
mod tests;
