//! Smoothing of a patch as a membrane over its border.
//!
//! Interior vertices move to `Σ_j w_ij (x_j - x_i) = 0` with `w_ij = 1 / |edge ij|` before the motion: every edge
//! pulls with equal force for its initial length. On an evenly meshed plane nothing moves. Conjugate gradients solve
//! the system.
//!
//! Source: ours; the weights are those of the scale-dependent umbrella operator (M. Desbrun et al., SIGGRAPH 1999).

use super::patch::Patch;
use glam::{DVec2, DVec3};
use nurbskin_geometry::numeric::conjugate_gradients::GraphMatrix;

/// Stiffness of a spring above which the patch stays as it is. Guard: squares of larger numbers leave the range of
/// doubles.
const MAX_STIFFNESS: f64 = 1e100;
/// Relative residual at which conjugate gradients end. Guard: far below the noise of any scan.
const STRETCH_TOLERANCE: f64 = 1e-9;
/// Most steps of conjugate gradients. Guard: bounds the time of a patch; what they leave is a shape between the first
/// and the fair one.
const MAX_STRETCH_STEPS: usize = 400;

/// Moves the interior vertices to the equilibrium of springs along the edges. Each edge pulls with the same force for
/// its present length: on an even mesh this is a membrane, and it moves nothing in an evenly meshed plane.
pub(super) fn stretch(patch: &mut Patch) {
    let (rim, count) = (patch.rim, patch.points.len() - patch.rim);
    if count == 0 {
        return;
    }
    let own = |k: u32| {
        (k as usize)
            .checked_sub(rim)
            .and_then(|k| u32::try_from(k).ok())
    };
    // 1. Springs; each interior edge occurs in both its triangles.
    let mut edges = Vec::new();
    let mut held = vec![0.0; count];
    let mut right = vec![DVec3::ZERO; count];
    for [a, b, c] in &patch.triangles {
        for (&a, &b) in [(a, b), (b, c), (c, a)] {
            let [p, q] = [a, b].map(|k| patch.points[k as usize]);
            let weight = 1.0 / p.distance(q).max(f64::MIN_POSITIVE);
            match (own(a), own(b)) {
                (Some(a), Some(b)) if a < b => edges.push((a, b, weight)),
                // The reverse of such an edge.
                (Some(a), None) => {
                    held[a as usize] += weight;
                    right[a as usize] += weight * q;
                }
                _ => {}
            }
        }
    }
    if held
        .iter()
        .chain(edges.iter().map(|e| &e.2))
        .any(|w| !w.is_finite() || *w > MAX_STIFFNESS)
    {
        return;
    }
    // 2. Relative to a corner of the rim, to avoid cancellation far from the origin.
    let origin = patch.points[0];
    for (right, held) in right.iter_mut().zip(&held) {
        *right -= *held * origin;
    }
    let pairs: Vec<[u32; 2]> = edges.iter().map(|&(a, b, _)| [a, b]).collect();
    let weights: Vec<f64> = edges.iter().map(|e| e.2).collect();
    let ties: Vec<DVec2> = held.iter().map(|&w| DVec2::splat(w)).collect();
    let mut matrix = GraphMatrix::new(&pairs, &vec![[true; 2]; count]);
    matrix.weigh(&weights, &ties);
    let solve = |part: &dyn Fn(DVec3) -> DVec2| {
        let right: Vec<DVec2> = right.iter().map(|p| part(*p)).collect();
        let mut x: Vec<DVec2> = patch.points[rim..]
            .iter()
            .map(|p| part(*p - origin))
            .collect();
        matrix.solve(&right, &mut x, STRETCH_TOLERANCE, MAX_STRETCH_STEPS);
        x
    };
    let xy = solve(&|p| DVec2::new(p.x, p.y));
    let z = solve(&|p| DVec2::new(p.z, 0.0));
    for (p, (xy, z)) in patch.points[rim..].iter_mut().zip(xy.iter().zip(&z)) {
        *p = origin + DVec3::new(xy.x, xy.y, z.x);
    }
}
