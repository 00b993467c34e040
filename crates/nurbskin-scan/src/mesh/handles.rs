//! Handles of a mesh: detection, and removal of those that are faults.
//!
//! Every handle has a shortest loop of edges that does not separate the surface. A handle is a fault if that loop is
//! shorter than 0.08 √area and has fewer than 25 edges, with two exceptions. It may go around a wire: the area within 2 L of the
//! loop is less than 6 L² for its length L. On a nearly closed surface it may go around a hole that the mesh resolves, such as one
//! for a bolt: some loop of the same class has at least 8 edges, and the surface faces its middle all around. The surface is cut
//! along the loop, and both sides are closed with patches.
//!
//! Sources: J. Erickson, S. Har-Peled, *Optimally cutting a surface into a disk*, Discrete & Computational Geometry
//! 31, 2004; I. Guskov, Z. Wood, *Topological noise removal*, Graphics Interface 2001. The tests for wires and holes are ours.

mod homology;
mod loops;

use super::holes;
use super::manifold::{Manifold, NONE};
use super::repair::surface::Surface;
use glam::DVec3;
use homology::Homology;
use loops::Loop;
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::progress::Progress;

/// Length of a loop, in square roots of the area of the surface, below which its handle may be spurious. Trial: not
/// recorded. A larger value cuts the handles of cups; a smaller one leaves bridges between close walls.
const SPURIOUS_LOOP_LENGTH: f64 = 0.08;
/// Edges of a loop from which on its handle is resolved by the mesh and is no fault. Trial: not recorded.
const RESOLVED_LOOP_EDGES: usize = 25;
/// Edges of a loop up to which it is cut without the test for a wire ([`WIRE_AREA_RATIO`]). Trial: not recorded. A loop
/// of three or four edges does not resolve a wire.
const COARSE_LOOP_EDGES: usize = 4;
/// Area of the surface within twice a loop's length of it, in squares of that length, below which the loop goes around
/// a wire and is not cut. A tube has 4, and a strut between two walls 6 if it is three times as long as it is around.
/// Two sheets joined by a bridge or a tunnel have 25, and 6.5 to 14 where they end or join nearby. Trial: 9 before,
/// which kept bridges at the ears of a head and the rims of cans.
const WIRE_AREA_RATIO: f64 = 6.0;
/// Fewest edges of a loop around a hole that is no fault. Count. Trial: faults of five scans (two cans, a face, and clouds of a can
/// and a vase) face the middle of loops with six edges by up to 0.78, and of longer ones by up to 0.69.
const HOLE_EDGES: usize = 8;
/// Mean cosine between the normals at a loop and the directions to its middle, from which on the surface faces it all around.
/// Dimensionless. Trial: as [`HOLE_EDGES`]. It is 0.88 to 1 in round holes of 8 to 24 edges through plates and bosses, with noise of up
/// to a quarter of the edges, and 0.9 in square ones.
const HOLE_FACING: f64 = 0.8;
/// Area of the openings of a surface, as a share of its own, up to which it has an outward side. Dimensionless. Guard: a scanner
/// misses a few small places; a dome has one half.
const MOST_OPEN: f64 = 0.05;
/// Handles of a mesh above which it is left as it is. Guard: the time of a round is proportional to the number of
/// handles.
const MAX_HANDLES: usize = 1000;
/// Most rounds of cutting; each cuts all handles whose loops do not touch. Guard: a round that cuts nothing ends the
/// loop before.
const MAX_CUT_ROUNDS: usize = 24;
/// Parts of the searches for loops, each with tables of the size of the mesh. Count. Guard: memory and balance.
const RUNS: usize = 16;
/// Searches for a loop between two tests for cancellation. Guard: some milliseconds of work.
const VERTICES_PER_CHECK: usize = 64;

/// Result of [`cut_spurious`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CutHandles {
    /// Number of handles that were cut.
    pub count: usize,
    /// Length of the longest loop along which a handle was cut, in the scan's unit.
    pub longest: f64,
}

