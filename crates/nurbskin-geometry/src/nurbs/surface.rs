//! Rational B-spline surfaces.

use super::ControlNet;
use super::basis::{basis_derivatives, basis_functions};
use super::curve::{check_weights, project};
use super::knots::{KnotVector, MAX_DEGREE};
use crate::{Error, Result};
use glam::{DVec3, DVec4};
use serde::{Deserialize, Serialize};
use std::ops::{AddAssign, Mul};

/// A tensor-product NURBS surface S(u, v) of any degrees; without weights a polynomial B-spline surface
/// (Pal & Ballav 2007, eq. (3)).
///
/// ```
/// use nurbskin_geometry::{ControlNet, DVec3, KnotVector, NurbsSurface};
/// let net = ControlNet::from_fn(4, 4, |i, j| DVec3::new(i as f64, j as f64, (i * j) as f64))?;
/// let knots = KnotVector::uniform(3, 4)?;
/// let surface = NurbsSurface::new(knots.clone(), knots, net, None)?;
/// assert!((surface.point(0.5, 0.5) - DVec3::new(1.5, 1.5, 2.25)).length() < 1e-14);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct NurbsSurface {
    knots_u: KnotVector,
    knots_v: KnotVector,
    control_points: ControlNet,
    weights: Option<Vec<f64>>,
}

/// A surface as it is stored, not yet checked.
#[derive(Deserialize)]
struct Stored {
    knots_u: KnotVector,
    knots_v: KnotVector,
    control_points: ControlNet,
    weights: Option<Vec<f64>>,
}

impl TryFrom<Stored> for NurbsSurface {
    type Error = Error;

    fn try_from(stored: Stored) -> Result<Self> {
        let Stored {
            knots_u,
            knots_v,
            control_points,
            weights,
        } = stored;
        Self::new(knots_u, knots_v, control_points, weights)
    }
}

/// A point of a surface with its partial derivatives to second order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceDerivatives {
    /// S
    pub point: DVec3,
    /// dS/du
    pub du: DVec3,
    /// dS/dv
    pub dv: DVec3,
    /// d2S/du2
    pub duu: DVec3,
    /// d2S/du dv
    pub duv: DVec3,
    /// d2S/dv2
    pub dvv: DVec3,
}

impl NurbsSurface {
    /// A surface from its parts; weights, where given, in the order of the control points (u fastest).
    ///
    /// # Errors
    /// [`Error::Invalid`] if the counts disagree, a weight is not finite and positive, or the control points of a
    /// periodic direction are not wrapped (the last p must repeat the first p).
    pub fn new(
        knots_u: KnotVector,
        knots_v: KnotVector,
        control_points: ControlNet,
        weights: Option<Vec<f64>>,
    ) -> Result<Self> {
        let need = [knots_u.control_point_count(), knots_v.control_point_count()];
        if control_points.counts() != need {
            let [m, n] = control_points.counts();
            return Err(Error::invalid(format!(
                "the knots need {} x {} control points, not {m} x {n}",
                need[0], need[1]
            )));
        }
        check_weights(weights.as_deref(), need[0] * need[1])?;
        let this = Self {
            knots_u,
            knots_v,
            control_points,
            weights,
        };
        let [du, dv] = [this.knots_u.distinct_count(), this.knots_v.distinct_count()];
        let same = |i: usize, j: usize| this.homogeneous(i, j) == this.homogeneous(i % du, j % dv);
        let wrapped = (0..dv).all(|j| (du..need[0]).all(|i| same(i, j)))
            && (dv..need[1]).all(|j| (0..need[0]).all(|i| same(i, j)));
        if !wrapped {
            return Err(Error::invalid(
                "the control points of a periodic direction must repeat the first ones",
            ));
        }
        Ok(this)
    }

