//! Surfaces of a STEP file as NURBS; those without ends are cut to the box of what bounds them.

use super::instance::Instance;
use super::place::Geometry;
use super::shape::{Curve, Shape};
use crate::SurfaceKind;
use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::math;
use nurbskin_geometry::nurbs::elementary;
use nurbskin_geometry::nurbs::elementary::{POLE_TO_POLE, TURN, range};
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::sweep::extrude;
use nurbskin_geometry::nurbs::{NurbsCurve, NurbsSurface};
use std::f64::consts::TAU;

/// A surface and what it was.
#[derive(Clone, Debug)]
pub(super) struct Read {
    pub(super) surface: NurbsSurface,
    pub(super) kind: SurfaceKind,
    /// Whether its normal is against that of the file's surface.
    pub(super) flipped: bool,
}

/// Surfaces are cut this part of their length beyond what bounds them.
const MARGIN: f64 = 0.01;

/// The part of a surface that is wanted, where it has no ends of its own: parameters of ISO 10303-42, angles in radians.
type Window = [Option<[f64; 2]>; 2];

impl Geometry<'_, '_> {
    /// The surface with this number, cut to what is around these points where it has no ends.
    pub(super) fn surface(&self, id: u64, around: &[DVec3]) -> Result<Read> {
        self.step
            .deeper(id, || self.surface_at(id, around, [None, None]))
    }

    fn surface_at(&self, id: u64, around: &[DVec3], window: Window) -> Result<Read> {
        let instance = self.step.get(id)?;
        let name = instance.name();
        let (surface, kind) = match name {
            "PLANE" => (self.plane(&instance, around, window)?, SurfaceKind::Plane),
            "CYLINDRICAL_SURFACE" | "CONICAL_SURFACE" => {
                let kind = if name == "CYLINDRICAL_SURFACE" {
                    SurfaceKind::Cylinder
                } else {
                    SurfaceKind::Cone
                };
                (self.cone(&instance, around, window)?, kind)
            }
            "SPHERICAL_SURFACE" => (self.sphere(&instance, window)?, SurfaceKind::Sphere),
            "TOROIDAL_SURFACE" | "DEGENERATE_TOROIDAL_SURFACE" => {
                (self.torus(&instance, window)?, SurfaceKind::Torus)
            }
            "SURFACE_OF_REVOLUTION" => (
                self.revolution(&instance, around, window)?,
                SurfaceKind::Revolution,
            ),
            "SURFACE_OF_LINEAR_EXTRUSION" => (
                self.extrusion(&instance, around, window)?,
                SurfaceKind::Extrusion,
            ),
            "RECTANGULAR_TRIMMED_SURFACE" => return self.trimmed_surface(&instance, around),
            "CURVE_BOUNDED_SURFACE" => return self.surface(instance.all().reference(1)?, around),
            _ if name.contains("B_SPLINE_SURFACE")
                || ["BEZIER_SURFACE", "UNIFORM_SURFACE", "QUASI_UNIFORM_SURFACE"]
                    .contains(&name) =>
            {
                let surface = self.spline_surface(&instance)?;
                (cut(surface, window)?, SurfaceKind::BSpline)
            }
            _ => return Err(instance.error(format_args!("{name} is not read as a surface"))),
        };
        Ok(Read {
            surface,
            kind,
            flipped: false,
        })
    }

    fn plane(
        &self,
        instance: &Instance<'_, '_>,
        around: &[DVec3],
        window: Window,
    ) -> Result<NurbsSurface> {
        let frame = self.frame(instance.all().reference(1)?)?;
        let reach = |axis: usize| range(around.iter().map(|&p| frame.local(p)[axis]), MARGIN);
        let ends = [0, 1].map(|axis| window[axis].or_else(|| reach(axis)));
        let [Some(u), Some(v)] = ends else {
            return Err(instance.error("the plane has no border"));
        };
        elementary::plane(&frame, u, v).map_err(|e| instance.error(e))
    }