/// Cuts the handles that are faults of the mesh: bridges between parts of the surface that come close, and tunnels
/// through thin walls. A handle is a fault if a loop around it or through it is shorter than 8 % of the square root of
/// the surface's area and has fewer than 25 edges, and the surface widens beyond it. The surface is cut along the loop,
/// and both sides are closed with a patch. Handles without such a loop remain, as that of a jug; so do rings of thin
/// wire, and holes of nearly closed surfaces with at least eight edges around, such as those for bolts.
///
/// Loops are the shortest ones along edges that do not separate the surface. Each round is O((g + 1) n log n) for g
/// handles.
///
/// Source: J. Erickson, S. Har-Peled, *Optimally cutting a surface into a disk*, Discrete & Computational Geometry 31,
/// 2004; I. Guskov, Z. Wood, *Topological noise removal*, Graphics Interface 2001.
///
/// # Errors
/// [`Error::Cancelled`](nurbskin_geometry::Error::Cancelled).
pub fn cut_spurious(manifold: &mut Manifold, progress: &dyn Progress) -> Result<CutHandles> {
    let short = SPURIOUS_LOOP_LENGTH * manifold.area().sqrt();
    let mut cut = CutHandles::default();
    for _ in 0..MAX_CUT_ROUNDS {
        let genus = manifold.genus();
        if genus == 0 || genus > MAX_HANDLES {
            break;
        }
        // Longer loops have too many edges in any case: on a fine mesh this limits the search to a small region.
        let limit = short.min(RESOLVED_LOOP_EDGES as f64 * longest_edge(manifold));
        let found = short_loops(manifold, limit, progress)?;
        if found.is_empty() {
            break;
        }
        let longest = found.iter().map(|l| l.length).fold(0.0, f64::max);
        let after = cut_along(manifold.clone(), &found);
        // Every cut removes a handle; if none did, the mesh cannot be repaired here.
        if after.genus() >= genus {
            break;
        }
        cut.count += genus - after.genus();
        cut.longest = cut.longest.max(longest);
        *manifold = after;
    }
    Ok(cut)
}

fn longest_edge(manifold: &Manifold) -> f64 {
    let edges = (0..manifold.triangles.len()).map(|t| {
        let [a, b, c] = manifold.corners(t);
        a.distance(b).max(b.distance(c)).max(c.distance(a))
    });
    edges.fold(0.0, f64::max)
}

/// Loops no longer than `limit`, shortest first, that do not touch each other and together do not separate the surface.
fn short_loops(manifold: &Manifold, limit: f64, progress: &dyn Progress) -> Result<Vec<Loop>> {
    let homology = Homology::new(manifold);
    progress.check()?;
    let vertices = homology.vertices_on_generators(manifold);
    let run = vertices.len().div_ceil(RUNS).max(VERTICES_PER_CHECK);
    let through = each(vertices.len().div_ceil(run), |k| -> Result<Vec<Loop>> {
        let mut search = loops::Search::new(&homology, manifold);
        let mut found = Vec::new();
        for some in vertices[k * run..vertices.len().min((k + 1) * run)].chunks(VERTICES_PER_CHECK)
        {
            progress.check()?;
            let loops = some.iter();
            found.extend(loops.filter_map(|&vertex| search.shortest_through(vertex, limit)));
        }
        Ok(found)
    });
    let mut found = through.into_iter().collect::<Result<Vec<_>>>()?.concat();
    let mut search = loops::Search::new(&homology, manifold);
    found.retain(|l| l.sides.len() < RESOLVED_LOOP_EDGES);
    found.sort_by(|a, b| {
        a.length
            .total_cmp(&b.length)
            .then(a.vertices.cmp(&b.vertices))
    });
    found.dedup_by(|a, b| a.vertices == b.vertices);
    let mut touched = vec![false; manifold.points.len()];
    let mut basis: Vec<Vec<u64>> = Vec::new();
    // No loop around a hole is cut, wherever along the hole it lies.
    if is_nearly_closed(manifold) {
        let normals = vertex_normals(manifold);
        for hole in found.iter().filter(|l| is_hole(l, manifold, &normals)) {
            homology::independent(&mut basis, hole.class.clone());
        }
    }
    let mut chosen = Vec::new();
    for candidate in found {
        let touches = candidate.vertices.iter().any(|&v| touched[v as usize]);
        let mut wire = || {
            let square = candidate.length * candidate.length;
            candidate.sides.len() > COARSE_LOOP_EDGES
                && search.area_within(&candidate.vertices, 2.0 * candidate.length)
                    < WIRE_AREA_RATIO * square
        };
        if touches || wire() || !homology::independent(&mut basis, candidate.class.clone()) {
            continue;
        }
        for &v in &candidate.vertices {
            touched[v as usize] = true;
        }
        chosen.push(candidate);
    }
    Ok(chosen)
}

