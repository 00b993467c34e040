//! Where a mesh passes through itself: eyelids, lips and folds of merged scans.

use super::Manifold;
use glam::DVec3;
use nurbskin_geometry::spatial::boxes::Tree;
use nurbskin_geometry::spatial::triangles::crossing;

/// The vertices, by index, of triangles that pass through others without a common vertex. O(n log n) where few boxes of
/// triangles overlap, on all cores.
#[must_use]
pub fn crossed(mesh: &Manifold) -> Vec<bool> {
    let all: Vec<usize> = (0..mesh.triangles.len()).collect();
    crossed_among(&mesh.points, &mesh.triangles, &all, |_| true)
}

/// The same for the listed triangles, at other places of the vertices; only pairs in which `counts` holds for at least one are tested.
pub(super) fn crossed_among(
    places: &[DVec3],
    triangles: &[[u32; 3]],
    listed: &[usize],
    counts: impl Fn(usize) -> bool + Sync,
) -> Vec<bool> {
    let corners = |t: usize| triangles[t].map(|v| places[v as usize]);
    let boxes: Vec<[DVec3; 2]> = listed.iter().map(|&t| box_of(corners(t))).collect();
    let found = Tree::new(&boxes).filter_pairs(|a, b| {
        let (a, b) = (listed[a], listed[b]);
        let (one, two) = (triangles[a], triangles[b]);
        let apart = !one.iter().any(|vertex| two.contains(vertex));
        let sought = apart && (counts(a) || counts(b));
        let cross = sought && crossing(&corners(a), &corners(b)).is_some();
        cross.then_some([one, two])
    });
    let mut crossed = vec![false; places.len()];
    for &vertex in found.as_flattened().as_flattened() {
        crossed[vertex as usize] = true;
    }
    crossed
}

/// The box of a triangle.
pub(super) fn box_of([a, b, c]: [DVec3; 3]) -> [DVec3; 2] {
    [a.min(b).min(c), a.max(b).max(c)]
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::mesh::samples::Mesh;
    use std::f64::consts::PI;

    /// A unit sphere.
    pub(in crate::mesh) fn sphere(cells: [u32; 2]) -> Manifold {
        let sphere = Mesh::sphere(cells, 0.0, PI);
        Manifold {
            source: vec![None; sphere.points.len()],
            points: sphere.points,
            triangles: sphere.triangles,
            loops: Vec::new(),
        }
    }

    #[test]
    fn a_sphere_crosses_itself_once_a_vertex_goes_through_the_other_side() {
        let mut mesh = sphere([40, 20]);
        assert!(!crossed(&mesh).contains(&true));
        let (k, from) = (0..)
            .zip(mesh.points.clone())
            .find(|p| p.1.x > 0.95)
            .unwrap();
        mesh.points[k] = -1.3 * from;
        let flags = crossed(&mesh);
        assert!(flags[k], "the vertex that went through");
        // What it pierces lies opposite, and its own triangles beside its first place.
        for (flag, &point) in flags.iter().zip(&mesh.points) {
            let near = point.distance(from).min(point.distance(-from)) < 0.5;
            assert!(!flag || near, "{point}");
        }
    }
}