    fn cone(
        &self,
        instance: &Instance<'_, '_>,
        around: &[DVec3],
        window: Window,
    ) -> Result<NurbsSurface> {
        let all = instance.all();
        let frame = self.frame(all.reference(1)?)?;
        let radius = all.real(2)?;
        let slope = if instance.name() == "CONICAL_SURFACE" {
            math::tan(all.real(3)? * self.angle)
        } else {
            0.0
        };
        if !(radius >= 0.0 && slope.abs() < 1e6) || (radius == 0.0 && slope == 0.0) {
            return Err(instance.error("no surface has this radius or angle"));
        }
        let reach = || range(around.iter().map(|&p| frame.local(p).z), 0.0);
        let reach = || {
            Some(elementary::up_to_tip(
                radius,
                slope,
                reach()?,
                MARGIN,
                self.tolerance,
            ))
        };
        let Some(heights) = window[1].or_else(reach) else {
            return Err(instance.error("the surface is infinite and has no border"));
        };
        let turn = window[0].unwrap_or(TURN);
        elementary::cone(&frame, radius, slope, turn, heights).map_err(|e| instance.error(e))
    }

    fn sphere(&self, instance: &Instance<'_, '_>, window: Window) -> Result<NurbsSurface> {
        let all = instance.all();
        let frame = self.frame(all.reference(1)?)?;
        let [turn, latitudes] = [window[0].unwrap_or(TURN), window[1].unwrap_or(POLE_TO_POLE)];
        elementary::sphere(&frame, all.real(2)?, turn, latitudes).map_err(|e| instance.error(e))
    }

    fn torus(&self, instance: &Instance<'_, '_>, window: Window) -> Result<NurbsSurface> {
        let all = instance.all();
        let frame = self.frame(all.reference(1)?)?;
        let radii = [all.real(2)?, all.real(3)?];
        let outer = instance.name() != "DEGENERATE_TOROIDAL_SURFACE" || all.flag(4).unwrap_or(true);
        let tube = window[1].unwrap_or_else(|| elementary::spindle(radii, outer));
        let turn = window[0].unwrap_or(TURN);
        elementary::torus(&frame, radii, turn, tube).map_err(|e| instance.error(e))
    }

    /// The profile of a swept surface: what `along` says of it, where it has no ends.
    fn profile(
        &self,
        curve: &Curve,
        ends: Option<[f64; 2]>,
        wanted: Option<[f64; 2]>,
    ) -> Result<NurbsCurve> {
        let ends = wanted.or(ends);
        match (&curve.shape, curve.range, ends) {
            (Shape::Line(..) | Shape::Parabola(..) | Shape::Hyperbola(..), None, Some([a, b])) => {
                let part = Curve {
                    range: Some([a, b]),
                    reversed: false,
                    ..curve.clone()
                };
                part.whole(self.tolerance)
            }
            (Shape::Ellipse(..), None, _) if wanted.is_some() => Curve {
                range: wanted,
                ..curve.clone()
            }
            .whole(self.tolerance),
            (Shape::Spline(_), None, _) => {
                let whole = curve.whole(self.tolerance)?;
                let Some([a, b]) = wanted else {
                    return Ok(whole);
                };
                let (low, high) = whole.domain();
                whole.segment(a.max(low), b.min(high))
            }
            _ => curve.whole(self.tolerance),
        }
    }

    fn revolution(
        &self,
        instance: &Instance<'_, '_>,
        around: &[DVec3],
        window: Window,
    ) -> Result<NurbsSurface> {
        let all = instance.all();
        let curve = self.curve(all.reference(1)?)?;
        let axis = self.frame(all.reference(2)?)?;
        // A profile without ends: where it reaches the heights and radii of the boundary.
        let foot = axis.local(curve.shape.point(0.3));
        let angle = math::atan2(foot.y, foot.x);
        let ends = ends(&curve, around, |p| {
            let q = axis.local(p);
            let Shape::Line(origin, v) = &curve.shape else {
                // The point turned into the plane of the profile.
                let r = math::hypot(q.x, q.y);
                let turned = axis.at(DVec3::new(r * math::cos(angle), r * math::sin(angle), q.z));
                return curve.shape.parameter(turned);
            };
            let (o, way) = (axis.local(*origin), axis.local(axis.origin + *v));
            if way.z.abs() > 1e-6 * v.length() {
                return (q.z - o.z) / way.z;
            }
            // A line across the axis: the parameter of this radius, on the side where the line begins.
            let (a, b) = (math::hypot(way.x, way.y), o.x * way.x + o.y * way.y);
            let c = o.x * o.x + o.y * o.y - (q.x * q.x + q.y * q.y);
            (-b + (b * b - a * a * c).max(0.0).sqrt()) / (a * a)
        });
        let profile = self
            .profile(&curve, ends, window[1])
            .map_err(|e| instance.error(e))?;
        let turn = window[0].unwrap_or(TURN);
        elementary::revolved(&axis, &profile, turn).map_err(|e| instance.error(e))
    }

