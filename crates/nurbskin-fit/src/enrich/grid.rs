//! Catmull-Clark subdivision of ordered grids: tensor products of the cubic curve rules.
//!
//! ```text
//! refinement  (1, 6, 1) / 8 at points, (1, 1) / 2 between them        limit  (1, 4, 1) / 6
//! ```
//!
//! On a regular grid Catmull-Clark subdivision is knot insertion into a uniform bicubic B-spline surface. Control
//! points with given limits solve a tridiagonal system (1, 4, 1) / 6 per direction, cyclic where it is closed.
//! Meridians of a sphere continue on the opposite ones, through the poles.
//!
//! Sources: Catmull and Clark 1978; masks of Pal and Ballav 2007, figure 4.

use super::check_size;
use crate::chart::Topology;
use glam::DVec3;
use nurbskin_geometry::{PointGrid, Result};

/// A rule for a curve of control points; the flag marks a closed curve.
type CurveRule = fn(&[DVec3], bool) -> Vec<DVec3>;

/// One plain Catmull-Clark step: m lines become 2 m - 1 where the direction is open and 2 m where it is closed, and the
/// old points, at even indices, move. Open ends follow the cubic curve rule with the corners fixed. Poles of a
/// [`Topology::Sphere`] follow the meridians through them and stay single points. O(m n).
///
/// Source: Catmull & Clark 1978; the masks of Pal & Ballav 2007, figure 4.
///
/// # Errors
/// [`nurbskin_geometry::Error::Unsupported`] if the result would have more than 2^26 points.
pub fn subdivide_grid(grid: &PointGrid, topology: Topology) -> Result<PointGrid> {
    check_size(enriched_count(grid, topology, 1))?;
    with_single_poles(
        &along_both(grid, Ends::of(grid, topology), refined)?,
        topology,
    )
}

/// The limit positions of the control points `grid`: where infinitely many Catmull-Clark steps move them. O(m n).
///
/// # Errors
/// [`nurbskin_geometry::Error::Invalid`] if a coordinate overflows.
pub fn limit_grid(grid: &PointGrid, topology: Topology) -> Result<PointGrid> {
    with_single_poles(
        &along_both(grid, Ends::of(grid, topology), limit)?,
        topology,
    )
}

/// The control points whose limit positions are the points of `grid`: the solution of a tridiagonal system (1, 4, 1) /
/// 6 per direction, cyclic in closed directions, with fixed ends in open ones. The control points at a pole need not
/// coincide, but their limits do. O(m n).
///
/// # Errors
/// [`nurbskin_geometry::Error::Invalid`] if a coordinate overflows.
pub fn controls_of_grid(grid: &PointGrid, topology: Topology) -> Result<PointGrid> {
    along_both(grid, Ends::of(grid, topology), controls)
}

/// A denser grid through the same points: `levels` Catmull-Clark steps on the control points whose limit surface passes
/// through all points of `grid`, taken to the limit. The point (i, j) of `grid` is the point
/// (2^levels i, 2^levels j) of the result, to the last bit. O(4^levels m n).
///
/// On a sphere with an even number of lines around it the surface is smooth across the poles (a meridian continues on
/// the opposite one); with an odd number the meridians end there freely.
///
/// # Errors
/// [`nurbskin_geometry::Error::Unsupported`] if the result would have more than 2^26 points;
/// [`nurbskin_geometry::Error::Invalid`] if a coordinate overflows.
///
/// ```
/// use nurbskin_geometry::{DVec3, PointGrid};
/// use nurbskin_fit::chart::Topology;
/// use nurbskin_fit::enrich::enrich_grid;
/// let grid = PointGrid::from_fn(4, 5, |i, j| DVec3::new(i as f64, j as f64, (i * j) as f64))?;
/// let dense = enrich_grid(&grid, Topology::Disk, 2)?;
/// assert_eq!(dense.counts(), [13, 17]);
/// assert_eq!(dense.point(4 * 2, 4 * 3), grid.point(2, 3));
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
pub fn enrich_grid(grid: &PointGrid, topology: Topology, levels: usize) -> Result<PointGrid> {
    if levels == 0 {
        return Ok(grid.clone());
    }
    check_size(enriched_count(grid, topology, levels))?;
    let ends = Ends::of(grid, topology);
    let mut dense = along_both(grid, ends, controls)?;
    for _ in 0..levels {
        dense = along_both(&dense, ends, refined)?;
    }
    dense = along_both(&dense, ends, limit)?;
    // The original points are there up to rounding; their exact values are restored.
    let [m, n] = dense.counts();
    let stride = 1 << levels;
    let mut points = dense.into_points();
    for j in 0..grid.count_v() {
        for i in 0..grid.count_u() {
            points[j * stride * m + i * stride] = grid.point(i, j);
        }
    }
    PointGrid::new(m, n, points)
}

