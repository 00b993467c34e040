//! Lines and conics as they are, until it is known which part of them is wanted, and NURBS.

use super::on_surface::OnSurface;
use glam::DVec3;
use nurbskin_geometry::math;
use nurbskin_geometry::nurbs::elementary::Frame;
use nurbskin_geometry::nurbs::sweep::join;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve, conic};
use nurbskin_geometry::{Error, Result};
use std::f64::consts::TAU;

/// A curve with the parameter of ISO 10303-42.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    /// `P + t V`
    Line(DVec3, DVec3),
    /// `C + a cos t X + b sin t Y`
    Ellipse(Frame, f64, f64),
    /// `C + f (t^2 X + 2 t Y)`
    Parabola(Frame, f64),
    /// `C + a cosh t X + b sinh t Y`
    Hyperbola(Frame, f64, f64),
    Spline(NurbsCurve),
    /// `S(p(t))`
    OnSurface(Box<OnSurface>),
}

/// A curve and the sense it is run through.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub(super) shape: Shape,
    /// Whether it runs against its parameter.
    pub(super) reversed: bool,
    /// The part that a `TRIMMED_CURVE` takes: parameters where it starts and ends, along its sense.
    pub(super) range: Option<[f64; 2]>,
}

impl From<Shape> for Curve {
    fn from(shape: Shape) -> Self {
        Self {
            shape,
            reversed: false,
            range: None,
        }
    }
}

impl Shape {
    pub(super) fn point(&self, t: f64) -> DVec3 {
        match self {
            Shape::Line(p, v) => *p + t * *v,
            Shape::Ellipse(f, a, b) => f.at(DVec3::new(a * math::cos(t), b * math::sin(t), 0.0)),
            Shape::Parabola(f, focal) => f.at(DVec3::new(focal * t * t, 2.0 * focal * t, 0.0)),
            Shape::Hyperbola(f, a, b) => {
                f.at(DVec3::new(a * math::cosh(t), b * math::sinh(t), 0.0))
            }
            Shape::Spline(c) => c.point(t),
            Shape::OnSurface(c) => c.point(t),
        }
    }

    /// The parameter of the point of the curve next to a point that lies on it.
    pub(super) fn parameter(&self, p: DVec3) -> f64 {
        match self {
            Shape::Line(origin, v) => (p - *origin).dot(*v) / v.length_squared(),
            Shape::Ellipse(f, a, b) => {
                let local = f.local(p);
                math::atan2(local.y / b, local.x / a).rem_euclid(TAU)
            }
            Shape::Parabola(f, focal) => f.local(p).y / (2.0 * focal),
            Shape::Hyperbola(f, _, b) => math::asinh(f.local(p).y / b),
            Shape::Spline(c) => c.nearest(p),
            Shape::OnSurface(c) => c.parameter(p),
        }
    }

    /// The curve from parameter a to b > a.
    pub(super) fn part(&self, a: f64, b: f64) -> Result<NurbsCurve> {
        let wrong = || Error::invalid(format!("the curve has no part from {a} to {b}"));
        if !(a < b && (b - a).is_finite()) {
            return Err(wrong());
        }
        let bezier = |points: Vec<DVec3>, weight: f64| {
            let weights = Some(vec![1.0, weight, 1.0]);
            NurbsCurve::new(KnotVector::clamped(2, &[a, b])?, points, weights)
        };
        match self {
            Shape::Line(..) => NurbsCurve::new(
                KnotVector::clamped(1, &[a, b])?,
                vec![self.point(a), self.point(b)],
                None,
            ),
            Shape::Ellipse(f, x, y) => conic::arc(
                f.origin,
                *x * f.axes.x_axis,
                *y * f.axes.y_axis,
                a,
                b.min(a + TAU),
            ),
            Shape::Parabola(f, focal) => {
                let middle = f.at(DVec3::new(focal * a * b, focal * (a + b), 0.0));
                let points = vec![self.point(a), middle, self.point(b)];
                NurbsCurve::new(KnotVector::clamped(2, &[a, b])?, points, None)
            }
            Shape::Hyperbola(f, x, y) => {
                let (m, weight) = (f64::midpoint(a, b), math::cosh(0.5 * (b - a)));
                let middle = f.at(DVec3::new(
                    x * math::cosh(m) / weight,
                    y * math::sinh(m) / weight,
                    0.0,
                ));
                bezier(vec![self.point(a), middle, self.point(b)], weight)
            }
            Shape::Spline(c) => {
                let (low, high) = c.domain();
                if a <= low && b >= high {
                    // To the last bit: cutting rounds the points of a rational curve.
                    return c.clamped();
                }
                c.segment(a.max(low), b.min(high))
            }
            Shape::OnSurface(c) => c.part(a, b),
        }
    }

