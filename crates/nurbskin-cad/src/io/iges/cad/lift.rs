//! Curves on surfaces: from the parameter plane into space, and whether the two agree.

use crate::pcurve::lift::lift;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::sweep::over;
use nurbskin_geometry::nurbs::{NurbsCurve, NurbsSurface};
use nurbskin_geometry::{DVec3, Result};

/// The largest distance between S(p(t)) and C(t) that samples show; both over the same parameters.
pub(super) fn gap(surface: &NurbsSurface, pcurve: &NurbsCurve, curve: &NurbsCurve) -> f64 {
    let (a, b) = curve.domain();
    let at = |k: u32| {
        let t = a + (b - a) * f64::from(k) / 16.0;
        let uv = pcurve.point(t);
        surface.point(uv.x, uv.y).distance(curve.point(t))
    };
    (0..=16).map(at).fold(0.0, f64::max)
}

/// Whether a curve in the parameter plane is a single point of the surface, a pole.
pub(super) fn is_point(surface: &NurbsSurface, pcurve: &NurbsCurve, tolerance: f64) -> bool {
    let (a, b) = pcurve.domain();
    let at = |k: u32| {
        let uv = pcurve.point(a + (b - a) * f64::from(k) / 8.0);
        surface.point(uv.x, uv.y)
    };
    let first = at(0);
    (1..=8).all(|k| at(k).distance(first) <= tolerance)
}

/// The file's curve in the parameter plane, run as the curve in space does and over its parameters, with the distance
/// of the two.
///
/// # Errors
/// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if knots collapse onto each other.
pub(super) fn paired(
    surface: &NurbsSurface,
    pcurve: &NurbsCurve,
    curve: &NurbsCurve,
) -> Result<(NurbsCurve, f64)> {
    let forth = over(&pcurve.clamped()?, curve.domain())?;
    let forth = forth.map_points(|p| DVec3::new(p.x, p.y, 0.0))?;
    let back = forth.reversed()?;
    let gaps = [&forth, &back].map(|p| gap(surface, p, curve));
    Ok(if gaps[0] <= gaps[1] {
        (forth, gaps[0])
    } else {
        (back, gaps[1])
    })
}

/// How far places of C lie from the curve S(p), wherever they are on it.
pub(super) fn apart(surface: &NurbsSurface, pcurve: &NurbsCurve, curve: &NurbsCurve) -> f64 {
    let ((a, b), (c, d)) = (pcurve.domain(), curve.domain());
    let at = |t: f64| {
        let uv = pcurve.point(t);
        surface.point(uv.x, uv.y)
    };
    let step = (b - a) / 64.0;
    let samples: Vec<DVec3> = (0..=64).map(|k| at(a + step * f64::from(k))).collect();
    let from_place = |k: u32| {
        let place = curve.point(c + (d - c) * f64::from(k) / 8.0);
        let distances = samples.iter().map(|s| s.distance(place)).enumerate();
        let nearest = distances.min_by(|x, y| x.1.total_cmp(&y.1));
        let middle = a + step * nearest.map_or(0.0, |n| n.0 as f64);
        // Thirds: the distance falls and rises once between the neighbours.
        let (mut low, mut high) = ((middle - step).max(a), (middle + step).min(b));
        for _ in 0..48 {
            let third = (high - low) / 3.0;
            let (x, y) = (low + third, high - third);
            if at(x).distance(place) < at(y).distance(place) {
                high = y;
            } else {
                low = x;
            }
        }
        at(f64::midpoint(low, high)).distance(place)
    };
    (0..=8).map(from_place).fold(0.0, f64::max)
}

/// The curve S(p(t)) over the parameters of p: exact along iso-parametric lines, else cubic pieces with its derivatives,
/// within `tolerance` at samples.
///
/// # Errors
/// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if that takes too many pieces.
pub(super) fn lifted(
    surface: &NurbsSurface,
    pcurve: &NurbsCurve,
    tolerance: f64,
) -> Result<NurbsCurve> {
    if let Some(curve) = iso(surface, pcurve) {
        return curve;
    }
    lift(pcurve, tolerance, |uv| {
        let s = surface.derivatives(uv.x, uv.y);
        [s.point, s.du, s.dv]
    })
}

/// The exact curve of a straight p-curve along one of the parameters.
fn iso(surface: &NurbsSurface, pcurve: &NurbsCurve) -> Option<Result<NurbsCurve>> {
    let [from, to] = *pcurve.control_points() else {
        return None;
    };
    #[expect(clippy::float_cmp, reason = "exactly along one of the parameters")]
    let (direction, at, range) = match (from.x == to.x, from.y == to.y) {
        (true, false) => (Direction::U, from.x, (from.y, to.y)),
        (false, true) => (Direction::V, from.y, (from.x, to.x)),
        _ => return None,
    };
    let along = || -> Result<NurbsCurve> {
        let line = surface.iso_curve(direction, at)?;
        let (a, b) = line.domain();
        let (low, high) = (range.0.min(range.1).max(a), range.0.max(range.1).min(b));
        let part = line.segment(low, high)?;
        let part = if range.0 > range.1 {
            part.reversed()?
        } else {
            part
        };
        over(&part, pcurve.domain())
    };
    Some(along())
}
