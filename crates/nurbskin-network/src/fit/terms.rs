//! Terms of the objective that belong to one face: distances of points, and bending.
//!
//! - Tangent distance: w [(n . (S - X))^2 + eps |S - X|^2 across n], with the normal n of the scan. A small eps lets the
//!   parameters of the points slide along the surface.
//! - Bending: the thin plate `a b (S_uu^2 / a^4 + 2 S_uv^2 / (a b)^2 + S_vv^2 / b^4)` with the lengths a and b of the face, by
//!   Gauss quadrature, exactly.
//!
//! Source: A. Blake, M. Isard, *Active Contours* (1998), for distances along the normal; H. Pottmann, M. Hofer, *Geometry of
//! the squared distance function to curves and surfaces* (2003).

use super::network::{DEGREE, Face, WIDTH};
use super::patch::Along;
use super::system::{STENCIL, Symmetric, add, directed, place, scalar, times};
use crate::layout::OnFace;
use glam::DVec3;
use nurbskin_geometry::numeric::quadrature::gauss_legendre;
use nurbskin_geometry::nurbs::KnotVector;
use nurbskin_geometry::nurbs::basis::basis_derivatives;

/// Weight of a point on a line, or beyond an open side, as a point of the faces.
/// Trial: not recorded; the normal of the first says little, and the second lies on no face.
pub(crate) const ON_LINE_WEIGHT: f64 = 1e-3;
/// Points of the quadrature of [`evenness`] per span and direction. Count.
/// Derived: exact for the second derivatives along their own direction; the others only need to be bounded.
const EVEN_POINTS: usize = 3;

/// The points that a network is fitted to, and where they lie on it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Samples {
    /// The points.
    pub(crate) points: Vec<DVec3>,
    /// Their unit normals.
    pub(crate) normals: Vec<DVec3>,
    /// Their weights.
    pub(crate) weights: Vec<f64>,
    /// The nearest place known.
    pub(crate) feet: Vec<OnFace>,
    /// Distance from there.
    pub(crate) distances: Vec<f64>,
}

impl Samples {
    /// The indices of the points on each of `faces` faces, ascending.
    pub(crate) fn by_face(&self, faces: usize) -> Vec<Vec<u32>> {
        let mut lists = vec![Vec::new(); faces];
        for (k, foot) in (0_u32..).zip(&self.feet) {
            lists[foot.face as usize].push(k);
        }
        lists
    }
}

/// The normal equations of one face in its control points.
#[derive(Clone, Debug)]
pub(crate) struct FaceTerms {
    /// For each control point the blocks with its partners.
    pub(crate) stencil: Vec<Symmetric>,
    /// For each control point the right-hand side.
    pub(crate) rhs: Vec<DVec3>,
    /// Trace of the sum w B'B of the basis functions: the scale of the data.
    pub(crate) trace: f64,
}

/// The distances of some points from a face with these sides open. `slide` is eps: 1 for plain distances. O(points).
pub(crate) fn distances(
    face: &Face,
    open: [bool; 4],
    samples: &Samples,
    points: &[u32],
    slide: f64,
) -> FaceTerms {
    let [nu, nv] = face.counts();
    let mut terms = FaceTerms {
        stencil: vec![[0.0; 6]; nu * nv * STENCIL],
        rhs: vec![DVec3::ZERO; nu * nv],
        trace: 0.0,
    };
    let patch = face.patch();
    for &k in points {
        let k = k as usize;
        let OnFace { u, v, .. } = samples.feet[k];
        let basis = patch.basis::<0>(u, v);
        let [bu, bv] = [&basis[0].values[0], &basis[1].values[0]];
        let mut b = [0.0; WIDTH * WIDTH];
        for j in 0..WIDTH {
            for i in 0..WIDTH {
                b[j * WIDTH + i] = bu[i] * bv[j];
            }
        }
        let w = match face.is_beyond(open, [u, v], samples.points[k]) {
            true => ON_LINE_WEIGHT * samples.weights[k],
            false => samples.weights[k],
        };
        let block = directed(samples.normals[k], w, w * slide);
        let pull = times(&block, samples.points[k]);
        let first = basis[1].first * nu + basis[0].first;
        for j in 0..WIDTH {
            for i in 0..WIDTH {
                let one = b[j * WIDTH + i];
                let at = first + j * nu + i;
                terms.rhs[at] += one * pull;
                terms.trace += w * one * one;
                let row = &mut terms.stencil[at * STENCIL..(at + 1) * STENCIL];
                for (m, partner) in row[..WIDTH - i].iter_mut().enumerate() {
                    add(partner, &block, one * b[j * WIDTH + i + m]);
                }
                for l in j + 1..WIDTH {
                    let start = place(-i.cast_signed(), (l - j).cast_signed());
                    for (m, partner) in row[start..start + WIDTH].iter_mut().enumerate() {
                        add(partner, &block, one * b[l * WIDTH + m]);
                    }
                }
            }
        }
    }
    terms
}