/// Whether the openings of a manifold are so small that it has an outward side. Without one, a hole looks like a bar.
fn is_nearly_closed(manifold: &Manifold) -> bool {
    let openings: f64 = (0..manifold.loops.len())
        .map(|k| manifold.flat_area(k))
        .sum();
    openings <= MOST_OPEN * manifold.area()
}

/// The outward unit normal at each vertex of a manifold that is nearly closed.
fn vertex_normals(manifold: &Manifold) -> Vec<DVec3> {
    let middle = manifold.points.iter().sum::<DVec3>() / manifold.points.len() as f64;
    let volume: f64 = (0..manifold.triangles.len())
        .map(|t| manifold.vector_area(t).dot(manifold.corners(t)[0] - middle))
        .sum();
    let mut normals = manifold.normals();
    for n in &mut normals {
        *n *= volume.signum();
    }
    normals
}

/// Whether a loop goes around a hole that the mesh resolves.
fn is_hole(around: &Loop, manifold: &Manifold, normals: &[DVec3]) -> bool {
    let place = |&v: &u32| manifold.points[v as usize];
    let count = around.vertices.len() as f64;
    let middle = around.vertices.iter().map(place).sum::<DVec3>() / count;
    let facing = around
        .vertices
        .iter()
        .map(|v| normals[*v as usize].dot((middle - place(v)).normalize_or_zero()));
    around.sides.len() >= HOLE_EDGES && facing.sum::<f64>() >= HOLE_FACING * count
}

/// Cuts the surface along these loops and closes the new borders.
fn cut_along(manifold: Manifold, loops: &[Loop]) -> Manifold {
    let mut surface = Surface::from_manifold(manifold);
    let mut fresh = vec![false; surface.opposite.len()];
    for &side in loops.iter().flat_map(|l| &l.sides) {
        let other = surface.opposite[side as usize];
        if other != NONE {
            fresh[side as usize] = true;
            fresh[other as usize] = true;
            surface.cut(side);
        }
    }
    let assembled = surface.assemble();
    let manifold = assembled.manifold;
    // Borders that consist of cut sides only are closed; cuts that met a border have become part of it.
    let mut cut_from = vec![None; manifold.points.len()];
    for (k, &t) in assembled.kept.iter().enumerate() {
        for s in 0..3 {
            if fresh[3 * t as usize + s] {
                let corners = manifold.triangles[k];
                cut_from[corners[s] as usize] = Some(corners[(s + 1) % 3]);
            }
        }
    }
    let closed = |border: &[u32]| {
        let mut steps = border.iter().zip(border.iter().cycle().skip(1));
        steps.all(|(&a, &b)| cut_from[a as usize] == Some(b))
    };
    let holes: Vec<usize> = (0..manifold.loops.len())
        .filter(|&k| closed(&manifold.loops[k]))
        .collect();
    holes::fill(manifold, &holes).0
}

#[cfg(test)]
#[allow(clippy::cast_possible_truncation, reason = "small meshes")]
mod tests;
