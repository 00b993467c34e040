//! Pockets: small patches that hang on a mesh by a neck so narrow that a chart has no room for them.
//!
//! A harmonic layout maps a patch behind a neck of relative width ε to an area of order ε². A triangle is squeezed if
//! its share of the domain is less than 1 % of its share of the surface. Connected squeezed triangles of little area
//! are a pocket and are cut off, with the ring of triangles around them.
//!
//! Source: ours.

use super::chart::MeshChart;
use super::sides::{NONE, Sides};
use nurbskin_scan::mesh::Manifold;

/// Ratio of a triangle's share of the domain to its share of the surface up to which it is squeezed. Trial: not
/// recorded. A larger one cuts limbs off, a smaller one leaves pockets that the fit cannot follow.
const MAX_SQUEEZED_RATIO: f64 = 0.01;
/// Fewest connected triangles of a pocket without folds. Trial: not recorded; one or two are slivers.
const MIN_POCKET_TRIANGLES: usize = 3;
/// Largest area of a pocket, as a share of the surface's. Trial: not recorded; larger patches are limbs.
const MAX_POCKET_AREA: f64 = 0.002;

impl MeshChart {
    /// The triangles of pockets: patches that the chart squeezes or folds, with the triangles around them. These are
    /// crumbs, double layers and cavities behind small holes in the mesh of a noisy scan; no smooth surface can follow
    /// them. Most meshes have none. `mesh` must be the charted mesh. O(n log n).
    #[must_use]
    pub fn pockets(&self, mesh: &Manifold) -> Vec<bool> {
        let count = mesh.triangles.len();
        let mut cut = vec![false; count];
        // 1. Squeezed triangles, by their shares of both areas.
        let space: Vec<f64> = (0..count).map(|t| mesh.vector_area(t).length()).collect();
        let flat = |[a, b, c]: &[glam::DVec2; 3]| 0.5 * (*b - *a).perp_dot(*c - *a);
        let flats: Vec<f64> = self.corners.iter().map(flat).collect();
        let (whole, all): (f64, f64) = (space.iter().sum(), flats.iter().sum());
        let least = MAX_SQUEEZED_RATIO * all / whole.max(f64::MIN_POSITIVE);
        let squeezed: Vec<bool> = (space.iter().zip(&flats))
            .map(|(space, flat)| *flat <= least * space)
            .collect();
        if !squeezed.contains(&true) {
            return cut;
        }
        // 2. Small connected components of these triangles.
        let partner = Sides::new(&mesh.triangles).partner;
        let mut seen = vec![false; count];
        for first in 0..count {
            if seen[first] || !squeezed[first] {
                continue;
            }
            seen[first] = true;
            let mut patch = vec![first];
            let mut k = 0;
            while let Some(&t) = patch.get(k) {
                for &other in &partner[3 * t..3 * t + 3] {
                    let u = other as usize / 3;
                    if other != NONE && squeezed[u] && !seen[u] {
                        seen[u] = true;
                        patch.push(u);
                    }
                }
                k += 1;
            }
            let area: f64 = patch.iter().map(|&t| space[t]).sum();
            let folds = patch.iter().any(|&t| flats[t] <= 0.0);
            if area <= MAX_POCKET_AREA * whole && (folds || patch.len() >= MIN_POCKET_TRIANGLES) {
                for t in patch {
                    cut[t] = true;
                }
            }
        }
        // 3. With the triangles around them, so that the cut is clean.
        let mut near = vec![false; mesh.points.len()];
        for (triangle, _) in mesh.triangles.iter().zip(&cut).filter(|t| *t.1) {
            for &v in triangle {
                near[v as usize] = true;
            }
        }
        for (triangle, cut) in mesh.triangles.iter().zip(&mut cut) {
            *cut |= triangle.iter().any(|&v| near[v as usize]);
        }
        cut
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use nurbskin_geometry::progress::Silent;
    use nurbskin_scan::mesh::samples::Mesh;
    use nurbskin_scan::mesh::{holes, repair};
    use std::f64::consts::TAU;

    /// A round sheet of radius 1 with a balloon of radius 0.02 on it that hangs by a neck of radius 0.0004.
    fn sheet_with_balloon() -> Mesh {
        Mesh::lattice([24, 60], [true, false], |u, v| {
            let a = TAU * u;
            let (r, z) = if v < 0.6 {
                (0.0004_f64.powf(v / 0.6), 0.0)
            } else {
                let turn = 0.02 + (v - 0.6) / 0.4 * 2.98;
                (0.02 * turn.sin(), 0.02 * (1.0 - turn.cos()))
            };
            DVec3::new(r * a.cos(), r * a.sin(), z)
        })
    }

    #[test]
    fn a_balloon_on_a_neck_is_a_pocket_and_what_is_left_has_none() {
        let mesh = sheet_with_balloon();
        let source = repair::repair(&mesh.points, &mesh.triangles, &Silent)
            .unwrap()
            .manifold;
        let scanned = source.triangles.len();
        let (whole, _) = holes::fill(source.clone(), &[1]);
        let chart = super::super::chart_of_mesh(&whole, &Silent).unwrap();
        let mut pockets = chart.pockets(&whole);
        pockets.truncate(scanned);
        assert!(pockets.contains(&true), "{:?}", chart.quality);
        for (triangle, pocket) in source.triangles.iter().zip(&pockets) {
            let far = |&k: &u32| source.points[k as usize].length() > 0.1;
            let top = |&k: &u32| source.points[k as usize].z > 0.02;
            assert!(!(*pocket && triangle.iter().any(far)));
            assert!(*pocket || !triangle.iter().all(top));
        }
        // What was near the neck may take two rounds.
        let mut rest = source;
        for _ in 0..3 {
            let cut = repair::without(rest.clone(), &pockets);
            let scanned = cut.triangles.len();
            let (filled, _) = holes::fill(cut.clone(), &[1]);
            let chart = super::super::chart_of_mesh(&filled, &Silent).unwrap();
            rest = cut;
            pockets = chart.pockets(&filled);
            pockets.truncate(scanned);
            if !pockets.contains(&true) {
                assert!(chart.quality.smallest_jacobian > 0.0, "{:?}", chart.quality);
                return;
            }
        }
        panic!("pockets are left after three rounds");
    }
}
