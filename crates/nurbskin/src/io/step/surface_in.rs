//! Surfaces of a STEP file as NURBS; those without ends are cut to the box of what bounds them.

use super::curve_in::{Curve, Shape, knots};
use super::instance::Instance;
use super::place::{Frame, Geometry};
use crate::Result;
use crate::cad::SurfaceKind;
use crate::nurbs::refine::Direction;
use crate::nurbs::{ControlNet, KnotVector, NurbsCurve, NurbsSurface, conic};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, TAU};

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

/// The range of values, a little wider.
fn range(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let [a, b] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| {
        [a.min(x), b.max(x)]
    });
    let margin = MARGIN * (b - a);
    (a <= b && (b - a).is_finite()).then_some([a - margin, b + margin])
}

/// Ruled between two curves over the same knots.
fn ruled(low: &NurbsCurve, high: &NurbsCurve, [a, b]: [f64; 2]) -> Result<NurbsSurface> {
    let mut points = low.control_points().to_vec();
    points.extend_from_slice(high.control_points());
    let weights = low.weights().map(|w| [w, w].concat());
    let net = ControlNet::new(low.control_points().len(), 2, points)?;
    NurbsSurface::new(
        low.knots().clone(),
        KnotVector::clamped(1, &[a, b])?,
        net,
        weights,
    )
}

