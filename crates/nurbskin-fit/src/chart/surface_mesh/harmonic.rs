//! The inside of a domain: every free vertex a weighted mean of its neighbours.

use super::layout::{Setup, Surface};
use super::sides::ends;
use glam::DVec2;
use nurbskin_geometry::numeric::conjugate_gradients::GraphMatrix;

/// Edges weigh at least and at most so much: needles would tie vertices together or let them go. More than the least where
/// the cotangents vanish, as on a lattice, would twist the lines.
const WEIGHTS: [f64; 2] = [1e-3, 20.0];
/// Most steps of a solve.
const STEPS: usize = 3000;

/// The equations of a layout. With positive weights nothing folds: on a disk with a convex rim (Tutte 1963, DOI
/// 10.1112/plms/s3-13.1.743); on a torus, and so on a tube whose rims are lines u = const and free in v, which is half of
/// one (Gortler, Gotsman & Thurston 2006, DOI 10.1016/j.cagd.2005.05.002).
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

    /// For a setup whose turns of v were all reversed.
    pub(super) fn turn_round(&mut self) {
        for turns in &mut self.turns {
            turns.y = -turns.y;
        }
    }

    /// Improves `places` until the equations hold to `relative`, with the weight of each edge times the geometric mean of
    /// the factors at its ends. O(n^1.25).
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
        self.matrix.solve(&right, places, relative, STEPS);
    }
}

/// The mean cotangent of the angles that an edge is seen under, clamped.
fn weight(surface: &Surface<'_>, side: u32) -> f64 {
    let cotangent = |side: u32| {
        let (t, s) = (side as usize / 3, side as usize % 3);
        let p = surface.corners(t);
        let apex = p[(s + 2) % 3];
        let (x, y) = (p[s] - apex, p[(s + 1) % 3] - apex);
        (x.dot(y) / x.cross(y).length().max(f64::MIN_POSITIVE)).clamp(-1e3, 1e3)
    };
    let other = surface.sides.partner[side as usize];
    let sum = cotangent(side)
        + if other == super::sides::NONE {
            0.0
        } else {
            cotangent(other)
        };
    (0.5 * sum).clamp(WEIGHTS[0], WEIGHTS[1])
}
