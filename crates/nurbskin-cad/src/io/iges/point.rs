//! Points (entity 116), point sets and polylines (entity 106).

use super::field::Fields;
use nurbskin_geometry::{DVec3, Result};

/// Copious data that are read: a set of points, or a line through them.
#[derive(Clone, Debug)]
pub(super) enum Copious {
    Points(Vec<DVec3>),
    Polyline(Vec<DVec3>),
}

/// Reads entity 116; its display symbol is left aside.
pub(super) fn read_point(fields: &mut Fields<'_>) -> Result<DVec3> {
    let c = fields.reals(3, "point")?;
    Ok(DVec3::from_slice(&c))
}

/// Reads entity 106 of these forms: 1 to 3 are points, 11 to 13 and 63 lines; `None` for the drawing aids.
pub(super) fn read_copious(fields: &mut Fields<'_>, form: i64) -> Result<Option<Copious>> {
    if !matches!(form, 1..=3 | 11..=13 | 63) {
        return Ok(None);
    }
    let kind = fields.integer(0)?;
    if form != 63 && kind != form % 10 || !(1..=3).contains(&kind) {
        return Err(fields.refuse(format!(
            "copious data of form {form} say they hold kind {kind} of tuples; the two must agree"
        )));
    }
    let count = fields.count("tuples of copious data")?;
    let per = [2, 3, 6][usize::try_from(kind - 1).unwrap_or(0)];
    let height = if kind == 1 { fields.real(0.0)? } else { 0.0 };
    let values = fields.reals(count.saturating_mul(per), "copious data")?;
    let mut points: Vec<DVec3> = values
        .chunks_exact(per)
        .map(|c| DVec3::new(c[0], c[1], if kind == 1 { height } else { c[2] }))
        .collect();
    if form < 10 {
        return Ok(Some(Copious::Points(points)));
    }
    // A closed planar curve comes back to its first point without repeating it.
    if form == 63 && points.first() != points.last() {
        points.extend(points.first().copied());
    }
    Ok(Some(Copious::Polyline(points)))
}
