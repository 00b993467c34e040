//! A cell laid flat: a map to a regular polygon that folds nothing.
//!
//! The outline goes to the polygon, arc by arc by length; every inner vertex becomes a mean of its neighbours with
//! positive weights `½ (cot α + cot β)`, clamped as in the charts of disks. A disk with a convex rim then has no folded
//! triangle (W. T. Tutte, *How to draw a graph*, Proc. London Math. Soc. 13, 1963).

use super::surface::Surface;
use glam::{DVec2, DVec3};
use nurbskin_geometry::numeric::conjugate_gradients::GraphMatrix;

/// Least and largest weight of an edge. Source: `chart::surface_mesh::harmonic` of nurbskin-fit, same weights.
const WEIGHTS: [f64; 2] = [1e-3, 20.0];
/// Largest cotangent of an angle. Guard: triangles without area.
const MAX_COTANGENT: f64 = 1e3;
/// Residual of the equations, relative. Trial: first parameters need no more.
const RESIDUAL: f64 = 1e-5;
/// Most steps of the solver. Guard: some tens do.
const MAX_STEPS: usize = 2000;

/// A cell in the plane.
#[derive(Debug)]
pub(crate) struct Flat {
    /// Vertices of the mesh, ascending.
    pub(crate) vertices: Vec<u32>,
    /// Their places.
    pub(crate) places: Vec<DVec2>,
    /// Triangles, by numbers in `vertices`.
    triangles: Vec<[u32; 3]>,
}

impl Flat {
    /// The triangles `members` with the outline at the places given. Vertices of the mesh with their places.
    pub(crate) fn new(surface: &Surface<'_>, members: &[u32], outline: &[(u32, DVec2)]) -> Self {
        let of = |t: &u32| surface.mesh.triangles[*t as usize];
        let mut vertices: Vec<u32> = members.iter().flat_map(of).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let local = |v: u32| super::surface::index(vertices.partition_point(|&w| w < v));
        let triangles: Vec<[u32; 3]> = members.iter().map(|t| of(t).map(local)).collect();
        let mut places = vec![DVec2::ZERO; vertices.len()];
        let mut free = vec![[true; 2]; vertices.len()];
        for &(v, place) in outline {
            let k = local(v) as usize;
            if vertices.get(k) == Some(&v) {
                places[k] = place;
                free[k] = [false; 2];
            }
        }
        if free.iter().any(|f| f[0]) {
            let (edges, weights) = weighted(surface, &vertices, &triangles);
            let mut matrix = GraphMatrix::new(&edges, &free);
            let zero = vec![DVec2::ZERO; vertices.len()];
            matrix.weigh(&weights, &zero);
            matrix.solve(&zero, &mut places, RESIDUAL, MAX_STEPS);
        }
        Self {
            vertices,
            places,
            triangles,
        }
    }

    /// The place on the surface of a point in the plane: in the triangle that contains it, or comes nearest to.
    pub(crate) fn lift(&self, surface: &Surface<'_>, point: DVec2) -> DVec3 {
        let mut best = (f64::NEG_INFINITY, DVec3::ZERO);
        for t in &self.triangles {
            let [a, b, c] = t.map(|k| self.places[k as usize]);
            let double = (b - a).perp_dot(c - a);
            if double <= 0.0 {
                continue;
            }
            let shares = [
                (b - point).perp_dot(c - point) / double,
                (c - point).perp_dot(a - point) / double,
                (a - point).perp_dot(b - point) / double,
            ];
            let least = shares[0].min(shares[1]).min(shares[2]);
            if least > best.0 {
                let positive = shares.map(|s| s.max(0.0));
                let sum: f64 = positive.iter().sum();
                let corners = t.map(|k| surface.place(self.vertices[k as usize]));
                let at = corners.iter().zip(positive).map(|(p, s)| *p * (s / sum));
                best = (least, at.sum());
            }
        }
        if best.0 == f64::NEG_INFINITY {
            // All triangles without extent in the plane.
            let sum: DVec3 = self.vertices.iter().map(|&v| surface.place(v)).sum();
            return sum / self.vertices.len().max(1) as f64;
        }
        best.1
    }
}

/// The edges of the triangles, each once, with their weights.
fn weighted(
    surface: &Surface<'_>,
    vertices: &[u32],
    triangles: &[[u32; 3]],
) -> (Vec<[u32; 2]>, Vec<f64>) {
    let mut halves: Vec<([u32; 2], f64)> = Vec::with_capacity(3 * triangles.len());
    for t in triangles {
        let p = t.map(|k| surface.place(vertices[k as usize]));
        for s in 0..3 {
            let (a, b) = (t[s], t[(s + 1) % 3]);
            let apex = p[(s + 2) % 3];
            let (x, y) = (p[s] - apex, p[(s + 1) % 3] - apex);
            let cotangent = x.dot(y) / x.cross(y).length().max(f64::MIN_POSITIVE);
            let half = 0.5 * cotangent.clamp(-MAX_COTANGENT, MAX_COTANGENT);
            halves.push(([a.min(b), a.max(b)], half));
        }
    }
    halves.sort_by(|x, y| x.0.cmp(&y.0).then(x.1.total_cmp(&y.1)));
    let edges = halves.chunk_by(|x, y| x.0 == y.0);
    edges
        .map(|same| {
            let sum: f64 = same.iter().map(|(_, w)| w).sum();
            (same[0].0, sum.clamp(WEIGHTS[0], WEIGHTS[1]))
        })
        .unzip()
}
