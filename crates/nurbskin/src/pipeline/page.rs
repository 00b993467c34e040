//! Reports as pages of HTML.

use super::Outcome;
use crate::progress::Progress;
use crate::report::{Kind, Measured, Source, Subject, document, page};
use crate::{Error, Result};
use std::path::Path;

/// The page of a fit of the scan in `input`.
///
/// # Errors
/// [`Error::Read`] if the scan is gone; [`Error::Cancelled`].
pub(super) fn page_of_fit(
    outcome: &Outcome,
    input: &Path,
    command: Option<&str>,
    progress: &dyn Progress,
) -> Result<String> {
    let per_point = &outcome.per_point;
    let subject = Subject {
        kind: Kind::Fit,
        title: &name_of(input),
        command,
        inputs: &[Source::of(input)?],
        outcome: &json_of(outcome)?,
        unit: outcome.input.unit,
        model: Some(&outcome.model),
        scan: Some(Measured {
            points: &per_point.points,
            indices: &per_point.indices,
            deviation: Some(&per_point.deviation),
            faces: &per_point.faces,
            held_out: &per_point.held_out,
            rejected: &outcome.rejected,
            spacing: outcome.input.spacing,
        }),
        triangles: None,
        origin: outcome.origin,
    };
    page(&document(&subject, progress)?)
}

/// The name of a file without its folder.
pub(super) fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// What a verb prints with `--json`.
pub(super) fn json_of(outcome: &impl serde::Serialize) -> Result<serde_json::Value> {
    serde_json::to_value(outcome)
        .map_err(|e| Error::invalid(format!("the figures cannot be put into JSON: {e}")))
}
