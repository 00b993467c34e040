//! Conic arcs (entity 104), exactly.

use super::super::field::Fields;
use glam::{DMat2, DMat3, DVec2};
use nurbskin_geometry::math;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve, conic};
use nurbskin_geometry::{DVec3, Error, Result};
use std::f64::consts::TAU;

/// Reads entity 104: the coefficients of A x^2 + B x y + C y^2 + D x + E y + F = 0, the plane's z, start and end. An
/// ellipse runs counter-clockwise, and all around where its end is its start; parabolas and hyperbolas have one way.
pub(super) fn read(fields: &mut Fields<'_>, form: i64) -> Result<NurbsCurve> {
    let c = fields.reals(11, "conic arc")?;
    let [start, end] = [DVec2::new(c[7], c[8]), DVec2::new(c[9], c[10])];
    // Whatever the form says, the sign of B^2 - 4 A C tells an ellipse; forms tell a parabola, which rounding hides.
    let discriminant = c[1] * c[1] - 4.0 * c[0] * c[2];
    let size = (c[1] * c[1]).max((4.0 * c[0] * c[2]).abs());
    let made = if form == 3 || discriminant.abs() <= 1e-14 * size {
        open(&c, start, end, true)
    } else if discriminant < 0.0 {
        ellipse(&c, start, end)
    } else {
        open(&c, start, end, false)
    };
    made.map_err(|e| fields.refuse(format!("the conic arc is not valid: {e}")))
}

fn ellipse(c: &[f64], start: DVec2, end: DVec2) -> Result<NurbsCurve> {
    // Its centre, where the gradient vanishes.
    let matrix = DMat2::from_cols_array(&[c[0], c[1] / 2.0, c[1] / 2.0, c[2]]);
    let centre = matrix.inverse() * DVec2::new(-c[3] / 2.0, -c[4] / 2.0);
    let level = -(c[5] + 0.5 * (c[3] * centre.x + c[4] * centre.y));
    // Axes of the ellipse: eigenvectors.
    let angle = if c[1] == 0.0 {
        0.0
    } else {
        0.5 * math::atan2(c[1], c[0] - c[2])
    };
    let (sin, cos) = math::sin_cos(angle);
    let axis = |d: DVec2| -> Result<DVec2> {
        let squared = level / d.dot(matrix * d);
        if squared > 0.0 && squared.is_finite() {
            Ok(d * squared.sqrt())
        } else {
            Err(Error::invalid(
                "the equation of its ellipse has no solution",
            ))
        }
    };
    let (x, y) = (axis(DVec2::new(cos, sin))?, axis(DVec2::new(-sin, cos))?);
    let angle_of = |p: DVec2| {
        let d = p - centre;
        math::atan2(d.dot(y) / y.length_squared(), d.dot(x) / x.length_squared())
    };
    let from = angle_of(start);
    let mut sweep = (angle_of(end) - from).rem_euclid(TAU);
    if start == end || sweep <= 0.0 {
        sweep = TAU;
    }
    let z = c[6];
    conic::arc(
        centre.extend(z),
        x.extend(0.0),
        y.extend(0.0),
        from,
        from + sweep,
    )
}

/// A piece of a parabola or hyperbola: the tangents at its ends meet in the middle control point, and the equation of
/// the conic gives its weight.
fn open(c: &[f64], start: DVec2, end: DVec2, parabola: bool) -> Result<NurbsCurve> {
    let form = DMat3::from_cols(
        DVec3::new(c[0], c[1] / 2.0, c[3] / 2.0),
        DVec3::new(c[1] / 2.0, c[2], c[4] / 2.0),
        DVec3::new(c[3] / 2.0, c[4] / 2.0, c[5]),
    );
    let [p, q] = [start, end].map(|p| p.extend(1.0));
    // The pole of the chord.
    let pole = (form * p).cross(form * q);
    let middle = pole.truncate() / pole.z;
    let pole = middle.extend(1.0);
    let squared = -p.dot(form * q) / (2.0 * pole.dot(form * pole));
    let weight = if parabola { 1.0 } else { squared.sqrt() };
    if !middle.is_finite() || !weight.is_finite() || weight <= 0.0 {
        return Err(Error::invalid(
            "its ends do not lie on one branch of its equation",
        ));
    }
    let z = c[6];
    let points = [start, middle, end].map(|p| p.extend(z)).to_vec();
    let weights = (!parabola).then(|| vec![1.0, weight, 1.0]);
    NurbsCurve::new(KnotVector::uniform(2, 3)?, points, weights)
}
