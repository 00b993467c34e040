//! The checks of a CAD file, as a quality report.

use super::text::{ERROR, NOTE, PASS, Page, WARNING, styled};
use super::{Show, measured};
use crate::failure::Result;
use nurbskin::Unit;
use nurbskin::cad::check::{Check, Severity};
use nurbskin::pipeline::{Checked, FitCheck};
use nurbskin::unit::{counted, three_digits};

/// Parts of the report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Group {
    Geometry,
    Topology,
}

/// Which way a limit goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Limit {
    Most,
    Least,
    Above,
}

/// A check in words.
#[derive(Debug)]
struct Words {
    name: &'static str,
    group: Group,
    limit: Limit,
    /// What is measured.
    title: &'static str,
    /// What is counted, one and several; empty where it is measured and not counted.
    counted: [&'static str; 2],
}

const fn words(
    name: &'static str,
    group: Group,
    limit: Limit,
    title: &'static str,
    counted: [&'static str; 2],
) -> Words {
    Words {
        name,
        group,
        limit,
        title,
        counted,
    }
}

use Group::{Geometry, Topology};
use Limit::{Above, Least, Most};

/// Every check of the library, in the words of a quality report.
const ALL: [Words; 26] = [
    words("faces", Topology, Least, "faces", ["face", "faces"]),
    words(
        "edge_vertex_gap",
        Geometry,
        Most,
        "gap between an edge and its vertex",
        ["", ""],
    ),
    words(
        "edge_surface_gap",
        Geometry,
        Most,
        "gap between an edge and its face",
        ["", ""],
    ),
    words(
        "neighbour_gap",
        Geometry,
        Most,
        "gap between two faces along their common edge",
        ["", ""],
    ),
    words(
        "loop_gap",
        Geometry,
        Most,
        "gap between successive edges of a loop",
        ["", ""],
    ),
    words(
        "boundary_off_surface",
        Geometry,
        Most,
        "boundary beyond the end of its surface",
        ["", ""],
    ),
    words(
        "edge_tangency",
        Geometry,
        Most,
        "angle between faces across an edge",
        ["", ""],
    ),
    words(
        "normal_jump",
        Geometry,
        Most,
        "angle across an edge that is meant to be smooth",
        ["", ""],
    ),
    words(
        "edge_curvature",
        Geometry,
        Most,
        "jump of the curvature across a smooth edge",
        ["", ""],
    ),
    words(
        "knot_tangency",
        Geometry,
        Most,
        "crease inside a face",
        ["", ""],
    ),
    words(
        "knot_curvature",
        Geometry,
        Most,
        "jump of the curvature inside a face",
        ["", ""],
    ),
    words("degree", Geometry, Most, "degree", ["", ""]),
    words(
        "knot_distance",
        Geometry,
        Least,
        "width of the narrowest knot span",
        ["", ""],
    ),
    words(
        "edge_length",
        Geometry,
        Least,
        "length of the shortest edge",
        ["", ""],
    ),
    words(
        "face_width",
        Geometry,
        Least,
        "width of the narrowest face",
        ["", ""],
    ),
    words(
        "loop_crossings",
        Topology,
        Most,
        "crossing boundary loops",
        ["crossing", "crossings"],
    ),
    words(
        "loop_orientation",
        Topology,
        Most,
        "boundary loops that run the wrong way",
        ["loop", "loops"],
    ),
    words(
        "loop_nesting",
        Topology,
        Most,
        "holes outside their face or inside another hole",
        ["hole", "holes"],
    ),
    words(
        "folds",
        Geometry,
        Most,
        "fold inside a face or at a smooth edge",
        ["", ""],
    ),
    words(
        "self_intersections",
        Geometry,
        Most,
        "self-intersections",
        ["place", "places"],
    ),
    words(
        "unoccupied_rows",
        Geometry,
        Most,
        "rows of knot spans that no face touches",
        ["row", "rows"],
    ),
    words(
        "shell_orientation",
        Topology,
        Most,
        "edges whose faces look opposite ways",
        ["edge", "edges"],
    ),
    words(
        "non_manifold_edges",
        Topology,
        Most,
        "edges of more than two faces",
        ["edge", "edges"],
    ),
    words(
        "free_edges",
        Topology,
        Most,
        "free edges of a closed shell",
        ["edge", "edges"],
    ),
    words(
        "open_edges",
        Topology,
        Most,
        "free edges of an open shell",
        ["edge", "edges"],
    ),
    words(
        "solid_volume",
        Topology,
        Above,
        "volume of the smallest solid",
        ["", ""],
    ),
];

/// The words of a check; one that a later library adds has its name only.
fn words_of(check: &Check) -> (String, Group, Limit, [&'static str; 2]) {
    let known = ALL.iter().find(|words| words.name == check.name);
    known.map_or_else(
        || (check.name.replace('_', " "), Geometry, Most, ["", ""]),
        |words| {
            (
                words.title.to_owned(),
                words.group,
                words.limit,
                words.counted,
            )
        },
    )
}

/// Angles and ratios nearer to nothing than this are rounding errors.
const NOTHING: f64 = 1e-6;

/// A measured value or a limit.
fn value(check: &Check, x: f64, unit: Unit) -> String {
    let x = if check.unit == "deg" || check.unit.is_empty() {
        if x.abs() < NOTHING { 0.0 } else { x }
    } else {
        x
    };
    let whole = x.fract() == 0.0 && x.abs() < 1e15;
    match &*check.unit {
        symbol if Unit::from_symbol(symbol) == Some(unit) => measured::length(unit, x),
        "deg" => format!("{} degrees", three_digits(x)),
        // Jumps of the curvature are relative.
        "" if check.name.ends_with("_curvature") => format!("{} %", three_digits(100.0 * x)),
        "" if whole => format!("{x:.0}"),
        "" => three_digits(x),
        other => format!("{} {other}", three_digits(x)),
    }
}

/// A check as a sentence: what, how much, what is allowed, where.
fn sentence(check: &Check, unit: Unit) -> String {
    let (title, _, limit, nouns) = words_of(check);
    let counted_as = |x: f64| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "counts are small and not negative"
        )]
        let n = x as usize;
        counted(n, nouns[0], nouns[1])
    };
    let none = check.limit == 0.0;
    let (measured, allowed) = match (limit, nouns) {
        (Most, [one, _]) if !one.is_empty() && none => {
            let allowed = match check.severity {
                Severity::Defect => ", none allowed",
                Severity::Information => "",
            };
            (counted_as(check.measured), allowed.to_owned())
        }
        (Above, _) => (
            value(check, check.measured, unit),
            " (must be positive)".into(),
        ),
        (limit, _) => {
            let sign = if limit == Least { ">=" } else { "<=" };
            (
                value(check, check.measured, unit),
                format!(" (limit {sign} {})", value(check, check.limit, unit)),
            )
        }
    };
    let place = check.where_.filter(|_| !check.within);
    let place = place.map_or_else(String::new, |p| {
        format!("; worst at {}", unit.place(p.to_array()))
    });
    format!("{title}: {measured}{allowed}{place}")
}

