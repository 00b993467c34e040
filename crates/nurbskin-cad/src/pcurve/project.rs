//! The p-curve of a curve on a surface.
//!
//! Feet of points of the curve are found by Newton's method, each from the one before; p' follows from
//! `C' = S_u u' + S_v v'`. Between the feet runs a cubic Hermite curve, and intervals are halved until it stays within
//! the tolerance of the feet. Source: foot points, *The NURBS Book*, 2nd ed., section 6.1.

use glam::{DVec2, DVec3};
use nurbskin_geometry::nurbs::closest::ClosestPoint;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::shape::Edge as Side;
use nurbskin_geometry::nurbs::{NurbsCurve, NurbsSurface};
use nurbskin_geometry::{Error, Result};

/// Finds p-curves on one surface.
#[derive(Clone, Debug)]
pub(crate) struct Projector {
    pub(super) surface: NurbsSurface,
    /// Made when it is needed.
    closest: Option<ClosestPoint>,
    /// Which directions close, so that parameters run on by periods.
    pub(crate) closed: [bool; 2],
    low: DVec2,
    high: DVec2,
    pub(crate) poles: Vec<(Side, DVec3)>,
    pub(super) tolerance: f64,
    /// How close to its curve a p-curve that a file has must be.
    pub(crate) given: f64,
    /// How close the p-curve at hand is made: looser for a curve that is not on the surface.
    pub(super) within: f64,
}

/// A place of the p-curve.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) t: f64,
    pub(super) uv: DVec2,
    /// dp/dt where it was extrapolated, at a pole.
    pub(super) slope: Option<DVec2>,
}

impl Projector {
    /// For a clamped surface; p-curves will be within `tolerance` of the feet of their curve.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the tolerance is not positive.
    pub(crate) fn new(surface: &NurbsSurface, tolerance: f64) -> Result<Self> {
        if !(tolerance > 0.0 && tolerance.is_finite()) {
            return Err(Error::invalid(format!(
                "the tolerance of p-curves must be a positive length, not {tolerance}"
            )));
        }
        let surface = crate::natural::clamped(surface)?;
        let [(a, b), (c, d)] = surface.domain();
        let pole = |side: Side| {
            let at = match side {
                Side::UMin | Side::VMin => surface.point(a, c),
                Side::UMax | Side::VMax => surface.point(b, d),
            };
            surface.is_pole(side, tolerance).then_some((side, at))
        };
        Ok(Self {
            closed: Direction::BOTH.map(|d| surface.is_closed(d, tolerance)),
            low: DVec2::new(a, c),
            high: DVec2::new(b, d),
            poles: Side::ALL.into_iter().filter_map(pole).collect(),
            closest: None,
            surface,
            tolerance,
            given: tolerance,
            within: tolerance,
        })
    }

    /// The surface, clamped.
    pub(crate) fn surface(&self) -> &NurbsSurface {
        &self.surface
    }

    /// How far p-curves may be from their curves.
    pub(crate) fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Lengths of the domain.
    pub(crate) fn period(&self) -> DVec2 {
        self.high - self.low
    }

    /// (u, v) with the closed directions brought into the domain, the others held in it.
    pub(crate) fn wrapped(&self, uv: DVec2) -> DVec2 {
        let wrap = |t: f64, a: f64, b: f64, closed: bool| {
            if t >= a && t <= b {
                t
            } else if closed && t.is_finite() {
                (a + (t - a).rem_euclid(b - a)).clamp(a, b)
            } else if t > a {
                b
            } else {
                a
            }
        };
        DVec2::new(
            wrap(uv.x, self.low.x, self.high.x, self.closed[0]),
            wrap(uv.y, self.low.y, self.high.y, self.closed[1]),
        )
    }

    /// S at (u, v), which may lie periods outside.
    pub(crate) fn at(&self, uv: DVec2) -> DVec3 {
        let uv = self.wrapped(uv);
        self.surface.point(uv.x, uv.y)
    }

