//! Curves of a STEP file: lines and conics as they are, until it is known which part is wanted, and NURBS.

use super::instance::{Instance, real};
use super::parse::Value;
use super::place::Geometry;
use crate::nurbs::elementary::Frame;
use crate::nurbs::sweep::join;
use crate::nurbs::{KnotVector, NurbsCurve, conic};
use crate::{Error, Result};
use glam::DVec3;
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
            Shape::Ellipse(f, a, b) => f.at(DVec3::new(a * t.cos(), b * t.sin(), 0.0)),
            Shape::Parabola(f, focal) => f.at(DVec3::new(focal * t * t, 2.0 * focal * t, 0.0)),
            Shape::Hyperbola(f, a, b) => f.at(DVec3::new(a * t.cosh(), b * t.sinh(), 0.0)),
            Shape::Spline(c) => c.point(t),
        }
    }

    /// The parameter of the point of the curve next to a point that lies on it.
    pub(super) fn parameter(&self, p: DVec3) -> f64 {
        match self {
            Shape::Line(origin, v) => (p - *origin).dot(*v) / v.length_squared(),
            Shape::Ellipse(f, a, b) => {
                let local = f.local(p);
                (local.y / b).atan2(local.x / a).rem_euclid(TAU)
            }
            Shape::Parabola(f, focal) => f.local(p).y / (2.0 * focal),
            Shape::Hyperbola(f, _, b) => (f.local(p).y / b).asinh(),
            Shape::Spline(c) => nearest(c, p),
        }
    }

    /// The curve from parameter a to b > a.
    fn part(&self, a: f64, b: f64) -> Result<NurbsCurve> {
        let wrong = || Error::invalid(format!("no part of a curve from {a} to {b}"));
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
                let (m, weight) = (f64::midpoint(a, b), (0.5 * (b - a)).cosh());
                let middle = f.at(DVec3::new(
                    x * m.cosh() / weight,
                    y * m.sinh() / weight,
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
            _ => None,
        }
    }

    /// The curve from parameter a up to b, through the end of its period where b is not above a.
    fn upwards(&self, a: f64, b: f64, tolerance: f64) -> Result<NurbsCurve> {
        let Some(period) = self.period(tolerance) else {
            return self.part(a, b);
        };
        let Shape::Spline(curve) = self else {
            let slack = 1e-9;
            let way = (b - a).rem_euclid(period);
            let way = if way < slack || way > period - slack {
                period
            } else {
                way
            };
            return self.part(a, a + way);
        };
        let (low, high) = curve.domain();
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
        join(&[curve.segment(a, high)?, curve.segment(low, b)?])
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
                return Err(Error::invalid("a line between two vertices that are one"));
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
        if let Shape::Spline(curve) = &self.shape {
            // Vertices at the ends of the curve take it as it is.
            let (low, high) = curve.domain();
            let at = |t: f64, p: DVec3| curve.point(t).distance(p) <= tolerance;
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
            _ => return Err(Error::invalid("a curve without ends")),
        };
        if self.reversed {
            curve.reversed()
        } else {
            Ok(curve)
        }
    }
}

/// The parameter of the nearest point: from samples, then by Newton's method. *The NURBS Book*, 2nd ed., section 6.1.
fn nearest(curve: &NurbsCurve, p: DVec3) -> f64 {
    let breaks = curve.knots().breakpoints();
    let (low, high) = curve.domain();
    let mut best = (f64::INFINITY, low);
    for w in breaks.windows(2) {
        for k in 0..=8 {
            let t = w[0] + (w[1] - w[0]) * f64::from(k) / 8.0;
            let distance = curve.point(t).distance(p);
            if distance < best.0 {
                best = (distance, t);
            }
        }
    }
    let mut t = best.1;
    for _ in 0..20 {
        let [c, d1, d2] = curve.derivatives(t);
        let r = c - p;
        let (slope, bend) = (r.dot(d1), d1.dot(d1) + r.dot(d2));
        let bend = if bend > 0.0 { bend } else { d1.dot(d1) };
        if bend.is_nan() || bend <= 0.0 {
            break;
        }
        let next = (t - slope / bend).clamp(low, high);
        if curve.point(next).distance(p) >= best.0 {
            break;
        }
        best = (curve.point(next).distance(p), next);
        t = next;
    }
    best.1
}

