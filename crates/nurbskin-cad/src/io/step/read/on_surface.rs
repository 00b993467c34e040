//! Curves that a STEP file gives in the parameter plane of a surface only.

use super::instance::Instance;
use super::place::Geometry;
use super::shape::{Curve, Shape};
use crate::pcurve::lift::{leaves, lift, outside};
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::math;
use nurbskin_geometry::nurbs::NurbsSurface;
use nurbskin_geometry::nurbs::closest::ClosestPoint;
use nurbskin_geometry::nurbs::elementary::Frame;
use nurbskin_geometry::nurbs::refine::Direction;
use std::f64::consts::TAU;

/// A surface with the parameters of ISO 10303-42, in the units of the file.
#[derive(Clone, Debug)]
enum Base {
    Plane(Frame),
    /// Of this radius at v = 0, which grows by this much with v.
    Cone(Frame, f64, f64),
    /// A sphere is a torus about a point.
    Torus(Frame, f64, f64),
    Net(Box<Net>),
}

#[derive(Clone, Debug)]
struct Net {
    surface: NurbsSurface,
    closest: ClosestPoint,
    /// Lengths of the directions that close, 0 of the others.
    period: DVec2,
}

/// A curve in the parameter plane of a surface.
#[derive(Clone, Debug)]
pub(super) struct OnSurface {
    base: Base,
    /// Lengths and radians per unit of u and v.
    unit: DVec2,
    pub(super) flat: Shape,
    /// The part of `flat` that is meant, where that is endless.
    range: Option<[f64; 2]>,
    tolerance: f64,
}

impl Base {
    /// The point at (u, v) and the derivatives along u and v.
    fn jet(&self, uv: DVec2) -> [DVec3; 3] {
        let ((sin_u, cos_u), (sin_v, cos_v)) = (math::sin_cos(uv.x), math::sin_cos(uv.y));
        let turned = |r: f64, z: f64| DVec3::new(r * cos_u, r * sin_u, z);
        let aside = |r: f64| DVec3::new(-r * sin_u, r * cos_u, 0.0);
        let (frame, [point, du, dv]) = match self {
            Base::Plane(frame) => (frame, [uv.extend(0.0), DVec3::X, DVec3::Y]),
            Base::Cone(frame, radius, slope) => {
                let r = radius + slope * uv.y;
                (frame, [turned(r, uv.y), aside(r), turned(*slope, 1.0)])
            }
            Base::Torus(frame, major, minor) => {
                let r = major + minor * cos_v;
                let dv = turned(-minor * sin_v, minor * cos_v);
                (frame, [turned(r, minor * sin_v), aside(r), dv])
            }
            Base::Net(net) => {
                let [u, v] = net.surface.domain();
                let held = |t: f64, (a, b): (f64, f64), period: f64| {
                    if period > 0.0 && !(a..=b).contains(&t) {
                        a + (t - a).rem_euclid(period)
                    } else {
                        t.clamp(a, b)
                    }
                };
                let (u, v) = (held(uv.x, u, net.period.x), held(uv.y, v, net.period.y));
                let s = net.surface.derivatives(u, v);
                return [s.point, s.du, s.dv];
            }
        };
        [frame.at(point), frame.axes * du, frame.axes * dv]
    }

    /// (u, v) of a point on the surface.
    fn inverse(&self, p: DVec3) -> DVec2 {
        match self {
            Base::Plane(frame) => frame.local(p).truncate(),
            Base::Cone(frame, ..) => {
                let q = frame.local(p);
                DVec2::new(math::atan2(q.y, q.x), q.z)
            }
            Base::Torus(frame, major, _) => {
                let q = frame.local(p);
                DVec2::new(
                    math::atan2(q.y, q.x),
                    math::atan2(q.z, math::hypot(q.x, q.y) - major),
                )
            }
            Base::Net(net) => {
                let foot = net.closest.closest(p);
                DVec2::new(foot.u, foot.v)
            }
        }
    }

    /// After how much u and v repeat; 0 where they do not.
    fn period(&self) -> DVec2 {
        match self {
            Base::Plane(_) => DVec2::ZERO,
            Base::Cone(..) => DVec2::new(TAU, 0.0),
            Base::Torus(_, major, _) => DVec2::new(TAU, if *major > 0.0 { TAU } else { 0.0 }),
            Base::Net(net) => net.period,
        }
    }
}

impl OnSurface {
    pub(super) fn point(&self, t: f64) -> DVec3 {
        self.base.jet(self.flat.point(t).truncate() * self.unit)[0]
    }

    /// The parameter of the point of the curve next to a point that lies on it.
    pub(super) fn parameter(&self, p: DVec3) -> f64 {
        let (uv, period) = (self.base.inverse(p), self.base.period());
        let turns = |period: f64| if period > 0.0 { -2..=2 } else { 0..=0 };
        let shifts = turns(period.x).flat_map(|i| turns(period.y).map(move |j| (i, j)));
        let places = shifts.map(|(i, j)| {
            let place = uv + DVec2::new(f64::from(i), f64::from(j)) * period;
            let place = (place / self.unit).extend(0.0);
            let t = self.flat.parameter(place);
            // In the range, if one is given; of several places on the curve any.
            let outside = self.range.map_or(0.0, |[a, b]| (a - t).max(t - b).max(0.0));
            (self.flat.point(t).distance(place) + outside, t)
        });
        places
            .fold((f64::INFINITY, 0.0), |a, b| if b.0 < a.0 { b } else { a })
            .1
    }