/// Number of points after `levels` steps; `None` on overflow.
fn enriched_count(grid: &PointGrid, topology: Topology, levels: usize) -> Option<usize> {
    let closed = topology.closed();
    let factor = 1_usize.checked_shl(u32::try_from(levels).ok()?)?;
    let [m, n] = [0, 1].map(|direction| {
        let count = grid.counts()[direction];
        if closed[direction] {
            count.checked_mul(factor)
        } else {
            (count - 1).checked_mul(factor)?.checked_add(1)
        }
    });
    // A shift past the width of the integer gives zero, which is an overflow as well.
    (factor > 0).then_some(())?;
    m?.checked_mul(n?)
}

/// The treatment of the ends of a grid's lines.
#[derive(Clone, Copy)]
struct Ends {
    closed: [bool; 2],
    /// Whether a line of constant v continues on the opposite one, through the poles.
    through_poles: bool,
}

impl Ends {
    /// Meridians have an opposite one if their number is even. The first grid decides: every refined one is even.
    fn of(grid: &PointGrid, topology: Topology) -> Self {
        Self {
            closed: topology.closed(),
            through_poles: topology == Topology::Sphere
                && grid.count_v().is_multiple_of(2)
                && grid.count_u() > 1,
        }
    }
}

/// The rule applied along u and then along v.
fn along_both(grid: &PointGrid, ends: Ends, rule: CurveRule) -> Result<PointGrid> {
    let half_turn = grid.count_v() / 2;
    let rows: Vec<Vec<DVec3>> = if ends.through_poles {
        let (first, second): (Vec<_>, Vec<_>) = (0..half_turn)
            .map(|j| through_poles(grid.row(j), grid.row(j + half_turn), rule))
            .unzip();
        first.into_iter().chain(second).collect()
    } else {
        (0..grid.count_v())
            .map(|j| rule(grid.row(j), ends.closed[0]))
            .collect()
    };
    let along_u = PointGrid::new(rows[0].len(), rows.len(), rows.concat())?.transposed();
    let columns: Vec<Vec<DVec3>> = (0..along_u.count_v())
        .map(|i| rule(along_u.row(i), ends.closed[1]))
        .collect();
    Ok(PointGrid::new(columns[0].len(), columns.len(), columns.concat())?.transposed())
}

/// The rule on the closed curve of two opposite meridians, split into the two again. The poles belong to both.
fn through_poles(near: &[DVec3], far: &[DVec3], rule: CurveRule) -> (Vec<DVec3>, Vec<DVec3>) {
    let inner = &far[1..far.len() - 1];
    let ring: Vec<DVec3> = near.iter().chain(inner.iter().rev()).copied().collect();
    let ring = rule(&ring, true);
    let near = ring[..=ring.len() / 2].to_vec();
    let far = std::iter::once(ring[0])
        .chain(ring[ring.len() / 2..].iter().rev().copied())
        .collect();
    (near, far)
}

/// The grid with each pole row replaced by its mean.
fn with_single_poles(grid: &PointGrid, topology: Topology) -> Result<PointGrid> {
    if topology != Topology::Sphere {
        return Ok(grid.clone());
    }
    let last = grid.count_u() - 1;
    let mean = |i: usize| grid.column(i).sum::<DVec3>() / grid.count_v() as f64;
    let poles = [mean(0), mean(last)];
    PointGrid::from_fn(grid.count_u(), grid.count_v(), |i, j| match i {
        0 => poles[0],
        i if i == last => poles[1],
        _ => grid.point(i, j),
    })
}

