//! The largest distance of the points of a grid from a surface, never underestimated.
//!
//! ```text
//! max_k min over visited t of |Q_k - S(t)|   ≥   max_k dist(Q_k, S)
//! ```
//!
//! Points are visited in order of their distance at their own parameters; once that is below the largest foot distance,
//! the rest need no iteration. O(m n log(m n)).
//!
//! Source: Gauss-Newton projection as in A6.4, *The NURBS Book*; the pruning is ours.

use glam::DVec3;
use nurbskin_geometry::{NurbsSurface, PointGrid};

/// Most Gauss-Newton steps to a foot point. Count.
/// Guard: a distance is an upper bound wherever they end.
const MAX_FOOT_STEPS: usize = 12;
/// Most lengths of a step that are tried, each half of the one before. Count.
/// Guard: a step that does not help at 1/128 of its length hardly helps at all.
const MAX_STEP_HALVINGS: usize = 8;
/// Determinant of the first fundamental form, relative to the product of its diagonal, up to which the tangents count
/// as parallel. Dimensionless.
/// Guard: above rounding.
const PARALLEL_TANGENTS: f64 = 1e-12;
/// Relative fall of the distance in a step at which the iteration ends. Dimensionless.
/// Guard: far below any tolerance.
const CONVERGED_GAIN: f64 = 1e-9;

/// An upper bound of the largest distance of the points of `grid` from `surface`: the distance of every point is to an
/// actual point of the surface, found from its own parameters. Points whose distance at their parameters is no more
/// than the largest distance found are skipped. O(m n log(m n)).
pub(super) fn largest_distance(
    surface: &NurbsSurface,
    grid: &PointGrid,
    parameters: &[Vec<f64>; 2],
) -> f64 {
    let m = grid.count_u();
    let mut distances: Vec<(f64, usize)> = grid
        .points()
        .iter()
        .enumerate()
        .map(|(k, q)| {
            let on_surface = surface.point(parameters[0][k % m], parameters[1][k / m]);
            (on_surface.distance(*q), k)
        })
        .collect();
    distances.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut largest = 0.0_f64;
    for (distance, k) in distances {
        if distance <= largest {
            break;
        }
        let start = [parameters[0][k % m], parameters[1][k / m]];
        largest = largest.max(foot_distance(surface, grid.points()[k], start));
    }
    largest
}

/// The distance of `point` to the best of the surface points that a damped Gauss-Newton iteration visits.
fn foot_distance(surface: &NurbsSurface, point: DVec3, start: [f64; 2]) -> f64 {
    let domain = surface.domain();
    let periodic = surface.periodic();
    let mut at = start;
    let mut best = surface.point(at[0], at[1]).distance(point);
    for _ in 0..MAX_FOOT_STEPS {
        let s = surface.derivatives(at[0], at[1]);
        let r = point - s.point;
        let tangents = [s.du, s.dv];
        let gradient = tangents.map(|t| t.dot(r));
        // At an end of the domain an outward step is blocked.
        let free = [0, 1].map(|d| {
            let (a, b) = domain[d];
            periodic[d] || !((at[d] <= a && gradient[d] < 0.0) || (at[d] >= b && gradient[d] > 0.0))
        });
        let [a, c] = tangents.map(|t| t.length_squared());
        let b = s.du.dot(s.dv);
        let determinant = a * c - b * b;
        let mut step = match free {
            [true, true] if determinant > PARALLEL_TANGENTS * a * c => [
                (c * gradient[0] - b * gradient[1]) / determinant,
                (a * gradient[1] - b * gradient[0]) / determinant,
            ],
            [_, true] if c > 0.0 => [0.0, gradient[1] / c],
            [true, _] if a > 0.0 => [gradient[0] / a, 0.0],
            _ => break,
        };
        let mut better = None;
        for _ in 0..MAX_STEP_HALVINGS {
            let next = [0, 1].map(|d| {
                let to = at[d] + step[d];
                if periodic[d] {
                    to
                } else {
                    to.clamp(domain[d].0, domain[d].1)
                }
            });
            let distance = surface.point(next[0], next[1]).distance(point);
            if distance < best {
                better = Some((next, distance));
                break;
            }
            step = step.map(|x| 0.5 * x);
        }
        let Some((next, distance)) = better else {
            break;
        };
        let gained = best - distance;
        (at, best) = (next, distance);
        if gained <= CONVERGED_GAIN * best {
            break;
        }
    }
    best
}
