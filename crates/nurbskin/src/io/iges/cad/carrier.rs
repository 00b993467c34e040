//! Surfaces as faces lie on them; those without ends are cut to what lies on them.

use super::{Got, Place, leave};
use crate::cad::SurfaceKind;
use crate::nurbs::{ControlNet, KnotVector, NurbsCurve, NurbsSurface, conic};
use crate::{DVec3, Error, Result};
use glam::{DMat3, DVec2};
use std::f64::consts::TAU;

/// A point and three directions, which need be neither perpendicular nor of unit length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) origin: DVec3,
    pub(super) axes: DMat3,
}

impl Frame {
    /// With z along `axis` and x along `reference`, or anywhere across where that is left out.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a direction has no length, or they are parallel.
    pub(super) fn new(origin: DVec3, axis: DVec3, reference: Option<DVec3>) -> Result<Self> {
        let no = |what: &str| Error::invalid(format!("its {what} has no direction"));
        let z = axis.try_normalize().ok_or_else(|| no("axis"))?;
        let x = match reference {
            Some(x) => {
                let x = x.try_normalize().ok_or_else(|| no("reference direction"))?;
                (x - z * x.dot(z)).try_normalize()
            }
            None => Some(z.any_orthonormal_vector()),
        };
        let x = x.ok_or_else(|| no("reference direction beside its axis"))?;
        let axes = DMat3::from_cols(x, z.cross(x), z);
        Ok(Self { origin, axes })
    }

    pub(super) fn at(&self, p: DVec3) -> DVec3 {
        self.origin + self.axes * p
    }

    pub(super) fn placed(&self, place: Place) -> Self {
        let axes = [0, 1, 2].map(|k| place.vector(self.axes.col(k)));
        Self {
            origin: place.apply(self.origin),
            axes: DMat3::from_cols(axes[0], axes[1], axes[2]),
        }
    }
}

/// A surface of a file in the coordinates of its entity.
#[derive(Clone, Debug)]
pub(super) enum Carrier {
    /// A surface with ends.
    Net {
        surface: NurbsSurface,
        /// The surface over all of its knots, where the file asks for a part of it.
        whole: Option<NurbsSurface>,
        kind: SurfaceKind,
        /// Whether the parameters are those that the file's curves on the surface speak of.
        own_parameters: bool,
    },
    /// z = 0.
    Plane(Frame),
    /// Around z, of this radius.
    Cylinder(Frame, f64),
    /// Around z, of this radius at z = 0, which grows by this much with z.
    Cone(Frame, f64, f64),
}

impl Carrier {
    pub(super) fn kind(&self) -> SurfaceKind {
        match self {
            Carrier::Net { kind, .. } => *kind,
            Carrier::Plane(_) => SurfaceKind::Plane,
            Carrier::Cylinder(..) => SurfaceKind::Cylinder,
            Carrier::Cone(..) => SurfaceKind::Cone,
        }
    }

    /// The surface in the coordinates of the model. One without ends reaches as far as these points, which are in those
    /// coordinates too.
    pub(super) fn realise(&self, place: Place, points: &[DVec3]) -> Got<NurbsSurface> {
        let frame = match self {
            Carrier::Net { surface, .. } => {
                return Ok(if place.is_identity() {
                    surface.clone()
                } else {
                    surface.map_points(|p| place.apply(p))?
                });
            }
            Carrier::Plane(frame) | Carrier::Cylinder(frame, _) | Carrier::Cone(frame, ..) => {
                frame.placed(place)
            }
        };
        let Some([low, high]) = local_box(&frame, points) else {
            return leave("a surface without ends that nothing bounds");
        };
        let local = match self {
            Carrier::Cylinder(_, radius) => wall(*radius, 0.0, [low.z, high.z])?,
            Carrier::Cone(_, radius, slope) => wall(*radius, *slope, [low.z, high.z])?,
            _ => return Ok(patch(&frame, low, high)?),
        };
        Ok(local.map_points(|p| frame.at(p))?)
    }

