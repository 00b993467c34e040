//! What `fit` and `deviation` have in common: the scan, the deviation, the verdict.

use super::text::{ERROR, PASS, Page, WARNING, styled};
use nurbskin::Unit;
use nurbskin::deviation::verdict::{Reason, Verdict};
use nurbskin::pipeline::{DeviationSummary, Input};
use nurbskin::unit::{UnitSource, counted, grouped, percent};

/// What is shorter than this is nothing, mm: the size of an atom, below which there are rounding errors only.
const NOTHING: f64 = 1e-7;

/// A length for people.
pub(super) fn length(unit: Unit, x: f64) -> String {
    let nothing = x.abs() * unit.millimetres() < NOTHING;
    unit.length(if nothing { 0.0 } else { x })
}

/// The size of what was read, for the end of a line: `, 196 x 78.9 x 37.5 mm (mm assumed)`.
pub(crate) fn sized(corners: Option<[[f64; 3]; 2]>, unit: Unit, source: UnitSource) -> String {
    let size = corners.map(extents).map_or_else(
        || format!(", unit {unit}"),
        |sides| format!(", {}", unit.size(sides)),
    );
    match source {
        UnitSource::Assumed => format!("{size} ({unit} assumed)"),
        _ => size,
    }
}

/// Lengths of the sides of a box.
pub(super) fn extents([low, high]: [[f64; 3]; 2]) -> [f64; 3] {
    [0, 1, 2].map(|k| high[k] - low[k])
}

/// The scan: its size, and what of it was ignored.
pub(super) fn scan(page: &mut Page, input: &Input) {
    let unit = input.unit;
    let size = sized(Some(input.bounding_box), unit, input.unit_source);
    let order = match (&*input.organisation, input.grid) {
        ("grid", Some([m, n])) => format!("grid of {m} x {n}"),
        (other, _) => other.to_owned(),
    };
    page.row(
        "scan",
        &format!(
            "{}: {}, {order}{size}",
            input.path,
            counted(input.points, "point", "points"),
        ),
    );
    if let Some(spacing) = input.spacing {
        let noise = match input.noise {
            Some(noise) if noise > 0.0 => format!(", noise {} (1 sigma)", unit.length(noise)),
            Some(_) => ", no noise".to_owned(),
            None => ", noise unknown".to_owned(),
        };
        page.row(
            "",
            &format!("point spacing {}{noise}", unit.length(spacing)),
        );
    }
    let ignored = input.points.saturating_sub(input.used);
    if ignored > 0 {
        let rejected = &input.rejected;
        let why = [
            (rejected.left_out, "in parts without a surface"),
            (rejected.outlier, "outliers"),
            (rejected.duplicate, "duplicates"),
            (rejected.non_finite, "not finite"),
        ];
        let why: Vec<String> = why
            .iter()
            .filter(|(n, _)| *n > 0)
            .map(|(n, why)| {
                let why = if *n == 1 {
                    why.trim_end_matches('s')
                } else {
                    why
                };
                format!("{} {why}", grouped(*n))
            })
            .collect();
        let share = ignored as f64 / input.points as f64;
        page.row(
            "ignored",
            &format!(
                "{} ({}): {}",
                counted(ignored, "point", "points"),
                percent(share),
                why.join(", ")
            ),
        );
    }
}

/// The deviation of the points.
pub(super) fn deviation(
    page: &mut Page,
    found: &DeviationSummary,
    tolerance: Option<f64>,
    within: Option<f64>,
    unit: Unit,
) {
    let d = &found.scan_to_surface;
    page.row(
        "deviation",
        &format!(
            "95 % of the points within {}, rms {}",
            length(unit, d.p95),
            length(unit, d.rms)
        ),
    );
    let worst = match found.worst.first() {
        Some(worst) => format!(
            "{} at {}",
            if length(unit, worst.deviation) == unit.length(0.0) {
                unit.length(0.0)
            } else {
                unit.signed_length(worst.deviation)
            },
            unit.place(worst.point)
        ),
        None => length(unit, d.max),
    };
    page.row("", &format!("worst {worst}"));
    if let (Some(tolerance), Some(share)) = (tolerance, d.within_tolerance) {
        let asked = within.map_or(String::new(), |share| {
            format!("; {} asked for", percent(share))
        });
        page.row(
            "",
            &format!(
                "{} of the points within the tolerance of {}{asked}",
                percent(share),
                unit.length(tolerance)
            ),
        );
    }
    if let Some(held) = &found.hold_out {
        page.row(
            "held out",
            &format!(
                "{}: 95 % within {}, worst {}",
                counted(held.count, "point", "points"),
                length(unit, held.p95),
                length(unit, held.max)
            ),
        );
    }
}

/// The verdict in a word, and its colour.
pub(super) fn word(verdict: Verdict) -> (&'static str, anstyle::Style) {
    match verdict {
        Verdict::Pass => ("pass", PASS),
        Verdict::Fail => ("FAIL", ERROR),
        Verdict::CannotTell => ("CANNOT TELL", WARNING),
        Verdict::NotAsked => ("not asked", anstyle::Style::new()),
    }
}

/// The verdict with its reasons, each with its place and one thing to do.
pub(super) fn verdict(
    page: &mut Page,
    verdict: Verdict,
    reason: &str,
    reasons: &[Reason],
    unit: Unit,
) {
    let (name, style) = word(verdict);
    let name = styled(style, name);
    let mut reasons = reasons.iter();
    let Some(first) = reasons.next() else {
        // Without a tolerance the figures that follow are those of the rows above.
        let said = match verdict {
            Verdict::NotAsked => reason.split(';').next().unwrap_or(reason),
            _ => reason,
        };
        page.row("verdict", &format!("{name}: {said}"));
        return;
    };
    page.row("verdict", &format!("{name}: {}", first.words(unit)));
    next(page, first);
    for reason in reasons {
        page.row("", &format!("and: {}", reason.words(unit)));
        next(page, reason);
    }
}

fn next(page: &mut Page, reason: &Reason) {
    if let Some(next) = &reason.next {
        page.row("", &format!("next: {next}"));
    }
}
