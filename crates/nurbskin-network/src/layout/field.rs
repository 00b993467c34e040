//! A smooth cross field on a triangle mesh: four directions per triangle that follow the curvature and the hard lines.
//!
//! The curvature tensor of a triangle sums its edges, e being the unit edge, l its length and β the signed angle:
//! T = Σ β l / 2 · e eᵀ. One implicit step of diffusion over s = 0.02 D (D: diagonal of the box) smooths it. No link
//! crosses a hard edge. A is the diagonal of the areas, L the Laplacian of the dual graph:
//!
//! ```text
//! (A + s² L) T' = T
//! ```
//!
//! The cross z = exp(4 iθ), θ from the first side of the triangle, is smooth and near the principal directions z₀, by
//! the weight W = ((|k1| - |k2|) / (|k1| + |k2| + 1/D))², and near the hard edges. H is the connection Laplacian:
//!
//! ```text
//! (H + c W) z = c W z₀,   c = area / (2 s)²,   (H z)_a = Σ_b w_ab (z_a - exp(4 i (α_a - α_b)) z_b)
//! ```
//!
//! α is the angle of the common edge in each of the two triangles. Sources: D. Cohen-Steiner, J.-M. Morvan, *Restricted
//! Delaunay Triangulations and Normal Cycle*, Symposium on Computational Geometry 2003; F. Knöppel, K. Crane,
//! U. Pinkall, P. Schröder, *Globally Optimal Direction Fields*, ACM Transactions on Graphics 32 (4), 2013.

mod system;
#[cfg(test)]
mod tests;

use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use nurbskin_scan::mesh::Manifold;
use nurbskin_scan::mesh::manifold::NONE;
use system::{Links, solve};

/// Length over which curvature is averaged, as a share of the diagonal. Trial: 0.02 on banana, aorta, fandisk, bunny,
/// head and sea vase. 0.01 follows smaller details (ears and eyes of the head) and more noise.
pub const SMOOTHING: f64 = 0.02;
/// Weight of a hard edge in the alignment; that of the clearest principal direction is 1. Trial: 10, as in the prototype;
/// not varied. Crosses on a box are then along its edges within 1e-4 degrees.
const HARD_WEIGHT: f64 = 10.0;
/// Added to the diagonal of the connection Laplacian. Guard: keeps the matrix of a mesh without any curvature
/// definite; a millionth of the smallest weight that has an influence.
const MIN_DIAGONAL: f64 = 1e-9;

/// Four directions per triangle, a quarter turn apart: an arm, its perpendicular, and their opposites.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CrossField {
    /// One unit arm per triangle, in the triangle's plane.
    pub arms: Vec<DVec3>,
    /// How firmly each direction is determined, from 0 (arbitrary) to 1.
    pub strength: Vec<f64>,
    /// Absolute curvature along the arm and along its perpendicular, per unit of length.
    pub curvature: Vec<[f64; 2]>,
    /// Principal curvatures of each triangle, averaged over [`SMOOTHING`].
    pub principal: Vec<Principal>,
}

/// Principal curvatures at a triangle; convex is positive for outward triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Principal {
    /// Unit direction of `k1`, in the triangle's plane.
    pub direction: DVec3,
    /// The curvature of larger absolute value, per unit of length.
    pub k1: f64,
    /// The other one, at right angles.
    pub k2: f64,
}

/// The cross field of a mesh. `hard` marks the sides (3 t + s) of sharp lines, both sides of an edge or one of them;
/// borders count as hard. Two sparse factorisations in the number of triangles: about O(n log n) memory, O(n^1.5)
/// time. The result does not depend on the number of threads. A mesh without triangles has an empty field.
#[must_use]
pub fn cross_field(mesh: &Manifold, hard: &[bool]) -> CrossField {
    field_of(&Links::new(mesh, hard))
}

fn field_of(links: &Links) -> CrossField {
    let scale = SMOOTHING * links.diagonal;
    let tensors = smooth_tensors(links, scale);
    let principal: Vec<Principal> = (0..tensors.len())
        .map(|t| links.frames[t].principal(&tensors[t]))
        .collect();
    let z = crosses(links, &principal, scale);
    let mut field = CrossField {
        principal,
        ..CrossField::default()
    };
    for ((z, frame), tensor) in z.iter().zip(&links.frames).zip(&tensors) {
        let arm = frame.direction(math::direction_angle(*z) / 4.0);
        let beside = frame.normal.cross(arm);
        field.arms.push(arm);
        field.strength.push(z.length().min(1.0));
        // The tensor's value along a direction is the curvature across it.
        field
            .curvature
            .push([tensor.along(beside).abs(), tensor.along(arm).abs()]);
    }
    field
}

/// Principal curvatures of each triangle, averaged over a length. `hard` as in [`cross_field`].
#[must_use]
pub fn principal_curvatures(mesh: &Manifold, hard: &[bool], scale: f64) -> Vec<Principal> {
    let links = Links::new(mesh, hard);
    let tensors = smooth_tensors(&links, scale);
    let each = links.frames.iter().zip(&tensors);
    each.map(|(frame, tensor)| frame.principal(tensor))
        .collect()
}

/// An orthonormal frame of a triangle.
#[derive(Clone, Copy, Debug, Default)]
struct Frame {
    /// Along the first side.
    along: DVec3,
    /// normal × along.
    across: DVec3,
    normal: DVec3,
}

