//! Shells: what their faces leave open, which way they look, folds and self-intersections.

use super::tree::Tree;
use super::{FOLD, Limit, Report, Severity, Subject, Worst};
use crate::cad::mass::shell_mass;
use crate::cad::model::ShellKind;
use crate::cad::tessellate::{ModelTessellation, tessellate};
use crate::nurbs::NurbsSurface;
use glam::{DVec2, DVec3};

/// Triangles allowed for the search.
const TRIANGLES: usize = 2_000_000;
/// Chordal tolerance as a share of the diagonal, ...
const SHARE: f64 = 1e-3;
/// ... and that which confirms what was found.
const FINER: f64 = 1.25e-4;

pub(super) fn check(subject: &Subject, report: &mut Report) {
    let coarse = tessellate(subject.model, SHARE * subject.diagonal, TRIANGLES);
    let [mut fold, mut crossings] = [Worst::default(); 2];
    match coarse {
        Ok(mesh) => {
            for (face, why) in &mesh.left_out {
                report.skipped.push(format!(
                    "folds and self-intersections of face {face}: {why}"
                ));
            }
            fold = folds(subject, &mesh);
            crossings = overlaps(&mesh);
            // Chords cut corners: what is real is there with shorter ones as well.
            if crossings.value > 0.5 {
                if let Ok(mesh) = tessellate(subject.model, FINER * subject.diagonal, TRIANGLES) {
                    crossings = overlaps(&mesh);
                }
            }
        }
        Err(error) => report
            .skipped
            .push(format!("folds and self-intersections: {error}")),
    }
    let (defect, none) = (Severity::Defect, Limit::Most(0.0));
    report.add("folds", defect, Limit::Most(FOLD), "deg", fold);
    report.add("self_intersections", defect, none, "", crossings);
    let [orientation, shared, free, open] = uses(subject);
    report.add("shell_orientation", defect, none, "", orientation);
    report.add("non_manifold_edges", defect, none, "", shared);
    report.add("free_edges", defect, none, "", free);
    report.add("open_edges", Severity::Information, none, "", open);
    let mut least = Worst::of(f64::INFINITY);
    let mut any = false;
    for (k, shell) in subject.model.shells().iter().enumerate() {
        if shell.kind != ShellKind::Solid {
            continue;
        }
        any = true;
        match shell_mass(subject.model, k) {
            Ok(mass) => {
                let volume = Worst {
                    value: mass.volume.unwrap_or(f64::NAN),
                    place: Some(mass.centroid),
                    face: None,
                    edge: None,
                };
                least = least.smaller(volume);
            }
            Err(error) => report
                .skipped
                .push(format!("the volume of shell {k}: {error}")),
        }
    }
    if any {
        let unit = format!("{}3", subject.model.unit);
        report.add("solid_volume", defect, Limit::Above(0.0), &unit, least);
    }
}

/// Edges that faces use in the same sense, that more than two use, and that one uses in closed and in open shells.
fn uses(subject: &Subject) -> [Worst; 4] {
    let mut worst = [Worst::default(); 4];
    let model = subject.model;
    // Faces without a shell are taken as an open one.
    let mut shell_of = vec![usize::MAX; model.faces().len()];
    for (k, shell) in model.shells().iter().enumerate() {
        shell.faces.iter().for_each(|&face| shell_of[face] = k);
    }
    for (k, edge) in model.edges().iter().enumerate() {
        let Some(curve) = &edge.curve else { continue };
        let (a, b) = curve.domain();
        let place = Some(curve.point(f64::midpoint(a, b)));
        let mut shells: Vec<usize> = subject.uses[k].iter().map(|u| shell_of[u[0]]).collect();
        shells.sort_unstable();
        shells.dedup();
        for shell in shells {
            let mut senses = [0_u32; 2];
            let mut face = None;
            for &[f, l, m] in subject.uses[k].iter().filter(|u| shell_of[u[0]] == shell) {
                let found = &model.faces()[f];
                let used = &found.loops[l].uses[m];
                senses[usize::from(used.reversed != found.reversed)] += 1;
                face = face.or(Some(f));
            }
            let closed = model
                .shells()
                .get(shell)
                .is_some_and(|s| s.kind != ShellKind::Open);
            match senses {
                [1, 1] => {}
                [1, 0] | [0, 1] if closed => worst[2].count(place, face, Some(k)),
                [1, 0] | [0, 1] => worst[3].count(place, face, Some(k)),
                [2, 0] | [0, 2] => worst[0].count(place, face, Some(k)),
                _ => worst[1].count(place, face, Some(k)),
            }
        }
    }
    worst
}