    /// The pole of the surface at this point of its domain or within the tolerance of this point of space.
    pub(crate) fn pole_at(&self, point: DVec3) -> Option<Side> {
        let near = |p: &&(Side, DVec3)| p.1.distance(point) <= 4.0 * self.tolerance;
        self.poles.iter().find(near).map(|p| p.0)
    }

    /// The sides that are poles.
    pub(crate) fn has_pole(&self, side: Side) -> bool {
        self.poles.iter().any(|p| p.0 == side)
    }

    /// The parameter of a side: u or v.
    pub(crate) fn side_parameter(&self, side: Side) -> f64 {
        match side {
            Side::UMin => self.low.x,
            Side::UMax => self.high.x,
            Side::VMin => self.low.y,
            Side::VMax => self.high.y,
        }
    }

    /// The foot of a point near the start, by Newton's method: only where it is a minimum with free variables.
    pub(super) fn foot_from(&self, point: DVec3, start: DVec2) -> (DVec2, f64) {
        let mut uv = start;
        let mut distance = self.at(uv).distance(point);
        for _ in 0..24 {
            let place = self.wrapped(uv);
            let d = self.surface.derivatives(place.x, place.y);
            let r = d.point - point;
            let g = DVec2::new(r.dot(d.du), r.dot(d.dv));
            let gauss = [d.du.dot(d.du), d.du.dot(d.dv), d.dv.dot(d.dv)];
            let newton = [
                gauss[0] + r.dot(d.duu),
                gauss[1] + r.dot(d.duv),
                gauss[2] + r.dot(d.dvv),
            ];
            let mut step = solve(newton, g)
                .or_else(|| solve(gauss, g))
                .unwrap_or_else(|| {
                    DVec2::new(
                        if gauss[0] > 0.0 { -g.x / gauss[0] } else { 0.0 },
                        if gauss[2] > 0.0 { -g.y / gauss[2] } else { 0.0 },
                    )
                });
            // At a border that the step leads over, only the other variable moves.
            let out = self.leads_out(place, step);
            if out[0] {
                step = DVec2::new(0.0, if gauss[2] > 0.0 { -g.y / gauss[2] } else { 0.0 });
            } else if out[1] {
                step = DVec2::new(if gauss[0] > 0.0 { -g.x / gauss[0] } else { 0.0 }, 0.0);
            }
            let longest = 0.25 * self.period();
            step = step.clamp(-longest, longest);
            let length = (d.du * step.x + d.dv * step.y).length();
            let mut improved = false;
            for _ in 0..8 {
                let next = self.held(uv + step);
                let reached = self.at(next).distance(point);
                if reached < distance || (reached <= distance && length <= 1e-3 * self.tolerance) {
                    improved = reached < distance;
                    (uv, distance) = (next, reached);
                    break;
                }
                step *= 0.25;
            }
            if !improved {
                break;
            }
        }
        (uv, distance)
    }

    fn leads_out(&self, place: DVec2, step: DVec2) -> [bool; 2] {
        let out = |t: f64, s: f64, a: f64, b: f64, closed: bool| {
            !closed && ((t <= a && s < 0.0) || (t >= b && s > 0.0))
        };
        [
            out(place.x, step.x, self.low.x, self.high.x, self.closed[0]),
            out(place.y, step.y, self.low.y, self.high.y, self.closed[1]),
        ]
    }

    /// (u, v) held in the domain where it is not closed.
    pub(super) fn held(&self, mut uv: DVec2) -> DVec2 {
        if !self.closed[0] {
            uv.x = uv.x.clamp(self.low.x, self.high.x);
        }
        if !self.closed[1] {
            uv.y = uv.y.clamp(self.low.y, self.high.y);
        }
        uv
    }