/// Integrals of products of the d-th derivatives, d = 0 to 2, of the functions i and i + k along one direction:
/// `[d][i][k]`.
pub(crate) fn grams(knots: &KnotVector) -> [Vec<[f64; WIDTH]>; 3] {
    let n = knots.control_point_count();
    let mut grams = [0; 3].map(|_| vec![[0.0; WIDTH]; n]);
    let rule = gauss_legendre(WIDTH);
    let breaks = knots.breakpoints();
    for w in breaks.windows(2) {
        let half = 0.5 * (w[1] - w[0]);
        for &(x, weight) in &rule {
            let t = w[0] + half * (1.0 + x);
            let span = knots.span(t);
            let mut b = [0.0; 3 * WIDTH];
            basis_derivatives(knots, span, t, 2, &mut b);
            for (gram, b) in grams.iter_mut().zip(b.chunks(WIDTH)) {
                for i in 0..WIDTH {
                    for k in i..WIDTH {
                        gram[span - DEGREE + i][k - i] += half * weight * b[i] * b[k];
                    }
                }
            }
        }
    }
    grams
}

/// The thin plate of a face of these lengths in the half stencil of its control points, and its trace. O(n).
pub(crate) fn bending(face: &Face, [a, b]: [f64; 2]) -> (Vec<f64>, f64) {
    let [nu, nv] = face.counts();
    let [gu, gv] = [0, 1].map(|d| grams(&face.knots[d]));
    let mut stencil = vec![0.0; nu * nv * STENCIL];
    let mut trace = 0.0;
    let [w0, w1, w2] = [b / (a * a * a), 2.0 / (a * b), a / (b * b * b)];
    for j in 0..nv {
        for i in 0..nu {
            let row = &mut stencil[(j * nu + i) * STENCIL..][..STENCIL];
            for dj in 0..WIDTH.min(nv - j) {
                let low = if dj == 0 { 0 } else { i.min(DEGREE) };
                for k in (i - low)..(i + WIDTH).min(nu) {
                    let (lo, off) = (k.min(i), k.abs_diff(i));
                    let value = w0 * gu[2][lo][off] * gv[0][j][dj]
                        + w1 * gu[1][lo][off] * gv[1][j][dj]
                        + w2 * gu[0][lo][off] * gv[2][j][dj];
                    row[place(k.cast_signed() - i.cast_signed(), dj.cast_signed())] = value;
                }
            }
            trace += row[0];
        }
    }
    (stencil, trace)
}