    /// From parameter a to b > a.
    pub(super) fn part(&self, a: f64, b: f64) -> Result<nurbskin_geometry::nurbs::NurbsCurve> {
        let flat = self.flat.part(a, b)?;
        if let Base::Net(net) = &self.base
            && leaves(
                &flat,
                net.surface.domain(),
                [net.period.x, net.period.y].map(|p| p > 0.0),
            )
        {
            return Err(outside());
        }
        lift(&flat, 0.1 * self.tolerance, |uv| {
            let [point, du, dv] = self.base.jet(uv * self.unit);
            [point, du * self.unit.x, dv * self.unit.y]
        })
    }

    /// All of it, where it has ends or closes.
    pub(super) fn whole(&self) -> Result<nurbskin_geometry::nurbs::NurbsCurve> {
        let ends = self.flat.domain().map(|(a, b)| [a, b]);
        let closed = || self.period(self.tolerance).map(|period| [0.0, period]);
        let Some([a, b]) = self.range.or(ends).or_else(closed) else {
            return Err(nurbskin_geometry::Error::invalid(
                "the curve is infinite and has no vertices",
            ));
        };
        self.part(a, b)
    }

    /// The length after which it comes back to where it was.
    pub(super) fn period(&self, tolerance: f64) -> Option<f64> {
        match &self.flat {
            Shape::Ellipse(..) => Some(TAU),
            Shape::Spline(flat) => {
                let (a, b) = flat.domain();
                (self.point(a).distance(self.point(b)) <= tolerance).then_some(b - a)
            }
            Shape::Line(_, way) => {
                let (way, period) = (way.truncate() * self.unit, self.base.period());
                let along = [(way.x, way.y, period.x), (way.y, way.x, period.y)];
                let round = along.into_iter().find(|&(on, off, period)| {
                    period > 0.0 && off.abs() <= 1e-12 * on.abs() && on != 0.0
                });
                round.map(|(on, _, period)| period / on.abs())
            }
            _ => None,
        }
    }
}

impl Geometry<'_, '_> {
    /// A `PCURVE`: name, surface, and a representation of a curve in its parameter plane.
    pub(super) fn on_surface(&self, instance: &Instance<'_, '_>) -> Result<Curve> {
        let all = instance.all();
        let (base, unit) = self.base(all.reference(1)?)?;
        let definition = self.step.get(all.reference(2)?)?;
        let [flat] = definition.all().references(1)?[..] else {
            return Err(definition.error("the definition should hold one curve"));
        };
        let plane = Geometry {
            planar: true,
            ..*self
        };
        let flat = plane.curve(flat)?;
        let curve = OnSurface {
            base,
            unit,
            flat: flat.shape,
            range: flat.range.map(|[a, b]| [a.min(b), a.max(b)]),
            tolerance: self.tolerance,
        };
        Ok(Curve {
            shape: Shape::OnSurface(Box::new(curve)),
            reversed: flat.reversed,
            range: flat.range,
        })
    }

    /// A surface as curves in its parameter plane see it, and the units of its parameters.
    fn base(&self, id: u64) -> Result<(Base, DVec2)> {
        let instance = self.step.get(id)?;
        let all = instance.all();
        let frame = || self.frame(all.reference(1)?);
        let angle = self.angle;
        Ok(match instance.name() {
            "PLANE" => (Base::Plane(frame()?), DVec2::ONE),
            "CYLINDRICAL_SURFACE" => {
                let base = Base::Cone(frame()?, all.real(2)?, 0.0);
                (base, DVec2::new(angle, 1.0))
            }
            "CONICAL_SURFACE" => {
                let slope = math::tan(all.real(3)? * angle);
                let base = Base::Cone(frame()?, all.real(2)?, slope);
                (base, DVec2::new(angle, 1.0))
            }
            "SPHERICAL_SURFACE" => {
                let base = Base::Torus(frame()?, 0.0, all.real(2)?);
                (base, DVec2::splat(angle))
            }
            "TOROIDAL_SURFACE" => {
                let base = Base::Torus(frame()?, all.real(2)?, all.real(3)?);
                (base, DVec2::splat(angle))
            }
            "RECTANGULAR_TRIMMED_SURFACE" if all.flag(6)? && all.flag(7)? => {
                let basis = all.reference(1)?;
                return self.step.deeper(id, || self.base(basis));
            }
            name if name.contains("B_SPLINE_SURFACE") => {
                let surface = self.spline_surface(&instance)?;
                let closed = |d| surface.is_closed(d, self.tolerance);
                let length = |(a, b): (f64, f64), d| if closed(d) { b - a } else { 0.0 };
                let [u, v] = surface.domain();
                let net = Net {
                    closest: ClosestPoint::with_tolerance(&surface, 0.01 * self.tolerance)?,
                    period: DVec2::new(length(u, Direction::U), length(v, Direction::V)),
                    surface,
                };
                (Base::Net(Box::new(net)), DVec2::ONE)
            }
            name => {
                return Err(instance.error(format_args!(
                    "the curve is given only in the parameter plane of a {name}; such a curve is not read"
                )));
            }
        })
    }
}
