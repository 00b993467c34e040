//! Surfaces by themselves: degrees, knots, creases, rows that nobody uses, narrow faces.

use super::{ANGLE, CURVATURE, DEGREE, Limit, Report, Severity, Subject, Worst};
use crate::mass::face_mass;
use crate::model::Face;
use crate::region::{Cover, Region};
use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::{NurbsCurve, NurbsSurface};

/// Places per span along a knot line, and lines across a span.
const PLACES: usize = 4;

pub(super) fn check(subject: &Subject, report: &mut Report) {
    let unit = subject.model.unit.to_string();
    let [mut angle, mut curvature, mut rows] = [Worst::default(); 3];
    let [mut narrowest, mut width] = [Worst::of(f64::INFINITY); 2];
    for (k, face, region) in subject.faces() {
        for direction in Direction::BOTH {
            let jumps = jumps(subject, k, face, region, direction);
            angle = angle.larger(jumps[0]);
            curvature = curvature.larger(jumps[1]);
            narrowest = narrowest.smaller(narrowest_span(&face.surface, direction, k));
            free_rows(face, region, direction, k, &mut rows);
        }
        match face_width(subject, face, k) {
            Ok(found) => width = width.smaller(found),
            Err(error) => report
                .skipped
                .push(format!("the width of face {}: {error}", k + 1)),
        }
    }
    let defect = Severity::Defect;
    report.add("knot_tangency", defect, Limit::Most(ANGLE), "deg", angle);
    report.add(
        "knot_curvature",
        Severity::Information,
        Limit::Most(CURVATURE),
        "",
        curvature,
    );
    report.add("degree", defect, Limit::Most(DEGREE), "", degree(subject));
    let least = Limit::Least(subject.length);
    report.add("knot_distance", defect, least, &unit, narrowest);
    report.add("face_width", defect, least, &unit, width);
    report.add(
        "unoccupied_rows",
        Severity::Information,
        Limit::Most(0.0),
        "",
        rows,
    );
}

fn degree(subject: &Subject) -> Worst {
    let mut worst = Worst::default();
    for (k, face, _) in subject.faces() {
        let place = middle(&face.surface);
        let [p, q] = face.surface.degree();
        worst = worst.larger(Worst::at(p.max(q) as f64, place, k));
        for used in face.loops.iter().flat_map(|each| &each.uses) {
            let curve = subject.model.edges()[used.edge].curve.as_ref();
            let degrees = [Some(&used.pcurve), curve].into_iter().flatten();
            let degree = degrees.map(|c: &NurbsCurve| c.knots().degree()).max();
            let degree = degree.unwrap_or_default() as f64;
            worst = worst.larger(Worst::at(degree, place, k).on_edge(used.edge));
        }
    }
    worst
}

fn middle(surface: &NurbsSurface) -> DVec3 {
    let [(a, b), (c, d)] = surface.domain();
    surface.point(f64::midpoint(a, b), f64::midpoint(c, d))
}

/// (u, v) from the parameter of a direction and that of the other.
fn place(direction: Direction, t: f64, s: f64) -> DVec2 {
    match direction {
        Direction::U => DVec2::new(t, s),
        Direction::V => DVec2::new(s, t),
    }
}

