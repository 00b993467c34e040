//! Curves of a STEP file.

use super::instance::{Instance, real};
use super::parse::Value;
use super::place::Geometry;
use super::shape::{Curve, Shape};
use crate::io::text::true_weights;
use nurbskin_geometry::nurbs::sweep::join;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve};
use nurbskin_geometry::{Error, Result};

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
        return Err(instance.error(format_args!(
            "a curve of degree {degree} cannot have {count} control points"
        )));
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
                let space = all.reference(1).and_then(|curve| self.curve(curve));
                // Without a curve in space that is understood, one of the parameter planes will do.
                return space.or_else(|mut error| {
                    for plane in all.references(2).unwrap_or_default() {
                        match self.curve(plane) {
                            Ok(curve) => return Ok(curve),
                            Err(why) => error = why,
                        }
                    }
                    Err(error)
                });
            }
            "PCURVE" | "BOUNDED_PCURVE" => return self.on_surface(&instance),
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
            return Err(instance.error("this entity is not read as a curve"));
        };
        let weights = if named("RATIONAL_B_SPLINE_CURVE") && complex {
            true_weights(instance.part("RATIONAL_B_SPLINE_CURVE")?.reals(0)?)
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
            return Err(instance.error("the curve has no segments"));
        }
        let ends = parts.windows(2).all(|w| {
            let (a, b) = (w[0].domain().1, w[1].domain().0);
            w[0].point(a).distance(w[1].point(b)) <= 100.0 * self.tolerance
        });
        if !ends {
            return Err(instance.error("the segments of the curve do not follow each other"));
        }
        join(&parts)
            .map(Shape::Spline)
            .map_err(|e| instance.error(e))
    }
}