    /// Knot vector along u.
    #[must_use]
    pub fn knots_u(&self) -> &KnotVector {
        &self.knots_u
    }
    /// Knot vector along v.
    #[must_use]
    pub fn knots_v(&self) -> &KnotVector {
        &self.knots_v
    }
    /// Control points, wrapped where periodic.
    #[must_use]
    pub fn control_points(&self) -> &ControlNet {
        &self.control_points
    }
    /// Weights in the order of the control points; `None` means polynomial.
    #[must_use]
    pub fn weights(&self) -> Option<&[f64]> {
        self.weights.as_deref()
    }
    /// Control point (i, j) as (w P, w).
    #[must_use]
    pub fn homogeneous(&self, i: usize, j: usize) -> DVec4 {
        let w = self
            .weights
            .as_ref()
            .map_or(1.0, |w| w[j * self.control_points.count_u() + i]);
        (self.control_points.point(i, j) * w).extend(w)
    }
    /// All control points as (w P, w), u fastest.
    #[must_use]
    pub fn homogeneous_points(&self) -> Vec<DVec4> {
        let points = self.control_points.points().iter();
        match &self.weights {
            Some(weights) => points
                .zip(weights)
                .map(|(&p, &w)| (p * w).extend(w))
                .collect(),
            None => points.map(|p| p.extend(1.0)).collect(),
        }
    }
    /// A surface from control points (w P, w), u fastest; unless `rational`, w is taken as 1.
    ///
    /// # Errors
    /// As [`NurbsSurface::new`] and [`ControlNet::new`].
    pub fn from_homogeneous(
        knots_u: KnotVector,
        knots_v: KnotVector,
        points: &[DVec4],
        rational: bool,
    ) -> Result<Self> {
        let (points, weights) = project(points, rational);
        let [m, n] = [knots_u.control_point_count(), knots_v.control_point_count()];
        Self::new(knots_u, knots_v, ControlNet::new(m, n, points)?, weights)
    }
    /// Degrees [p, q].
    #[must_use]
    pub fn degree(&self) -> [usize; 2] {
        [self.knots_u.degree(), self.knots_v.degree()]
    }
    /// Number of control points along u and v, those that wrap around counted once.
    #[must_use]
    pub fn distinct_counts(&self) -> [usize; 2] {
        [self.knots_u.distinct_count(), self.knots_v.distinct_count()]
    }
    /// Which directions are periodic.
    #[must_use]
    pub fn periodic(&self) -> [bool; 2] {
        [self.knots_u.is_periodic(), self.knots_v.is_periodic()]
    }
    /// Whether weights are present.
    #[must_use]
    pub fn is_rational(&self) -> bool {
        self.weights.is_some()
    }
    /// The parameter rectangle [(a, b) of u, (c, d) of v].
    #[must_use]
    pub fn domain(&self) -> [(f64, f64); 2] {
        [self.knots_u.domain(), self.knots_v.domain()]
    }
    /// Corners of the box around the control points, which holds the surface (convex hull property).
    #[must_use]
    pub fn bounding_box(&self) -> [DVec3; 2] {
        self.control_points.bounding_box()
    }

    /// S(u, v); (u, v) is brought into the domain first.
    ///
    /// Source: A4.3, *The NURBS Book*, 2nd ed., p. 134.
    #[must_use]
    pub fn point(&self, u: f64, v: f64) -> DVec3 {
        let [p, q] = self.degree();
        let (u, v) = (self.knots_u.wrap(u), self.knots_v.wrap(v));
        let (span_u, span_v) = (self.knots_u.span(u), self.knots_v.span(v));
        let mut basis_u = [0.0; MAX_DEGREE + 1];
        let mut basis_v = [0.0; MAX_DEGREE + 1];
        basis_functions(&self.knots_u, span_u, u, &mut basis_u);
        basis_functions(&self.knots_v, span_v, v, &mut basis_v);
        if self.weights.is_none() {
            let mut sum = DVec3::ZERO;
            for (l, &bv) in basis_v[..=q].iter().enumerate() {
                let row = &self.control_points.row(span_v - q + l)[span_u - p..=span_u];
                let inner = row
                    .iter()
                    .zip(&basis_u)
                    .fold(DVec3::ZERO, |a, (&c, &b)| a + b * c);
                sum += bv * inner;
            }
            return sum;
        }
        let mut sum = DVec4::ZERO;
        for (l, &bv) in basis_v[..=q].iter().enumerate() {
            for (k, &bu) in basis_u[..=p].iter().enumerate() {
                sum += bu * bv * self.homogeneous(span_u - p + k, span_v - q + l);
            }
        }
        sum.truncate() / sum.w
    }

    /// The point and its partial derivatives to second order; (u, v) is brought into the domain first. At a knot where
    /// a derivative jumps, the value from the right (at the end of the domain, from the left).
    ///
    /// Source: A3.6 and A4.4, *The NURBS Book*, 2nd ed., pp. 111 and 137.
    #[must_use]
    pub fn derivatives(&self, u: f64, v: f64) -> SurfaceDerivatives {
        let (u, v) = (self.knots_u.wrap(u), self.knots_v.wrap(v));
        self.derivatives_on([self.knots_u.span(u), self.knots_v.span(v)], u, v)
    }

