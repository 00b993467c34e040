//! B-spline curves and surfaces (ISO 10303-42).

use super::text::{Id, Text};
use nurbskin_geometry::Result;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve, NurbsSurface};

/// Appends the multiplicities of these knots.
fn multiplicities(text: &mut Text, knots: &KnotVector) {
    #[expect(clippy::float_cmp, reason = "multiplicity is about identical knots")]
    let runs = knots.knots().chunk_by(|a, b| a == b);
    text.list(runs, |text, run| {
        text.count(run.len());
    });
}

/// Appends the distinct knots.
fn distinct(text: &mut Text, knots: &KnotVector) {
    let mut values = knots.knots().to_vec();
    values.dedup();
    text.reals(&values);
}

/// The weights, unless all are the same: then the curve or surface is polynomial.
#[expect(clippy::float_cmp, reason = "identical weights cancel exactly")]
fn true_weights(weights: Option<&[f64]>) -> Option<&[f64]> {
    weights.filter(|w| w.iter().any(|x| *x != w[0]))
}

/// Writes a clamped surface. `S_u` and `S_v` as here: the control points are listed u by u, all along v for each.
///
/// # Errors
/// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if the origin makes a point non-finite.
pub(super) fn surface(text: &mut Text, surface: &NurbsSurface, uncertainty: f64) -> Result<Id> {
    let net = surface.control_points();
    let [m, n] = net.counts();
    let mut ids = Vec::with_capacity(m * n);
    for i in 0..m {
        for j in 0..n {
            ids.push(text.point(net.point(i, j))?);
        }
    }
    let [closed_u, closed_v] = Direction::BOTH.map(|d| surface.is_closed(d, uncertainty));
    let [p, q] = surface.degree();
    let shape = |text: &mut Text| {
        text.count(p).raw(",").count(q).raw(",");
        text.list(ids.chunks(n), |text, column| {
            text.ids(column);
        });
        text.raw(",.UNSPECIFIED.,").flag(closed_u).raw(",");
        text.flag(closed_v).raw(",.F.");
    };
    let [ku, kv] = [surface.knots_u(), surface.knots_v()];
    let knots = |text: &mut Text| {
        multiplicities(text, ku);
        text.raw(",");
        multiplicities(text, kv);
        text.raw(",");
        distinct(text, ku);
        text.raw(",");
        distinct(text, kv);
        text.raw(",.UNSPECIFIED.)");
    };
    Ok(match true_weights(surface.weights()) {
        None => text.add(|text| {
            text.raw("B_SPLINE_SURFACE_WITH_KNOTS('',");
            shape(text);
            text.raw(",");
            knots(text);
        }),
        // A complex instance: all the names, in alphabetical order.
        Some(weights) => text.add(|text| {
            text.raw("(BOUNDED_SURFACE()B_SPLINE_SURFACE(");
            shape(text);
            text.raw(")B_SPLINE_SURFACE_WITH_KNOTS(");
            knots(text);
            text.raw("GEOMETRIC_REPRESENTATION_ITEM()RATIONAL_B_SPLINE_SURFACE(");
            text.list(0..m, |text, i| {
                text.list(0..n, |text, j| {
                    text.real(weights[j * m + i]);
                });
            });
            text.raw(")REPRESENTATION_ITEM('')SURFACE())");
        }),
    })
}

/// Writes a curve in space. `closed`: whether it ends where it starts.
///
/// # Errors
/// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if the origin makes a point non-finite.
pub(super) fn curve(text: &mut Text, curve: &NurbsCurve, closed: bool) -> Result<Id> {
    let points = curve.control_points().iter();
    let ids = points.map(|&p| text.point(p)).collect::<Result<Vec<_>>>()?;
    Ok(spline(text, curve, &ids, closed))
}

/// Writes a curve of a parameter plane.
pub(super) fn curve_uv(text: &mut Text, curve: &NurbsCurve) -> Id {
    let points = curve.control_points();
    let closed = points.first() == points.last();
    let ids: Vec<Id> = points.iter().map(|p| text.point_uv(p.truncate())).collect();
    spline(text, curve, &ids, closed)
}

fn spline(text: &mut Text, curve: &NurbsCurve, ids: &[Id], closed: bool) -> Id {
    let shape = |text: &mut Text| {
        text.count(curve.knots().degree()).raw(",");
        text.ids(ids)
            .raw(",.UNSPECIFIED.,")
            .flag(closed)
            .raw(",.F.");
    };
    let knots = |text: &mut Text| {
        multiplicities(text, curve.knots());
        text.raw(",");
        distinct(text, curve.knots());
        text.raw(",.UNSPECIFIED.)");
    };
    match true_weights(curve.weights()) {
        None => text.add(|text| {
            text.raw("B_SPLINE_CURVE_WITH_KNOTS('',");
            shape(text);
            text.raw(",");
            knots(text);
        }),
        Some(weights) => text.add(|text| {
            text.raw("(BOUNDED_CURVE()B_SPLINE_CURVE(");
            shape(text);
            text.raw(")B_SPLINE_CURVE_WITH_KNOTS(");
            knots(text);
            text.raw("CURVE()GEOMETRIC_REPRESENTATION_ITEM()RATIONAL_B_SPLINE_CURVE(");
            text.reals(weights);
            text.raw(")REPRESENTATION_ITEM(''))");
        }),
    }
}
