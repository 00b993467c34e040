//! Evaluation of one bicubic face, and the nearest place on it.

use super::network::{DEGREE, WIDTH};
use glam::DVec3;
use nurbskin_geometry::nurbs::KnotVector;
use nurbskin_geometry::nurbs::basis::{basis_derivatives, basis_functions};

/// Steps of the search for a foot. Count.
/// Guard: it converges quadratically near the foot; a start from the last iteration needs two or three.
const FOOT_STEPS: usize = 12;
/// Halvings of a step that does not come nearer. Count.
/// Guard: 0.4^8 is below a thousandth of the step.
const HALVINGS: usize = 8;
/// Factor by which a step that does not come nearer is shortened.
/// Trial: not recorded.
const SHORTEN: f64 = 0.4;
/// Parameter step at which the search ends. Face widths.
/// Guard: far below the deviation that a step of this size makes.
const SMALLEST_STEP: f64 = 1e-9;
/// Determinant of the Hessian, as a share of the product of its Gauss-Newton diagonal, below which that of Gauss-Newton is
/// taken.
/// Guard: keeps the step a descent.
const LEAST_DETERMINANT: f64 = 1e-3;

/// The corners of a face, (u, v), in the order of its vertices.
pub(crate) const CORNERS: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

/// The basis functions along one direction at a parameter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Along {
    /// The first control point that counts.
    pub(crate) first: usize,
    /// `values[k][i]`: k-th derivative of the i-th function.
    pub(crate) values: [[f64; WIDTH]; 3],
}

impl Along {
    /// At a parameter, with derivatives up to `ORDER`, at most 2.
    #[inline]
    pub(crate) fn new<const ORDER: usize>(knots: &KnotVector, t: f64) -> Self {
        let span = knots.span(t);
        let mut values = [[0.0; WIDTH]; 3];
        let out = values.as_flattened_mut();
        match ORDER {
            0 => basis_functions(knots, span, t, out),
            order => basis_derivatives(knots, span, t, order, out),
        }
        Self {
            first: span - DEGREE,
            values,
        }
    }
}

/// A point and its partial derivatives.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Jet {
    pub(crate) point: DVec3,
    pub(crate) du: DVec3,
    pub(crate) dv: DVec3,
    pub(crate) duu: DVec3,
    pub(crate) duv: DVec3,
    pub(crate) dvv: DVec3,
}

impl Jet {
    /// Unit normal; zero where the derivatives are parallel.
    pub(crate) fn normal(&self) -> DVec3 {
        self.du.cross(self.dv).normalize_or_zero()
    }
}

/// A place on a face and its distance from a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PatchFoot {
    pub(crate) u: f64,
    pub(crate) v: f64,
    pub(crate) squared: f64,
}

/// One face, borrowed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patch<'a> {
    knots: [&'a KnotVector; 2],
    net: &'a [DVec3],
    width: usize,
}

impl<'a> Patch<'a> {
    pub(crate) fn new(u: &'a KnotVector, v: &'a KnotVector, net: &'a [DVec3]) -> Self {
        Self {
            knots: [u, v],
            net,
            width: u.control_point_count(),
        }
    }

    /// The basis of both directions at a place, with derivatives up to `ORDER`, at most 2.
    #[inline]
    pub(crate) fn basis<const ORDER: usize>(&self, u: f64, v: f64) -> [Along; 2] {
        let [along_u, along_v] = self.knots;
        [
            Along::new::<ORDER>(along_u, u),
            Along::new::<ORDER>(along_v, v),
        ]
    }

    /// The basis functions along direction d at each of some parameters.
    pub(crate) fn bases<const ORDER: usize>(&self, d: usize, at: &[f64]) -> Vec<Along> {
        let knots = self.knots[d];
        at.iter().map(|&t| Along::new::<ORDER>(knots, t)).collect()
    }

    /// Indices of the control points that count at a place, v by v.
    pub(crate) fn indices(&self, [u, v]: &[Along; 2]) -> impl Iterator<Item = [usize; 3]> + use<> {
        let (i0, j0, width) = (u.first, v.first, self.width);
        (0..WIDTH).flat_map(move |j| (0..WIDTH).map(move |i| [(j0 + j) * width + i0 + i, i, j]))
    }

    /// The point at a place.
    pub(crate) fn point(&self, u: f64, v: f64) -> DVec3 {
        let basis = self.basis::<0>(u, v);
        let [bu, bv] = [&basis[0].values[0], &basis[1].values[0]];
        self.indices(&basis)
            .map(|[at, i, j]| bu[i] * bv[j] * self.net[at])
            .sum()
    }

    /// The point and its derivatives to the first order.
    pub(crate) fn tangents(&self, u: f64, v: f64) -> Jet {
        let [u, v] = self.basis::<1>(u, v);
        self.tangents_of(&u, &v)
    }

