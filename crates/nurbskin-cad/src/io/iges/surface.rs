//! Rational B-spline surfaces (entity 128).

use super::card::CardWriter;
use super::field::Fields;
use super::write::Spelling;
use crate::io::text::{shifted, true_weights};
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::{ControlNet, KnotVector, NurbsSurface};
use nurbskin_geometry::{DVec3, Error, Result};

/// Puts a clamped surface: `128,K1,K2,M1,M2,PROP1..5,` knots, weights, points, `U0,U1,V0,V1;`, u fastest.
///
/// PROP1 and PROP2 say whether the surface closes within `resolution`; PROP3 that the weights are all equal; PROP4 and
/// PROP5 that it is not periodic, which a clamped knot vector never is. Directory entries of properties follow.
///
/// # Errors
/// [`Error::Invalid`] if the spelling is too coarse for the knots or weights, or the origin makes a point non-finite.
pub(super) fn push(
    section: &mut CardWriter,
    surface: &NurbsSurface,
    spelling: Spelling,
    origin: DVec3,
    resolution: f64,
    properties: &[usize],
) -> Result<()> {
    let [m, n] = surface.control_points().counts();
    let [p, q] = surface.degree();
    let [closed_u, closed_v] = Direction::BOTH.map(|d| surface.is_closed(d, resolution));
    let weights = surface.weights();
    let equal = weights.is_none_or(|w| w.iter().all(|w| Some(w) == w_first(weights)));
    let flags = [closed_u, closed_v, equal, false, false].map(usize::from);
    for number in [128, m - 1, n - 1, p, q].into_iter().chain(flags) {
        section.token(&format!("{number},"));
    }
    for knots in [surface.knots_u(), surface.knots_v()] {
        if spelling.is_coarse() {
            let rounded = knots.knots().iter().map(|&u| spelling.rounded(u)).collect();
            KnotVector::new(knots.degree(), rounded).map_err(|_| too_coarse("knots"))?;
        }
        for &knot in knots.knots() {
            section.spelled(|text| {
                spelling.knot(text, knot);
                text.push(',');
            });
        }
    }
    for k in 0..m * n {
        let weight = weights.map_or(1.0, |w| w[k]);
        if spelling.is_coarse() && spelling.rounded(weight) <= 0.0 {
            return Err(too_coarse("weights"));
        }
        section.spelled(|text| {
            spelling.weight(text, weight);
            text.push(',');
        });
    }
    if spelling.is_coarse() {
        section.end_card();
    }
    for &point in surface.control_points().points() {
        push_point(section, point, spelling, origin)?;
    }
    let [(a, b), (c, d)] = surface.domain();
    let last = if properties.is_empty() { ';' } else { ',' };
    for (value, delimiter) in [(a, ','), (b, ','), (c, ','), (d, last)] {
        section.spelled(|text| {
            spelling.weight(text, value);
            text.push(delimiter);
        });
    }
    push_properties(section, properties);
    section.end_card();
    Ok(())
}

/// Puts what follows the parameters of an entity that has properties: no associativities, then theirs.
fn push_properties(section: &mut CardWriter, properties: &[usize]) {
    let Some((last, others)) = properties.split_last() else {
        return;
    };
    section.token(&format!("0,{},", properties.len()));
    for property in others {
        section.token(&format!("{property},"));
    }
    section.token(&format!("{last};"));
}

fn w_first(weights: Option<&[f64]>) -> Option<&f64> {
    weights.and_then(|w| w.first())
}

fn too_coarse(what: &str) -> Error {
    Error::invalid(format!(
        "six decimals are too coarse for the {what} of this surface; write the exact layout"
    ))
}

/// Puts three coordinates, each with its delimiter.
pub(super) fn push_point(
    section: &mut CardWriter,
    point: DVec3,
    spelling: Spelling,
    origin: DVec3,
) -> Result<()> {
    let point = shifted(point, origin);
    if !point.is_finite() {
        return Err(Error::invalid(format!(
            "the point {point} is not finite once the origin {origin} is added"
        )));
    }
    for x in point.to_array() {
        section.spelled(|text| {
            spelling.coordinate(text, x);
            text.push(',');
        });
    }
    Ok(())
}

