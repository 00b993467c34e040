//! Exact conics and surfaces of revolution.
//!
//! A conic arc of up to a quarter turn is a rational quadratic whose middle control point is the meeting point of the
//! end tangents, with the cosine of half the angle as weight; longer arcs are joined by double knots. The parameter is
//! not the angle: it runs over \[0, 1\] with equal shares for equal pieces.

use super::{ControlNet, KnotVector, NurbsCurve, NurbsSurface};
use crate::math;
use crate::{Error, Result};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, TAU};

/// A chain of arcs on the unit circle.
struct Arcs {
    knots: KnotVector,
    /// (x, y, weight) of each control point.
    points: Vec<(f64, f64, f64)>,
}

impl Arcs {
    /// From angle `start` counter-clockwise to `end`, in radians.
    fn new(start: f64, end: f64) -> Result<Self> {
        let sweep = end - start;
        // A little more than a turn is a turn: start + TAU is rounded.
        let rounding = f64::EPSILON * (start.abs() + TAU);
        if !(sweep > 0.0 && sweep <= TAU + rounding) {
            return Err(Error::invalid(format!(
                "an arc must run from a smaller to a larger angle, at most one turn, not from {start} to {end}"
            )));
        }
        let whole = sweep >= TAU - rounding;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 1 and 4"
        )]
        let pieces = if whole {
            4
        } else {
            (sweep / FRAC_PI_2).ceil().clamp(1.0, 4.0) as usize
        };
        let step = if whole {
            FRAC_PI_2
        } else {
            sweep / pieces as f64
        };
        let cosine = if whole { 0.0 } else { math::cos(step) };
        // The cosine of half the step; exact where the step is a quarter turn.
        let weight = f64::midpoint(1.0, cosine).sqrt();
        // Quarter turns from the axis are exact.
        let on_circle = |k: usize| {
            let (sin, cos) = math::sin_cos(start);
            match (whole, k) {
                (true, 1) => (-sin, cos),
                (true, 2) => (-cos, -sin),
                (true, 3) => (sin, -cos),
                (true, _) => (cos, sin),
                _ => {
                    let (sin, cos) = math::sin_cos(start + k as f64 * step);
                    (cos, sin)
                }
            }
        };
        let mut points = vec![on_circle(0)];
        for k in 1..=pieces {
            let ((x0, y0), (x1, y1)) = (on_circle(k - 1), on_circle(k));
            let scale = 1.0 / (1.0 + cosine);
            points.extend([((x0 + x1) * scale, (y0 + y1) * scale), (x1, y1)]);
        }
        let breaks: Vec<f64> = (0..=pieces)
            .flat_map(|k| {
                let copies = if k == 0 || k == pieces { 1 } else { 2 };
                std::iter::repeat_n(k as f64 / pieces as f64, copies)
            })
            .collect();
        let weights = (0..points.len()).map(|k| if k % 2 == 1 { weight } else { 1.0 });
        Ok(Self {
            knots: KnotVector::clamped(2, &breaks)?,
            points: points
                .iter()
                .zip(weights)
                .map(|(&(x, y), w)| (x, y, w))
                .collect(),
        })
    }
}

/// The arc `centre + cos(a) x + sin(a) y` for a from `start` to `end` in radians, at most one turn: a circle if x and y
/// are perpendicular and of equal length, an ellipse otherwise. A whole turn has 9 control points.
///
/// Source: A7.1, *The NURBS Book*, 2nd ed., p. 308.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_geometry::nurbs::conic;
/// let arc = conic::arc(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0, 2.0)?;
/// assert!((arc.point(0.3).length() - 1.0).abs() < 1e-15);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] if the angles do not rise or span more than a turn, or a number is not finite.
pub fn arc(centre: DVec3, x: DVec3, y: DVec3, start: f64, end: f64) -> Result<NurbsCurve> {
    let arcs = Arcs::new(start, end)?;
    let points = arcs
        .points
        .iter()
        .map(|&(a, b, _)| centre + a * x + b * y)
        .collect();
    let weights = arcs.points.iter().map(|p| p.2).collect();
    NurbsCurve::new(arcs.knots, points, Some(weights))
}

/// The whole circle around `axis`, counter-clockwise seen from its tip.
///
/// # Errors
/// [`Error::Invalid`] if the radius is not positive or the axis has no direction.
pub fn circle(centre: DVec3, axis: DVec3, radius: f64) -> Result<NurbsCurve> {
    let [x, y, _] = frame(axis)?;
    let radius = positive("radius", radius)?;
    arc(centre, radius * x, radius * y, 0.0, TAU)
}

/// The whole ellipse with the semi-axes x and y: [`arc`] over a turn.
///
/// # Errors
/// [`Error::Invalid`] if a number is not finite.
pub fn ellipse(centre: DVec3, x: DVec3, y: DVec3) -> Result<NurbsCurve> {
    arc(centre, x, y, 0.0, TAU)
}