/// What a note means for who reads it.
fn meaning(check: &Check) -> &'static str {
    match &*check.name {
        "edge_tangency" if check.measured > 179.0 => {
            " - faces meet at a knife edge, or one of them folds back on the other"
        }
        "edge_tangency" => " - the model has sharp edges",
        "normal_jump" | "edge_curvature" => " - highlights may break there",
        "open_edges" => " - a sheet and no solid",
        "unoccupied_rows" => " - the surface extends beyond its trimmed face",
        _ => "",
    }
}

/// The check of the files that a fit wrote, on one line; the reasons of the verdict say what failed.
pub(super) fn of_fit(found: &FitCheck) -> String {
    let failed = found.checks.iter().filter(|check| !check.pass).count();
    let all = counted(found.checks.len(), "check", "checks");
    match &*found.verdict {
        "pass" => format!(
            "{}: {all}, and the file reads back the same",
            styled(PASS, "pass")
        ),
        "fail" if failed > 0 => format!("{}: {failed} of {all}", styled(ERROR, "FAIL")),
        "fail" => format!("{}: {}", styled(ERROR, "FAIL"), found.said),
        _ => found.said.clone(),
    }
}

impl Show {
    /// The checks of a CAD file.
    ///
    /// # Errors
    /// As [`print()`](super::print).
    pub(crate) fn checked(&self, checked: &Checked) -> Result<()> {
        self.json(checked)?;
        self.warnings(&checked.warnings, &[]);
        let mut page = self.page();
        fill(&mut page, checked, self.verbose);
        self.result(page)
    }
}

