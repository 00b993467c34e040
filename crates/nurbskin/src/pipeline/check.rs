//! Product-data quality of a CAD file, and its round trip through the reader.
//!
//! The check reads the file, runs the quality checks of [`nurbskin_cad`] and compares the model with the file read
//! again. `nurbskin check` reports the result; a fit runs the same check on its output, and the worse verdict counts.

use super::defects::reasons;
use super::networks::kinds;
use super::reads_back::difference;
use super::{Outcome, Output, SCHEMA, Source};
use crate::deviation::verdict::Reason;
use nurbskin_cad::check::{self, Check};
use nurbskin_cad::io::file::{CadFormat, CadWriteOptions, cad_text};
use nurbskin_cad::{JumpSummary, Meant};
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::counted;
use nurbskin_geometry::{DVec3, Result, Unit};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::Path;

/// The findings on a CAD file. Lengths are in its unit.
#[derive(Clone, Debug, Serialize)]
pub struct Checked {
    /// Version of the library.
    pub nurbskin: &'static str,
    /// Version of this JSON: [`SCHEMA`](super::SCHEMA).
    pub schema: u32,
    /// Its path.
    pub path: String,
    /// Its format.
    pub format: &'static str,
    /// Unit of the lengths.
    pub unit: Unit,
    /// Number of faces.
    pub faces: usize,
    /// `fail` if a check fails or the file does not read back, `not_checked` if a check could not run, else `pass`.
    pub verdict: &'static str,
    /// The failed checks in words.
    pub reasons: Vec<Reason>,
    /// Each check with the measured value, the limit and the worst place.
    pub checks: Vec<Check>,
    /// Angles between normals across the edges that are meant to be smooth, in degrees.
    pub normal_jump: JumpSummary,
    /// The checks that could not run, one sentence each.
    pub not_checked: Vec<String>,
    /// Whether the model, written in the same format and read again, is identical: faces, edges, curves and, in STEP,
    /// shells; numbers to the last bit.
    pub reads_back: bool,
    /// The differences where it does not read back.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub differs: Option<String>,
    /// Warnings: findings that affect the result.
    pub warnings: Vec<String>,
}

/// Checks the CAD file at `path`.
///
/// # Errors
/// Errors of the reader.
pub fn check(path: &Path, progress: &dyn Progress) -> Result<Checked> {
    check_from(&Source::file(path), progress)
}

/// As [`check()`], for a file or for bytes.
///
/// # Errors
/// As [`check()`].
pub fn check_from(source: &Source, progress: &dyn Progress) -> Result<Checked> {
    let path = source.path();
    progress.stage("read", None);
    let file = source.read_cad()?;
    progress.check()?;
    progress.stage("check", None);
    let format = if file.format == CadFormat::Step.name() {
        CadFormat::Step
    } else {
        CadFormat::Iges
    };
    let mut warnings = file.warnings;
    for (entity, count) in &file.unread {
        let entities = counted(*count, "entity", "entities");
        warnings.push(format!(
            "{entities} of type {entity} not read, and so not checked"
        ));
    }
    let report = check::check(&file.model);
    let text = cad_text(&file.model, format, &CadWriteOptions::default());
    let differs = match text {
        Ok(text) => difference(&text, path, &file.model, DVec3::ZERO),
        Err(error) => Some(error.to_string()),
    };
    let reads_back = differs.is_none();
    let unit = file.model.unit;
    let mut found = reasons(&report, unit, DVec3::ZERO, false);
    found.extend(differs.as_deref().map(not_the_same));
    Ok(Checked {
        nurbskin: env!("CARGO_PKG_VERSION"),
        schema: SCHEMA,
        path: path.display().to_string(),
        format: file.format,
        unit,
        faces: file.model.faces().len(),
        verdict: verdict_of(&found, &report.skipped),
        reasons: found,
        checks: report.checks,
        normal_jump: report.normal_jump,
        not_checked: report.skipped,
        reads_back,
        differs,
        warnings,
    })
}

