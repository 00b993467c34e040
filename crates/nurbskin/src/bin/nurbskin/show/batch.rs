//! Several scans in one run: a line for each, and a last line for all.

use super::text::{ERROR, LABEL, seconds, styled};
use super::{Show, measured, one_terminal};
use crate::failure::{Failure, Result};
use anstyle::Style;
use nurbskin::deviation::verdict::Verdict;
use nurbskin::pipeline::Outcome;
use nurbskin::unit::{UnitSource, grouped, percent};
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

/// A column: its title and least width, characters.
type Column = (&'static str, usize);

/// Of the scan.
const SCAN: [Column; 2] = [("scan", 4), ("unit", 10)];
/// Where a tolerance is asked for: it, and the share of the points within it.
const ASKED: [Column; 2] = [("tolerance", 9), ("within", 7)];
/// Where none is: the distance that 95 % of the points keep.
const ACHIEVED: [Column; 1] = [("95 %", 8)];
/// Of the result.
const RESULT: [Column; 3] = [("check", 5), ("verdict", 11), ("time", 6)];

/// The results of several scans, shown as they come.
#[derive(Debug)]
pub(crate) struct Batch {
    show: Show,
    start: Instant,
    columns: Vec<Column>,
    /// Whether a tolerance is asked for.
    asked: bool,
    list: Vec<Value>,
    written: usize,
    not_passed: usize,
    errors: usize,
}

impl Batch {
    /// Begins the table of these scans; `asked` says whether a tolerance is asked for.
    ///
    /// # Errors
    /// As [`print()`](super::print).
    pub(crate) fn new<'a>(
        show: Show,
        scans: impl Iterator<Item = &'a Path>,
        asked: bool,
    ) -> Result<Self> {
        let middle: &[Column] = if asked { &ASKED } else { &ACHIEVED };
        let mut columns = [&SCAN[..], middle, &RESULT].concat();
        let names = scans.map(|path| path.display().to_string().chars().count());
        if let Some((_, width)) = columns.first_mut() {
            *width = names.chain([*width]).max().unwrap_or(0);
        }
        let batch = Self {
            show,
            start: Instant::now(),
            columns,
            asked,
            list: Vec::new(),
            written: 0,
            not_passed: 0,
            errors: 0,
        };
        let titles = batch.columns.iter().map(|(title, _)| (*title).to_owned());
        let titles = batch.cells(titles.map(|title| (title, LABEL)));
        batch.line(&format!("{titles}{}", styled(LABEL, "output, reason")))?;
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
        let check = outcome.check.as_ref().map_or("-", |check| &*check.verdict);
        let (verdict, style) = measured::word(outcome.verdict);
        let plain = Style::new();
        let mut cells = vec![
            (input.path.clone(), plain),
            (format!("{unit}{assumed}"), plain),
        ];
        if self.asked {
            let tolerance = outcome.tolerance.map(|t| measured::length(unit, t));
            let within = d.within_tolerance.map(percent);
            cells.extend([tolerance, within].map(|cell| (cell.unwrap_or("-".into()), plain)));
        } else {
            cells.push((measured::length(unit, d.p95), plain));
        }
        let failed = if check == "fail" { ERROR } else { plain };
        cells.extend([
            (check.replace('_', " "), failed),
            (verdict.to_owned(), style),
            (seconds(outcome.time.total), plain),
        ]);
        let cells = self.cells(cells);
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
        let mut cells = vec![("-".to_owned(), Style::new()); self.columns.len()];
        if let Some(first) = cells.first_mut() {
            first.0 = path;
        }
        // The verdict is the last column but one.
        if let Some(cell) = cells.iter_mut().rev().nth(1) {
            *cell = ("error".to_owned(), ERROR);
        }
        let cells = self.cells(cells);
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
            n => format!(" ({} did not pass)", grouped(n)),
        };
        let errors = match self.errors {
            1 => "1 error".to_owned(),
            n => format!("{} errors", grouped(n)),
        };
        self.line(&format!(
            "{} written{not_passed}, {errors}, {}",
            grouped(self.written),
            seconds(time)
        ))?;
        Ok(match (self.errors, self.not_passed) {
            (0, 0) => crate::DONE,
            (0, _) => crate::NOT_PASSED,
            _ => crate::ERROR,
        })
    }

    /// Cells in their columns, each in its style.
    fn cells(&self, cells: impl IntoIterator<Item = (String, Style)>) -> String {
        let padded = cells.into_iter().zip(&self.columns);
        let padded = padded.map(|((cell, style), (_, width))| {
            // A cell is one word to what breaks lines.
            let cell = cell.replace(' ', "\u{a0}");
            let gap = width.saturating_sub(cell.chars().count());
            format!("{}{}  ", styled(style, &cell), " ".repeat(gap))
        });
        padded.collect()
    }

    fn line(&self, text: &str) -> Result<()> {
        let mut page = self.show.page();
        page.line(text);
        self.show.result(page)
    }
}
