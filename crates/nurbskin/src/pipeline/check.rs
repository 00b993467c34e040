//! Product-data quality of a CAD file, and that it reads back.

use super::reads_back::difference;
use super::{Outcome, Output, SCHEMA, Source};
use crate::cad::check::{self, Check};
use crate::io::cad::{CadFormat, CadWriteOptions, cad_text};
use crate::progress::Progress;
use crate::{DVec3, Result, Unit};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::Path;

/// What was found in a CAD file. Lengths are in its unit.
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
    /// `pass` if every check does and the file reads back, else `fail`.
    pub verdict: &'static str,
    /// Each with what was measured, its limit and the worst place.
    pub checks: Vec<Check>,
    /// Whether the model, written in the same format and read again, is the same: faces, edges, curves and, in STEP,
    /// shells, numbers to the last bit.
    pub reads_back: bool,
    /// What differs where it does not read back.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub differs: Option<String>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Checks the CAD file at `path`.
///
/// # Errors
/// Those of reading.
pub fn check(path: &Path, progress: &dyn Progress) -> Result<Checked> {
    check_from(&Source::file(path), progress)
}

/// As [`check`], of a file or of bytes.
///
/// # Errors
/// As [`check`].
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
        warnings.push(format!(
            "{count} of {entity} are not understood and not checked"
        ));
    }
    let report = check::check(&file.model);
    warnings.extend(report.skipped.iter().cloned());
    let text = cad_text(&file.model, format, &CadWriteOptions::default());
    let differs = match text {
        Ok(text) => difference(&text, path, &file.model, DVec3::ZERO),
        Err(error) => Some(error.to_string()),
    };
    let reads_back = differs.is_none();
    let passes = reads_back && report.pass();
    Ok(Checked {
        nurbskin: env!("CARGO_PKG_VERSION"),
        schema: SCHEMA,
        path: path.display().to_string(),
        format: file.format,
        unit: file.model.unit,
        faces: file.model.faces().len(),
        verdict: if passes { "pass" } else { "fail" },
        checks: report.checks,
        reads_back,
        differs,
        warnings,
    })
}

/// What the checks say of the files that a fit wrote.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitCheck {
    /// `pass` if every check does and every file reads back, else `fail`.
    pub verdict: Cow<'static, str>,
    /// Whether every CAD file reads back to the model that was written, as in [`Checked`].
    pub reads_back: bool,
    /// Each check with what was measured, its limit and the worst place.
    pub checks: Vec<Check>,
    /// The result, a sentence.
    #[serde(skip)]
    pub said: String,
}

/// Checks the CAD files among the outputs of a fit; `None` where there are none.
///
/// # Errors
/// [`Error::Read`](crate::Error::Read) if one is gone.
pub(super) fn check_outputs_of(outcome: &Outcome, exact: bool) -> Result<Option<FitCheck>> {
    let is_cad = |output: &&Output| output.format == "step" || output.format == "iges";
    let files: Vec<&Output> = outcome.outputs.iter().filter(is_cad).collect();
    if files.is_empty() {
        return Ok(None);
    }
    let mut differs = None;
    for output in &files {
        // The paper's layout has six decimals.
        if exact || output.format == "step" {
            let text = match &output.content {
                Some(content) => Cow::Borrowed(content),
                None => Cow::Owned(crate::io::read_file(&output.path)?),
            };
            let found = difference(&text, &output.path, &outcome.model, outcome.origin);
            differs = differs.or(found);
        }
    }
    let report = check::check(&outcome.model);
    let failed: Vec<&Check> = report.checks.iter().filter(|check| !check.pass).collect();
    let passes = differs.is_none() && report.pass();
    let said = if passes {
        format!(
            "pass: {} checks, and the file reads back the same",
            report.checks.len()
        )
    } else {
        let failed = failed.iter().map(|check| {
            format!(
                "{} is {:.3e} {} (limit {})",
                check.name, check.measured, check.unit, check.limit
            )
        });
        let mut all: Vec<String> = failed.chain(report.skipped.iter().cloned()).collect();
        all.extend(
            differs
                .iter()
                .map(|why| format!("the file does not read back the same: {why}")),
        );
        format!("fail: {}", all.join("; "))
    };
    Ok(Some(FitCheck {
        verdict: Cow::Borrowed(if passes { "pass" } else { "fail" }),
        reads_back: differs.is_none(),
        checks: report.checks,
        said,
    }))
}