    fn extrusion(
        &self,
        instance: &Instance<'_, '_>,
        around: &[DVec3],
        window: Window,
    ) -> Result<NurbsSurface> {
        let all = instance.all();
        let curve = self.curve(all.reference(1)?)?;
        let way = self.vector(all.reference(2)?)?;
        let square = way.length_squared();
        // A profile without ends: where boundary points come to when they move along the way.
        let normal = match &curve.shape {
            Shape::Line(_, v) => v.cross(way).cross(way),
            Shape::Parabola(f, _) | Shape::Hyperbola(f, ..) => f.axes.z_axis,
            _ => DVec3::ZERO,
        };
        let ends = ends(&curve, around, |p| match &curve.shape {
            Shape::Line(origin, v) => (p - *origin).dot(normal) / v.dot(normal),
            shape => {
                let height = (p - shape.point(0.0)).dot(normal) / way.dot(normal);
                shape.parameter(p - height * way)
            }
        });
        let profile = self
            .profile(&curve, ends, window[0])
            .map_err(|e| instance.error(e))?;
        let heights = |points: &[DVec3]| range(points.iter().map(|p| p.dot(way) / square), 0.0);
        let own = heights(profile.control_points());
        let (Some([a, b]), Some([c, d])) = (own, heights(around).or(window[1].map(|_| [0.0, 0.0])))
        else {
            return Err(instance.error("the surface is infinite and has no border"));
        };
        let [c, d] = window[1].unwrap_or_else(|| {
            let ([c, d], margin) = ([c - b, d - a], MARGIN * (d - a - (c - b)));
            [c - margin, d + margin]
        });
        let start = profile.map_points(|p| p + c * way)?;
        extrude(&start, (d - c) * way).map_err(|e| instance.error(e))
    }

    /// A `RECTANGULAR_TRIMMED_SURFACE`; where edges bound the face, they bound it more closely, and the basis is enough.
    fn trimmed_surface(&self, instance: &Instance<'_, '_>, around: &[DVec3]) -> Result<Read> {
        let all = instance.all();
        let basis = all.reference(1)?;
        let (along, up) = (all.flag(6)?, all.flag(7)?);
        let mut read = if around.is_empty() {
            let kind = self.step.get(basis)?;
            let angle = self.angle;
            // Which parameters are angles.
            let [u, v] = match kind.name() {
                "SPHERICAL_SURFACE" | "TOROIDAL_SURFACE" | "DEGENERATE_TOROIDAL_SURFACE" => {
                    [angle; 2]
                }
                "CYLINDRICAL_SURFACE" | "CONICAL_SURFACE" | "SURFACE_OF_REVOLUTION" => [angle, 1.0],
                _ => [1.0; 2],
            };
            let pair = |k: usize, scale: f64| -> Result<[f64; 2]> {
                let (a, mut b) = (all.real(k)? * scale, all.real(k + 1)? * scale);
                #[expect(clippy::float_cmp, reason = "an angle is scaled, or in radians")]
                if b <= a && (scale == angle && (k == 2 || u == v)) {
                    b += TAU;
                }
                Ok([a.min(b), a.max(b)])
            };
            let window = [Some(pair(2, u)?), Some(pair(4, v)?)];
            self.step
                .deeper(basis, || self.surface_at(basis, around, window))?
        } else {
            self.surface(basis, around)?
        };
        for (direction, sense) in [(Direction::U, along), (Direction::V, up)] {
            if !sense {
                read.surface = read.surface.reversed(direction)?;
            }
        }
        read.flipped = false;
        Ok(read)
    }
}

fn cut(surface: NurbsSurface, window: Window) -> Result<NurbsSurface> {
    let mut surface = surface;
    for (direction, window) in Direction::BOTH.into_iter().zip(window) {
        if let Some([a, b]) = window {
            let (low, high) = surface.knots(direction).domain();
            surface = surface.segment(direction, a.max(low), b.min(high))?;
        }
    }
    Ok(surface)
}

/// The parameters of a profile that has no ends where `parameter` puts the boundary points, a little wider.
fn ends(curve: &Curve, around: &[DVec3], parameter: impl Fn(DVec3) -> f64) -> Option<[f64; 2]> {
    let endless = matches!(
        curve.shape,
        Shape::Line(..) | Shape::Parabola(..) | Shape::Hyperbola(..)
    );
    let all = around.iter().map(|&p| parameter(p));
    endless.then(|| range(all, MARGIN)).flatten()
}