    /// The foot nearest of all, in the period nearest to `near`.
    pub(super) fn foot_anywhere(
        &mut self,
        point: DVec3,
        near: Option<DVec2>,
    ) -> Result<(DVec2, f64)> {
        if self.closest.is_none() {
            self.closest = Some(ClosestPoint::with_tolerance(
                &self.surface,
                0.01 * self.tolerance,
            )?);
        }
        let Some(closest) = &self.closest else {
            return Err(Error::invalid("no closest point"));
        };
        let foot = closest.closest(point);
        let (uv, distance) = self.foot_from(point, DVec2::new(foot.u, foot.v));
        let uv = near.map_or(uv, |near| uv + self.turns(near - uv));
        Ok((uv, distance))
    }

    /// The whole periods of the closed directions nearest to `gap`.
    pub(crate) fn turns(&self, gap: DVec2) -> DVec2 {
        let turns = (gap / self.period()).round() * self.period();
        DVec2::new(
            if self.closed[0] { turns.x } else { 0.0 },
            if self.closed[1] { turns.y } else { 0.0 },
        )
    }

    /// dp/dt at a place, from the side where `toward` lies in parameter space and time.
    pub(super) fn slope(&self, curve: &NurbsCurve, place: Place, toward: Place) -> DVec2 {
        if let Some(slope) = place.slope {
            return slope;
        }
        // A little into the interval: derivatives at a knot are those of the other side, perhaps.
        let t = place.t + 1e-9 * (toward.t - place.t);
        let uv = self.wrapped(place.uv + 1e-9 * (toward.uv - place.uv));
        let velocity = curve.derivatives(t)[1];
        let d = self.surface.derivatives(uv.x, uv.y);
        let gauss = [d.du.dot(d.du), d.du.dot(d.dv), d.dv.dot(d.dv)];
        let right = DVec2::new(velocity.dot(d.du), velocity.dot(d.dv));
        solve(gauss, -right).unwrap_or((toward.uv - place.uv) / (toward.t - place.t))
    }

    /// The p-curve of a curve on the surface, over the same parameters. (u, v) runs on continuously over the seams of
    /// closed directions, so that it may leave the domain by a period; it starts inside the domain. At a pole, where
    /// the curve begins or ends, u (or v) is the limit from the curve. On a plane it is exact; elsewhere it is a straight
    /// line or a cubic within the tolerance of the feet of the curve. A curve that is not on the surface is projected.
    ///
    /// # Errors
    /// None for a valid curve, unless numbers overflow.
    pub(crate) fn pcurve(&mut self, curve: &NurbsCurve) -> Result<NurbsCurve> {
        if let Some(exact) = self.on_plane(curve)? {
            return Ok(exact);
        }
        let mut places = self.places(curve)?;
        let off = |p: &Place| self.at(p.uv).distance(curve.point(p.t));
        self.within = self
            .tolerance
            .max(0.01 * places.iter().map(off).fold(0.0, f64::max));
        // The start goes into the domain.
        if let Some(first) = places.first().copied() {
            let shift = self.wrapped(first.uv) - first.uv;
            let shift = self.turns(shift);
            places.iter_mut().for_each(|p| p.uv += shift);
        }
        if let Some(line) = self.straight(curve, &places)? {
            return Ok(line);
        }
        self.refine(curve, &mut places);
        self.hermite(curve, &places)
    }

    /// On a parallelogram p is an affine image of the curve.
    fn on_plane(&self, curve: &NurbsCurve) -> Result<Option<NurbsCurve>> {
        let s = &self.surface;
        let net = s.control_points();
        if s.is_rational() || net.counts() != [2, 2] || s.degree() != [1, 1] {
            return Ok(None);
        }
        let (origin, x, y) = (
            net.point(0, 0),
            net.point(1, 0) - net.point(0, 0),
            net.point(0, 1) - net.point(0, 0),
        );
        let twist = (net.point(1, 1) - origin - x - y).length();
        if twist > 1e-12 * (x.length() + y.length()) {
            return Ok(None);
        }
        let gram = [x.dot(x), x.dot(y), y.dot(y)];
        let map = |p: DVec3| {
            let r = p - origin;
            let st = solve(gram, -DVec2::new(r.dot(x), r.dot(y)))?;
            Some((self.low + st * self.period()).extend(0.0))
        };
        let points = curve.control_points().iter().map(|&p| map(p));
        let Some(points) = points.collect::<Option<Vec<_>>>() else {
            return Ok(None);
        };
        let weights = curve.weights().map(<[f64]>::to_vec);
        NurbsCurve::new(curve.knots().clone(), points, weights).map(Some)
    }

