//! Shells: what their faces leave open, which way they look, folds and self-intersections.

use super::crossings::{Found, TRIANGLES, folds_and_crossings};
use super::{FOLD, Limit, Report, Severity, Subject, Worst};
use crate::mass::shell_mass;
use crate::model::ShellKind;
use crate::normal_jump::NormalJumps;
use nurbskin_geometry::unit::grouped;

pub(super) fn check(subject: &Subject, jumps: &NormalJumps, report: &mut Report) {
    let (defect, none) = (Severity::Defect, Limit::Most(0.0));
    match folds_and_crossings(subject) {
        Ok(Found {
            fold, crossings, ..
        }) => {
            let fold = fold.larger(folded_edge(jumps));
            report.add("folds", defect, Limit::Most(FOLD), "deg", fold);
            report.add("self_intersections", defect, none, "", crossings);
        }
        Err(_) => report.skipped.push(format!(
            "folds and self-intersections: more than {} triangles would be needed to look for them",
            grouped(TRIANGLES)
        )),
    }
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
                .push(format!("the volume of shell {}: {error}", k + 1)),
        }
    }
    if any {
        let unit = format!("{}3", subject.model.unit);
        report.add("solid_volume", defect, Limit::Above(0.0), &unit, least);
    }
}

/// The largest angle across an edge that is meant to be smooth, where the surface turns back there.
fn folded_edge(jumps: &NormalJumps) -> Worst {
    jumps
        .smooth_above(FOLD)
        .map(|e| Worst::at(e.sampled, e.place, e.faces[0]).on_edge(e.edge))
        .fold(Worst::default(), Worst::larger)
}

/// Edges that faces use in the same sense, that more than two use, and that one uses in closed and in open shells.
fn uses(subject: &Subject) -> [Worst; 4] {
    let mut worst = [Worst::default(); 4];
    let model = subject.model;
    let shell_of = subject.shell_of_faces();
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
