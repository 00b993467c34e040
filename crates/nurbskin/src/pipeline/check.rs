//! Product-data quality of a CAD file, and that it reads back.

use super::{Outcome, Output};
use crate::cad::check::{self, Check};
use crate::cad::{Face, Model};
use crate::io::cad::{CadFormat, CadWriteOptions, cad_text, read_cad, read_cad_bytes};
use crate::progress::Progress;
use crate::{DVec3, Result, Unit};
use serde::Serialize;
use std::path::Path;

/// What was found in a CAD file. Lengths are in its unit.
#[derive(Clone, Debug, Serialize)]
pub struct Checked {
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
    /// Whether the model, written in the same format and read again, is the same to the last bit of every number.
    pub reads_back: bool,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Checks the CAD file at `path`.
///
/// # Errors
/// Those of reading.
pub fn check(path: &Path, progress: &dyn Progress) -> Result<Checked> {
    progress.stage("read", None);
    let file = read_cad(path)?;
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
    let reads_back = text.is_ok_and(|text| reads_back(&text, path, &file.model, DVec3::ZERO));
    let passes = reads_back && report.pass();
    Ok(Checked {
        path: path.display().to_string(),
        format: file.format,
        unit: file.model.unit,
        faces: file.model.faces().len(),
        verdict: if passes { "pass" } else { "fail" },
        checks: report.checks,
        reads_back,
        warnings,
    })
}

/// What the checks say of the files that a fit wrote.
#[derive(Clone, Debug, Serialize)]
pub struct FitCheck {
    /// `pass` if every check does and every file reads back, else `fail`.
    pub verdict: &'static str,
    /// Whether every CAD file reads back to the model that was written, to the last bit of its surfaces.
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
    let mut back = true;
    for output in &files {
        // The paper's layout has six decimals.
        if exact || output.format == "step" {
            let text = crate::io::read_file(&output.path)?;
            back &= reads_back(&text, &output.path, &outcome.model, outcome.origin);
        }
    }
    let report = check::check(&outcome.model);
    let failed: Vec<&Check> = report.checks.iter().filter(|check| !check.pass).collect();
    let passes = back && report.pass();
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
        if !back {
            all.push("the file does not read back the same".into());
        }
        format!("fail: {}", all.join("; "))
    };
    Ok(Some(FitCheck {
        verdict: if passes { "pass" } else { "fail" },
        reads_back: back,
        checks: report.checks,
        said,
    }))
}

/// Whether the text of a CAD file, read again, has the same faces as a model moved by `origin`: as many, on the same
/// surfaces to the last bit, with loops of as many edges.
pub(super) fn reads_back(text: &[u8], path: &Path, model: &Model, origin: DVec3) -> bool {
    let Ok(again) = read_cad_bytes(text, path) else {
        return false;
    };
    let (ours, theirs) = (model.faces(), again.model.faces());
    let moved = |p: DVec3| if origin == DVec3::ZERO { p } else { p + origin };
    if ours.len() != theirs.len() || model.unit != again.model.unit {
        return false;
    }
    // The order of faces is the format's own.
    let mut open: Vec<&Face> = theirs.iter().collect();
    ours.iter().all(|ours| {
        let Ok(surface) = ours.surface.map_points(moved) else {
            return false;
        };
        // IGES has no faces that look against their surface: it is transposed.
        let turned = ours.reversed.then(|| surface.transposed());
        let same = |theirs: &&Face| {
            let as_it_is = surface == theirs.surface;
            let as_turned = !theirs.reversed && turned.as_ref() == Some(&theirs.surface);
            (as_it_is || as_turned) && ours.loops.len() == theirs.loops.len()
        };
        match open.iter().position(same) {
            Some(at) => {
                open.remove(at);
                true
            }
            None => false,
        }
    })
}
