//! The dual graph of a mesh, and sparse systems on it.

use super::{Frame, NONE};
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMat, Triplet};
use faer::traits::ComplexField;
use faer::traits::ext::ComplexFieldExt;
use faer::{Mat, Side};
use glam::DVec3;
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
                    bend: sine.atan2(n.dot(m)),
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

/// Solves a positive definite system: its diagonal, its other entries (row, column, value) once for each pair, and
/// `count` right-hand sides. If the matrix is not definite to rounding (input that is not finite), the right-hand side
/// over the diagonal is returned.
pub(super) fn solve<T: ComplexField + std::ops::Div<Output = T> + Copy>(
    diagonal: &[T],
    off: &[(usize, usize, T)],
    count: usize,
    right: impl Fn(usize, usize) -> T,
) -> Vec<Vec<T>> {
    let n = diagonal.len();
    let mut entries: Vec<Triplet<usize, usize, T>> =
        (0..n).map(|t| Triplet::new(t, t, diagonal[t])).collect();
    for &(a, b, value) in off {
        // The lower triangle only.
        entries.push(if a > b {
            Triplet::new(a, b, value)
        } else {
            Triplet::new(b, a, value.conj())
        });
    }
    let solved = SparseColMat::try_new_from_triplets(n, n, &entries)
        .ok()
        .and_then(|matrix| {
            let symbolic = SymbolicLlt::try_new(matrix.symbolic(), Side::Lower).ok()?;
            let factor = Llt::try_new_with_symbolic(symbolic, matrix.as_ref(), Side::Lower).ok()?;
            Some(factor.solve(&Mat::from_fn(n, count, &right)))
        });
    let column = |k: usize| match &solved {
        Some(x) => (0..n).map(|t| x[(t, k)]).collect(),
        None => (0..n).map(|t| right(t, k) / diagonal[t]).collect(),
    };
    (0..count).map(column).collect()
}
