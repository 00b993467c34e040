//! Filling of holes with fair patches.
//!
//! A patch is the triangulation of least area of the border polygon, refined to the edge lengths around it and
//! smoothed as a membrane over the fixed border, so that a hole in a plane is filled in the plane.
//!
//! The caller names the borders to fill. Which borders are holes and which are openings of the surface is decided with its
//! topology, in `chart::shape` of nurbskin-fit.
//!
//! Source: P. Liepa, *Filling holes in meshes*, Eurographics Symposium on Geometry Processing 2003.

mod fair;
mod patch;
mod refine;

use super::manifold::Manifold;
use patch::Patch;
use std::collections::HashSet;

/// A hole that was filled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filled {
    /// Number of edges of the border.
    pub edges: usize,
    /// Length of the border, in the scan's unit.
    pub length: f64,
    /// Area of the patch, in the scan's unit squared.
    pub area: f64,
    /// Number of added vertices; they have no source.
    pub added: usize,
}

/// Fills the holes with these indices in [`Manifold::loops`]; the other borders remain in their order. Indices that do
/// not exist are ignored.
///
/// A patch is a triangulation of its border of approximately least area, refined to the edge lengths around it, coarser
/// towards the middle, and smoothed as a membrane over the border, so that a hole in a plane is filled in the plane.
/// Existing vertices and triangles keep their indices; added ones follow, without source. About O(n log n) in the edges
/// around a hole.
///
/// Source: P. Liepa, *Filling holes in meshes*, Eurographics Symposium on Geometry Processing 2003.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_scan::mesh::Manifold;
/// use nurbskin_scan::mesh::holes::fill;
/// use nurbskin_scan::mesh::repair::repair;
/// use nurbskin_geometry::progress::Silent;
/// // A cube without lid.
/// let points: Vec<DVec3> = (0..8_u8).map(|k| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2))).collect();
/// let walls = [[0, 2, 1], [1, 2, 3], [0, 1, 4], [4, 1, 5], [1, 3, 5], [5, 3, 7], [3, 2, 7], [7, 2, 6], [2, 0, 6], [6, 0, 4]];
/// let open = repair(&points, &walls, &Silent)?.manifold;
/// assert_eq!((open.loops.len(), open.euler_characteristic()), (1, 1));
/// let (closed, filled) = fill(open, &[0]);
/// assert_eq!((closed.loops.len(), closed.euler_characteristic()), (0, 2));
/// assert!((filled[0].area - 1.0).abs() < 1e-9);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[must_use]
pub fn fill(mut manifold: Manifold, holes: &[usize]) -> (Manifold, Vec<Filled>) {
    let mut chosen = vec![false; manifold.loops.len()];
    let mut order = Vec::new();
    for &k in holes {
        if let Some(chosen @ false) = chosen.get_mut(k) {
            *chosen = true;
            order.push(k);
        }
    }
    let mut filled = Vec::with_capacity(order.len());
    if order.is_empty() {
        return (manifold, filled);
    }
    let edges = edges_between_rims(&manifold, &chosen);
    for k in order {
        let length = manifold.border_length(k);
        // The border runs in the direction of its triangles, the patch in the opposite one.
        let mut rim = manifold.loops[k].clone();
        rim.reverse();
        let places = rim.iter().map(|&v| manifold.points[v as usize]).collect();
        let joined = |i: usize, j: usize| {
            let (a, b) = (rim[i], rim[j]);
            edges.contains(&(a.min(b), a.max(b)))
        };
        let patch = Patch::over(places, &joined);
        let added = patch.points.len() - rim.len();
        let base = manifold.points.len();
        let number = |local: &u32| {
            let k = *local as usize;
            let fresh = || u32::try_from(base + k - rim.len()).unwrap_or(u32::MAX);
            rim.get(k).copied().unwrap_or_else(fresh)
        };
        filled.push(Filled {
            edges: rim.len(),
            length,
            area: patch.area(),
            added,
        });
        let triangles = patch.triangles.iter();
        manifold
            .triangles
            .extend(triangles.map(|[a, b, c]| [number(a), number(b), number(c)]));
        manifold.points.extend(&patch.points[rim.len()..]);
        manifold.source.resize(base + added, None);
    }
    let mut k = 0;
    manifold.loops.retain(|_| {
        k += 1;
        !chosen[k - 1]
    });
    (manifold, filled)
}

/// The edges between vertices of the chosen borders, which a patch must not repeat.
fn edges_between_rims(manifold: &Manifold, chosen: &[bool]) -> HashSet<(u32, u32)> {
    let mut on_rim = vec![false; manifold.points.len()];
    for (border, _) in manifold.loops.iter().zip(chosen).filter(|b| *b.1) {
        for &k in border {
            on_rim[k as usize] = true;
        }
    }
    let mut edges = HashSet::new();
    for [a, b, c] in &manifold.triangles {
        for (a, b) in [(a, b), (b, c), (c, a)] {
            if on_rim[*a as usize] && on_rim[*b as usize] {
                edges.insert((*a.min(b), *a.max(b)));
            }
        }
    }
    edges
}

#[cfg(test)]
mod tests;
