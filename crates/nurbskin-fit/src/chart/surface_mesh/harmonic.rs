//! The equations of a layout: every free vertex is a weighted mean of its neighbours.
//!
//! ```text
//! sum_b w_ab √(f_a f_b) (x_b - x_a + j_ab) = 0        w_ab = ½ (cot α + cot β), clamped to [0.001, 20]
//! ```
//!
//! The cotangents are those of the discrete Laplacian (Pinkall and Polthier 1993); the clamp keeps them positive. Then
//! nothing folds: on a disk with a convex rim (Tutte 1963), and on a torus (Gortler, Gotsman and Thurston 2006).
//! Conjugate gradients with a multigrid solve the equations in about O(n^1.25).

use super::layout::{Setup, Surface};
use super::sides::ends;
use glam::DVec2;
use nurbskin_geometry::numeric::conjugate_gradients::GraphMatrix;

/// Least and largest weight of an edge. Trial: needles tie vertices together with larger weights, or let them go with
/// smaller ones; a least weight of 0.05 in an earlier version twisted the lines where cotangents vanish, as on a
/// lattice.
const EDGE_WEIGHTS: [f64; 2] = [1e-3, 20.0];
/// Most steps of conjugate gradients. Guard: with the multigrid some tens do.
const MAX_CG_STEPS: usize = 3000;
/// Largest cotangent of an angle before the mean of the two is taken. Guard: triangles without area would give
/// infinities.
const MAX_COTANGENT: f64 = 1e3;

/// The equations of a layout. With positive weights nothing folds: on a disk with a convex rim (Tutte 1963, DOI
/// 10.1112/plms/s3-13.1.743); on a torus, and hence on a tube whose rims are lines u = const and free in v, since such
/// a tube is half of a torus (Gortler, Gotsman & Thurston 2006, DOI 10.1016/j.cagd.2005.05.002).
#[derive(Debug)]
pub(super) struct Harmonic {
    /// Edges within the graph, their turns and weights.
    edges: Vec<[u32; 2]>,
    turns: Vec<DVec2>,
    base: Vec<f64>,
    /// Edges to poles: vertex, pole, weight and u of the pole.
    spokes: Vec<(u32, u32, f64, f64)>,
    matrix: GraphMatrix,
}

impl Harmonic {
    pub(super) fn new(surface: &Surface<'_>, setup: &Setup) -> Self {
        let (mut edges, mut turns, mut base, mut spokes) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for &side in &surface.sides.edges {
            let [a, b] = ends(surface.triangles, side);
            let w = weight(surface, side);
            let pole = |k: u32| setup.poles.and_then(|p| p.iter().position(|&p| p == k));
            match (pole(a), pole(b)) {
                (None, None) => {
                    edges.push([a, b]);
                    turns.push(setup.jump(side as usize));
                    base.push(w);
                }
                (None, Some(p)) => spokes.push((a, b, w, p as f64)),
                (Some(p), None) => spokes.push((b, a, w, p as f64)),
                (Some(_), Some(_)) => {}
            }
        }
        let free: Vec<[bool; 2]> = (0_u32..)
            .zip(&setup.held)
            .map(|(k, h)| h.map(|h| h.is_none() && !setup.is_pole(k)))
            .collect();
        Self {
            matrix: GraphMatrix::new(&edges, &free),
            edges,
            turns,
            base,
            spokes,
        }
    }

    /// Reverses the turns of v, as for a setup whose v was reversed.
    pub(super) fn turn_round(&mut self) {
        for turns in &mut self.turns {
            turns.y = -turns.y;
        }
    }

    /// Improves `places` until the equations hold to a residual of `relative`. The weight of an edge is multiplied by
    /// the geometric mean of the factors at its ends. O(n^1.25).
    pub(super) fn solve(
        &mut self,
        setup: &Setup,
        factors: &[f64],
        places: &mut [DVec2],
        relative: f64,
    ) {
        let both = |a: u32, b: u32| (factors[a as usize] * factors[b as usize]).sqrt();
        let mut ties = vec![DVec2::ZERO; places.len()];
        let mut right = vec![DVec2::ZERO; places.len()];
        let mut weights = Vec::with_capacity(self.edges.len());
        for ((&[a, b], turns), w) in self.edges.iter().zip(&self.turns).zip(&self.base) {
            let w = w * both(a, b);
            weights.push(w);
            right[a as usize] += w * turns;
            right[b as usize] -= w * turns;
        }
        for &(k, pole, w, u) in &self.spokes {
            let w = w * both(k, pole);
            ties[k as usize].x += w;
            right[k as usize].x += w * u;
            places[pole as usize] = DVec2::new(u, 0.0);
        }
        for (place, held) in places.iter_mut().zip(&setup.held) {
            place.x = held[0].unwrap_or(place.x);
            place.y = held[1].unwrap_or(place.y);
        }
        self.matrix.weigh(&weights, &ties);
        self.matrix.solve(&right, places, relative, MAX_CG_STEPS);
    }
}

/// The mean cotangent of the angles opposite an edge, clamped.
fn weight(surface: &Surface<'_>, side: u32) -> f64 {
    let cotangent = |side: u32| {
        let (t, s) = (side as usize / 3, side as usize % 3);
        let p = surface.corners(t);
        let apex = p[(s + 2) % 3];
        let (x, y) = (p[s] - apex, p[(s + 1) % 3] - apex);
        (x.dot(y) / x.cross(y).length().max(f64::MIN_POSITIVE)).clamp(-MAX_COTANGENT, MAX_COTANGENT)
    };
    let other = surface.sides.partner[side as usize];
    let sum = cotangent(side)
        + if other == super::sides::NONE {
            0.0
        } else {
            cotangent(other)
        };
    (0.5 * sum).clamp(EDGE_WEIGHTS[0], EDGE_WEIGHTS[1])
}