/// The largest turn of the normal, in degrees, and the largest relative jump of the curvature across the inner knot
/// lines of a direction where the face has them.
fn jumps(
    subject: &Subject,
    k: usize,
    face: &Face,
    region: &Region,
    direction: Direction,
) -> [Worst; 2] {
    let surface = &face.surface;
    let (knots, along) = (surface.knots(direction), surface.knots(direction.other()));
    let (breaks, across) = (knots.breakpoints(), along.breakpoints());
    let mut worst = [Worst::default(); 2];
    for (i, &t) in breaks.iter().enumerate().take(breaks.len() - 1).skip(1) {
        // A knot of multiplicity m leaves p - m derivatives.
        if knots.multiplicity(t) + 2 <= knots.degree() {
            continue;
        }
        for range in across.windows(2) {
            for l in 0..PLACES {
                let s = range[0] + (range[1] - range[0]) * (l as f64 + 0.5) / PLACES as f64;
                let spot = place(direction, t, s);
                // Both sides of the line have to be there.
                let near = 1e-3 * (breaks[i + 1] - t).min(t - breaks[i - 1]);
                let beside = [t - near, t + near].map(|t| region.contains(place(direction, t, s)));
                if face.trimmed && beside != [true, true] {
                    continue;
                }
                let before = knots.knots().partition_point(|&u| u < t) - 1;
                let sides = [before, knots.span(t)].map(|span| match direction {
                    Direction::U => [span, along.span(s)],
                    Direction::V => [along.span(s), span],
                });
                let point = surface.point(spot.x, spot.y);
                let [one, two] = sides.map(|spans| surface.normal_on(spans, spot.into()));
                let (Some(n), Some(m)) = (one, two) else {
                    continue;
                };
                let angle = math::angle_between(n, m).to_degrees();
                worst[0] = worst[0].larger(Worst::at(angle, point, k));
                let [one, two] = sides.map(|spans| surface.curvature_on(spans, spot.into()));
                if let (Some(one), Some(two), true) = (one, two, angle <= ANGLE) {
                    // With equal normals only the curvature across jumps, and twice the mean by as much.
                    let jump = 2.0 * (one.mean - two.mean).abs();
                    let most = [one, two].map(|c| c.principal[0].abs().max(c.principal[1].abs()));
                    let most = most[0].max(most[1]).max(1.0 / subject.diagonal);
                    worst[1] = worst[1].larger(Worst::at(jump / most, point, k));
                }
            }
        }
    }
    worst
}

/// The span of a direction that is narrowest in space; each is as wide as it is anywhere.
fn narrowest_span(surface: &NurbsSurface, direction: Direction, face: usize) -> Worst {
    let breaks = surface.knots(direction).breakpoints();
    let (a, b) = surface.knots(direction.other()).domain();
    let mut narrowest = Worst::of(f64::INFINITY);
    for range in breaks.windows(2) {
        let mut widest = Worst::default();
        for l in 0..=2 * PLACES {
            let s = a + (b - a) * l as f64 / (2 * PLACES) as f64;
            let at = |k: usize| {
                let t = range[0] + (range[1] - range[0]) * k as f64 / PLACES as f64;
                let spot = place(direction, t, s);
                surface.point(spot.x, spot.y)
            };
            let length = (0..PLACES).map(|k| at(k).distance(at(k + 1))).sum();
            widest = widest.larger(Worst::at(length, at(0), face));
        }
        narrowest = narrowest.smaller(widest);
    }
    narrowest
}

/// Counts the rows of spans that the region does not touch.
fn free_rows(face: &Face, region: &Region, direction: Direction, k: usize, rows: &mut Worst) {
    if !face.trimmed {
        return;
    }
    let (a, b) = face.surface.knots(direction.other()).domain();
    for range in face.surface.knots(direction).breakpoints().windows(2) {
        let (low, high) = (place(direction, range[0], a), place(direction, range[1], b));
        // What only touches the row's ends does not use it.
        let inset = 1e-9 * (high - low);
        if region.cover(low + inset, high - inset) == Cover::Outside {
            let spot = low.midpoint(high);
            rows.count(Some(face.surface.point(spot.x, spot.y)), Some(k), None);
        }
    }
}

/// Twice the area over the length of the border: the width of a strip, the radius of a disk. Without a border, the root
/// of the area.
fn face_width(subject: &Subject, face: &Face, k: usize) -> nurbskin_geometry::Result<Worst> {
    let area = face_mass(face, DVec3::ZERO)?;
    let mut border = 0.0;
    for used in face.loops.iter().flat_map(|each| &each.uses) {
        let seam = subject.uses[used.edge].iter().filter(|u| u[0] == k).count() > 1;
        if let (Some(curve), false) = (&subject.model.edges()[used.edge].curve, seam) {
            let (a, b) = curve.domain();
            let count = 16 * (curve.knots().breakpoints().len() - 1);
            let at = |i: usize| curve.point(a + (b - a) * i as f64 / count as f64);
            border += (0..count).map(|i| at(i).distance(at(i + 1))).sum::<f64>();
        }
    }
    let width = if border > 0.0 {
        2.0 * area.area / border
    } else {
        area.area.sqrt()
    };
    Ok(Worst::at(width, area.centroid, k))
}
