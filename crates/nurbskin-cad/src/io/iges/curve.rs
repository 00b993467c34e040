//! Curves: rational B-splines (entity 126), lines (110) and circular arcs (100) as exact B-splines.

use super::card::CardWriter;
use super::field::Fields;
use super::number::push_real;
use super::surface::{knots_of, restricted, whole_number};
use crate::io::text::{shifted, true_weights};
use nurbskin_geometry::math;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve, conic};
use nurbskin_geometry::{DVec3, Result};
use std::f64::consts::TAU;

/// Puts a clamped curve: `126,K,M,PROP1..4,` knots, weights, points, `V0,V1,` normal; every number reads back to the same
/// f64. PROP1: that it is plane, within `resolution`; PROP2: that it closes; PROP3: that the weights are all equal; PROP4:
/// that it is not periodic.
///
/// # Errors
/// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if the origin makes a point non-finite.
pub(super) fn push(
    section: &mut CardWriter,
    curve: &NurbsCurve,
    origin: DVec3,
    resolution: f64,
    parametric: bool,
) -> Result<()> {
    let points: Vec<DVec3> = curve
        .control_points()
        .iter()
        .map(|&p| shifted(p, origin))
        .collect();
    if points.iter().any(|p| !p.is_finite()) {
        return Err(nurbskin_geometry::Error::invalid(format!(
            "a curve leads to numbers that are too large once the origin {origin} is added"
        )));
    }
    let normal = if parametric {
        Some(DVec3::Z)
    } else {
        normal_of(&points, resolution)
    };
    let gap = points
        .first()
        .zip(points.last())
        .map_or(0.0, |(a, b)| a.distance(*b));
    let closed = gap <= if parametric { 0.0 } else { resolution };
    let weights = curve.weights();
    #[expect(clippy::float_cmp, reason = "identical weights cancel exactly")]
    let equal = weights.is_none_or(|w| w.iter().all(|x| *x == w[0]));
    let flags = [normal.is_some(), closed, equal, false].map(usize::from);
    let numbers = [126, points.len() - 1, curve.knots().degree()];
    for number in numbers.into_iter().chain(flags) {
        section.token(&format!("{number},"));
    }
    let (a, b) = curve.domain();
    let knots = curve.knots().knots().iter().copied();
    let weights = (0..points.len()).map(|k| weights.map_or(1.0, |w| w[k]));
    let coordinates = points.iter().flat_map(|p| p.to_array());
    let mut reals: Vec<f64> = knots.chain(weights).chain(coordinates).collect();
    reals.extend([a, b]);
    reals.extend(normal.unwrap_or(DVec3::ZERO).to_array());
    let last = reals.len() - 1;
    for (k, x) in reals.into_iter().enumerate() {
        section.spelled(|text| {
            push_real(text, x);
            text.push(if k == last { ';' } else { ',' });
        });
    }
    Ok(())
}

/// The normal of the plane that all these points lie in, within `resolution`, where they tell one.
fn normal_of(points: &[DVec3], resolution: f64) -> Option<DVec3> {
    let first = *points.first()?;
    let far = |of: &dyn Fn(DVec3) -> DVec3| {
        let longest = |a: DVec3, b: DVec3| if b.length() > a.length() { b } else { a };
        points
            .iter()
            .map(|&p| of(p - first))
            .fold(DVec3::ZERO, longest)
    };
    let along = far(&|d| d).try_normalize()?;
    // A curve that is straight within the resolution lies in many planes: any of them.
    let across = far(&|d| along.cross(d));
    let normal = if across.length() > resolution {
        across.try_normalize()?
    } else {
        along.any_orthonormal_vector()
    };
    points
        .iter()
        .all(|p| (*p - first).dot(normal).abs() <= resolution)
        .then_some(normal)
}

/// Reads entity 126: K, M, PROP1-4, knots, weights, points, V0, V1, normal.
pub(super) fn read_spline(fields: &mut Fields<'_>) -> Result<NurbsCurve> {
    let upper = whole_number(fields, "K")?;
    let degree = whole_number(fields, "M")?;
    for _ in 0..3 {
        fields.integer(0)?; // planar, closed, polynomial: the numbers themselves tell
    }
    let periodic = fields.integer(0)? == 1;
    let count = upper + 1;
    let knots = fields.reals(count + degree + 1, "knots")?;
    let weights = fields.reals(count, "weights")?;
    let points = fields.points(count, "control points")?;
    let refused = |fields: &Fields<'_>, error: nurbskin_geometry::Error| {
        fields.refuse(format!("the curve is not valid: {error}"))
    };
    let plain = knots_of(degree, &knots).map_err(|e| refused(fields, e))?;
    let (a, b) = plain.domain();
    let range = restricted(fields.real(a)?, fields.real(b)?, (a, b));
    let weights = true_weights(weights);
    // Periodic as we store it, where knots and points continue themselves; else the same curve unclamped.
    let curve = periodic
        .then(|| KnotVector::from_periodic_knots(degree, knots).ok())
        .flatten()
        .and_then(|wrapped| NurbsCurve::new(wrapped, points.clone(), weights.clone()).ok());
    let curve = match curve {
        Some(curve) => curve,
        None => NurbsCurve::new(plain, points, weights).map_err(|e| refused(fields, e))?,
    };
    match range {
        Some(range) => curve
            .segment(range.0, range.1)
            .map_err(|e| refused(fields, e)),
        None => Ok(curve),
    }
}

/// Reads entity 110 of form 0, a line from point to point, as a curve of degree 1 on \[0, 1\].
pub(super) fn read_line(fields: &mut Fields<'_>) -> Result<NurbsCurve> {
    let points = fields.points(2, "ends of a line")?;
    let knots = KnotVector::new(1, vec![0., 0., 1., 1.])?;
    NurbsCurve::new(knots, points, None)
}

/// Reads entity 100, an arc counter-clockwise about its centre in a plane of constant z, as an exact rational curve of
/// degree 2 on \[0, 1\]. An end that is the start means the full circle.
pub(super) fn read_arc(fields: &mut Fields<'_>) -> Result<NurbsCurve> {
    let c = fields.reals(7, "arc")?;
    let at = |x: f64, y: f64| DVec3::new(x, y, c[0]);
    let (centre, start, end) = (at(c[1], c[2]), at(c[3], c[4]), at(c[5], c[6]));
    let (from, to) = (start - centre, end - centre);
    let radius = from.length();
    if radius <= 0.0 || to.length() <= 0.0 || !radius.is_finite() || !to.length().is_finite() {
        return Err(fields.refuse("an arc whose start or end is its centre"));
    }
    let angle_from = math::atan2(from.y, from.x);
    let mut sweep = (math::atan2(to.y, to.x) - angle_from).rem_euclid(TAU);
    if start == end || sweep <= 0.0 {
        sweep = TAU;
    }
    let aside = DVec3::new(-from.y, from.x, 0.0);
    conic::arc(centre, from, aside, 0.0, sweep)
        .map_err(|e| fields.refuse(format!("the arc is not valid: {e}")))
}