/// The part of the thin plate along the surface: of the second derivatives only what lies in the tangent plane, so that the
/// parameters are even and the shape is free. In the half stencil. O(n).
pub(crate) fn evenness(face: &Face, [a, b]: [f64; 2]) -> Vec<Symmetric> {
    let [nu, nv] = face.counts();
    let mut stencil = vec![[0.0; 6]; nu * nv * STENCIL];
    let [w0, w1, w2] = [b / (a * a * a), 2.0 / (a * b), a / (b * b * b)];
    let patch = face.patch();
    let rule = gauss_legendre(EVEN_POINTS);
    let [us, vs] = [0, 1].map(|d| {
        let breaks = face.knots[d].breakpoints();
        let places = |w: &[f64]| {
            let (low, half) = (w[0], 0.5 * (w[1] - w[0]));
            rule.iter()
                .map(move |&(x, weight)| (low + half * (1.0 + x), half * weight))
                .collect::<Vec<_>>()
        };
        breaks
            .windows(2)
            .flat_map(places)
            .map(|(t, weight)| (Along::new::<2>(&face.knots[d], t), weight))
            .collect::<Vec<(Along, f64)>>()
    });
    for (v, wv) in &vs {
        for (u, wu) in &us {
            let normal = patch.tangents_of(u, v).normal();
            let block = directed(normal, 0.0, wu * wv);
            let ([bu, du, ddu], [bv, dv, ddv]) = (&u.values, &v.values);
            let mut rows = [[0.0; WIDTH * WIDTH]; 3];
            for j in 0..WIDTH {
                for i in 0..WIDTH {
                    rows[0][j * WIDTH + i] = ddu[i] * bv[j];
                    rows[1][j * WIDTH + i] = du[i] * dv[j];
                    rows[2][j * WIDTH + i] = bu[i] * ddv[j];
                }
            }
            let product = |p: usize, q: usize| {
                w0 * rows[0][p] * rows[0][q]
                    + w1 * rows[1][p] * rows[1][q]
                    + w2 * rows[2][p] * rows[2][q]
            };
            let first = v.first * nu + u.first;
            for j in 0..WIDTH {
                for i in 0..WIDTH {
                    let (at, p) = (first + j * nu + i, j * WIDTH + i);
                    let row = &mut stencil[at * STENCIL..(at + 1) * STENCIL];
                    for (m, partner) in row[..WIDTH - i].iter_mut().enumerate() {
                        add(partner, &block, product(p, p + m));
                    }
                    for l in j + 1..WIDTH {
                        let start = place(-i.cast_signed(), (l - j).cast_signed());
                        for (m, partner) in row[start..start + WIDTH].iter_mut().enumerate() {
                            add(partner, &block, product(p, l * WIDTH + m));
                        }
                    }
                }
            }
        }
    }
    stencil
}

/// Adds `w` times blocks to blocks.
pub(crate) fn add_blocks(stencil: &mut [Symmetric], blocks: &[Symmetric], w: f64) {
    for (block, other) in stencil.iter_mut().zip(blocks) {
        add(block, other, w);
    }
}

/// Adds `w` times scalar entries to blocks.
pub(crate) fn add_scalars(stencil: &mut [Symmetric], values: &[f64], w: f64) {
    for (block, &value) in stencil.iter_mut().zip(values) {
        add(block, &scalar(1.0), w * value);
    }
}

/// The thin-plate energy of a face's control points, for tests and figures.
#[cfg(test)]
pub(crate) fn energy(face: &Face, lengths: [f64; 2]) -> f64 {
    let [nu, nv] = face.counts();
    let (stencil, _) = bending(face, lengths);
    let mut sum = 0.0;
    for j in 0..nv {
        for i in 0..nu {
            let one = face.net[j * nu + i];
            for dj in 0..WIDTH.min(nv - j) {
                let low = if dj == 0 { 0 } else { i.min(DEGREE) };
                for k in (i - low)..(i + WIDTH).min(nu) {
                    let at = place(k.cast_signed() - i.cast_signed(), dj.cast_signed());
                    let both = if at == 0 { 1.0 } else { 2.0 };
                    sum += both
                        * stencil[(j * nu + i) * STENCIL + at]
                        * one.dot(face.net[(j + dj) * nu + k]);
                }
            }
        }
    }
    sum
}