    /// The point and its derivatives of the polynomial piece on the given spans, wherever (u, v) lies.
    pub(super) fn derivatives_on(
        &self,
        [span_u, span_v]: [usize; 2],
        u: f64,
        v: f64,
    ) -> SurfaceDerivatives {
        let [p, q] = self.degree();
        let mut basis_u = [0.0; 3 * (MAX_DEGREE + 1)];
        let mut basis_v = [0.0; 3 * (MAX_DEGREE + 1)];
        basis_derivatives(&self.knots_u, span_u, u, 2, &mut basis_u);
        basis_derivatives(&self.knots_v, span_v, v, 2, &mut basis_v);
        let (basis_u, basis_v) = (&basis_u[..3 * (p + 1)], &basis_v[..3 * (q + 1)]);
        let (points, count) = (self.control_points.points(), self.control_points.count_u());
        let rows = (span_v - q..=span_v).map(|j| j * count + span_u - p..j * count + span_u + 1);
        let Some(weights) = &self.weights else {
            let a = tensor_sums(
                basis_u,
                basis_v,
                rows.map(|row| points[row].iter().copied()),
            );
            return SurfaceDerivatives {
                point: a[0][0],
                du: a[1][0],
                dv: a[0][1],
                duu: a[2][0],
                duv: a[1][1],
                dvv: a[0][2],
            };
        };
        let rows = rows.map(|row| {
            let weighted = points[row.clone()].iter().zip(&weights[row]);
            weighted.map(|(&point, &w)| (w * point).extend(w))
        });
        let a = tensor_sums(basis_u, basis_v, rows);
        let x = a.map(|row| row.map(DVec4::truncate));
        let w = a.map(|row| row.map(|h| h.w));
        let point = x[0][0] / w[0][0];
        let du = (x[1][0] - w[1][0] * point) / w[0][0];
        let dv = (x[0][1] - w[0][1] * point) / w[0][0];
        let duu = (x[2][0] - 2.0 * w[1][0] * du - w[2][0] * point) / w[0][0];
        let duv = (x[1][1] - w[1][0] * dv - w[0][1] * du - w[1][1] * point) / w[0][0];
        let dvv = (x[0][2] - 2.0 * w[0][1] * dv - w[0][2] * point) / w[0][0];
        SurfaceDerivatives {
            point,
            du,
            dv,
            duu,
            duv,
            dvv,
        }
    }

    /// The same surface with u and v exchanged (its normal turns round).
    #[must_use]
    pub fn transposed(&self) -> Self {
        let weights = self.weights.as_ref().map(|w| {
            let [m, n] = self.control_points.counts();
            (0..m)
                .flat_map(|i| (0..n).map(move |j| w[j * m + i]))
                .collect()
        });
        Self {
            knots_u: self.knots_v.clone(),
            knots_v: self.knots_u.clone(),
            control_points: self.control_points.transposed(),
            weights,
        }
    }

    /// The surface moved by an affine map of its control points (affine invariance).
    ///
    /// # Errors
    /// [`Error::Invalid`] if a control point becomes non-finite.
    pub fn map_points(&self, f: impl Fn(DVec3) -> DVec3) -> Result<Self> {
        Ok(Self {
            control_points: self.control_points.map(f)?,
            ..self.clone()
        })
    }
}

/// Sums `a[k][l]` of the k-th derivative along u and the l-th along v, k + l <= 2, over the rows of control points on a
/// span; the basis functions and their two derivatives follow each other.
#[inline]
fn tensor_sums<V: Copy + Default + AddAssign + Mul<f64, Output = V>>(
    basis_u: &[f64],
    basis_v: &[f64],
    rows: impl Iterator<Item = impl Iterator<Item = V>>,
) -> [[V; 3]; 3] {
    let (m, n) = (basis_u.len() / 3, basis_v.len() / 3);
    let (u0, u12) = basis_u.split_at(m);
    let (u1, u2) = u12.split_at(m);
    let mut a = [[V::default(); 3]; 3];
    for (l, row) in rows.enumerate() {
        let [mut s0, mut s1, mut s2] = [V::default(); 3];
        for (((point, &b0), &b1), &b2) in row.zip(u0).zip(u1).zip(u2) {
            s0 += point * b0;
            s1 += point * b1;
            s2 += point * b2;
        }
        let [v0, v1, v2] = [basis_v[l], basis_v[n + l], basis_v[2 * n + l]];
        a[0][0] += s0 * v0;
        a[0][1] += s0 * v1;
        a[0][2] += s0 * v2;
        a[1][0] += s1 * v0;
        a[1][1] += s1 * v1;
        a[2][0] += s2 * v0;
    }
    a
}
