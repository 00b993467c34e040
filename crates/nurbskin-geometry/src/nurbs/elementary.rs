//! Planes, cylinders, cones, spheres and tori in a frame, exactly, as far as what lies on them reaches.
//!
//! Parameters of a plane are lengths along x and y. Around the axis z, u runs over \[0, 1\] from the first angle to the
//! second; v of a cylinder or cone is the height, that of a sphere or torus runs over \[0, 1\] along the arc.

use super::{ControlNet, KnotVector, NurbsCurve, NurbsSurface, conic};
use crate::math;
use crate::{Error, Result};
use glam::{DAffine3, DMat3, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Angles of a whole turn.
pub const TURN: [f64; 2] = [0.0, TAU];

/// Angles from pole to pole.
pub const POLE_TO_POLE: [f64; 2] = [-FRAC_PI_2, FRAC_PI_2];

/// A point and three directions: perpendicular, of unit length and right-handed unless it was moved by what is not rigid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The point.
    pub origin: DVec3,
    /// The directions x, y and z, as columns.
    pub axes: DMat3,
}

impl Frame {
    /// With z along `axis` and x as near to `reference` as is across it; without one, or with one along the axis, as near
    /// to the x axis of space, or to its y axis.
    ///
    /// Source: ISO 10303-42, `build_axes` and `first_proj_axis`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the axis has no direction.
    pub fn new(origin: DVec3, axis: DVec3, reference: Option<DVec3>) -> Result<Self> {
        let none = || Error::invalid("its axis has no direction");
        let z = axis.try_normalize().ok_or_else(none)?;
        let across = |x: DVec3| {
            let x = x.try_normalize()?;
            (x - z * x.dot(z)).try_normalize()
        };
        let x = reference.and_then(across).or_else(|| across(DVec3::X));
        let x = x.or_else(|| across(DVec3::Y)).ok_or_else(none)?;
        let axes = DMat3::from_cols(x, z.cross(x), z);
        Ok(Self { origin, axes })
    }

    /// The point with these coordinates in the frame.
    pub fn at(&self, p: DVec3) -> DVec3 {
        self.origin + self.axes * p
    }

    /// The coordinates of a point in the frame.
    pub fn local(&self, p: DVec3) -> DVec3 {
        self.axes.inverse() * (p - self.origin)
    }

    /// The frame moved by a map, of points and of directions.
    pub fn moved(
        &self,
        point: impl Fn(DVec3) -> DVec3,
        direction: impl Fn(DVec3) -> DVec3,
    ) -> Self {
        let [x, y, z] = [0, 1, 2].map(|k| direction(self.axes.col(k)));
        Self {
            origin: point(self.origin),
            axes: DMat3::from_cols(x, y, z),
        }
    }

    /// The map from its coordinates to space.
    pub fn affine(&self) -> DAffine3 {
        DAffine3::from_mat3_translation(self.axes, self.origin)
    }

    /// x and y turned about z.
    fn turned(&self, angle: f64) -> Self {
        let axes = self.axes * DMat3::from_quat(math::rotation(angle * DVec3::Z));
        if angle == 0.0 {
            *self
        } else {
            Self { axes, ..*self }
        }
    }
}

/// The range of values, this part of its length wider at both ends; `None` without any that is finite.
pub fn range(values: impl Iterator<Item = f64>, margin: f64) -> Option<[f64; 2]> {
    let [a, b] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| {
        [a.min(x), b.max(x)]
    });
    let margin = margin * (b - a);
    (a <= b && (b - a).is_finite()).then_some([a - margin, b + margin])
}

/// The heights of a cone with this radius at height 0, which grows by `slope` with the height, from the range of what lies
/// on it, `margin` of it wider: not beyond the tip, where that is not between them but for `slack`, else on its longer
/// side. One height alone means the part up to the tip.
pub fn up_to_tip(
    radius: f64,
    slope: f64,
    [low, high]: [f64; 2],
    margin: f64,
    slack: f64,
) -> [f64; 2] {
    let wider = margin * (high - low);
    let (wide, tip) = ([low - wider, high + wider], -radius / slope);
    if !tip.is_finite() {
        return wide;
    }
    let slack = slack + 1e-9 * (radius.abs() + low.abs() + high.abs() + tip.abs());
    if high - low <= slack {
        [low.min(tip), high.max(tip)]
    } else if tip >= high - slack || tip - low > high - tip {
        [
            wide[0],
            if tip > high + slack {
                tip.min(wide[1])
            } else {
                tip
            },
        ]
    } else {
        [
            if tip < low - slack {
                tip.max(wide[0])
            } else {
                tip
            },
            wide[1],
        ]
    }
}

