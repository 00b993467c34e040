//! Gaps and smoothness along edges, and how long they are.

use super::{ANGLE, CURVATURE, JUMP, Limit, Report, Severity, Subject, Worst};
use crate::model::{EdgeUse, Model};
use crate::normal_jump::NormalJumps;
use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use nurbskin_geometry::nurbs::NurbsCurve;

pub(super) fn check(subject: &Subject, jumps: &NormalJumps, report: &mut Report) {
    let [mut vertex, mut surface, mut neighbour, mut off] = [Worst::default(); 4];
    let [mut angle, mut curvature] = [Worst::default(); 2];
    let mut shortest = Worst::of(f64::INFINITY);
    for (k, edge) in subject.model.edges().iter().enumerate() {
        if subject.uses[k].is_empty() {
            continue;
        }
        if let Some(curve) = &edge.curve {
            vertex = vertex.larger(vertex_gap(subject, k, curve));
            let (length, middle) = length_of(curve);
            let face = subject.uses[k][0][0];
            shortest = shortest.smaller(Worst::at(length, middle, face).on_edge(k));
        }
        for sample in samples(subject, k) {
            surface = surface.larger(sample.surface);
            neighbour = neighbour.larger(sample.neighbour);
            off = off.larger(sample.off);
            angle = angle.larger(sample.angle);
            curvature = curvature.larger(sample.curvature);
        }
    }
    let unit = subject.model.unit.to_string();
    let limit = Limit::Most(subject.length);
    report.add("edge_vertex_gap", Severity::Defect, limit, &unit, vertex);
    report.add("edge_surface_gap", Severity::Defect, limit, &unit, surface);
    report.add("neighbour_gap", Severity::Defect, limit, &unit, neighbour);
    report.add(
        "loop_gap",
        Severity::Defect,
        limit,
        &unit,
        loop_gap(subject),
    );
    report.add("boundary_off_surface", Severity::Defect, limit, &unit, off);
    let information = Severity::Information;
    report.add(
        "edge_tangency",
        information,
        Limit::Most(ANGLE),
        "deg",
        angle,
    );
    let jump = jumps.worst().map_or(Worst::default(), |edge| {
        Worst::at(edge.reach(), edge.place, edge.faces[0]).on_edge(edge.edge)
    });
    report.add("normal_jump", information, Limit::Most(JUMP), "deg", jump);
    report.add(
        "edge_curvature",
        information,
        Limit::Most(CURVATURE),
        "",
        curvature,
    );
    let limit = Limit::Least(subject.length);
    report.add("edge_length", Severity::Defect, limit, &unit, shortest);
}

/// The largest distance between an edge and its vertices, or where its p-curves put it on a surface: of what a receiver
/// must take for one. Measured as the checks do.
pub(crate) fn largest_gap(model: &Model) -> f64 {
    let mut worst = 0.0_f64;
    for edge in model.edges() {
        if let Some(curve) = &edge.curve {
            let (a, b) = curve.domain();
            for (t, vertex) in [(a, edge.start), (b, edge.end)] {
                worst = worst.max(curve.point(t).distance(model.vertices()[vertex]));
            }
        }
    }
    for face in model.faces() {
        for used in face.loops.iter().flat_map(|l| &l.uses) {
            let edge = &model.edges()[used.edge];
            let mut at = parameters(&used.pcurve, 24);
            at.extend(edge.curve.iter().flat_map(|c| parameters(c, 24)));
            for t in at {
                let place = used.pcurve.point(t);
                let on_edge = match &edge.curve {
                    Some(curve) => curve.point(t),
                    None => model.vertices()[edge.start],
                };
                worst = worst.max(face.surface.point(place.x, place.y).distance(on_edge));
            }
        }
    }
    worst
}

/// From the ends of a curve to its vertices.
fn vertex_gap(subject: &Subject, k: usize, curve: &NurbsCurve) -> Worst {
    let (edge, vertices) = (&subject.model.edges()[k], subject.model.vertices());
    let (a, b) = curve.domain();
    let gap = |t: f64, vertex: usize| {
        let point = curve.point(t);
        let value = point.distance(vertices[vertex]);
        Worst::at(value, point, subject.uses[k][0][0]).on_edge(k)
    };
    gap(a, edge.start).larger(gap(b, edge.end))
}

/// Length of the polyline of 64 chords and more, and the point at half of the domain.
fn length_of(curve: &NurbsCurve) -> (f64, DVec3) {
    let parameters = parameters(curve, 64);
    let points: Vec<DVec3> = parameters.iter().map(|&t| curve.point(t)).collect();
    let length = points.windows(2).map(|w| w[0].distance(w[1])).sum();
    let (a, b) = curve.domain();
    (length, curve.point(f64::midpoint(a, b)))
}

