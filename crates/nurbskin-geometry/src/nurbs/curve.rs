//! Rational B-spline curves.

use super::basis::basis_derivatives;
use super::knots::{KnotVector, MAX_DEGREE};
use crate::{Error, Result};
use glam::{DVec3, DVec4};
use serde::{Deserialize, Serialize};

/// A NURBS curve C(t) of any degree; without weights a polynomial B-spline curve (Pal & Ballav 2007, eq. (1)).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct NurbsCurve {
    knots: KnotVector,
    control_points: Vec<DVec3>,
    weights: Option<Vec<f64>>,
}

/// A curve as it is stored, not yet checked.
#[derive(Deserialize)]
struct Stored {
    knots: KnotVector,
    control_points: Vec<DVec3>,
    weights: Option<Vec<f64>>,
}

impl TryFrom<Stored> for NurbsCurve {
    type Error = Error;

    fn try_from(stored: Stored) -> Result<Self> {
        Self::new(stored.knots, stored.control_points, stored.weights)
    }
}

impl NurbsCurve {
    /// A curve from its parts.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the counts disagree, a coordinate is not finite, a weight is not finite and positive, or
    /// the control points of a periodic knot vector are not wrapped.
    pub fn new(
        knots: KnotVector,
        control_points: Vec<DVec3>,
        weights: Option<Vec<f64>>,
    ) -> Result<Self> {
        let count = knots.control_point_count();
        if control_points.len() != count {
            return Err(Error::invalid(format!(
                "the knots need {count} control points, not {}",
                control_points.len()
            )));
        }
        if let Some(i) = control_points.iter().position(|p| !p.is_finite()) {
            return Err(Error::invalid(format!("control point {i} is not finite")));
        }
        check_weights(weights.as_deref(), count)?;
        if knots.is_periodic() {
            let distinct = knots.distinct_count();
            let weight = |i: usize| weights.as_ref().map_or(1.0, |w| w[i]);
            #[expect(clippy::float_cmp, reason = "wrapped control points are copies")]
            let wrapped = (distinct..count).all(|i| {
                control_points[i] == control_points[i - distinct]
                    && weight(i) == weight(i - distinct)
            });
            if !wrapped {
                return Err(Error::invalid(
                    "the control points of a periodic curve must repeat the first ones",
                ));
            }
        }
        Ok(Self {
            knots,
            control_points,
            weights,
        })
    }

    /// The curve with every control point moved by `f`; exact where `f` is affine.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a point is no longer finite.
    pub fn map_points(&self, f: impl Fn(DVec3) -> DVec3) -> Result<Self> {
        Self::new(
            self.knots.clone(),
            self.control_points.iter().map(|&p| f(p)).collect(),
            self.weights.clone(),
        )
    }

