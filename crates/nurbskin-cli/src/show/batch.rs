//! Several scans in one run: a line for each, and a last line for all.

use super::text::{ERROR, LABEL, count, per_cent, seconds, styled};
use super::{Show, measured, one_terminal};
use crate::failure::{Failure, Result};
use nurbskin::deviation::verdict::Verdict;
use nurbskin::pipeline::Outcome;
use nurbskin::unit::UnitSource;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

/// Columns: scan, unit, tolerance, share within it, 95 % of the points, check, verdict, seconds.
const TITLES: [&str; 8] = [
    "scan",
    "unit",
    "tolerance",
    "within",
    "95 %",
    "check",
    "verdict",
    "time",
];
/// Least widths of these, characters.
const WIDTHS: [usize; 8] = [4, 10, 9, 7, 8, 7, 11, 6];

/// The results of several scans, shown as they come.
#[derive(Debug)]
pub(crate) struct Batch {
    show: Show,
    start: Instant,
    widths: [usize; 8],
    list: Vec<Value>,
    written: usize,
    not_passed: usize,
    errors: usize,
}

impl Batch {
    /// Begins the table of these scans.
    ///
    /// # Errors
    /// As [`print()`](super::print).
    pub(crate) fn new<'a>(show: Show, scans: impl Iterator<Item = &'a Path>) -> Result<Self> {
        let mut widths = WIDTHS;
        let names = scans.map(|path| path.display().to_string().chars().count());
        widths[0] = names.chain([widths[0]]).max().unwrap_or(0);
        let batch = Self {
            show,
            start: Instant::now(),
            widths,
            list: Vec::new(),
            written: 0,
            not_passed: 0,
            errors: 0,
        };
        let titles = batch.cells(&TITLES.map(str::to_owned));
        batch.line(&styled(LABEL, &format!("{titles}output, reason")))?;
        Ok(batch)
    }

    /// A scan that was fitted; `told` are warnings that were told while it was.
    ///
    /// # Errors
    /// As [`print()`](super::print).
    pub(crate) fn fitted(&mut self, outcome: &Outcome, told: &[String]) -> Result<()> {
        self.written += 1;
        self.not_passed += usize::from(!outcome.verdict.is_good());
        self.list.push(serde_json::to_value(outcome)?);
        let input = &outcome.input;
        let unit = input.unit;
        self.show
            .outcome_warnings(outcome, told, &format!("{}: ", input.path));
        let assumed = match input.unit_source {
            UnitSource::Assumed => " assumed",
            _ => "",
        };
        let d = &outcome.deviation.scan_to_surface;
        let tolerance = outcome.tolerance;
        let check = outcome.check.as_ref();
        let (verdict, style) = measured::word(outcome.verdict);
        let cells = self.cells(&[
            input.path.clone(),
            format!("{unit}{assumed}"),
            tolerance.map_or("-".into(), |t| unit.length(t)),
            d.within_tolerance.map_or("-".into(), per_cent),
            unit.length(d.p95),
            check.map_or("-".into(), |check| check.verdict.replace('_', " ")),
            verdict.to_owned(),
            seconds(outcome.time.total),
        ]);
        let cells = cells.replacen(verdict, &styled(style, verdict), 1);
        let outputs: Vec<String> = outcome
            .outputs
            .iter()
            .map(|output| {
                let note = if output.replaced { " (replaced)" } else { "" };
                format!("{}{note}", output.path.display())
            })
            .collect();
        let reason = match outcome.verdict {
            Verdict::Pass | Verdict::NotAsked => String::new(),
            _ => format!("; {}", outcome.reason),
        };
        self.line(&format!("{cells}{}{reason}", outputs.join(", ")))
    }

    /// A scan that could not be fitted.
    ///
    /// # Errors
    /// As [`print()`](super::print).
    pub(crate) fn failed(&mut self, path: &Path, failure: &Failure) -> Result<()> {
        self.errors += 1;
        let path = path.display().to_string();
        self.list
            .push(json!({ "input": { "path": path }, "error": failure.json() }));
        // Where both are seen in one place the line of the table is enough.
        if self.show.quiet || self.show.json || !one_terminal() {
            self.show.error(failure);
        }
        let mut cells = ["-"; 8].map(str::to_owned);
        cells[0] = path;
        cells[6] = "error".into();
        let cells = self.cells(&cells);
        let cells = cells.replacen(" error ", &format!(" {} ", styled(ERROR, "error")), 1);
        self.line(&format!("{cells}{failure}"))
    }

    /// Ends the table; the worst exit status.
    ///
    /// # Errors
    /// As [`print()`](super::print).
    pub(crate) fn finish(self) -> Result<u8> {
        let time = self.start.elapsed().as_secs_f64();
        self.show.json(&json!({
            "scans": self.list,
            "summary": {
                "scans": self.list.len(), "written": self.written, "not_passed": self.not_passed, "errors": self.errors,
                "time": time,
            },
        }))?;
        let not_passed = match self.not_passed {
            0 => String::new(),
            n => format!(" ({} did not pass)", count(n)),
        };
        let errors = match self.errors {
            1 => "1 error".to_owned(),
            n => format!("{} errors", count(n)),
        };
        self.line(&format!(
            "{} written{not_passed}, {errors}, {}",
            count(self.written),
            seconds(time)
        ))?;
        Ok(match (self.errors, self.not_passed) {
            (0, 0) => crate::DONE,
            (0, _) => crate::NOT_PASSED,
            _ => crate::ERROR,
        })
    }

    fn cells(&self, cells: &[String; 8]) -> String {
        let padded = cells.iter().zip(self.widths).map(|(cell, width)| {
            // A cell is one word to the setter of lines.
            let cell = cell.replace(' ', "\u{a0}");
            let gap = width.saturating_sub(cell.chars().count());
            format!("{cell}{}  ", " ".repeat(gap))
        });
        padded.collect()
    }

    fn line(&self, text: &str) -> Result<()> {
        let mut page = self.show.page();
        page.line(text);
        self.show.result(page)
    }
}