/// A profile in the half plane of X and Z, turned around Z from angle a to b.
fn turned(frame: &Frame, profile: &NurbsCurve, turn: Option<[f64; 2]>) -> Result<NurbsSurface> {
    let [a, b] = turn.unwrap_or([0.0, TAU]);
    let (sin, cos) = a.sin_cos();
    let start = Frame {
        x: cos * frame.x + sin * frame.y,
        y: cos * frame.y - sin * frame.x,
        ..*frame
    };
    // In the frame the axis is exact, and so are the poles.
    let surface = conic::revolve(profile, DVec3::ZERO, DVec3::Z, (b - a).min(TAU))?;
    surface.map_points(|p| start.at(p))
}

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
        let local: Vec<DVec3> = around.iter().map(|&p| frame.local(p)).collect();
        let u = window[0].or_else(|| range(local.iter().map(|p| p.x)));
        let v = window[1].or_else(|| range(local.iter().map(|p| p.y)));
        let (Some([a, b]), Some([c, d])) = (u, v) else {
            return Err(instance.error("a plane without ends"));
        };
        let at = |u: f64, v: f64| frame.at(DVec3::new(u, v, 0.0));
        let row = |v: f64| {
            NurbsCurve::new(
                KnotVector::clamped(1, &[a, b])?,
                vec![at(a, v), at(b, v)],
                None,
            )
        };
        ruled(&row(c)?, &row(d)?, [c, d]).map_err(|e| instance.error(e))
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
            (all.real(3)? * self.angle).tan()
        } else {
            0.0
        };
        if !(radius >= 0.0 && slope.abs() < 1e6) || (radius == 0.0 && slope == 0.0) {
            return Err(instance.error("its radius or angle is impossible"));
        }
        let heights = || around.iter().map(|&p| frame.local(p).z);
        let Some([mut c, mut d]) = window[1].or_else(|| range(heights())) else {
            return Err(instance.error("a surface without ends"));
        };
        if slope != 0.0 && window[1].is_none() {
            // Not beyond the tip.
            let tip = -radius / slope;
            let slack = self.tolerance + 1e-9 * (d - c);
            let (low, high) = heights().fold((f64::INFINITY, f64::NEG_INFINITY), |a, x| {
                (a.0.min(x), a.1.max(x))
            });
            if low >= tip - slack {
                c = c.max(tip);
            } else if high <= tip + slack {
                d = d.min(tip);
            }
        }
        let tip_at = |v: f64| {
            let x = radius + v * slope;
            if x.abs() <= 1e-12 * (radius + (v * slope).abs()) {
                0.0
            } else {
                x
            }
        };
        let points = vec![DVec3::new(tip_at(c), 0.0, c), DVec3::new(tip_at(d), 0.0, d)];
        let knots = KnotVector::clamped(1, &[c, d]).map_err(|e| instance.error(e))?;
        turned(&frame, &NurbsCurve::new(knots, points, None)?, window[0])
    }

    fn sphere(&self, instance: &Instance<'_, '_>, window: Window) -> Result<NurbsSurface> {
        let all = instance.all();
        let frame = self.frame(all.reference(1)?)?;
        let radius = self.positive(instance, all.real(2)?)?;
        let [c, d] = window[1].unwrap_or([-FRAC_PI_2, FRAC_PI_2]);
        let arc = conic::arc(DVec3::ZERO, radius * DVec3::X, radius * DVec3::Z, c, d)?;
        turned(&frame, &on_axis(&arc, radius)?, window[0])
    }

    fn torus(&self, instance: &Instance<'_, '_>, window: Window) -> Result<NurbsSurface> {
        let all = instance.all();
        let frame = self.frame(all.reference(1)?)?;
        let major = all.real(2)?;
        let minor = self.positive(instance, all.real(3)?)?;
        let mut v = window[1].unwrap_or([0.0, TAU]);
        if major < 0.0 {
            return Err(instance.error("a negative radius"));
        }
        if major < minor && window[1].is_none() {
            // A spindle: its outer or its inner part.
            let outer =
                instance.name() != "DEGENERATE_TOROIDAL_SURFACE" || all.flag(4).unwrap_or(true);
            let pole = (-major / minor).acos();
            v = if outer {
                [-pole, pole]
            } else {
                [pole, TAU - pole]
            };
        }
        let arc = conic::arc(
            major * DVec3::X,
            minor * DVec3::X,
            minor * DVec3::Z,
            v[0],
            v[1],
        )?;
        turned(&frame, &on_axis(&arc, major + minor)?, window[0])
    }

    fn positive(&self, instance: &Instance<'_, '_>, value: f64) -> Result<f64> {
        if value > 0.0 {
            return Ok(value);
        }
        Err(instance.error(format_args!("a radius should be positive, not {value}")))
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
        let ends = match &curve.shape {
            Shape::Line(origin, v) => {
                let (o, w) = (axis.local(*origin), v.dot(axis.z));
                let radial = axis.local(axis.origin + *v);
                range(around.iter().map(|&p| {
                    let q = axis.local(p);
                    if w.abs() > 1e-6 * v.length() {
                        return (q.z - o.z) / w;
                    }
                    // A line across the axis: the parameter of this radius, on the side where the line begins.
                    let (a, b) = (radial.x.hypot(radial.y), o.x * radial.x + o.y * radial.y);
                    let c = o.x * o.x + o.y * o.y - (q.x * q.x + q.y * q.y);
                    (-b + (b * b - a * a * c).max(0.0).sqrt()) / (a * a)
                }))
            }
            Shape::Parabola(..) | Shape::Hyperbola(..) => {
                // Boundary points turned into the plane of the profile.
                let foot = axis.local(curve.shape.point(0.3));
                let angle = foot.y.atan2(foot.x);
                range(around.iter().map(|&p| {
                    let q = axis.local(p);
                    let r = q.x.hypot(q.y);
                    curve.shape.parameter(axis.at(DVec3::new(
                        r * angle.cos(),
                        r * angle.sin(),
                        q.z,
                    )))
                }))
            }
            _ => None,
        };
        let profile = self
            .profile(&curve, ends, window[1])
            .map_err(|e| instance.error(e))?;
        let local = profile.map_points(|p| axis.local(p))?;
        let turn = window[0].unwrap_or([0.0, TAU]);
        turned(&axis, &local, Some(turn)).map_err(|e| instance.error(e))
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
        let ends = match &curve.shape {
            Shape::Line(origin, v) => {
                // In the plane of the line and the way.
                let normal = v.cross(way);
                let across = normal.cross(way);
                range(
                    around
                        .iter()
                        .map(|&p| (p - *origin).dot(across) / v.dot(across)),
                )
            }
            Shape::Parabola(..) | Shape::Hyperbola(..) => {
                range(around.iter().map(|&p| curve.shape.parameter(p)))
            }
            _ => None,
        };
        let profile = self
            .profile(&curve, ends, window[0])
            .map_err(|e| instance.error(e))?;
        let heights = |points: &[DVec3]| range_of(points.iter().map(|p| p.dot(way) / square));
        let own = heights(profile.control_points());
        let (Some([a, b]), Some([c, d])) = (own, heights(around).or(window[1].map(|_| [0.0, 0.0])))
        else {
            return Err(instance.error("a surface without ends"));
        };
        let [c, d] = window[1].unwrap_or([c - b, d - a]);
        let margin = if window[1].is_some() {
            0.0
        } else {
            MARGIN * (d - c)
        };
        let [c, d] = [c - margin, d + margin];
        let (low, high) = (
            profile.map_points(|p| p + c * way)?,
            profile.map_points(|p| p + d * way)?,
        );
        ruled(&low, &high, [c, d]).map_err(|e| instance.error(e))
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

    fn spline_surface(&self, instance: &Instance<'_, '_>) -> Result<NurbsSurface> {
        let complex = instance.is_complex();
        let base = instance.part("B_SPLINE_SURFACE")?;
        let k = usize::from(!complex);
        let degree = [base.count(k)?, base.count(k + 1)?];
        // Rows along u, in the file; u is fastest here.
        let rows = base.list(k + 2)?;
        let mut lines = Vec::with_capacity(rows.len());
        for row in rows {
            let super::parse::Value::List(row) = row else {
                return Err(instance.error("its control points should be a list of lists"));
            };
            let points = base
                .references_of(k + 2, row)?
                .into_iter()
                .map(|p| self.point(p));
            lines.push(points.collect::<Result<Vec<_>>>()?);
        }
        let counts = [lines.len(), lines.first().map_or(0, Vec::len)];
        if counts.contains(&0) || lines.iter().any(|l| l.len() != counts[1]) {
            return Err(instance.error("its rows of control points differ in length"));
        }
        let named = |text: &str| instance.parts.iter().any(|p| p.name == text);
        let given = if named("B_SPLINE_SURFACE_WITH_KNOTS") {
            let part = instance.part("B_SPLINE_SURFACE_WITH_KNOTS")?;
            let k = if complex { 0 } else { 8 };
            Some([
                (part.counts(k)?, part.reals(k + 2)?),
                (part.counts(k + 1)?, part.reals(k + 3)?),
            ])
        } else if named("BEZIER_SURFACE")
            || named("UNIFORM_SURFACE")
            || named("QUASI_UNIFORM_SURFACE")
        {
            None
        } else {
            return Err(instance.error("its knots are missing"));
        };
        let made = |axis: usize| {
            let given = given.as_ref().map(|g| (&g[axis].0[..], &g[axis].1[..]));
            knots(
                instance,
                degree[axis],
                counts[axis],
                given,
                named("BEZIER_SURFACE"),
                named("QUASI_UNIFORM_SURFACE"),
            )
        };
        let weights = if complex && named("RATIONAL_B_SPLINE_SURFACE") {
            Some(self.weights(instance, counts)?)
        } else {
            None
        };
        let net = ControlNet::from_fn(counts[0], counts[1], |i, j| lines[i][j])
            .map_err(|e| instance.error(e))?;
        let surface = NurbsSurface::new(made(0)?, made(1)?, net, weights);
        surface
            .and_then(|s| s.clamped())
            .map_err(|e| instance.error(e))
    }

    fn weights(&self, instance: &Instance<'_, '_>, [m, n]: [usize; 2]) -> Result<Vec<f64>> {
        let part = instance.part("RATIONAL_B_SPLINE_SURFACE")?;
        let mut rows = Vec::new();
        for row in part.list(0)? {
            let super::parse::Value::List(row) = row else {
                return Err(instance.error("its weights should be a list of lists"));
            };
            rows.push(part.reals_of(0, row)?);
        }
        if rows.len() != m || rows.iter().any(|r| r.len() != n) {
            return Err(instance.error("it has not a weight for each control point"));
        }
        Ok((0..n)
            .flat_map(|j| rows.iter().map(move |r| r[j]))
            .collect())
    }
}

fn range_of(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let [a, b] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| {
        [a.min(x), b.max(x)]
    });
    (a <= b).then_some([a, b])
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

/// The profile with ends that are on the axis to rounding put on it.
fn on_axis(profile: &NurbsCurve, size: f64) -> Result<NurbsCurve> {
    let last = profile.control_points().len().saturating_sub(1);
    let mut k = 0;
    let points = profile.control_points().iter().map(|&p| {
        let end = k == 0 || k == last;
        k += 1;
        if end && p.x.abs() <= 1e-14 * size {
            DVec3::new(0.0, p.y, p.z)
        } else {
            p
        }
    });
    let points = points.collect();
    NurbsCurve::new(
        profile.knots().clone(),
        points,
        profile.weights().map(<[f64]>::to_vec),
    )
}
