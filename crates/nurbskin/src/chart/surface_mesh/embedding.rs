//! The inside of a disk laid out between its rim, without folds and with little stretch.

use crate::numeric::conjugate_gradients::GraphMatrix;
use glam::{DVec2, DVec3};

/// Edges weigh at least and at most so much: needles would tie vertices together or let them go.
const WEIGHTS: [f64; 2] = [0.05, 20.0];
/// Most rounds that even out the stretch.
const ROUNDS: usize = 8;
/// A round must lower the stretch by this part.
const WORTH: f64 = 0.003;
/// Stretches are told apart within this factor of their mean.
const LARGEST_STRETCH: f64 = 50.0;

/// A disk in the plane.
pub(super) struct Layout {
    pub(super) places: Vec<DVec2>,
    /// Part of the triangles turned over.
    pub(super) flipped: f64,
    /// Root mean square stretch against that of an isometry of the same area; at least 1.
    pub(super) stretch: f64,
}

/// Lays out the vertices; those with a place in `held` keep it, and must lie on a convex polygon.
///
/// Every free vertex is a mean of its neighbours with positive weights, so nothing folds (Tutte 1963, DOI
/// 10.1112/plms/s3-13.1.743). The weights start as clamped cotangents and are lowered round by round where the surface
/// is stretched over too little of the plane (as Yoshizawa, Belyaev & Seidel 2004, DOI 10.1109/SMI.2004.1314516), which
/// keeps them positive.
pub(super) fn lay_out(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    held: &[Option<DVec2>],
) -> Layout {
    let edges = weighted_edges(positions, triangles);
    let middle = held.iter().flatten().sum::<DVec2>() / held.iter().flatten().count().max(1) as f64;
    let mut places: Vec<DVec2> = held.iter().map(|h| h.unwrap_or(middle)).collect();
    let mut factors = vec![1.0; positions.len()];
    let ends: Vec<[u32; 2]> = edges.iter().map(|&(a, b, _)| [a, b]).collect();
    let free: Vec<[bool; 2]> = held.iter().map(|h| [h.is_none(); 2]).collect();
    let mut matrix = GraphMatrix::new(&ends, &free);
    let right = vec![DVec2::ZERO; positions.len()];
    let mut solve = |places: &mut Vec<DVec2>, factors: &[f64], relative: f64| {
        let weights: Vec<f64> = edges
            .iter()
            .map(|&(a, b, w)| w * (factors[a as usize] * factors[b as usize]).sqrt())
            .collect();
        matrix.weigh(&weights, &[]);
        matrix.solve(&right, places, relative, 3000);
    };
    solve(&mut places, &factors, 1e-6);
    let mut stretches = Stretches::measure(positions, triangles, &places);
    for _ in 0..ROUNDS {
        let next_factors: Vec<f64> = factors
            .iter()
            .zip(&stretches.at)
            .map(|(f, s)| f / s)
            .collect();
        let mut next = places.clone();
        solve(&mut next, &next_factors, 1e-6);
        let then = Stretches::measure(positions, triangles, &next);
        if then.whole > (1.0 - WORTH) * stretches.whole {
            break;
        }
        (places, factors, stretches) = (next, next_factors, then);
    }
    solve(&mut places, &factors, 1e-11);
    let stretches = Stretches::measure(positions, triangles, &places);
    let turned = triangles.iter().filter(|t| {
        let [a, b, c] = t.map(|k| places[k as usize]);
        (b - a).perp_dot(c - a) < 0.0
    });
    Layout {
        flipped: turned.count() as f64 / triangles.len().max(1) as f64,
        stretch: stretches.whole,
        places,
    }
}

/// The edges with the mean cotangent of the angles they are seen under, clamped.
fn weighted_edges(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<(u32, u32, f64)> {
    let mut sides: Vec<(u32, u32, f64)> = Vec::with_capacity(3 * triangles.len());
    for t in triangles {
        for c in 0..3 {
            let (a, b) = (t[(c + 1) % 3], t[(c + 2) % 3]);
            let apex = positions[t[c] as usize];
            let (x, y) = (positions[a as usize] - apex, positions[b as usize] - apex);
            let cotangent = x.dot(y) / x.cross(y).length().max(f64::MIN_POSITIVE);
            sides.push((a.min(b), a.max(b), cotangent.clamp(-1e3, 1e3)));
        }
    }
    sides.sort_unstable_by(|x, y| (x.0, x.1).cmp(&(y.0, y.1)).then(x.2.total_cmp(&y.2)));
    sides
        .chunk_by(|x, y| (x.0, x.1) == (y.0, y.1))
        .map(|same| {
            let sum: f64 = same.iter().map(|s| s.2).sum();
            (
                same[0].0,
                same[0].1,
                (0.5 * sum).clamp(WEIGHTS[0], WEIGHTS[1]),
            )
        })
        .collect()
}

/// How far lengths of the plane are drawn out on the surface.
struct Stretches {
    /// At each vertex, against that of the whole.
    at: Vec<f64>,
    /// Root mean square over the surface, 1 for an isometry of the same area.
    whole: f64,
}

impl Stretches {
    /// Source: the L2 stretch of Sander et al. 2001, DOI 10.1145/383259.383307, bounded where triangles vanish.
    fn measure(positions: &[DVec3], triangles: &[[u32; 3]], places: &[DVec2]) -> Self {
        let corners = |t: &[u32; 3]| t.map(|k| (positions[k as usize], places[k as usize]));
        let mut areas = [0.0, 0.0];
        let parts: Vec<(f64, f64)> = triangles
            .iter()
            .map(|t| {
                let [(p, a), (q, b), (r, c)] = corners(t);
                let area = 0.5 * (q - p).cross(r - p).length();
                let twice = (b - a).perp_dot(c - a);
                areas[0] += area;
                areas[1] += 0.5 * twice.max(0.0);
                let du = p * (b.y - c.y) + q * (c.y - a.y) + r * (a.y - b.y);
                let dv = p * (c.x - b.x) + q * (a.x - c.x) + r * (b.x - a.x);
                let squared = 0.5 * (du.length_squared() + dv.length_squared());
                let square = if twice > 0.0 {
                    squared / (twice * twice)
                } else {
                    f64::INFINITY
                };
                (area, square)
            })
            .collect();
        let usual = areas[0] / areas[1].max(f64::MIN_POSITIVE);
        let mut sums = vec![(0.0, 0.0); positions.len()];
        let mut whole = 0.0;
        for (t, (area, square)) in triangles.iter().zip(&parts) {
            let square = (square / usual).clamp(0.0, LARGEST_STRETCH * LARGEST_STRETCH);
            whole += area * square;
            for &k in t {
                sums[k as usize].0 += area * square;
                sums[k as usize].1 += area;
            }
        }
        let whole = (whole / areas[0].max(f64::MIN_POSITIVE)).sqrt();
        Self {
            at: sums
                .iter()
                .map(|&(sum, area)| {
                    let own = if area > 0.0 {
                        (sum / area).sqrt()
                    } else {
                        whole
                    };
                    (own / whole).clamp(1.0 / LARGEST_STRETCH, LARGEST_STRETCH)
                })
                .collect(),
            whole,
        }
    }
}