impl Frame {
    /// A triangle without area has a frame, too: any normal across its first side.
    fn new([a, b, c]: [DVec3; 3]) -> Self {
        let along = (b - a).normalize_or(DVec3::X);
        let normal = (b - a)
            .cross(c - a)
            .normalize_or(along.any_orthonormal_vector());
        Self {
            along,
            across: normal.cross(along),
            normal,
        }
    }

    fn direction(&self, angle: f64) -> DVec3 {
        math::cos(angle) * self.along + math::sin(angle) * self.across
    }

    fn angle(&self, direction: DVec3) -> f64 {
        math::atan2(direction.dot(self.across), direction.dot(self.along))
    }

    /// The tensor in the plane of the frame, its eigenvectors turned by a right angle.
    fn principal(&self, tensor: &Tensor) -> Principal {
        let [a, b] = [tensor.along(self.along), tensor.along(self.across)];
        let mixed = tensor.times(self.along).dot(self.across);
        let angle = 0.5 * math::atan2(2.0 * mixed, a - b);
        let (mean, half) = (0.5 * (a + b), math::hypot(0.5 * (a - b), mixed));
        let [large, small] = [mean + half, mean - half];
        if large.abs() >= small.abs() {
            Principal {
                direction: self.direction(angle + std::f64::consts::FRAC_PI_2),
                k1: large,
                k2: small,
            }
        } else {
            Principal {
                direction: self.direction(angle),
                k1: small,
                k2: large,
            }
        }
    }
}

/// A symmetric 3 x 3 matrix: xx, yy, zz, xy, xz, yz.
#[derive(Clone, Copy, Debug, Default)]
struct Tensor([f64; 6]);

impl Tensor {
    fn add(&mut self, e: DVec3, factor: f64) {
        let terms = [
            e.x * e.x,
            e.y * e.y,
            e.z * e.z,
            e.x * e.y,
            e.x * e.z,
            e.y * e.z,
        ];
        for (sum, term) in self.0.iter_mut().zip(terms) {
            *sum += factor * term;
        }
    }

    fn times(&self, v: DVec3) -> DVec3 {
        let [xx, yy, zz, xy, xz, yz] = self.0;
        DVec3::new(
            xx * v.x + xy * v.y + xz * v.z,
            xy * v.x + yy * v.y + yz * v.z,
            xz * v.x + yz * v.y + zz * v.z,
        )
    }

    fn along(&self, v: DVec3) -> f64 {
        v.dot(self.times(v))
    }
}

/// Curvature tensors per area, diffused over `scale`.
fn smooth_tensors(links: &Links, scale: f64) -> Vec<Tensor> {
    let mut sums = vec![Tensor::default(); links.frames.len()];
    for link in &links.links {
        for t in link.triangles {
            sums[t].add(
                link.edge.normalize_or_zero(),
                0.5 * link.bend * link.edge.length(),
            );
        }
    }
    let mut diagonal = links.areas.clone();
    let mut off = Vec::with_capacity(links.links.len());
    for link in &links.links {
        let weight = scale * scale * link.weight;
        let [a, b] = link.triangles;
        diagonal[a] += weight;
        diagonal[b] += weight;
        off.push((a, b, -weight));
    }
    let columns = solve(&diagonal, &off, 6, |t, k| sums[t].0[k]);
    let of = |t: usize| Tensor(std::array::from_fn(|k| columns[k][t]));
    (0..sums.len()).map(of).collect()
}

/// The smooth crosses, as complex numbers in the frames of the triangles: real and imaginary parts are the unknowns 2t and
/// 2t + 1.
fn crosses(links: &Links, principal: &[Principal], scale: f64) -> Vec<DVec2> {
    let cross = |angle: f64| math::unit_vector(4.0 * angle);
    let mut weights = Vec::with_capacity(principal.len());
    let mut wanted = Vec::with_capacity(principal.len());
    for (k, frame) in principal.iter().zip(&links.frames) {
        let [large, small] = [k.k1.abs(), k.k2.abs()];
        let weight = ((large - small) / (large + small + links.diagonal.recip())).powi(2);
        weights.push(weight);
        wanted.push(cross(frame.angle(k.direction)) * weight);
    }
    for &(t, edge) in &links.hard {
        weights[t] += HARD_WEIGHT;
        wanted[t] += cross(links.frames[t].angle(edge)) * HARD_WEIGHT;
    }
    let factor = |t: usize| links.areas[t] / (2.0 * scale).powi(2);
    let own = |t: usize| factor(t) * weights[t] + MIN_DIAGONAL;
    let mut diagonal: Vec<f64> = (0..2 * weights.len()).map(|k| own(k / 2)).collect();
    let mut off = Vec::with_capacity(4 * links.links.len());
    for link in &links.links {
        let [a, b] = link.triangles;
        for k in [2 * a, 2 * a + 1, 2 * b, 2 * b + 1] {
            diagonal[k] += link.weight;
        }
        let turn = links.frames[a].angle(link.edge) - links.frames[b].angle(link.edge);
        // The product with a complex number, as a matrix of two rows.
        let z = -link.weight * cross(turn);
        off.extend(
            [(0, 0, z.x), (0, 1, -z.y), (1, 0, z.y), (1, 1, z.x)]
                .map(|(i, j, value)| (2 * a + i, 2 * b + j, value)),
        );
    }
    let parts = |k: usize, _| wanted[k / 2][k % 2] * factor(k / 2);
    let solution = solve(&diagonal, &off, 1, parts);
    let number = |z: &[f64]| DVec2::from_slice(z);
    solution
        .iter()
        .flat_map(|x| x.chunks_exact(2))
        .map(number)
        .collect()
}