/// What all forms of B-spline curves and one direction of surfaces share: the knots for this many control points.
pub(super) fn knots(
    instance: &Instance<'_, '_>,
    degree: usize,
    count: usize,
    given: Option<(&[usize], &[f64])>,
    bezier: bool,
    quasi: bool,
) -> Result<KnotVector> {
    let fail = |e: Error| instance.error(e);
    if let Some((multiplicities, values)) = given {
        let total = multiplicities
            .iter()
            .try_fold(0_usize, |sum, &m| sum.checked_add(m));
        if multiplicities.len() != values.len() || total != Some(count + degree + 1) {
            return Err(instance.error(format_args!(
                "{count} control points of degree {degree} need {} knots, and multiplicities and knots in pairs",
                count + degree + 1
            )));
        }
        let knots = multiplicities.iter().zip(values);
        let knots = knots
            .flat_map(|(&m, &u)| std::iter::repeat_n(u, m))
            .collect();
        return KnotVector::new(degree, knots).map_err(fail);
    }
    if degree == 0 || count <= degree {
        return Err(instance.error(format_args!("degree {degree} with {count} control points")));
    }
    if bezier {
        if !(count - 1).is_multiple_of(degree) {
            return Err(instance.error("Bezier pieces do not fill its control points"));
        }
        let pieces = (count - 1) / degree;
        let inner = (1..pieces).flat_map(|k| std::iter::repeat_n(k as f64, degree));
        let mut breaks = vec![0.0];
        breaks.extend(inner);
        breaks.push(pieces as f64);
        return KnotVector::clamped(degree, &breaks).map_err(fail);
    }
    let spans = count - degree;
    if quasi {
        let breaks: Vec<f64> = (0..=spans).map(|k| k as f64).collect();
        return KnotVector::clamped(degree, &breaks).map_err(fail);
    }
    let knots = (0..=count + degree)
        .map(|k| k as f64 - degree as f64)
        .collect();
    KnotVector::new(degree, knots).map_err(fail)
}

impl Geometry<'_, '_> {
    /// The curve with this number.
    pub(super) fn curve(&self, id: u64) -> Result<Curve> {
        self.step.deeper(id, || self.curve_at(id))
    }

    fn curve_at(&self, id: u64) -> Result<Curve> {
        let instance = self.step.get(id)?;
        let all = instance.all();
        let positive = |k: usize| {
            let value = all.real(k)?;
            if value > 0.0 {
                return Ok(value);
            }
            Err(instance.error(format_args!(
                "attribute {} should be positive, not {value}",
                k + 1
            )))
        };
        let shape = match instance.name() {
            "LINE" => Shape::Line(
                self.point(all.reference(1)?)?,
                self.vector(all.reference(2)?)?,
            ),
            "CIRCLE" => {
                let radius = positive(2)?;
                Shape::Ellipse(self.frame(all.reference(1)?)?, radius, radius)
            }
            "ELLIPSE" => Shape::Ellipse(self.frame(all.reference(1)?)?, positive(2)?, positive(3)?),
            "PARABOLA" => Shape::Parabola(self.frame(all.reference(1)?)?, positive(2)?),
            "HYPERBOLA" => {
                Shape::Hyperbola(self.frame(all.reference(1)?)?, positive(2)?, positive(3)?)
            }
            "POLYLINE" => {
                let points = all.references(1)?.into_iter().map(|p| self.point(p));
                let mut points = points.collect::<Result<Vec<_>>>()?;
                points.dedup();
                let breaks: Vec<f64> = (0..points.len()).map(|k| k as f64).collect();
                Shape::Spline(NurbsCurve::new(
                    KnotVector::clamped(1, &breaks)?,
                    points,
                    None,
                )?)
            }
            "TRIMMED_CURVE" => return self.trimmed(&instance),
            "COMPOSITE_CURVE"
            | "COMPOSITE_CURVE_ON_SURFACE"
            | "BOUNDARY_CURVE"
            | "OUTER_BOUNDARY_CURVE" => self.composite(&instance)?,
            "SURFACE_CURVE" | "SEAM_CURVE" | "INTERSECTION_CURVE" | "BOUNDED_SURFACE_CURVE" => {
                return self.curve(all.reference(1)?);
            }
            _ if instance
                .parts
                .iter()
                .any(|p| p.name.starts_with("BOUNDED_SURFACE_CURVE")) =>
            {
                return self.curve(instance.part("SURFACE_CURVE")?.reference(0)?);
            }
            name if name.contains("B_SPLINE_CURVE") || name.ends_with("_CURVE") => {
                self.spline(&instance)?
            }
            name => return Err(instance.error(format_args!("{name} is not read as a curve"))),
        };
        Ok(shape.into())
    }