/// The message for a file that does not contain the model it was written from.
fn not_the_same(why: &str) -> Reason {
    Reason::new(format!("the file does not read back the same: {why}"))
}

/// `fail`, `not_checked` or `pass`.
fn verdict_of(failed: &[Reason], skipped: &[String]) -> &'static str {
    match (failed, skipped) {
        ([], []) => "pass",
        ([], _) => NOT_CHECKED,
        _ => "fail",
    }
}

/// The verdict if no check failed and at least one could not run.
const NOT_CHECKED: &str = "not_checked";

/// Result of the checks on the files written by a fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitCheck {
    /// `fail` if a check fails or a file does not read back, `not_checked` if a check could not run, else `pass`.
    pub verdict: Cow<'static, str>,
    /// Whether every CAD file reads back to the written model, as in [`Checked`].
    pub reads_back: bool,
    /// The failed checks in words; they are among the reasons of the outcome.
    pub reasons: Vec<Reason>,
    /// The checks that could not run, one sentence each.
    pub not_checked: Vec<String>,
    /// Each check with the measured value, the limit and the worst place, in the scan's coordinates.
    pub checks: Vec<Check>,
    /// The result in one sentence.
    #[serde(skip)]
    pub said: String,
}

/// Checks the CAD files among the outputs of a fit. The verdict of the outcome becomes the worse of its own and that of
/// the checks. Does nothing if there are no CAD files.
///
/// # Errors
/// [`Error::Read`](nurbskin_geometry::Error::Read) if a file no longer exists.
pub(super) fn check_outputs_of(outcome: &mut Outcome, exact: bool) -> Result<()> {
    let is_cad = |output: &&Output| output.format == "step" || output.format == "iges";
    let files: Vec<&Output> = outcome.outputs.iter().filter(is_cad).collect();
    if files.is_empty() {
        return Ok(());
    }
    let mut differs = None;
    for output in &files {
        // The paper's layout has six decimals.
        if exact || output.format == "step" {
            let text = match &output.content {
                Some(content) => Cow::Borrowed(content),
                None => Cow::Owned(nurbskin_geometry::files::read_file(&output.path)?),
            };
            let found = difference(&text, &output.path, &outcome.model, outcome.origin);
            differs = differs.or(found);
        }
    }
    judge(outcome, differs);
    Ok(())
}

/// Checks the surfaces of a fit without a CAD output, as the STEP file that would be written. The verdict of the
/// outcome then equals that of [`fit`](super::fit()) with an output.
///
/// # Errors
/// [`Error::Cancelled`](nurbskin_geometry::Error::Cancelled).
pub fn check_fitted(outcome: &mut Outcome, progress: &dyn Progress) -> Result<()> {
    progress.stage("check", None);
    progress.check()?;
    let options = CadWriteOptions {
        origin: outcome.origin,
        ..CadWriteOptions::default()
    };
    let differs = match cad_text(&outcome.model, CadFormat::Step, &options) {
        Ok(text) => difference(
            &text,
            Path::new("surface.step"),
            &outcome.model,
            outcome.origin,
        ),
        Err(error) => Some(error.to_string()),
    };
    judge(outcome, differs);
    progress.check()
}

