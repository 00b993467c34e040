//! The dual graph of a mesh, and sparse systems on it.

use super::{Frame, NONE};
use crate::cholesky::Pattern;
use glam::DVec3;
use nurbskin_geometry::math;
use nurbskin_scan::mesh::Manifold;

/// Largest weight of a link: length of the edge over the distance of the centroids. Trial: 20. Without a limit, needles
/// side by side dominate the matrix.
const MAX_WEIGHT: f64 = 20.0;
/// Least distance of centroids and square root of an area, as a share of the diagonal. Guard: triangles without extent
/// divide by it.
const MIN_DISTANCE: f64 = 1e-9;
/// Least area, in squares of the diagonal. Guard: keeps the rows of triangles without area definite.
const MIN_AREA: f64 = 1e-12;

/// The triangles of a mesh and the links between them across edges that are not hard.
pub(super) struct Links {
    pub(super) frames: Vec<Frame>,
    /// Areas, not zero.
    pub(super) areas: Vec<f64>,
    pub(super) links: Vec<Link>,
    /// Triangles at hard edges and borders, with the edge.
    pub(super) hard: Vec<(usize, DVec3)>,
    /// Diagonal of the box round the mesh, or 1 if it has no extent.
    pub(super) diagonal: f64,
}

/// Two triangles that share an edge.
pub(super) struct Link {
    pub(super) triangles: [usize; 2],
    /// The edge, in the direction of the first triangle.
    pub(super) edge: DVec3,
    /// Angle between the normals, positive where the surface is convex.
    pub(super) bend: f64,
    /// Length of the edge over the distance of the centroids.
    pub(super) weight: f64,
}

impl Links {
    pub(super) fn new(mesh: &Manifold, hard: &[bool]) -> Self {
        let count = mesh.triangles.len();
        let diagonal = diagonal(&mesh.points);
        let frames: Vec<Frame> = (0..count).map(|t| Frame::new(mesh.corners(t))).collect();
        let area = |t| mesh.vector_area(t).length() + MIN_AREA * diagonal * diagonal;
        let areas = (0..count).map(area).collect();
        let centre = |t: usize| mesh.corners(t).iter().sum::<DVec3>() / 3.0;
        let is_hard = |side: usize| hard.get(side).copied().unwrap_or(false);
        let opposite = mesh.adjacency().opposite;
        let mut made = Self {
            frames,
            areas,
            links: Vec::with_capacity(opposite.len() / 2),
            hard: Vec::new(),
            diagonal,
        };
        for (side, &other) in opposite.iter().enumerate() {
            let (a, s) = (side / 3, side % 3);
            let corners = mesh.corners(a);
            let edge = corners[(s + 1) % 3] - corners[s];
            let other = other as usize;
            if other == NONE as usize || is_hard(side) || is_hard(other) {
                made.hard.push((a, edge));
            } else if side < other {
                let b = other / 3;
                let [n, m] = [made.frames[a].normal, made.frames[b].normal];
                let sine = n.cross(m).dot(edge.normalize_or_zero());
                let apart = centre(a).distance(centre(b)).max(MIN_DISTANCE * diagonal);
                made.links.push(Link {
                    triangles: [a, b],
                    edge,
                    bend: math::atan2(sine, n.dot(m)),
                    weight: (edge.length() / apart).min(MAX_WEIGHT),
                });
            }
        }
        made
    }
}

/// Diagonal of the box round finite points; 1 if they have no extent.
fn diagonal(points: &[DVec3]) -> f64 {
    let mut finite = points.iter().filter(|p| p.is_finite());
    let first = finite.next().copied().unwrap_or_default();
    let (low, high) = finite.fold((first, first), |(l, h), p| (l.min(*p), h.max(*p)));
    let length = low.distance(high);
    if length > 0.0 { length } else { 1.0 }
}

/// Solves a symmetric positive definite system: its diagonal, its other entries (row, column, value) once for each pair,
/// and `count` right-hand sides. Entries at one place add up. If the matrix is not definite to rounding (input that is
/// not finite), the right-hand side over the diagonal is returned.
pub(super) fn solve(
    diagonal: &[f64],
    off: &[(usize, usize, f64)],
    count: usize,
    right: impl Fn(usize, usize) -> f64,
) -> Vec<Vec<f64>> {
    let n = diagonal.len();
    let factor = lower_triangle(diagonal, off)
        .and_then(|(columns, rows, values)| Pattern::new(&columns, &rows)?.factor(&values));
    let column = |k: usize| {
        let mut x: Vec<f64> = (0..n).map(|t| right(t, k)).collect();
        match &factor {
            Some(factor) => factor.solve(&mut x),
            None => x.iter_mut().zip(diagonal).for_each(|(x, d)| *x /= d),
        }
        x
    };
    (0..count).map(column).collect()
}

/// The beginnings of the columns of a lower triangle, its rows and its values, from its diagonal and other entries. None
/// if there are too many.
fn lower_triangle(
    diagonal: &[f64],
    off: &[(usize, usize, f64)],
) -> Option<(Vec<u32>, Vec<u32>, Vec<f64>)> {
    u32::try_from(diagonal.len() + off.len()).ok()?;
    let number = |k: usize| u32::try_from(k).ok();
    // Column, row, place in `off`: the sums are taken in that order.
    let mut order: Vec<(usize, usize, usize)> = (off.iter().enumerate())
        .map(|(k, &(a, b, _))| (a.min(b), a.max(b), k))
        .collect();
    order.sort_unstable();
    let mut order = order.into_iter().peekable();
    let (mut columns, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
    for (j, &own) in diagonal.iter().enumerate() {
        rows.push(number(j)?);
        values.push(own);
        let mut last = j;
        while let Some((_, row, k)) = order.next_if(|(column, ..)| *column == j) {
            if row == last {
                if let Some(value) = values.last_mut() {
                    *value += off[k].2;
                }
            } else {
                rows.push(number(row)?);
                values.push(off[k].2);
                last = row;
            }
        }
        columns.push(number(rows.len())?);
    }
    Some((columns, rows, values))
}