    /// The same from the basis functions, with derivatives of the first order.
    #[inline]
    pub(crate) fn tangents_of(&self, u: &Along, v: &Along) -> Jet {
        let ([bu, du, _], [bv, dv, _]) = (&u.values, &v.values);
        let mut jet = Jet::default();
        for j in 0..WIDTH {
            let row = &self.net[(v.first + j) * self.width + u.first..][..WIDTH];
            let (mut p, mut d) = (DVec3::ZERO, DVec3::ZERO);
            for i in 0..WIDTH {
                p += bu[i] * row[i];
                d += du[i] * row[i];
            }
            jet.point += bv[j] * p;
            jet.du += bv[j] * d;
            jet.dv += dv[j] * p;
        }
        jet
    }

    /// The point and its derivatives to the second order.
    pub(crate) fn jet(&self, u: f64, v: f64) -> Jet {
        let [u, v] = self.basis::<2>(u, v);
        let ([bu, du, duu], [bv, dv, dvv]) = (&u.values, &v.values);
        let mut jet = Jet::default();
        for j in 0..WIDTH {
            let row = &self.net[(v.first + j) * self.width + u.first..][..WIDTH];
            let (mut p, mut d, mut dd) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
            for i in 0..WIDTH {
                p += bu[i] * row[i];
                d += du[i] * row[i];
                dd += duu[i] * row[i];
            }
            jet.point += bv[j] * p;
            jet.du += bv[j] * d;
            jet.dv += dv[j] * p;
            jet.duu += bv[j] * dd;
            jet.duv += dv[j] * d;
            jet.dvv += dvv[j] * p;
        }
        jet
    }

    /// The place nearest to a point from a start, over the face with its rim: Newton steps on the squared distance, clamped
    /// to the face and shortened until they come nearer.
    ///
    /// Source: *The NURBS Book*, 2nd ed., section 6.1, with the Gauss-Newton matrix where the Hessian is not definite.
    pub(crate) fn foot(&self, point: DVec3, u: f64, v: f64) -> PatchFoot {
        let (mut u, mut v) = (u, v);
        let mut jet = self.jet(u, v);
        let mut r = jet.point - point;
        let mut squared = r.length_squared();
        for _ in 0..FOOT_STEPS {
            let Some([du, dv]) = step(&jet, r, [u, v]) else {
                break;
            };
            let mut t = 1.0;
            let mut moved = None;
            for _ in 0..HALVINGS {
                let (a, b) = ((u + t * du).clamp(0.0, 1.0), (v + t * dv).clamp(0.0, 1.0));
                let there = self.jet(a, b);
                let s = there.point - point;
                if s.length_squared() < squared {
                    moved = Some((a, b, there, s));
                    break;
                }
                t *= SHORTEN;
            }
            let Some((a, b, there, s)) = moved else { break };
            let size = (a - u).abs() + (b - v).abs();
            (u, v, jet, r, squared) = (a, b, there, s, s.length_squared());
            if size < SMALLEST_STEP {
                break;
            }
        }
        PatchFoot { u, v, squared }
    }
}

/// The Newton step of |r|^2 / 2 at (u, v) within the unit square; `None` in a corner that is the nearest place.
fn step(jet: &Jet, r: DVec3, [u, v]: [f64; 2]) -> Option<[f64; 2]> {
    let g = [r.dot(jet.du), r.dot(jet.dv)];
    let (a, b, c) = (
        jet.du.length_squared(),
        jet.du.dot(jet.dv),
        jet.dv.length_squared(),
    );
    let mut h = [a + r.dot(jet.duu), b + r.dot(jet.duv), c + r.dot(jet.dvv)];
    if h[0] <= 0.0 || h[2] <= 0.0 || h[0] * h[2] - h[1] * h[1] < LEAST_DETERMINANT * a * c {
        h = [
            a * 1.0001 + f64::MIN_POSITIVE,
            b,
            c * 1.0001 + f64::MIN_POSITIVE,
        ];
    }
    let held = |t: f64, g: f64| (t <= 0.0 && g > 0.0) || (t >= 1.0 && g < 0.0);
    match [held(u, g[0]), held(v, g[1])] {
        [true, true] => None,
        [true, false] => Some([0.0, -g[1] / h[2]]),
        [false, true] => Some([-g[0] / h[0], 0.0]),
        [false, false] => {
            let determinant = h[0] * h[2] - h[1] * h[1];
            if determinant <= 0.0 {
                return Some([-g[0] / h[0], -g[1] / h[2]]);
            }
            let du = (g[1] * h[1] - g[0] * h[2]) / determinant;
            let dv = (g[0] * h[1] - g[1] * h[0]) / determinant;
            Some([du, dv])
        }
    }
}
