//! A patch stretched over its border.

use super::patch::Patch;
use glam::{DVec2, DVec3};
use nurbskin_geometry::numeric::conjugate_gradients::GraphMatrix;

/// Moves the vertices inside to where springs between them rest: each edge pulls with the same force for its length as
/// it has now, which on an even mesh is a membrane and moves nothing in a plane that is meshed evenly.
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
    // 1. Springs; each edge inside is met from both its triangles.
    let mut edges = Vec::new();
    let mut held = vec![0.0; count];
    let mut right = vec![DVec3::ZERO; count];
    for [a, b, c] in &patch.triangles {
        for (&a, &b) in [(a, b), (b, c), (c, a)] {
            let [p, q] = [a, b].map(|k| patch.points[k as usize]);
            let weight = 1.0 / p.distance(q).max(f64::MIN_POSITIVE);
            match (own(a), own(b)) {
                (Some(a), Some(b)) if a < b => edges.push((a, b, weight)),
                // The same edge from its other side.
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
        .any(|w| !w.is_finite() || *w > 1e100)
    {
        return;
    }
    // 2. Around a corner of the rim, so that digits are not lost far from the origin.
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
        matrix.solve(&right, &mut x, 1e-9, 400);
        x
    };
    let xy = solve(&|p| DVec2::new(p.x, p.y));
    let z = solve(&|p| DVec2::new(p.z, 0.0));
    for (p, (xy, z)) in patch.points[rim..].iter_mut().zip(xy.iter().zip(&z)) {
        *p = origin + DVec3::new(xy.x, xy.y, z.x);
    }
}
