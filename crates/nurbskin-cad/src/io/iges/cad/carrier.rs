//! Surfaces as faces lie on them; those without ends are cut to what lies on them.

use super::{Got, Place, leave};
use crate::SurfaceKind;
use glam::DVec2;
use nurbskin_geometry::nurbs::elementary;
use nurbskin_geometry::nurbs::elementary::{Frame, TURN, range};
use nurbskin_geometry::nurbs::{ControlNet, KnotVector, NurbsCurve, NurbsSurface};
use nurbskin_geometry::{DVec3, Result};

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
        let (frame, radius, slope) = match self {
            Carrier::Net { surface, .. } => {
                return Ok(if place.is_identity() {
                    surface.clone()
                } else {
                    surface.map_points(|p| place.apply(p))?
                });
            }
            Carrier::Plane(frame) => (frame, 0.0, 0.0),
            Carrier::Cylinder(frame, radius) => (frame, *radius, 0.0),
            Carrier::Cone(frame, radius, slope) => (frame, *radius, *slope),
        };
        let frame = place.frame(frame);
        let reach = |axis: usize| range(points.iter().map(|&p| frame.local(p)[axis]), 0.0);
        let [Some(x), Some(y), Some(z)] = [0, 1, 2].map(reach) else {
            return leave("the surface is infinite and has no border");
        };
        Ok(match self {
            Carrier::Plane(_) => elementary::plane(&frame, x, y)?,
            _ => {
                let heights = elementary::up_to_tip(radius, slope, z, 0.0, 0.0);
                elementary::cone(&frame, radius, slope, TURN, heights)?
            }
        })
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
        let frame = place.frame(frame);
        let flat = |p: DVec3| frame.local(p).truncate().extend(0.0);
        curve.map_points(flat).ok()
    }
}
