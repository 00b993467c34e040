//! What was fitted, how well, and where it went.

use super::text::Page;
use super::{Show, check, measured, written};
use crate::failure::Result;
use nurbskin::chart::Topology;
use nurbskin::fit::approximate::trade::said;
use nurbskin::pipeline::{FaceLayout, Outcome, SurfaceSummary};
use nurbskin::unit::{counted, grouped, percent, three_digits};

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
        let label = if outcome.surface.layout == FaceLayout::Network {
            "network"
        } else {
            "surface"
        };
        page.row(label, &format!("{}, {method}", of(&outcome.surface)));
        for row in joins(&outcome.surface) {
            page.row("", &row);
        }
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

/// The edges of a network, and how smooth they are.
fn joins(surface: &SurfaceSummary) -> Vec<String> {
    let (Some(edges), Some(jump)) = (surface.edges, surface.normal_jump) else {
        return Vec::new();
    };
    let mut rows = vec![format!(
        "{}, {} sharp, {} at borders",
        counted(edges.smooth, "smooth edge", "smooth edges"),
        grouped(edges.sharp),
        grouped(edges.border)
    )];
    if edges.smooth > 0 {
        rows.push(format!(
            "normals turn by {} degrees at most across smooth edges, by more than 0.1 on {} of their length, by more than 0.5 on {}",
            three_digits(jump.bound.unwrap_or(jump.max)),
            percent(jump.over_tenth),
            percent(jump.over_half)
        ));
    }
    rows
}

/// The shape of a network in words.
fn shape_of(surface: &SurfaceSummary, faces: usize) -> String {
    let closed = match surface.borders {
        Some(0) => "closed".to_owned(),
        Some(n) => format!("open at {}", counted(n, "border", "borders")),
        None => "open".to_owned(),
    };
    let handles = match surface.genus {
        None | Some(0) => String::new(),
        Some(n) => format!(", {}", counted(n, "handle", "handles")),
    };
    format!(
        "{}, {closed}{handles}",
        counted(faces, "four-sided face", "four-sided faces")
    )
}

fn of(surface: &SurfaceSummary) -> String {
    let [p, q] = surface.degree;
    let degree = if p == q {
        format!("degree {p}")
    } else {
        format!("degree {p} x {q}")
    };
    let count: usize = surface.control_points.iter().product();
    let count = counted(count, "control point", "control points");
    if let Some(faces) = surface.faces {
        return format!("{}, {count}, {degree}", shape_of(surface, faces));
    }
    let shape = match surface.topology.map_or("surface", Topology::name) {
        "disk" => "open sheet",
        name => name,
    };
    let net: Vec<String> = surface
        .control_points
        .iter()
        .map(usize::to_string)
        .collect();
    let net = net.join(" x ");
    let kept = surface.kept.map_or(String::new(), |[a, b]| {
        format!(", {a} x {b} lines of points kept")
    });
    let trimmed = if surface.trimmed { ", trimmed" } else { "" };
    format!("{shape}, {net} = {count}, {degree}{trimmed}{kept}")
}