/// Checks the model of an outcome and makes its verdict the worse of both; `differs` gives the difference found by
/// reading a file of the model back.
fn judge(outcome: &mut Outcome, differs: Option<String>) {
    let kinds = kinds(&outcome.edges);
    let mut report = check::check_meant(&outcome.model, Meant::Kinds(&kinds));
    let mut failed = reasons(&report, outcome.input.unit, outcome.origin, true);
    failed.extend(differs.as_deref().map(not_the_same));
    for place in report.checks.iter_mut().filter_map(|c| c.where_.as_mut()) {
        *place += outcome.origin;
    }
    let verdict = verdict_of(&failed, &report.skipped);
    let said = match verdict {
        "pass" => format!(
            "{} passed, and the file reads back the same",
            counted(report.checks.len(), "check", "checks")
        ),
        NOT_CHECKED => format!("not checked: {}", report.skipped.join("; ")),
        _ => {
            let words = failed.iter().map(|reason| reason.words(outcome.input.unit));
            let words: Vec<String> = words.collect();
            format!("fail: {}", words.join("; "))
        }
    };
    outcome.set_check(FitCheck {
        verdict: Cow::Borrowed(verdict),
        reads_back: differs.is_none(),
        reasons: failed,
        not_checked: report.skipped,
        checks: report.checks,
        said,
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deviation::verdict::Verdict;
    use crate::pipeline::{Options, fit_scan};
    use nurbskin_geometry::progress::Silent;
    use nurbskin_scan::{GridLayout, Organisation, Scan};

    #[test]
    fn what_could_not_be_checked_has_not_failed() {
        let failed = [Reason::new("an edge is too short")];
        let skipped = ["folds: the faces are too fine".to_owned()];
        assert_eq!(verdict_of(&[], &[]), "pass");
        assert_eq!(verdict_of(&[], &skipped), "not_checked");
        assert_eq!(verdict_of(&failed, &skipped), "fail");
        let point = |k: i32| DVec3::new(f64::from(k % 12), f64::from(k / 12), 0.0);
        let scan = Scan {
            points: (0..144).map(point).collect(),
            organisation: Organisation::Grid(GridLayout::complete(12, 12).unwrap()),
            ..Scan::default()
        };
        let mut outcome = fit_scan(scan, "plane", &Options::default(), &Silent).unwrap();
        let check = |reasons: &[Reason]| FitCheck {
            verdict: verdict_of(reasons, &skipped).into(),
            reads_back: true,
            reasons: reasons.to_vec(),
            not_checked: skipped.to_vec(),
            checks: Vec::new(),
            said: String::new(),
        };
        outcome.set_check(check(&[]));
        assert_eq!(outcome.verdict, Verdict::NotAsked);
        assert!(
            outcome
                .warnings
                .contains(&"not checked: folds: the faces are too fine".to_owned())
        );
        // A failed check is final, however often it is repeated.
        for _ in 0..2 {
            outcome.set_check(check(&failed));
            assert_eq!(outcome.verdict, Verdict::Fail);
            assert_eq!(outcome.reasons, failed);
            assert_eq!(outcome.reason, "an edge is too short");
        }
        // The reasons of the fit keep their places.
        let later = Reason::new("the points are few");
        outcome.reasons.push(later.clone());
        outcome.set_check(check(&failed));
        assert_eq!(outcome.reasons, [failed.to_vec(), vec![later]].concat());
    }

    #[test]
    fn a_surface_that_was_not_written_is_checked_as_the_file_would_be() {
        let point = |k: i32| DVec3::new(f64::from(k % 12), f64::from(k / 12), 0.0);
        let scan = Scan {
            points: (0..144).map(point).collect(),
            organisation: Organisation::Grid(GridLayout::complete(12, 12).unwrap()),
            origin: DVec3::new(1e6, 0.0, 0.0),
            ..Scan::default()
        };
        let mut outcome = fit_scan(scan, "plane", &Options::default(), &Silent).unwrap();
        assert_eq!(outcome.check, None);
        check_fitted(&mut outcome, &Silent).unwrap();
        let check = outcome.check.clone().unwrap();
        assert_eq!((&*check.verdict, check.reads_back), ("pass", true));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plane.step");
        crate::pipeline::write(&mut outcome, None, &[path], &Options::default(), &Silent).unwrap();
        assert_eq!(outcome.check, Some(check));
        assert_eq!(outcome.verdict, Verdict::NotAsked);
    }
}
