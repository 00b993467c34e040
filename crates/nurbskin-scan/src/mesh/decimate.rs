//! Decimation of a mesh by edge collapse.
//!
//! The cost of a collapse is the quadric error xᵀA x - 2 bᵀx + c at its minimiser: the sum of squared distances to the
//! planes of the triangles merged so far, plus a small weight on the distances to their centroids. A collapse must
//! satisfy the link condition, so that genus and borders remain, and turn no triangle by more than 75°. Sweeps in
//! storage order come first, then a queue with the cheapest edge first.
//!
//! Sources: M. Garland, P. S. Heckbert, *Surface simplification using quadric error metrics*, SIGGRAPH 1997; T. K.
//! Dey, H. Edelsbrunner, S. Guha, D. V. Nekhayev, *Topology preserving edge contraction*, 1999. The sweeps are ours.

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

/// Multiple of the wanted vertices to which sweeps in storage order reduce the mesh; a queue with the cheapest edge
/// first does the rest. Trial: not recorded. A larger multiple is slower; a smaller one places the vertices worse.
const SWEEP_MULTIPLE: usize = 3;
/// Quantile of the costs of all edges up to which a sweep collapses edges. Trial: not recorded. A lower one comes
/// nearer to the best order and takes more sweeps.
const SWEEP_COST_QUANTILE: f64 = 0.4;
/// Edges whose costs give that quantile. Derived: two standard errors of the share 0.4 among 2048 edges are 2 %.
const COST_SAMPLES: usize = 2048;
/// Share of the vertices below which a sweep has removed too few: the next one takes any edge, and if that removes no
/// more, sweeping ends. Trial: not recorded.
const MIN_SWEEP_SHARE: f64 = 0.02;
/// Cosine of the largest angle (75°) by which a collapse may turn a triangle. Guard: less than a right angle, so that
/// no triangle is turned over.
const MAX_TURN_COSINE: f64 = 0.26;
/// Least shape of a triangle that a collapse makes, from 0 for a line to 1 for an equilateral one, unless a triangle
/// around was worse before. Trial: not recorded. 0.2 is the shape of an isosceles triangle with an apex angle of 7°.
const MIN_TRIANGLE_SHAPE: f64 = 0.2;
/// Edges between two tests for cancellation. Guard: some tens of milliseconds of work.
const EDGES_PER_CHECK: usize = 1 << 16;

/// A mesh after [`decimate`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decimated {
    /// The same surface with fewer triangles. The source of each vertex is the least one of the vertices merged into
    /// it.
    pub manifold: Manifold,
    /// For each vertex of the given mesh the vertex into which it was merged; `None` if the vertex has no triangle.
    pub into: Vec<Option<u32>>,
}

/// Reduces a mesh by edge collapse until at most `wanted` vertices remain, or until no edge can collapse. The genus,
/// the borders and the orientation remain, and no triangle is turned over.
///
/// The cost of a collapse is the quadric error, with a term for an even distribution of the vertices; borders are
/// followed as the surface is. A mesh with many times the wanted vertices is first reduced by sweeps that collapse any
/// cheap edge, then in order of cost. About O(n log n): 1 us per vertex. 300 bytes per vertex. The result depends on
/// the order of vertices and triangles.
///
/// Sources: M. Garland, P. S. Heckbert, *Surface simplification using quadric error metrics*, SIGGRAPH 1997; T. K. Dey,
/// H. Edelsbrunner, S. Guha, D. V. Nekhayev, *Topology preserving edge contraction*, 1999.
///
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
    work.sweep_down_to(SWEEP_MULTIPLE.saturating_mul(wanted), progress)?;
    queue::best_first(&mut work, wanted, progress)?;
    Ok(work.finish(mesh))
}

/// A mesh that is being decimated.
struct Work {
    corners: Corners,
    /// Relative to the centre of their bounding box, in units of its diagonal.
    points: Vec<DVec3>,
    quadrics: Vec<Quadric>,
    /// The vertex into which each vertex was merged; itself while it exists.
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

    /// The cost of a collapse, and the place of the resulting vertex. Border vertices stay on the border.
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

    /// Collapses an edge to its first end if topology and shape permit it. Returns whether it did.
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

    /// Whether the triangles around an edge keep their orientation, and none becomes worse than the worst before, if
    /// its ends move to a place.
    fn fits(&self, side: u32, around: &Around, place: DVec3) -> bool {
        let gone = [side, self.corners.other(side)].map(|s| s / 3);
        let at = |s: u32| self.points[self.corners.start(s) as usize];
        let (mut worst_before, mut worst) = (MIN_TRIANGLE_SHAPE, f64::INFINITY);
        for &s in around.fans.iter().flatten() {
            let (next, last) = (at(after(s)), at(before(s)));
            let (old, shape) = faced([at(s), next, last]);
            worst_before = worst_before.min(shape);
            if gone.contains(&(s / 3)) {
                continue;
            }
            let (new, shape) = faced([place, next, last]);
            worst = worst.min(shape);
            if old.dot(new) < MAX_TURN_COSINE * old.length() * new.length() {
                return false;
            }
        }
        worst >= worst_before
    }

    /// Collapses cheap edges in storage order until at most `wanted` vertices remain.
    fn sweep_down_to(&mut self, wanted: usize, progress: &dyn Progress) -> Result<()> {
        let mut any = false;
        while self.corners.vertices > wanted {
            let limit = if any { f64::INFINITY } else { self.cheap() };
            let before = self.corners.vertices;
            self.sweep(limit, wanted, progress)?;
            let taken = (before - self.corners.vertices) as f64;
            if taken < MIN_SWEEP_SHARE * before as f64 {
                if any {
                    break;
                }
                any = true;
            }
        }
        Ok(())
    }

    /// Collapses edges of cost up to `limit`, each vertex at most once.
    fn sweep(&mut self, limit: f64, wanted: usize, progress: &dyn Progress) -> Result<()> {
        let mut touched = vec![false; self.points.len()];
        for side in 0..self.corners.vertex.len() {
            if side.is_multiple_of(EDGES_PER_CHECK) {
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

    /// The quantile of the costs up to which a sweep collapses edges.
    fn cheap(&self) -> f64 {
        let step = (self.corners.triangles * 3 / 2 / COST_SAMPLES).max(1);
        let edges = self.corners.edges().step_by(step);
        let mut costs: Vec<f64> = edges.map(|side| self.price(side).0).collect();
        costs.sort_by(f64::total_cmp);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a part of a count"
        )]
        let at = (SWEEP_COST_QUANTILE * costs.len() as f64) as usize;
        costs.get(at).copied().unwrap_or(f64::INFINITY)
    }

    /// The remaining triangles, renumbered.
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

/// The vertex into which a vertex was merged. Near O(1) by path halving.
fn root(parent: &mut [u32], mut k: usize) -> usize {
    while parent[k] as usize != k {
        parent[k] = parent[parent[k] as usize];
        k = parent[k] as usize;
    }
    k
}

/// The normal of a triangle times twice its area, and its shape 2√3 · 2A / Σ side²: 1 if it is equilateral, 0 if it is
/// a line.
fn faced([a, b, c]: [DVec3; 3]) -> (DVec3, f64) {
    let normal = (b - a).cross(c - a);
    let sides = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
    let shape = 2.0 * 3.0_f64.sqrt() * normal.length() / sides.max(f64::MIN_POSITIVE);
    (normal, shape)
}

#[cfg(test)]
#[allow(clippy::cast_possible_truncation, reason = "small meshes")]
mod tests;
