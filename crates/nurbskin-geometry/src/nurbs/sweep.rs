//! Curves joined end to end, and the surfaces that curves span: ruled and swept along a line. All exact.

use super::{ControlNet, KnotVector, NurbsCurve, NurbsSurface};
use crate::Result;
use glam::{DVec3, DVec4};

/// The curve over [a, b] in place of its own domain.
///
/// # Errors
/// [`Error::Invalid`](crate::Error::Invalid) if a < b does not hold or knots collapse onto each other.
pub fn over(curve: &NurbsCurve, (a, b): (f64, f64)) -> Result<NurbsCurve> {
    if curve.domain() == (a, b) {
        return Ok(curve.clone());
    }
    NurbsCurve::new(
        curve.knots().with_domain(a, b)?,
        curve.control_points().to_vec(),
        curve.weights().map(<[f64]>::to_vec),
    )
}

/// One curve along all of these, which follow each other end to end; every part keeps the length of its parameter
/// interval. Where two parts do not meet exactly, the end of the first counts. A joint has full multiplicity.
///
/// # Errors
/// [`Error::Invalid`](crate::Error::Invalid) without parts, or if the parameters leave the range of numbers.
pub fn join(parts: &[NurbsCurve]) -> Result<NurbsCurve> {
    let degree = parts.iter().map(|part| part.knots().degree()).max();
    let rational = parts.iter().any(|part| part.weights().is_some());
    let degree = degree.ok_or_else(|| crate::Error::invalid("a chain of no curves"))?;
    let (mut knots, mut points): (Vec<f64>, Vec<DVec4>) = (Vec::new(), Vec::new());
    for part in parts {
        let part = part.clamped()?;
        let part = part.elevate(degree - part.knots().degree())?;
        let homogeneous = part.homogeneous_points();
        let (Some(end), Some(last)) = (knots.last().copied(), points.last().copied()) else {
            (knots, points) = (part.knots().knots().to_vec(), homogeneous);
            continue;
        };
        let (a, _) = part.domain();
        knots.pop();
        let inner = part.knots().knots().iter().skip(degree + 1);
        knots.extend(inner.map(|&t| end + (t - a)));
        let scale = homogeneous.first().map_or(1.0, |first| last.w / first.w);
        points.extend(homogeneous.iter().skip(1).map(|&h| h * scale));
    }
    NurbsCurve::from_homogeneous(KnotVector::new(degree, knots)?, &points, rational)
}

/// Both curves with the same degree and the same knots over \[0, 1\].
fn alike(one: &NurbsCurve, other: &NurbsCurve) -> Result<[NurbsCurve; 2]> {
    let degree = one.knots().degree().max(other.knots().degree());
    let [one, other] = [one, other].map(|curve| -> Result<NurbsCurve> {
        let curve = over(&curve.clamped()?, (0.0, 1.0))?;
        curve.elevate(degree - curve.knots().degree())
    });
    let (one, other) = (one?, other?);
    // Knots that are the same to rounding are the same.
    let breaks = one.knots().breakpoints();
    let near = |t: f64| {
        let at = breaks.partition_point(|&b| b < t);
        let around = [at.checked_sub(1), Some(at)].into_iter().flatten();
        let nearest = around.filter_map(|k| breaks.get(k).copied());
        nearest
            .min_by(|a, b| (a - t).abs().total_cmp(&(b - t).abs()))
            .filter(|b| (b - t).abs() <= 1e-12)
            .unwrap_or(t)
    };
    let snapped = other.knots().knots().iter().map(|&t| near(t)).collect();
    let knots = KnotVector::new(degree, snapped).unwrap_or_else(|_| other.knots().clone());
    let other = NurbsCurve::from_homogeneous(
        knots,
        &other.homogeneous_points(),
        other.weights().is_some(),
    )?;
    let missing = |have: &NurbsCurve, wanted: &NurbsCurve| -> Vec<f64> {
        let (have, wanted) = (have.knots().knots(), wanted.knots().knots());
        let (mut k, mut all) = (0, Vec::new());
        for &t in wanted {
            while have.get(k).is_some_and(|&u| u < t) {
                k += 1;
            }
            if have.get(k).is_some_and(|&u| u <= t) {
                k += 1;
            } else {
                all.push(t);
            }
        }
        all
    };
    let [more_one, more_other] = [missing(&one, &other), missing(&other, &one)];
    Ok([
        one.insert_knots(&more_one)?,
        other.insert_knots(&more_other)?,
    ])
}