/// The report: what failed, what is worth knowing, and what passed.
fn fill(page: &mut Page, checked: &Checked, verbose: bool) {
    let unit = checked.unit;
    let failed: Vec<&Check> = checked.checks.iter().filter(|c| !c.pass).collect();
    let all = checked.checks.len() + 1;
    let count = failed.len() + usize::from(!checked.reads_back);
    let verdict = match (checked.verdict, count) {
        ("pass", _) => format!(
            "{} ({} passed)",
            styled(PASS, "pass"),
            counted(all, "check", "checks")
        ),
        ("fail", 1..) => format!("{} ({count} of {all} checks failed)", styled(ERROR, "FAIL")),
        (other, _) => styled(NOTE, &other.replace('_', " ")),
    };
    page.line(&format!(
        "{}: {verdict}; {}, {}, lengths in {unit}",
        checked.path,
        checked.format.to_uppercase(),
        counted(checked.faces, "face", "faces"),
    ));
    for check in &failed {
        page.marked("FAIL", ERROR, &sentence(check, unit));
    }
    if let Some(why) = &checked.differs {
        page.marked("FAIL", ERROR, &format!("read-back: {why}"));
    }
    for why in &checked.not_checked {
        page.marked("skip", WARNING, &format!("not checked: {why}"));
    }
    let notes = checked.checks.iter().filter(|c| c.pass && !c.within);
    for check in notes {
        let text = format!("{}{}", sentence(check, unit), meaning(check));
        page.marked("note", NOTE, &text);
    }
    passed(page, checked, verbose);
}

/// What passed: a line for each group, or with `verbose` for each check.
fn passed(page: &mut Page, checked: &Checked, verbose: bool) {
    let unit = checked.unit;
    for (group, name) in [(Geometry, "geometry"), (Topology, "topology")] {
        let of_group = checked.checks.iter().filter(|c| words_of(c).1 == group);
        let within: Vec<&Check> = of_group.filter(|c| c.within).collect();
        if verbose {
            for check in within {
                page.marked("ok", PASS, &sentence(check, unit));
            }
        } else if !within.is_empty() {
            let text = format!("{name}: {}", counted(within.len(), "check", "checks"));
            page.marked("ok", PASS, &text);
        }
    }
    if checked.reads_back {
        page.marked(
            "ok",
            PASS,
            "read-back: the file, written again, reads back the same",
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::borrow::Cow;

    fn check(name: &'static str, measured: f64, limit: f64, unit: &str, within: bool) -> Check {
        Check {
            name: Cow::Borrowed(name),
            measured,
            limit,
            unit: unit.into(),
            where_: Some(nurbskin::DVec3::new(35.7, 36.8, 23.2)),
            face: None,
            edge: None,
            severity: Severity::Defect,
            within,
            pass: within,
        }
    }

    #[test]
    fn checks_are_sentences_with_directions() {
        let mm = Unit::Millimetre;
        let said = |c: &Check| sentence(c, mm).replace('\u{a0}', " ");
        assert_eq!(
            said(&check("self_intersections", 8.0, 0.0, "", false)),
            "self-intersections: 8 places, none allowed; worst at (35.7, 36.8, 23.2) mm"
        );
        assert_eq!(
            said(&check("edge_length", 0.01, 0.02, "mm", false)),
            "length of the shortest edge: 10 um (limit >= 20 um); worst at (35.7, 36.8, 23.2) mm"
        );
        assert_eq!(
            said(&check("faces", 6.0, 1.0, "", true)),
            "faces: 6 (limit >= 1)"
        );
        assert_eq!(
            said(&check("degree", 5.0, 11.0, "", true)),
            "degree: 5 (limit <= 11)"
        );
        assert_eq!(
            said(&check("loop_crossings", 1.0, 0.0, "", true)),
            "crossing boundary loops: 1 crossing, none allowed"
        );
    }

    #[test]
    fn every_check_of_the_library_has_words() {
        let mut model = nurbskin::cad::Model::new("ring");
        let torus =
            nurbskin::nurbs::conic::torus(nurbskin::DVec3::ZERO, nurbskin::DVec3::Z, 3.0, 1.0);
        let face = torus.and_then(|torus| model.add_whole_surface(&torus, 1e-9));
        assert!(face.and_then(|face| model.add_shell_of(face)).is_ok());
        let report = nurbskin::cad::check::check(&model);
        assert!(report.checks.len() > 20);
        for check in &report.checks {
            assert!(
                ALL.iter().any(|words| words.name == check.name),
                "{}",
                check.name
            );
        }
    }
}
