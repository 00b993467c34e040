//! Handles: which are there, and which are faults of the mesh.

mod homology;
mod loops;

use super::holes;
use super::manifold::{Manifold, NONE};
use super::repair::surface::Surface;
use homology::Homology;
use loops::Loop;
use nurbskin_geometry::Result;
use nurbskin_geometry::progress::Progress;

/// Loops shorter than this, against the square root of the surface's area, belong to spurious handles.
const SHORT: f64 = 0.08;
/// A handle whose loop has so many edges or more is no fault of the mesh.
const RESOLVED: usize = 25;
/// A loop of more edges than this may be around a wire: that is so if less than [`TUBE`] times the square of its length is
/// surface within twice its length. A tube has 4, a strut between two walls 6 if it is three times as long as it is around.
/// Two sheets that a bridge or a tunnel joins have 25, and 6.5 to 14 where they end or join near by, as at the ears of a head
/// and the rims of cans.
const COARSE: usize = 4;
const TUBE: f64 = 6.0;
/// Meshes with more handles than this are left as they are.
const MOST: usize = 1000;
/// Rounds of cutting; each cuts all handles whose loops do not touch.
const ROUNDS: usize = 24;

/// What [`cut_spurious`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CutHandles {
    /// Number of handles cut.
    pub count: usize,
    /// Length of the longest loop that was cut along, in the scan's unit.
    pub longest: f64,
}

/// Cuts the handles that are faults of the mesh: bridges between parts of the surface that come close, and tunnels
/// through thin walls. A handle is one if a loop around it or through it is shorter than 8 % of the square root of the
/// surface's area and has fewer than 25 edges, and the surface widens beyond it. The surface is cut along the loop, and
/// both sides are closed with a patch. Handles with no such loop stay, like that of a jug; so do rings of thin wire.
///
/// Loops are the shortest ones by edges that do not part the surface. Each round is O((g + 1) n log n) for g handles.
///
/// Source: J. Erickson, S. Har-Peled, *Optimally cutting a surface into a disk*, Discrete & Computational Geometry 31,
/// 2004; I. Guskov, Z. Wood, *Topological noise removal*, Graphics Interface 2001.
///
/// # Errors
/// [`Error::Cancelled`](nurbskin_geometry::Error::Cancelled).
pub fn cut_spurious(manifold: &mut Manifold, progress: &dyn Progress) -> Result<CutHandles> {
    let short = SHORT * manifold.area().sqrt();
    let mut cut = CutHandles::default();
    for _ in 0..ROUNDS {
        let genus = manifold.genus();
        if genus == 0 || genus > MOST {
            break;
        }
        // Longer loops than that have too many edges in any case: where a mesh is fine, far less of it is looked at.
        let limit = short.min(RESOLVED as f64 * longest_edge(manifold));
        let found = short_loops(manifold, limit, progress)?;
        if found.is_empty() {
            break;
        }
        let longest = found.iter().map(|l| l.length).fold(0.0, f64::max);
        let after = cut_along(manifold.clone(), &found);
        // Every cut takes a handle away; if none did the mesh is stranger than this can mend.
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

/// Loops no longer than `limit`, shortest first, that do not touch each other and together do not part the surface.
fn short_loops(manifold: &Manifold, limit: f64, progress: &dyn Progress) -> Result<Vec<Loop>> {
    let homology = Homology::new(manifold);
    progress.check()?;
    let mut found: Vec<Loop> = Vec::new();
    let mut search = loops::Search::new(&homology, manifold);
    for (k, vertex) in homology
        .vertices_on_generators(manifold)
        .into_iter()
        .enumerate()
    {
        if k % 64 == 0 {
            progress.check()?;
        }
        found.extend(search.shortest_through(vertex, limit));
    }
    found.retain(|l| l.sides.len() < RESOLVED);
    found.sort_by(|a, b| {
        a.length
            .total_cmp(&b.length)
            .then(a.vertices.cmp(&b.vertices))
    });
    found.dedup_by(|a, b| a.vertices == b.vertices);
    let mut touched = vec![false; manifold.points.len()];
    let mut basis: Vec<Vec<u64>> = Vec::new();
    let mut chosen = Vec::new();
    for candidate in found {
        let touches = candidate.vertices.iter().any(|&v| touched[v as usize]);
        let mut wire = || {
            let square = candidate.length * candidate.length;
            candidate.sides.len() > COARSE
                && search.area_within(&candidate.vertices, 2.0 * candidate.length) < TUBE * square
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

/// The surface cut along these loops, new borders closed.
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
    // Borders of nothing but cut sides are closed; cuts that met a border are part of it now.
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