/// The rectangle of the plane z = 0 of a frame.
///
/// # Errors
/// [`Error::Invalid`] if a range is empty or a number not finite.
pub fn plane(frame: &Frame, x: [f64; 2], y: [f64; 2]) -> Result<NurbsSurface> {
    let knots = |ends: [f64; 2]| KnotVector::clamped(1, &ends);
    let net = ControlNet::from_fn(2, 2, |i, j| frame.at(DVec3::new(x[i], y[j], 0.0)))?;
    NurbsSurface::new(knots(x)?, knots(y)?, net, None)
}

/// A profile in the coordinates of a frame turned about its z axis between two angles.
fn turned(frame: &Frame, profile: &NurbsCurve, [from, to]: [f64; 2]) -> Result<NurbsSurface> {
    // In the frame the axis is exact, and so are the poles.
    let surface = conic::revolve(profile, DVec3::ZERO, DVec3::Z, (to - from).min(TAU))?;
    let start = frame.turned(from);
    surface.map_points(|p| start.at(p))
}

/// A profile in space turned about the z axis of a frame between two angles, counted from where it is; what of it is on the
/// axis to rounding is put on it.
///
/// # Errors
/// [`Error::Invalid`] if the angles do not rise.
pub fn revolved(frame: &Frame, profile: &NurbsCurve, turn: [f64; 2]) -> Result<NurbsSurface> {
    let local = profile.clamped()?.map_points(|p| {
        let q = frame.local(p);
        let rounding = 8.0 * f64::EPSILON * (p.length() + frame.origin.length());
        if math::hypot(q.x, q.y) <= rounding {
            DVec3::new(0.0, 0.0, q.z)
        } else {
            q
        }
    })?;
    turned(frame, &local, turn)
}

/// The side of a cylinder or cone about z with this radius at height 0, which grows by `slope` with the height.
///
/// # Errors
/// [`Error::Invalid`] if the heights or angles do not rise.
pub fn cone(
    frame: &Frame,
    radius: f64,
    slope: f64,
    turn: [f64; 2],
    heights: [f64; 2],
) -> Result<NurbsSurface> {
    let at = |z: f64| {
        let x = radius + slope * z;
        // The tip is on the axis exactly.
        let tip = x.abs() <= 1e-12 * (radius.abs() + (slope * z).abs());
        DVec3::new(if tip { 0.0 } else { x }, 0.0, z)
    };
    let knots = KnotVector::clamped(1, &heights)?;
    let profile = NurbsCurve::new(knots, heights.map(at).to_vec(), None)?;
    turned(frame, &profile, turn)
}

/// The part of a sphere about the origin of a frame between two longitudes and two latitudes.
///
/// # Errors
/// [`Error::Invalid`] if the radius is not positive or angles do not rise.
pub fn sphere(
    frame: &Frame,
    radius: f64,
    turn: [f64; 2],
    latitudes: [f64; 2],
) -> Result<NurbsSurface> {
    arc_turned(frame, [0.0, positive(radius)?], turn, latitudes)
}

/// The part of a torus about z between two angles about the axis and two around its tube. Where the tube is wider than the
/// torus, the angles around it must stay on one side of the axis: see [`spindle`].
///
/// # Errors
/// [`Error::Invalid`] if a radius is negative, that of the tube not positive, or angles do not rise.
pub fn torus(
    frame: &Frame,
    [major, minor]: [f64; 2],
    turn: [f64; 2],
    tube: [f64; 2],
) -> Result<NurbsSurface> {
    if !(major >= 0.0 && major.is_finite()) {
        return Err(Error::invalid(format!("its radius is {major}")));
    }
    arc_turned(frame, [major, positive(minor)?], turn, tube)
}

/// The angles around the tube of a torus where it does not meet itself: all, or those of the outer or the inner part of a
/// spindle.
pub fn spindle([major, minor]: [f64; 2], outer: bool) -> [f64; 2] {
    if major >= minor {
        return TURN;
    }
    let pole = math::acos(-major / minor);
    if outer {
        [-pole, pole]
    } else {
        [pole, TAU - pole]
    }
}

/// The arc of a circle, its centre `major` from the axis, turned; ends that are on the axis to rounding are put on it.
fn arc_turned(
    frame: &Frame,
    [major, minor]: [f64; 2],
    turn: [f64; 2],
    [from, to]: [f64; 2],
) -> Result<NurbsSurface> {
    let arc = conic::arc(
        major * DVec3::X,
        minor * DVec3::X,
        minor * DVec3::Z,
        from,
        to,
    )?;
    let mut points = arc.control_points().to_vec();
    let last = points.len().saturating_sub(1);
    for end in [0, last] {
        if let Some(p) = points.get_mut(end)
            && p.x.abs() <= 1e-14 * (major + minor)
        {
            p.x = 0.0;
        }
    }
    let weights = arc.weights().map(<[f64]>::to_vec);
    let profile = NurbsCurve::new(arc.knots().clone(), points, weights)?;
    turned(frame, &profile, turn)
}