/// The surface of the straight lines between points of the curves at equal shares of their parameter intervals: u runs
/// along the curves and v from `one` to `other`, both over \[0, 1\].
///
/// Source: *The NURBS Book*, 2nd ed., section 8.4.
///
/// # Errors
/// [`Error::Invalid`](crate::Error::Invalid) if weights underflow.
pub fn ruled(one: &NurbsCurve, other: &NurbsCurve) -> Result<NurbsSurface> {
    let [one, other] = alike(one, other)?;
    let rational = one.weights().is_some() || other.weights().is_some();
    let points = [one.homogeneous_points(), other.homogeneous_points()].concat();
    NurbsSurface::from_homogeneous(
        one.knots().clone(),
        KnotVector::uniform(1, 2)?,
        &points,
        rational,
    )
}

/// The surface that a curve sweeps when it moves by `vector`: u runs along the curve with its own parameter, v over
/// \[0, 1\].
///
/// # Errors
/// [`Error::Invalid`](crate::Error::Invalid) if a point is no longer finite.
pub fn extrude(curve: &NurbsCurve, vector: DVec3) -> Result<NurbsSurface> {
    let curve = curve.clamped()?;
    let near = curve.control_points();
    let points = near.iter().copied().chain(near.iter().map(|&p| p + vector));
    let weights = curve.weights().map(|w| [w, w].concat());
    let net = ControlNet::new(near.len(), 2, points.collect())?;
    NurbsSurface::new(
        curve.knots().clone(),
        KnotVector::uniform(1, 2)?,
        net,
        weights,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nurbs::conic;
    use std::f64::consts::{FRAC_PI_2, TAU};

    #[test]
    fn joined_curves_are_their_parts() {
        let arc = conic::arc(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0, FRAC_PI_2).unwrap();
        let line = NurbsCurve::new(
            KnotVector::new(1, vec![3., 3., 5., 5.]).unwrap(),
            vec![DVec3::Y, DVec3::new(-2.0, 1.0, 4.0)],
            None,
        )
        .unwrap();
        let both = join(&[arc.clone(), line.clone()]).unwrap();
        assert_eq!(both.domain(), (0.0, 3.0));
        for k in 0..=20 {
            let s = f64::from(k) / 20.0;
            assert!(both.point(s).distance(arc.point(s)) < 1e-15);
            assert!(
                both.point(1.0 + 2.0 * s)
                    .distance(line.point(3.0 + 2.0 * s))
                    < 1e-14
            );
        }
        assert!(join(&[]).is_err());
    }

    #[test]
    fn ruled_and_extruded_surfaces_hold_their_lines() {
        let circle = conic::arc(DVec3::ZERO, DVec3::X, DVec3::Y, 0.0, TAU).unwrap();
        let points = (0..6).map(|k| DVec3::new(f64::from(k), f64::from(k * k), 7.0));
        let knots = KnotVector::clamped(3, &[2.0, 2.3, 2.6, 3.0]).unwrap();
        let other = NurbsCurve::new(knots, points.collect(), None).unwrap();
        let surface = ruled(&circle, &other).unwrap();
        assert_eq!(surface.degree(), [3, 1]);
        let moved = extrude(&other, DVec3::new(1.0, 2.0, 3.0)).unwrap();
        for k in 0..=40 {
            let u = f64::from(k) / 40.0;
            let (a, b) = (circle.point(u), other.point(2.0 + u));
            for v in [0.0, 1.0] {
                assert!(surface.point(u, v).distance(a.lerp(b, v)) < 1e-13);
            }
            // Between rows, weights move the point along the line between them, and off it not at all.
            let middle = surface.point(u, 0.5);
            let off = (middle - a).reject_from((b - a).normalize()).length();
            assert!(off < 1e-13);
            let p = moved.point(2.0 + u, 0.25) - b;
            assert!(p.distance(DVec3::new(0.25, 0.5, 0.75)) < 1e-14);
        }
    }
}