/// The largest angle by which the normal turns at once inside a face: where it differs by more than the limit between
/// the corners of a triangle, the way between them is halved towards the larger turn.
fn folds(subject: &Subject, mesh: &ModelTessellation) -> Worst {
    let mut worst = Worst::default();
    let limit = FOLD.to_radians().cos();
    for (corners, &face) in mesh.corners.iter().zip(&mesh.faces) {
        for s in 0..3 {
            let [a, b] = [corners[s], corners[(s + 1) % 3]];
            let [n, m] = [a, b].map(|k| mesh.normals[k as usize]);
            if a > b || n == DVec3::ZERO || m == DVec3::ZERO || n.dot(m) >= limit {
                continue;
            }
            let ends = [a, b].map(|k| mesh.parameters[k as usize]);
            let surface = &subject.model.faces()[face as usize].surface;
            let (angle, place) = turn(surface, ends);
            let point = surface.point(place.x, place.y);
            worst = worst.larger(Worst::at(angle, point, face as usize));
        }
    }
    worst
}

/// By how many degrees the normal turns in a short piece between two places, and where.
fn turn(surface: &NurbsSurface, [mut a, mut b]: [DVec2; 2]) -> (f64, DVec2) {
    let normal = |p: DVec2| surface.normal(p.x, p.y).unwrap_or_default();
    let angle = |n: DVec3, m: DVec3| n.cross(m).length().atan2(n.dot(m));
    let (mut n, mut m) = (normal(a), normal(b));
    for _ in 0..24 {
        let middle = a.midpoint(b);
        let between = normal(middle);
        if between == DVec3::ZERO {
            break;
        }
        if angle(n, between) >= angle(between, m) {
            (b, m) = (middle, between);
        } else {
            (a, n) = (middle, between);
        }
    }
    (angle(n, m).to_degrees(), a.midpoint(b))
}

/// Counts the pairs of triangles without a common point that cross.
fn overlaps(mesh: &ModelTessellation) -> Worst {
    let corner = |k: u32| mesh.points[k as usize];
    let triangles: Vec<[DVec3; 3]> = mesh.triangles.iter().map(|t| t.map(corner)).collect();
    let bounds = |t: &[DVec3; 3]| [t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2])];
    let boxes: Vec<[DVec3; 2]> = triangles.iter().map(bounds).collect();
    let mut worst = Worst::default();
    Tree::new(&boxes).pairs(|a, b| {
        let near = mesh.triangles[a]
            .iter()
            .any(|k| mesh.triangles[b].contains(k));
        if !near {
            let place = cross(&triangles[a], &triangles[b]);
            if let Some(place) = place.or_else(|| cross(&triangles[b], &triangles[a])) {
                worst.count(Some(place), Some(mesh.faces[a] as usize), None);
            }
        }
        true
    });
    worst
}

/// Where a side of one triangle passes through the inside of another.
///
/// Source: T. Moeller, B. Trumbore, *Fast, minimum storage ray/triangle intersection*, J. Graphics Tools 2, 1997.
fn cross(one: &[DVec3; 3], two: &[DVec3; 3]) -> Option<DVec3> {
    // Touching does not count: shares of the way and of the triangle.
    const INSIDE: f64 = 1e-6;
    let [a, b, c] = *two;
    let (x, y) = (b - a, c - a);
    let normal = x.cross(y);
    for s in 0..3 {
        let (from, to) = (one[s], one[(s + 1) % 3]);
        let way = to - from;
        let height = normal.dot(way);
        // Nearly parallel sides are left to the others.
        if height.abs() <= 1e-12 * normal.length() * way.length() {
            continue;
        }
        let share = normal.dot(a - from) / height;
        if !(share > INSIDE && share < 1.0 - INSIDE) {
            continue;
        }
        let point = from + share * way;
        let square = normal.length_squared();
        let v = x.cross(point - a).dot(normal) / square;
        let u = (point - a).cross(y).dot(normal) / square;
        if u > INSIDE && v > INSIDE && u + v < 1.0 - INSIDE {
            return Some(point);
        }
    }
    None
}