    /// A realised surface made to hold curves where they leave its domain: over all of its knots where the file cuts it,
    /// and a bilinear one as far as needed, both exactly. Given are the rectangle in the parameter plane of places on the
    /// curves, which decides, and one that holds the curves.
    pub(super) fn reaching(
        &self,
        place: Place,
        surface: NurbsSurface,
        [[low, high], hull]: [[DVec2; 2]; 2],
    ) -> Result<NurbsSurface> {
        let holds = |surface: &NurbsSurface| {
            let [(a, b), (c, d)] = surface.domain();
            let slack = 1e-9 * DVec2::new(b - a, d - c);
            low.cmpge(DVec2::new(a, c) - slack).all() && high.cmple(DVec2::new(b, d) + slack).all()
        };
        let Carrier::Net { whole, .. } = self else {
            return Ok(surface);
        };
        if holds(&surface) {
            return Ok(surface);
        }
        let surface = match whole {
            Some(whole) => whole.map_points(|p| place.apply(p))?.clamped()?,
            None => surface,
        };
        let small = surface.degree() == [1, 1] && surface.control_points().counts() == [2, 2];
        if holds(&surface) || !small || surface.is_rational() {
            return Ok(surface);
        }
        let [(a, b), (c, d)] = surface.domain();
        // No further than makes sense of curves on it.
        let most = 0.1 * DVec2::new(b - a, d - c);
        let [from, to] = [DVec2::new(a, c), DVec2::new(b, d)];
        let low = hull[0].clamp(from - most, from);
        let high = hull[1].clamp(to, to + most);
        let net = surface.control_points();
        let at = |u: f64, v: f64| {
            let (s, t) = ((u - a) / (b - a), (v - c) / (d - c));
            let line = |j: usize| net.point(0, j) + s * (net.point(1, j) - net.point(0, j));
            line(0) + t * (line(1) - line(0))
        };
        let (x, y) = ([low.x, high.x], [low.y, high.y]);
        let knots = |[a, b]: [f64; 2]| KnotVector::new(1, vec![a, a, b, b]);
        let net = ControlNet::from_fn(2, 2, |i, j| at(x[i], y[j]))?;
        NurbsSurface::new(knots(x)?, knots(y)?, net, None)
    }

    /// The curve in the parameters of a plane as [`Carrier::realise`] makes it: exact. `None` for other surfaces.
    pub(super) fn pcurve(&self, place: Place, curve: &NurbsCurve) -> Option<NurbsCurve> {
        let Carrier::Plane(frame) = self else {
            return None;
        };
        let frame = frame.placed(place);
        let inverse = frame.axes.inverse();
        let flat = |p: DVec3| {
            let local = inverse * (p - frame.origin);
            DVec3::new(local.x, local.y, 0.0)
        };
        curve.map_points(flat).ok()
    }
}

/// The box of points in a frame; `None` where there is none that is finite.
fn local_box(frame: &Frame, points: &[DVec3]) -> Option<[DVec3; 2]> {
    let inverse = frame.axes.inverse();
    let local = points.iter().map(|&p| inverse * (p - frame.origin));
    let (low, high) = local.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
        (low.min(p), high.max(p))
    });
    (low.is_finite() && high.is_finite()).then_some([low, high])
}

/// The rectangle of a plane; its parameters are lengths along x and y.
fn patch(frame: &Frame, low: DVec3, high: DVec3) -> Result<NurbsSurface> {
    let (x, y) = ([low.x, high.x], [low.y, high.y]);
    let knots = |[a, b]: [f64; 2]| KnotVector::new(1, vec![a, a, b, b]);
    let net = ControlNet::from_fn(2, 2, |i, j| frame.at(DVec3::new(x[i], y[j], 0.0)))?;
    NurbsSurface::new(knots(x)?, knots(y)?, net, None)
}

/// The side of a cylinder or cone around z between these heights. A cone that reaches to its tip but for rounding, or
/// has no height, ends there; one that would reach beyond is cut there, on the side where it is longer.
fn wall(radius: f64, slope: f64, [low, high]: [f64; 2]) -> Got<NurbsSurface> {
    let (mut ends, scale) = ([low, high], radius.abs() + low.abs() + high.abs());
    if slope != 0.0 {
        let tip = -radius / slope;
        let near = 1e-9 * (scale + tip.abs());
        if high - low <= near {
            ends = [low.min(tip), high.max(tip)];
        } else if tip > low + near && tip < high - near {
            let above = high - tip > tip - low;
            ends = if above { [tip, high] } else { [low, tip] };
        } else if (tip - low).abs() <= near {
            ends[0] = tip;
        } else if (tip - high).abs() <= near {
            ends[1] = tip;
        }
        let at = |z: f64| {
            let r = radius + slope * z;
            let zero = (z - tip).abs() <= 0.0;
            DVec3::new(if zero { 0.0 } else { r }, 0.0, z)
        };
        return turned(at(ends[0]), at(ends[1]), ends);
    }
    let at = |z: f64| DVec3::new(radius, 0.0, z);
    turned(at(ends[0]), at(ends[1]), ends)
}

fn turned(from: DVec3, to: DVec3, [a, b]: [f64; 2]) -> Got<NurbsSurface> {
    if a >= b {
        return leave("its boundary has no extent along the axis of its surface");
    }
    let knots = KnotVector::new(1, vec![a, a, b, b])?;
    let profile = NurbsCurve::new(knots, vec![from, to], None)?;
    Ok(conic::revolve(&profile, DVec3::ZERO, DVec3::Z, TAU)?)
}