/// A surface as entity 128 gives it.
#[derive(Debug)]
pub(super) struct ReadSurface {
    pub(super) surface: NurbsSurface,
    /// The surface over all of its knots, where the file asks for a part of it.
    pub(super) whole: Option<NurbsSurface>,
    /// PROP1 and PROP2 of the file.
    pub(super) closed: [bool; 2],
}

/// Reads entity 128.
pub(super) fn read(fields: &mut Fields<'_>) -> Result<ReadSurface> {
    let upper_u = whole_number(fields, "K1")?;
    let upper_v = whole_number(fields, "K2")?;
    let degree_u = whole_number(fields, "M1")?;
    let degree_v = whole_number(fields, "M2")?;
    let closed = [fields.integer(0)? == 1, fields.integer(0)? == 1];
    fields.integer(0)?; // polynomial: the weights themselves tell
    let periodic = [fields.integer(0)? == 1, fields.integer(0)? == 1];
    let (m, n) = (upper_u + 1, upper_v + 1);
    let knots_u = fields.reals(m + degree_u + 1, "knots along u")?;
    let knots_v = fields.reals(n + degree_v + 1, "knots along v")?;
    let count = m.saturating_mul(n);
    let weights = true_weights(fields.reals(count, "weights")?);
    let points = fields.points(count, "control points")?;
    let refused =
        |fields: &Fields<'_>, e: Error| fields.refuse(format!("the surface is not valid: {e}"));
    let plain_u = knots_of(degree_u, &knots_u).map_err(|e| refused(fields, e))?;
    let plain_v = knots_of(degree_v, &knots_v).map_err(|e| refused(fields, e))?;
    let ((a, b), (c, d)) = (plain_u.domain(), plain_v.domain());
    let range_u = restricted(fields.real(a)?, fields.real(b)?, (a, b));
    let range_v = restricted(fields.real(c)?, fields.real(d)?, (c, d));
    let net = ControlNet::new(m, n, points).map_err(|e| refused(fields, e))?;
    let make = |knots_u: KnotVector, knots_v: KnotVector| {
        NurbsSurface::new(knots_u, knots_v, net.clone(), weights.clone())
    };
    // Periodic as we store it, where knots and points continue themselves; else the same surface unclamped.
    let wrapped = |is: bool, degree: usize, knots: &[f64], plain: &KnotVector| {
        is.then(|| KnotVector::from_periodic_knots(degree, knots.to_vec()).ok())
            .flatten()
            .unwrap_or_else(|| plain.clone())
    };
    let wrapped_u = wrapped(periodic[0], degree_u, &knots_u, &plain_u);
    let wrapped_v = wrapped(periodic[1], degree_v, &knots_v, &plain_v);
    let mut surface = make(wrapped_u.clone(), wrapped_v.clone())
        .or_else(|_| make(wrapped_u, plain_v.clone()))
        .or_else(|_| make(plain_u.clone(), wrapped_v))
        .or_else(|_| make(plain_u, plain_v))
        .map_err(|e| refused(fields, e))?;
    let cut = range_u.is_some() || range_v.is_some();
    let whole = cut.then(|| surface.clone());
    for (direction, range) in Direction::BOTH.into_iter().zip([range_u, range_v]) {
        if let Some((from, to)) = range {
            let part = surface.segment(direction, from, to);
            surface = part.map_err(|e| refused(fields, e))?;
        }
    }
    Ok(ReadSurface {
        surface,
        whole,
        closed,
    })
}

/// A count or degree, which cannot exceed what the record holds.
pub(super) fn whole_number(fields: &mut Fields<'_>, name: &str) -> Result<usize> {
    let value = fields.integer(0)?;
    let number = usize::try_from(value).ok().filter(|&n| n >= 1);
    let number = number
        .ok_or_else(|| fields.refuse(format!("{name} is {value} and should be 1 at least")))?;
    fields.expect_room(number, name)?;
    Ok(number)
}

pub(super) fn knots_of(degree: usize, knots: &[f64]) -> Result<KnotVector> {
    KnotVector::new(degree, knots.to_vec())
}

/// The range of parameters that a file asks for, where it is a true part of the domain. A range that makes no sense
/// says nothing about the shape and is left aside.
pub(super) fn restricted(from: f64, to: f64, (a, b): (f64, f64)) -> Option<(f64, f64)> {
    let (from, to) = (from.max(a), to.min(b));
    (from < to && (from > a || to < b)).then_some((from, to))
}