    /// Where its parameters begin and end, if they do.
    pub(super) fn domain(&self) -> Option<(f64, f64)> {
        match self {
            Shape::Spline(c) => Some(c.domain()),
            Shape::OnSurface(c) => c.flat.domain(),
            _ => None,
        }
    }

    /// The length after which the parameter repeats.
    fn period(&self, tolerance: f64) -> Option<f64> {
        match self {
            Shape::Ellipse(..) => Some(TAU),
            Shape::Spline(c) => {
                let (a, b) = c.domain();
                (c.point(a).distance(c.point(b)) <= tolerance).then_some(b - a)
            }
            Shape::OnSurface(c) => c.period(tolerance),
            _ => None,
        }
    }

    /// The curve from parameter a up to b, through the end of its period where b is not above a.
    fn upwards(&self, a: f64, b: f64, tolerance: f64) -> Result<NurbsCurve> {
        let Some(period) = self.period(tolerance) else {
            return self.part(a, b);
        };
        let Some((low, high)) = self.domain() else {
            let slack = 1e-9;
            let way = (b - a).rem_euclid(period);
            let way = if way < slack || way > period - slack {
                period
            } else {
                way
            };
            return self.part(a, a + way);
        };
        let slack = 1e-9 * period;
        let (a, b) = (
            if a > high - slack { low } else { a },
            if b < low + slack { high } else { b },
        );
        if b - a > slack {
            return self.part(
                if a < low + slack { low } else { a },
                if b > high - slack { high } else { b },
            );
        }
        join(&[self.part(a, high)?, self.part(low, b)?])
    }
}

impl Curve {
    /// The curve turned round.
    pub(super) fn turned(mut self) -> Self {
        self.reversed = !self.reversed;
        self.range = self.range.map(|[a, b]| [b, a]);
        self
    }

    /// The part from one point to the other, along the sense of the curve; all of a closed curve if they are one.
    pub(super) fn between(
        &self,
        from: DVec3,
        to: DVec3,
        one: bool,
        tolerance: f64,
    ) -> Result<NurbsCurve> {
        if let Shape::Line(..) = self.shape {
            let length = from.distance(to);
            if length.is_nan() || length <= 0.0 {
                return Err(Error::invalid(
                    "the line starts and ends at the same vertex",
                ));
            }
            return NurbsCurve::new(
                KnotVector::clamped(1, &[0.0, length])?,
                vec![from, to],
                None,
            );
        }
        let (start, end) = if self.reversed {
            (to, from)
        } else {
            (from, to)
        };
        let one = one
            || (self.shape.period(tolerance).is_some() && start.distance(end) <= 0.01 * tolerance);
        let (mut a, mut b) = (self.shape.parameter(start), self.shape.parameter(end));
        if let Some((low, high)) = self.shape.domain() {
            // Vertices at the ends of the curve take it as it is.
            let at = |t: f64, p: DVec3| self.shape.point(t).distance(p) <= tolerance;
            if at(low, start) {
                a = low;
            }
            if at(high, end) {
                b = high;
            }
        }
        let part = if one {
            b = a;
            self.shape.upwards(a, b, tolerance)?
        } else {
            self.shape.upwards(a, b, tolerance)?
        };
        if self.reversed {
            part.reversed()
        } else {
            Ok(part)
        }
    }

    /// The curve where no vertices bound it: all of it, or what it is trimmed to.
    pub(super) fn whole(&self, tolerance: f64) -> Result<NurbsCurve> {
        if let Some([a, b]) = self.range {
            let (a, b) = if self.reversed { (b, a) } else { (a, b) };
            let part = self.shape.upwards(a, b, tolerance)?;
            return if self.reversed {
                part.reversed()
            } else {
                Ok(part)
            };
        }
        let curve = match &self.shape {
            Shape::Ellipse(..) => self.shape.part(0.0, TAU)?,
            Shape::Spline(c) => c.clamped()?,
            Shape::OnSurface(c) => c.whole()?,
            _ => return Err(Error::invalid("the curve is infinite and has no vertices")),
        };
        if self.reversed {
            curve.reversed()
        } else {
            Ok(curve)
        }
    }
}