    /// Knot vector.
    #[must_use]
    pub fn knots(&self) -> &KnotVector {
        &self.knots
    }
    /// Control points, wrapped where periodic.
    #[must_use]
    pub fn control_points(&self) -> &[DVec3] {
        &self.control_points
    }
    /// Weights; `None` means polynomial.
    #[must_use]
    pub fn weights(&self) -> Option<&[f64]> {
        self.weights.as_deref()
    }
    /// Control point i as (w P, w).
    #[must_use]
    pub fn homogeneous(&self, i: usize) -> DVec4 {
        let w = self.weights.as_ref().map_or(1.0, |w| w[i]);
        (self.control_points[i] * w).extend(w)
    }
    /// All control points as (w P, w).
    #[must_use]
    pub fn homogeneous_points(&self) -> Vec<DVec4> {
        (0..self.control_points.len())
            .map(|i| self.homogeneous(i))
            .collect()
    }
    /// A curve from control points (w P, w); unless `rational`, w is taken as 1.
    ///
    /// # Errors
    /// As [`NurbsCurve::new`].
    pub fn from_homogeneous(knots: KnotVector, points: &[DVec4], rational: bool) -> Result<Self> {
        let (points, weights) = project(points, rational);
        Self::new(knots, points, weights)
    }
    /// The parameter interval.
    #[must_use]
    pub fn domain(&self) -> (f64, f64) {
        self.knots.domain()
    }
    /// C(t); t is brought into the domain first.
    ///
    /// Source: A4.1, *The NURBS Book*, 2nd ed., p. 124.
    #[must_use]
    pub fn point(&self, t: f64) -> DVec3 {
        self.derivatives(t)[0]
    }
    /// C, C' and C'' at t; t is brought into the domain first.
    ///
    /// Source: A4.2, *The NURBS Book*, 2nd ed., p. 127.
    #[must_use]
    pub fn derivatives(&self, t: f64) -> [DVec3; 3] {
        let p = self.knots.degree();
        let t = self.knots.wrap(t);
        let span = self.knots.span(t);
        let mut basis = [0.0; 3 * (MAX_DEGREE + 1)];
        basis_derivatives(&self.knots, span, t, 2, &mut basis);
        let mut a = [DVec4::ZERO; 3];
        for j in 0..=p {
            let point = self.homogeneous(span - p + j);
            for (k, a) in a.iter_mut().enumerate() {
                *a += basis[k * (p + 1) + j] * point;
            }
        }
        if self.weights.is_none() {
            return a.map(DVec4::truncate);
        }
        let w = a[0].w;
        let c = a[0].truncate() / w;
        let c1 = (a[1].truncate() - a[1].w * c) / w;
        let c2 = (a[2].truncate() - 2.0 * a[1].w * c1 - a[2].w * c) / w;
        [c, c1, c2]
    }

    /// The parameter of the point next to p: from nine samples in each span, then by Newton's method. *The NURBS Book*, 2nd ed., section 6.1.
    pub fn nearest(&self, p: DVec3) -> f64 {
        let breaks = self.knots().breakpoints();
        let (low, high) = self.domain();
        let mut best = (f64::INFINITY, low);
        for w in breaks.windows(2) {
            for k in 0..=8 {
                let t = w[0] + (w[1] - w[0]) * f64::from(k) / 8.0;
                let distance = self.point(t).distance(p);
                if distance < best.0 {
                    best = (distance, t);
                }
            }
        }
        let mut t = best.1;
        for _ in 0..20 {
            let [c, d1, d2] = self.derivatives(t);
            let r = c - p;
            let (slope, bend) = (r.dot(d1), d1.dot(d1) + r.dot(d2));
            let bend = if bend > 0.0 { bend } else { d1.dot(d1) };
            if bend.is_nan() || bend <= 0.0 {
                break;
            }
            let next = (t - slope / bend).clamp(low, high);
            if self.point(next).distance(p) >= best.0 {
                break;
            }
            best = (self.point(next).distance(p), next);
            t = next;
        }
        best.1
    }
}

/// Points and weights of homogeneous points.
pub(super) fn project(points: &[DVec4], rational: bool) -> (Vec<DVec3>, Option<Vec<f64>>) {
    if rational {
        let weights = points.iter().map(|h| h.w).collect();
        (
            points.iter().map(|h| h.truncate() / h.w).collect(),
            Some(weights),
        )
    } else {
        (points.iter().map(|h| h.truncate()).collect(), None)
    }
}

/// Weights are absent, or one finite positive number per control point.
pub(super) fn check_weights(weights: Option<&[f64]>, count: usize) -> Result<()> {
    let Some(weights) = weights else {
        return Ok(());
    };
    if weights.len() != count {
        return Err(Error::invalid(format!(
            "{count} control points need as many weights, not {}",
            weights.len()
        )));
    }
    match weights.iter().position(|w| !(w.is_finite() && *w > 0.0)) {
        Some(i) => Err(Error::invalid(format!(
            "weight {i} is not a positive number"
        ))),
        None => Ok(()),
    }
}
