//! The largest distance of the points of a grid from a surface, never underestimated.

use glam::DVec3;
use nurbskin_geometry::{NurbsSurface, PointGrid};

/// The largest distance of the points of `grid` from `surface`, from above: every point's distance is that to an actual
/// point of the surface, found from its own parameters. Points whose own parameters already give no more than the
/// largest distance found are not looked at closer. O(m n log(m n)).
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
    for _ in 0..12 {
        let s = surface.derivatives(at[0], at[1]);
        let r = point - s.point;
        let tangents = [s.du, s.dv];
        let gradient = tangents.map(|t| t.dot(r));
        // At an end of the domain a step outward is none.
        let free = [0, 1].map(|d| {
            let (a, b) = domain[d];
            periodic[d] || !((at[d] <= a && gradient[d] < 0.0) || (at[d] >= b && gradient[d] > 0.0))
        });
        let [a, c] = tangents.map(|t| t.length_squared());
        let b = s.du.dot(s.dv);
        let determinant = a * c - b * b;
        let mut step = match free {
            [true, true] if determinant > 1e-12 * a * c => [
                (c * gradient[0] - b * gradient[1]) / determinant,
                (a * gradient[1] - b * gradient[0]) / determinant,
            ],
            [_, true] if c > 0.0 => [0.0, gradient[1] / c],
            [true, _] if a > 0.0 => [gradient[0] / a, 0.0],
            _ => break,
        };
        let mut better = None;
        for _ in 0..8 {
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
        if gained <= 1e-9 * best {
            break;
        }
    }
    best
}
