//! What was fitted, how well, and where it went.

use super::text::Page;
use super::{Show, check, measured, written};
use crate::failure::Result;
use nurbskin::fit::approximate::trade::said;
use nurbskin::pipeline::{Outcome, SurfaceSummary};
use nurbskin::unit::{counted, percent, three_digits};

impl Show {
    /// The outcome of a fit; `told` are warnings that were told while it ran.
    ///
    /// # Errors
    /// As [`print()`](super::print).
    pub(crate) fn outcome(&self, outcome: &Outcome, told: &[String]) -> Result<()> {
        self.json(outcome)?;
        self.outcome_warnings(outcome, told, "");
        let (input, unit) = (&outcome.input, outcome.input.unit);
        let mut page = self.page();
        measured::scan(&mut page, input);
        surfaces(&mut page, outcome);
        measured::deviation(
            &mut page,
            &outcome.deviation,
            outcome.tolerance,
            outcome.within,
            unit,
        );
        let back = &outcome.deviation.surface_to_scan;
        if back.unsupported_area > 0.0 {
            page.row(
                "coverage",
                &format!(
                    "{} of the surface has no scan data under it",
                    percent(back.unsupported_area)
                ),
            );
        }
        if self.verbose {
            page.row(
                "",
                &format!(
                    "surface to scan: 95 % of the area within {}, at most {}",
                    measured::length(unit, back.p95),
                    measured::length(unit, back.max)
                ),
            );
            let said = format!(
                "curvature variation {} (0 for planes, cylinders and spheres)",
                three_digits(outcome.surface.curvature_variation)
            );
            page.row("fairness", &said);
            if outcome.tolerance.is_none() {
                page.row(
                    "aim",
                    &format!(
                        "{} ({})",
                        measured::length(unit, outcome.aim.value),
                        outcome.aim.source
                    ),
                );
            }
        }
        if let Some(found) = &outcome.check {
            page.row("check", &check::of_fit(found));
        }
        measured::verdict(
            &mut page,
            outcome.verdict,
            &outcome.reason,
            &outcome.reasons,
            unit,
        );
        written(&mut page, &outcome.outputs, Some(outcome.time.total));
        self.result(page)
    }

    /// The warnings of a fit, a doubt about its size first; each after `name`.
    pub(super) fn outcome_warnings(&self, outcome: &Outcome, told: &[String], name: &str) {
        let named = |text: &String| format!("{name}{text}");
        // The row of ignored points of a single scan says the same.
        let repeated = |text: &&String| name.is_empty() && text.contains(" ignored: ");
        let warnings = outcome.warnings.iter().filter(|text| !repeated(text));
        let warnings: Vec<String> = warnings.map(named).collect();
        self.warnings(&warnings, told);
        let details: Vec<String> = outcome.details.iter().map(named).collect();
        self.details(&details);
    }
}

/// The surface, or those of the separate parts of the scan.
fn surfaces(page: &mut Page, outcome: &Outcome) {
    let method = match &*outcome.method {
        "interpolate" => "interpolated",
        _ => "approximated",
    };
    if outcome.parts.is_empty() {
        page.row("surface", &format!("{}, {method}", of(&outcome.surface)));
        // With a tolerance it stands beside the verdict.
        if let (None, Some(ended)) = (outcome.tolerance, &outcome.surface.ended) {
            page.row("", ended);
        }
        if let Some(said) = said(&outcome.surface.neighbours, outcome.input.unit) {
            page.row("trade", &said);
        }
        return;
    }
    page.row(
        "surfaces",
        &format!(
            "{}, one for each separate part of the scan, {method}",
            outcome.parts.len()
        ),
    );
    let unit = outcome.input.unit;
    for (k, part) in outcome.parts.iter().enumerate() {
        page.row(
            "",
            &format!(
                "{}: {}; {}, 95 % within {}",
                k + 1,
                of(&part.surface),
                counted(part.points, "point", "points"),
                measured::length(unit, part.scan_to_surface.p95)
            ),
        );
    }
}

fn of(surface: &SurfaceSummary) -> String {
    let [m, n] = surface.control_points;
    let [p, q] = surface.degree;
    let degree = if p == q {
        format!("degree {p}")
    } else {
        format!("degree {p} x {q}")
    };
    let shape = match surface.topology.name() {
        "disk" => "open sheet",
        name => name,
    };
    let kept = surface.kept.map_or(String::new(), |[a, b]| {
        format!(", {a} x {b} lines of points kept")
    });
    let trimmed = if surface.trimmed { ", trimmed" } else { "" };
    format!(
        "{shape}, {m} x {n} = {}, {degree}{trimmed}{kept}",
        counted(m * n, "control point", "control points")
    )
}