fn positive(radius: f64) -> Result<f64> {
    if radius > 0.0 && radius.is_finite() {
        Ok(radius)
    } else {
        Err(Error::invalid(format!("its radius is {radius}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame() -> Frame {
        let reference = Some(DVec3::new(1.0, 1.0, 0.0));
        Frame::new(
            DVec3::new(1.0, -2.0, 3.0),
            DVec3::new(0.2, -0.3, 2.0),
            reference,
        )
        .unwrap()
    }

    fn samples(s: &NurbsSurface) -> impl Iterator<Item = DVec3> {
        let [(a, b), (c, d)] = s.domain();
        (0..=20_u32).flat_map(move |i| {
            (0..=20_u32).map(move |j| {
                let at = |a: f64, b: f64, k: u32| a + (b - a) * f64::from(k) / 20.0;
                s.point(at(a, b, i), at(c, d, j))
            })
        })
    }

    /// Every point is at its distance from the axis, centre or plane, and the parts end where they should.
    #[test]
    fn surfaces_are_exact_and_reach_their_ends() {
        let frame = frame();
        let local =
            |s: &NurbsSurface| -> Vec<DVec3> { samples(s).map(|p| frame.local(p)).collect() };
        let radius = |p: &DVec3| p.x.hypot(p.y);
        for p in local(&cone(&frame, 2.0, 0.5, TURN, [-4.0, 3.0]).unwrap()) {
            assert!((radius(&p) - (2.0 + 0.5 * p.z)).abs() < 1e-14 && p.z > -4.0 - 1e-14);
        }
        let part = sphere(&frame, 3.0, [0.4, 1.4], [-0.3, FRAC_PI_2]).unwrap();
        for p in local(&part) {
            assert!((p.length() - 3.0).abs() < 1e-14);
            assert!(radius(&p) < 1e-14 || (0.4 - 1e-14..=1.4 + 1e-14).contains(&p.y.atan2(p.x)));
            assert!(p.z >= 3.0 * (-0.3_f64).sin() - 1e-14);
        }
        for size in [[5.0, 2.0], [1.0, 2.0], [0.0, 2.0]] {
            let tube = spindle(size, true);
            for p in local(&torus(&frame, size, TURN, tube).unwrap()) {
                assert!(((radius(&p) - size[0]).hypot(p.z) - size[1]).abs() < 1e-13);
            }
        }
        let flat = plane(&frame, [-1.0, 2.0], [0.5, 0.75]).unwrap();
        assert!(local(&flat).iter().all(|p| p.z.abs() < 1e-14));
        let corner = DVec3::new(2.0, 0.5, 0.0);
        assert!(flat.point(2.0, 0.5).distance(frame.at(corner)) < 1e-14);
        assert!(sphere(&frame, 0.0, TURN, POLE_TO_POLE).is_err());
        assert!(torus(&frame, [-1.0, 2.0], TURN, TURN).is_err());
    }

    /// The tip of z = 4 - 2 r at height 4.
    #[test]
    #[expect(clippy::float_cmp, reason = "exact by design")]
    fn cones_end_at_their_tips() {
        let reach = |ends, margin| up_to_tip(2.0, -0.5, ends, margin, 1e-6);
        assert_eq!(reach([0.0, 2.0], 0.25), [-0.5, 2.5]);
        assert_eq!(reach([0.0, 3.9], 0.25)[1], 4.0);
        assert_eq!(reach([0.0, 4.0 + 1e-8], 0.25), [-(4.0 + 1e-8) * 0.25, 4.0]);
        assert_eq!(reach([1.0, 1.0], 0.25), [1.0, 4.0]);
        assert_eq!(reach([1.0, 6.0], 0.0), [1.0, 4.0]);
        assert_eq!(reach([3.0, 6.0], 0.0), [4.0, 6.0]);
        assert_eq!(up_to_tip(2.0, 0.0, [0.0, 4.0], 0.25, 1e-6), [-1.0, 5.0]);
        let tip = cone(&frame(), 2.0, -0.5, TURN, [0.0, 4.0]).unwrap();
        assert!(tip.is_pole(super::super::shape::Edge::VMax, 1e-14));
    }

    #[test]
    fn frames_are_right_handed_and_go_back() {
        let f = frame();
        assert!((f.axes.determinant() - 1.0).abs() < 1e-15);
        let p = DVec3::new(0.3, 7.0, -2.0);
        assert!(f.local(f.at(p)).distance(p) < 1e-14);
        assert!(f.affine().transform_point3(p).distance(f.at(p)) < 1e-14);
        // A reference along the axis says nothing.
        let along = Frame::new(DVec3::ZERO, DVec3::X, Some(DVec3::X)).unwrap();
        assert_eq!(along.axes.col(0), DVec3::Y);
        assert!(Frame::new(DVec3::ZERO, DVec3::ZERO, None).is_err());
    }
}