    fn spline(&self, instance: &Instance<'_, '_>) -> Result<Shape> {
        let complex = instance.is_complex();
        let base = instance.part("B_SPLINE_CURVE")?;
        // A simple instance begins with its name.
        let k = usize::from(!complex);
        let degree = base.count(k)?;
        let points = base.references(k + 1)?.into_iter().map(|p| self.point(p));
        let points = points.collect::<Result<Vec<_>>>()?;
        let named = |text: &str| instance.parts.iter().any(|p| p.name == text);
        let given = if named("B_SPLINE_CURVE_WITH_KNOTS") {
            let part = instance.part("B_SPLINE_CURVE_WITH_KNOTS")?;
            let k = if complex { 0 } else { 6 };
            Some((part.counts(k)?, part.reals(k + 1)?))
        } else if named("BEZIER_CURVE") || named("UNIFORM_CURVE") || named("QUASI_UNIFORM_CURVE") {
            None
        } else {
            return Err(instance.error("is not read as a curve"));
        };
        let weights = if named("RATIONAL_B_SPLINE_CURVE") && complex {
            Some(instance.part("RATIONAL_B_SPLINE_CURVE")?.reals(0)?)
        } else {
            None
        };
        let given = given.as_ref().map(|(m, u)| (&m[..], &u[..]));
        let knots = knots(
            instance,
            degree,
            points.len(),
            given,
            named("BEZIER_CURVE"),
            named("QUASI_UNIFORM_CURVE"),
        )?;
        let curve = NurbsCurve::new(knots, points, weights).and_then(|c| c.clamped());
        curve.map(Shape::Spline).map_err(|e| instance.error(e))
    }

    fn trimmed(&self, instance: &Instance<'_, '_>) -> Result<Curve> {
        let all = instance.all();
        let mut curve = self.curve(all.reference(1)?)?;
        let scale = match curve.shape {
            Shape::Ellipse(..) => self.angle,
            _ => 1.0,
        };
        let end = |k: usize| {
            for value in all.list(k)? {
                if let Value::Typed("PARAMETER_VALUE", _) = value {
                    return Ok(real(value).map(|t| t * scale));
                }
            }
            for value in all.list(k)? {
                if let Value::Reference(id) = value {
                    return self.point(*id).map(|p| Some(curve.shape.parameter(p)));
                }
            }
            Ok(None)
        };
        let (from, to) = (end(2)?, end(3)?);
        let against = !all.flag(4)?;
        if let (Some(a), Some(b)) = (from, to) {
            curve.range = Some([a, b]);
        }
        curve.reversed = curve.reversed != against;
        Ok(curve)
    }

    fn composite(&self, instance: &Instance<'_, '_>) -> Result<Shape> {
        let mut parts = Vec::new();
        for id in instance.all().references(1)? {
            let segment = self.step.get(id)?;
            let all = segment.all();
            let curve = self.curve(all.reference(2)?)?.whole(self.tolerance);
            let curve = curve.map_err(|e| segment.error(e))?;
            parts.push(if all.flag(1)? {
                curve
            } else {
                curve.reversed()?
            });
        }
        if parts.is_empty() {
            return Err(instance.error("a curve of no segments"));
        }
        let ends = parts.windows(2).all(|w| {
            let (a, b) = (w[0].domain().1, w[1].domain().0);
            w[0].point(a).distance(w[1].point(b)) <= 100.0 * self.tolerance
        });
        if !ends {
            return Err(instance.error("its segments do not follow each other"));
        }
        join(&parts)
            .map(Shape::Spline)
            .map_err(|e| instance.error(e))
    }
}