    /// The largest distance between a curve and its p-curve, at a few places in each span.
    pub(crate) fn gap(&self, curve: &NurbsCurve, pcurve: &NurbsCurve) -> f64 {
        let breaks = curve.knots().breakpoints();
        let parts = if breaks.len() > 200 { 2 } else { 8 };
        let mut worst = 0.0_f64;
        for w in breaks.windows(2) {
            for k in 0..=parts {
                let t = w[0] + (w[1] - w[0]) * f64::from(k) / f64::from(parts);
                let distance = self.at(pcurve.point(t).truncate()).distance(curve.point(t));
                worst = if distance.is_nan() {
                    f64::INFINITY
                } else {
                    worst.max(distance)
                };
            }
        }
        worst
    }
}

/// x with `H x = -g` for a positive definite symmetric H = [a, b, c], or `None`.
fn solve([a, b, c]: [f64; 3], g: DVec2) -> Option<DVec2> {
    let determinant = a * c - b * b;
    let sound = a > 0.0 && c > 0.0 && determinant > 1e-14 * a * c;
    sound.then(|| DVec2::new(b * g.y - c * g.x, b * g.x - a * g.y) / determinant)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_geometry::nurbs::conic;

    /// A circle around a tilted axis on the unit sphere, whole turns of a torus and a meridian from pole to pole: the
    /// p-curve runs on over the seam and is within the tolerance at equal parameters.
    #[test]
    fn pcurves_follow_their_curves() {
        let sphere = conic::sphere(DVec3::ZERO, 1.0).unwrap();
        let torus = conic::torus(DVec3::ZERO, DVec3::Z, 3.0, 1.0).unwrap();
        let axis = DVec3::new(0.3, -0.5, 0.8).normalize();
        let tilted = conic::circle(0.6 * axis, axis, 0.8).unwrap();
        let meridian =
            conic::arc(DVec3::ZERO, -DVec3::Z, DVec3::Y, 0.0, std::f64::consts::PI).unwrap();
        let tube = conic::circle(3.0 * DVec3::Y, DVec3::X, 1.0).unwrap();
        let ring = conic::circle(DVec3::Z, -DVec3::Z, 3.0).unwrap();
        let cases = [
            (&sphere, &tilted),
            (&sphere, &meridian),
            (&torus, &tube),
            (&torus, &ring),
        ];
        for (surface, curve) in cases {
            for tolerance in [1e-4, 1e-9] {
                let mut projector = Projector::new(surface, tolerance).unwrap();
                let pcurve = projector.pcurve(curve).unwrap();
                assert_eq!(pcurve.domain(), curve.domain());
                let (a, b) = curve.domain();
                for k in 0..=500 {
                    let t = a + (b - a) * f64::from(k) / 500.0;
                    let there = projector.at(pcurve.point(t).truncate());
                    assert!(there.distance(curve.point(t)) <= tolerance, "{t}");
                }
                let [(a, b), _] = surface.domain();
                let start = pcurve.point(pcurve.domain().0).x;
                assert!(start >= a && start <= b);
            }
        }
        let far = tilted.map_points(|p| 1.2 * p).unwrap();
        let far = Projector::new(&sphere, 1e-9).unwrap().pcurve(&far).unwrap();
        assert!(far.control_points().len() < 400);
    }
}