/// The surface that `profile` sweeps turning around the axis through `origin`, from angle 0 to `sweep` in radians: u
/// runs around the axis over \[0, 1\], v along the profile with its own parameter. A control point on the axis to
/// rounding is put on it, which makes an exact pole.
///
/// Source: A8.1, *The NURBS Book*, 2nd ed., p. 346.
///
/// # Errors
/// [`Error::Invalid`] if the sweep is not in (0, 2 pi] or the axis has no direction.
pub fn revolve(
    profile: &NurbsCurve,
    origin: DVec3,
    axis: DVec3,
    sweep: f64,
) -> Result<NurbsSurface> {
    let arcs = Arcs::new(0.0, sweep)?;
    let [_, _, axis] = frame(axis)?;
    let count = profile.control_points().len();
    let mut points = Vec::with_capacity(count * arcs.points.len());
    let mut weights = Vec::with_capacity(points.capacity());
    for (i, &point) in profile.control_points().iter().enumerate() {
        let foot = origin + axis * (point - origin).dot(axis);
        let mut x = point - foot;
        // Eight roundings of coordinates this large lead here.
        if x.length() <= 8.0 * f64::EPSILON * (point.length() + origin.length()) {
            x = DVec3::ZERO;
        }
        let y = axis.cross(x);
        let weight = profile.weights().map_or(1.0, |w| w[i]);
        points.extend(arcs.points.iter().map(|&(a, b, _)| foot + a * x + b * y));
        weights.extend(arcs.points.iter().map(|p| p.2 * weight));
    }
    let net = ControlNet::new(arcs.points.len(), count, points)?;
    NurbsSurface::new(arcs.knots, profile.knots().clone(), net, Some(weights))
}

/// The sphere, its poles at the lowest and highest z; normals point outwards. 9 x 5 control points.
///
/// # Errors
/// [`Error::Invalid`] if the radius is not positive.
pub fn sphere(centre: DVec3, radius: f64) -> Result<NurbsSurface> {
    let radius = positive("radius", radius)?;
    let meridian = arc(DVec3::ZERO, DVec3::X, DVec3::Z, -FRAC_PI_2, FRAC_PI_2)?;
    // The ends of the meridian are exactly on the axis.
    let on_axis = |i: usize, p: DVec3| match i {
        0 => -DVec3::Z,
        4 => DVec3::Z,
        _ => p,
    };
    let points = meridian.control_points().iter().enumerate();
    let points = points.map(|(i, &p)| on_axis(i, p)).collect();
    let weights = meridian.weights().map(<[f64]>::to_vec);
    let meridian = NurbsCurve::new(meridian.knots().clone(), points, weights)?;
    revolve(&meridian, DVec3::ZERO, DVec3::Z, TAU)?.map_points(|p| centre + radius * p)
}

/// The side of a cylinder that stands on `base` and ends at `base + axis`; normals point outwards.
///
/// # Errors
/// [`Error::Invalid`] if the radius is not positive or the axis has no direction.
pub fn cylinder(base: DVec3, axis: DVec3, radius: f64) -> Result<NurbsSurface> {
    positive("radius", radius)?;
    cone(base, axis, radius, radius)
}

/// The side of a cone, whole or cut off, with the radius `radius_base` at `base` and `radius_top` at `base + axis`; a
/// radius of 0 is the tip. Normals point outwards.
///
/// # Errors
/// [`Error::Invalid`] if a radius is negative, both are 0, or the axis has no direction.
pub fn cone(base: DVec3, axis: DVec3, radius_base: f64, radius_top: f64) -> Result<NurbsSurface> {
    if !(radius_base >= 0.0 && radius_top >= 0.0 && radius_base + radius_top > 0.0) {
        return Err(Error::invalid(format!(
            "the radii of a cone must not be negative nor both zero, not {radius_base} and {radius_top}"
        )));
    }
    let [x, _, _] = frame(axis)?;
    let points = vec![base + radius_base * x, base + axis + radius_top * x];
    let profile = NurbsCurve::new(KnotVector::uniform(1, 2)?, points, None)?;
    revolve(&profile, base, axis, TAU)
}

/// The torus around `axis`: a circle of radius `minor` at the distance `major` from the axis; normals point outwards.
///
/// # Errors
/// [`Error::Invalid`] if `minor` is not positive, `major` is not larger, or the axis has no direction.
pub fn torus(centre: DVec3, axis: DVec3, major: f64, minor: f64) -> Result<NurbsSurface> {
    positive("minor radius", minor)?;
    if major.is_nan() || major <= minor {
        return Err(Error::invalid(format!(
            "the major radius of a torus must exceed the minor one, not {major} and {minor}"
        )));
    }
    let [x, _, z] = frame(axis)?;
    let profile = arc(centre + major * x, minor * x, minor * z, 0.0, TAU)?;
    revolve(&profile, centre, axis, TAU)
}

fn positive(name: &str, value: f64) -> Result<f64> {
    if value > 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(Error::invalid(format!(
        "the {name} must be a positive number, not {value}"
    )))
}

/// A right-handed frame with its third direction along `axis`.
fn frame(axis: DVec3) -> Result<[DVec3; 3]> {
    let Some(z) = axis.try_normalize() else {
        return Err(Error::invalid(format!("the axis {axis} has no direction")));
    };
    let x = z.any_orthonormal_vector();
    Ok([x, z.cross(x), z])
}