/// Eight parameters per span and at least `least` over the domain, ends included.
fn parameters(curve: &NurbsCurve, least: usize) -> Vec<f64> {
    let breaks = curve.knots().breakpoints();
    let each = least.div_ceil(breaks.len() - 1).max(8);
    let mut parameters = vec![breaks[0]];
    for range in breaks.windows(2) {
        let at = |k: usize| range[0] + (range[1] - range[0]) * k as f64 / each as f64;
        parameters.extend((1..=each).map(at));
    }
    parameters
}

#[derive(Default)]
struct Sample {
    surface: Worst,
    neighbour: Worst,
    off: Worst,
    angle: Worst,
    curvature: Worst,
}

/// An edge on a face at a parameter.
struct Side {
    point: DVec3,
    /// By how much its place is outside the domain, in space.
    off: f64,
    normal: Option<DVec3>,
    /// Normal curvature across the edge.
    across: Option<f64>,
}

fn side(subject: &Subject, [face, _, _]: [usize; 3], used: &EdgeUse, t: f64) -> Side {
    let found = &subject.model.faces()[face];
    let surface = &found.surface;
    let [place, later] = [used.pcurve.derivatives(t)[0], used.pcurve.derivatives(t)[1]];
    let (place, velocity) = (place.truncate(), later.truncate());
    let [(a, b), (c, d)] = surface.domain();
    let inside = place.clamp(DVec2::new(a, c), DVec2::new(b, d));
    let scale = subject.regions[face]
        .as_ref()
        .map_or(DVec2::ONE, |r| r.scale());
    let at = surface.derivatives(place.x, place.y);
    let turn = if found.reversed { -1.0 } else { 1.0 };
    let tangent = at.du * velocity.x + at.dv * velocity.y;
    let across = surface.curvature(place.x, place.y).and_then(|bend| {
        let across = tangent.cross(bend.normal).try_normalize()?;
        let [cos, sin] = bend.directions.map(|direction| direction.dot(across));
        Some(turn * (bend.principal[0] * cos * cos + bend.principal[1] * sin * sin))
    });
    Side {
        point: at.point,
        off: ((place - inside) * scale).length(),
        normal: surface.normal(place.x, place.y).map(|n| turn * n),
        across,
    }
}

fn samples(subject: &Subject, k: usize) -> Vec<Sample> {
    let edge = &subject.model.edges()[k];
    let used = |&[face, each, at]: &[usize; 3]| &subject.model.faces()[face].loops[each].uses[at];
    let uses: Vec<&EdgeUse> = subject.uses[k].iter().map(used).collect();
    let mut at: Vec<f64> = edge.curve.iter().flat_map(|c| parameters(c, 24)).collect();
    uses.iter()
        .for_each(|used| at.extend(parameters(&used.pcurve, 24)));
    at.sort_by(f64::total_cmp);
    at.dedup();
    let sample = |&t: &f64| {
        let point = match &edge.curve {
            Some(curve) => curve.point(t),
            None => subject.model.vertices()[edge.start],
        };
        let worst = |value: f64, face: usize| Worst::at(value, point, face).on_edge(k);
        let mut sample = Sample::default();
        let mut sides: Vec<Side> = Vec::new();
        for (used, &key) in uses.iter().zip(&subject.uses[k]) {
            let (a, b) = used.pcurve.domain();
            let side = side(subject, key, used, t.clamp(a, b));
            sample.surface = sample
                .surface
                .larger(worst(side.point.distance(point), key[0]));
            sample.off = sample.off.larger(worst(side.off, key[0]));
            sides.push(side);
        }
        if let ([one, two], Some(_)) = (&sides[..], &edge.curve) {
            let face = subject.uses[k][0][0];
            sample.neighbour = worst(one.point.distance(two.point), face);
            if let (Some(n), Some(m)) = (one.normal, two.normal) {
                let angle = math::angle_between(n, m).to_degrees();
                sample.angle = worst(angle, face);
                if let (Some(x), Some(y), true) = (one.across, two.across, angle <= ANGLE) {
                    let most = x.abs().max(y.abs()).max(1.0 / subject.diagonal);
                    sample.curvature = worst((x - y).abs() / most, face);
                }
            }
        }
        sample
    };
    at.iter().map(sample).collect()
}

/// Between the end of a p-curve and the start of the next.
fn loop_gap(subject: &Subject) -> Worst {
    let mut worst = Worst::default();
    for (k, face, region) in subject.faces() {
        for each in &face.loops {
            let next = each.uses.iter().cycle().skip(1);
            for (used, next) in each.uses.iter().zip(next) {
                let (from, to) = (used.ends()[1], next.ends()[0]);
                let value = ((to - from) * region.scale()).length();
                let place = face.surface.point(from.x, from.y);
                worst = worst.larger(Worst::at(value, place, k).on_edge(used.edge));
            }
        }
    }
    worst
}
