//! Meshes of bodies: nets relaxed on the exact surface, and the bracket's mesh along its creases.

use super::net::{Grid, Net};
use super::relax::Relaxed;
use super::surface::Exact;
use super::{Body, bracket_mesh};
use crate::sides::sides_by_edge;
use glam::{DVec3, IVec3};
use nurbskin_geometry::math;
use nurbskin_geometry::{Error, Result};
use rayon::prelude::*;

/// Vertices of the mesh that closest points are searched on and that scattered points are drawn from. Trial: the share of
/// 4 million points on the hammer's peen end, of radius 5, is the same within its standard deviation of 0.4 % with a
/// quarter and with four times as many; a quarter leaves the starts of the search farther off.
const EVEN: usize = 40_000;
/// The count of vertices may be off by this part. Guard: a tenth of it takes two more trials.
const COUNT_TOLERANCE: f64 = 0.002;
/// Most meshes that are made to find the size of the cells. Guard: 3 or 4 suffice.
const MAX_TRIALS: usize = 6;
/// Meshes that are tried until one has the topology of the body. Guard: the first has, unless the count is too low.
const ATTEMPTS: usize = 3;
/// Cells along the diagonal of the first trial. Guard: coarser nets miss thin parts.
const FIRST_CELLS: f64 = 90.0;

/// Triangles whose vertices lie on the surface, about the body's own origin.
#[derive(Clone, Debug)]
pub(super) struct Mesh {
    pub(super) points: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// A mesh for the search and for drawing points.
pub(super) fn even(exact: Exact) -> Mesh {
    relaxed(
        exact,
        sized(exact, EVEN, |h| net(exact, h), |net| net.0.points.len()),
    )
}

/// A mesh of about `count` vertices, with edges along the creases if asked and the body has creases.
///
/// # Errors
/// [`Error::Invalid`] if so few vertices cannot have the body's topology.
pub(super) fn mesh(exact: Exact, count: usize, creases: bool) -> Result<Mesh> {
    for attempt in 0..ATTEMPTS {
        // Other cells may separate what two sheets of one cell did not.
        let count = (count - attempt * count / 1000).max(4);
        let mesh = if creases && exact.0 == Body::Bracket {
            let made = sized(exact, count, bracket_mesh::mesh, |mesh| mesh.points.len());
            bracket_mesh::relaxed(made)
        } else {
            relaxed(
                exact,
                sized(exact, count, |h| net(exact, h), |net| net.0.points.len()),
            )
        };
        let euler = euler_characteristic(exact, &mesh);
        if euler == Some(exact.0.euler_characteristic()) && faces_outward(exact, &mesh) {
            return Ok(mesh);
        }
    }
    Err(Error::Invalid(format!(
        "{count} points are too few for a mesh of the {}: ask for more, or for a cloud",
        exact.0.name()
    )))
}

/// What `make` makes of the edge length that yields `count` vertices, or the nearest number of all trials: they grow
/// with the inverse square. Where a body's flat faces lie in planes of the grid, the number jumps.
fn sized<T>(exact: Exact, count: usize, make: impl Fn(f64) -> T, len: impl Fn(&T) -> usize) -> T {
    let [low, high] = exact.bounds();
    let mut length = low.distance(high) / FIRST_CELLS;
    let mut best = make(length);
    let mut ratio = len(&best).max(1) as f64 / count as f64;
    let mut off = math::ln(ratio).abs();
    for _ in 0..MAX_TRIALS {
        if off <= COUNT_TOLERANCE {
            break;
        }
        length *= ratio.sqrt();
        let made = make(length);
        ratio = len(&made).max(1) as f64 / count as f64;
        if math::ln(ratio).abs() < off {
            (best, off) = (made, math::ln(ratio).abs());
        }
    }
    best
}

/// The net of cells of about `length`. The tee's ends are the middles of layers of cells.
fn net(exact: Exact, length: f64) -> (Net, Grid) {
    let [low, high] = exact.bounds();
    let mut spacing = DVec3::splat(length);
    let mut origin = low - 1.5 * length;
    let mut count = ((high - low) / length + 3.5).as_ivec3();
    if exact.0 == Body::Tee {
        let cells = ((high.x - low.x) / length).round().max(1.0);
        spacing.x = (high.x - low.x) / cells;
        origin.x = low.x - 0.5 * spacing.x;
        count.x = IVec3::splat(1).x + DVec3::splat(cells).as_ivec3().x;
        origin.z = high.z + 0.5 * length - f64::from(count.z) * length;
    }
    let grid = Grid {
        origin,
        spacing,
        count,
    };
    (grid.net(&|p| exact.level(p).value), grid)
}

/// The net with its vertices on the surface, evenly.
fn relaxed(exact: Exact, (net, grid): (Net, Grid)) -> Mesh {
    let last = grid.count - 1;
    // Vertices of a layer at an end stay on its circle.
    let ends = exact.ends();
    let end = |k: usize| {
        let cell = net.cells[k];
        ends.iter().find(|end| {
            (end.normal.x < 0.0 && cell.x == 0)
                || (end.normal.x > 0.0 && cell.x == last.x)
                || (end.normal.z > 0.0 && cell.z == last.z)
        })
    };
    let project =
        |k: usize, p: DVec3| end(k).map_or_else(|| exact.project(p), |end| end.closest(p));
    let points = (0..net.points.len())
        .map(|k| project(k, net.points[k]))
        .collect();
    let count = net.points.len();
    let mut relaxed = Relaxed::new(points, net.triangles.clone(), vec![false; count]);
    relaxed.run(&project);
    Mesh {
        points: relaxed.points,
        triangles: relaxed.triangles,
    }
}

/// V - E + F; `None` unless every edge has two triangles, or one at a border of a body that has borders.
fn euler_characteristic(exact: Exact, mesh: &Mesh) -> Option<i64> {
    let sides = sides_by_edge(&mesh.triangles);
    let mut edges = 0_i64;
    for edge in sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        edges += 1;
        if edge.len() > 2 || (edge.len() == 1 && exact.ends().is_empty()) {
            return None;
        }
    }
    let count = |n: usize| i64::try_from(n).unwrap_or(i64::MAX);
    Some(count(mesh.points.len()) - edges + count(mesh.triangles.len()))
}

/// Whether every triangle faces as the surface does beside it; in a coarse mesh of a thin wall, some do not.
fn faces_outward(exact: Exact, mesh: &Mesh) -> bool {
    mesh.triangles.par_iter().all(|triangle| {
        let [a, b, c] = triangle.map(|k| mesh.points[k as usize]);
        let normal = (b - a).cross(c - a);
        exact.level((a + b + c) / 3.0).gradient.dot(normal) > 0.0
    })
}
