//! Failed checks as sentences.
//!
//! Translates each failed quality check into a reason with measured value, limit, place and remedy. `fit` and `check`
//! use the same wording.

use crate::deviation::verdict::Reason;
use glam::DVec3;
use nurbskin_cad::check::{Check, Report};
use nurbskin_geometry::Unit;
use nurbskin_geometry::unit::{counted, three_digits};

/// The remedy for a surface that folds or intersects itself.
const CALMER: &str = "look at this place in the report (--report part.html); a surface with fewer control points \
                      (--max-control-points) or a larger tolerance (-t) is calmer there";

/// The failed checks of a model in `unit`, the most serious first; `origin` is added to the places. For a `fitted`
/// surface the reasons include a remedy.
pub(super) fn reasons(report: &Report, unit: Unit, origin: DVec3, fitted: bool) -> Vec<Reason> {
    let failed = report.checks.iter().filter(|check| !check.pass);
    let mut found: Vec<(usize, Reason)> = failed
        .map(|check| {
            let place = check.where_.map(|at| (at + origin).to_array());
            let calm = matches!(&*check.name, "folds" | "self_intersections");
            let reason = Reason {
                what: words(check, unit),
                where_: place,
                next: (fitted && calm).then(|| CALMER.to_owned()),
            };
            (usize::from(!calm), reason)
        })
        .collect();
    found.sort_by_key(|(rank, _)| *rank);
    found.into_iter().map(|(_, reason)| reason).collect()
}

/// A failed check as a sentence.
pub(super) fn words(check: &Check, unit: Unit) -> String {
    let length = |x: f64| unit.length(x);
    let [measured, limit] = [check.measured, check.limit];
    let (far, most, least) = (
        length(measured),
        format!("{} is allowed", length(limit)),
        format!("{} is the least", length(limit)),
    );
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a count"
    )]
    let count = measured.max(0.0).round() as usize;
    let places = |one: &str, many: &str| counted(count, one, many);
    let angle = three_digits(measured);
    match &*check.name {
        "faces" => "there is no face".into(),
        "edge_vertex_gap" => format!("an edge ends {far} from its vertex, {most}"),
        "edge_surface_gap" => format!("an edge is {far} off its face, {most}"),
        "neighbour_gap" => format!("neighbouring faces are {far} apart at their edge, {most}"),
        "loop_gap" => format!("a boundary has a gap of {far}, {most}"),
        "boundary_off_surface" => format!("a boundary is {far} beyond its surface, {most}"),
        "knot_tangency" => format!(
            "a face has a crease of {angle} degrees, {} is allowed",
            three_digits(limit)
        ),
        "degree" => format!("the degree is {count}, many systems keep {limit} at most"),
        "knot_distance" => format!("knots are {far} apart, {least}"),
        "edge_length" => format!("an edge is {far} long, {least}"),
        "face_width" => format!("a face is {far} wide, {least}"),
        "loop_crossings" => format!("boundaries cross at {}", places("place", "places")),
        "loop_orientation" => format!(
            "{} the wrong way round",
            places("boundary runs", "boundaries run")
        ),
        "loop_nesting" => format!(
            "{} not inside the outer boundary",
            places("hole is", "holes are")
        ),
        "folds" => format!(
            "the surface folds: its normal turns by {angle} degrees at once, {} is allowed",
            three_digits(limit)
        ),
        "self_intersections" => format!(
            "{} where the surface intersects itself",
            places("place", "places")
        ),
        "shell_orientation" => format!(
            "the faces at {} look opposite ways",
            places("edge", "edges")
        ),
        "non_manifold_edges" => format!("{} more than two faces", places("edge has", "edges have")),
        "free_edges" => format!("a closed shell is open at {}", places("edge", "edges")),
        "solid_volume" => format!(
            "a solid has a volume of {} {unit}3: it is inside out",
            three_digits(measured)
        ),
        other => format!(
            "{other} is {} {}, the limit is {}",
            three_digits(measured),
            check.unit,
            three_digits(limit)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_cad::check::Severity;

    #[test]
    fn failed_checks_are_sentences_with_places() {
        let check = |name: &'static str, measured: f64, limit: f64, pass: bool| Check {
            name: name.into(),
            measured,
            limit,
            unit: String::new(),
            where_: Some(DVec3::new(1.0, 2.0, 3.0)),
            face: Some(0),
            edge: None,
            severity: Severity::Defect,
            within: pass,
            pass,
        };
        let report = Report {
            checks: vec![
                check("edge_length", 0.01, 0.02, false),
                check("degree", 3.0, 11.0, true),
                check("self_intersections", 98.0, 0.0, false),
                check("loop_crossings", 1.0, 0.0, false),
            ],
            ..Report::default()
        };
        let said = reasons(&report, Unit::Millimetre, DVec3::new(100.0, 0.0, 0.0), true);
        let words: Vec<String> = said.iter().map(|r| r.words(Unit::Millimetre)).collect();
        assert_eq!(
            words,
            [
                "98 places where the surface intersects itself, at (101, 2, 3) mm",
                "an edge is 10 um long, 20 um is the least, at (101, 2, 3) mm",
                "boundaries cross at 1 place, at (101, 2, 3) mm",
            ]
        );
        assert!(said[0].next.is_some() && said[1].next.is_none());
        // Every check of the list has its words.
        for check in nurbskin_cad::check::check(&nurbskin_cad::Model::new("")).checks {
            assert!(
                !super::words(&check, Unit::Millimetre)
                    .contains(&*check.name.replace("faces", "?"))
            );
        }
    }
}