/// The neighbours of point k on a curve; the ends of an open curve are their own neighbours.
fn neighbours(curve: &[DVec3], k: usize, closed: bool) -> Option<[DVec3; 2]> {
    let count = curve.len();
    (closed || (k > 0 && k + 1 < count))
        .then(|| [curve[(k + count - 1) % count], curve[(k + 1) % count]])
}

/// Cubic subdivision: (1, 6, 1) / 8 at the points, (1, 1) / 2 between them.
fn refined(curve: &[DVec3], closed: bool) -> Vec<DVec3> {
    let count = curve.len();
    let mut refined = Vec::with_capacity(2 * count);
    for (k, &point) in curve.iter().enumerate() {
        refined.push(match neighbours(curve, k, closed) {
            Some([before, after]) => 0.125 * (before + after) + 0.75 * point,
            None => point,
        });
        if closed || k + 1 < count {
            refined.push(0.5 * point + 0.5 * curve[(k + 1) % count]);
        }
    }
    refined
}

/// (1, 4, 1) / 6.
fn limit(curve: &[DVec3], closed: bool) -> Vec<DVec3> {
    (0..curve.len())
        .map(|k| match neighbours(curve, k, closed) {
            Some([before, after]) => (before + after) / 6.0 + curve[k] * (2.0 / 3.0),
            None => curve[k],
        })
        .collect()
}

/// The control points with these limits: the inverse of [`limit`].
fn controls(curve: &[DVec3], closed: bool) -> Vec<DVec3> {
    let count = curve.len();
    if !closed {
        if count < 3 {
            return curve.to_vec();
        }
        let mut right: Vec<DVec3> = curve[1..count - 1].iter().map(|&q| 6.0 * q).collect();
        let last = right.len() - 1;
        right[0] -= curve[0];
        right[last] -= curve[count - 1];
        solve_141(&mut right, 4.0, 4.0);
        let ends = [curve[0], curve[count - 1]];
        return std::iter::once(ends[0])
            .chain(right)
            .chain([ends[1]])
            .collect();
    }
    match *curve {
        [] | [_] => curve.to_vec(),
        // Both neighbours of a point are the other one: (4 a + 2 b) / 6.
        [a, b] => vec![2.0 * a - b, 2.0 * b - a],
        _ => {
            // Sherman-Morrison: the cyclic matrix is a tridiagonal one plus w w^T with w = (1, 0 .. 0, 1).
            let mut solution: Vec<DVec3> = curve.iter().map(|&q| 6.0 * q).collect();
            let mut correction = vec![DVec3::ZERO; count];
            correction[0] = DVec3::ONE;
            correction[count - 1] = DVec3::ONE;
            solve_141(&mut solution, 3.0, 3.0);
            solve_141(&mut correction, 3.0, 3.0);
            let factor = (solution[0] + solution[count - 1])
                / (DVec3::ONE + correction[0] + correction[count - 1]);
            for (x, z) in solution.iter_mut().zip(&correction) {
                *x -= factor * *z;
            }
            solution
        }
    }
}

/// Solves, in place, the tridiagonal system with rows (1, 4, 1) but `first` and `last` as the outer diagonal entries.
/// It is diagonally dominant, so that elimination needs no pivoting.
fn solve_141(right: &mut [DVec3], first: f64, last: f64) {
    let count = right.len();
    let mut above = vec![0.0; count];
    for k in 0..count {
        let diagonal = match k {
            _ if count == 1 => first.min(last),
            0 => first,
            _ if k == count - 1 => last,
            _ => 4.0,
        };
        let (previous, factor) = if k > 0 {
            (right[k - 1], above[k - 1])
        } else {
            (DVec3::ZERO, 0.0)
        };
        above[k] = 1.0 / (diagonal - factor);
        right[k] = (right[k] - previous) * above[k];
    }
    for k in (1..count).rev() {
        let next = right[k];
        right[k - 1] -= above[k - 1] * next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controls_invert_the_limit() {
        for count in 1..12 {
            let curve: Vec<DVec3> = (0..count)
                .map(|k| DVec3::new((k * k) as f64, (k as f64).sin(), 1.0 / (1.0 + k as f64)))
                .collect();
            for closed in [false, true] {
                let back = limit(&controls(&curve, closed), closed);
                for (a, b) in back.iter().zip(&curve) {
                    assert!(a.distance(*b) < 1e-13, "{count} {closed}");
                }
            }
        }
    }
}
