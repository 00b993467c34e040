//! HTML reports of fits and deviations.
//!
//! Collects the result of a verb as a [`Subject`](crate::report::Subject) and passes it to [`crate::report`], which
//! creates the page.

use super::networks::kinds;
use super::{Compared, Heading, Outcome, PerPoint};
use crate::report::{Document, Kind, Measured, Subject, document, page};
use nurbskin_cad::io::Timestamp;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result};
use std::path::Path;

/// The page of a fit: one HTML file that works offline, with name and hash of the `input` file, if there is one.
///
/// # Errors
/// [`Error::Read`] if the scan no longer exists; [`Error::Invalid`] if `SOURCE_DATE_EPOCH` is no date;
/// [`Error::Cancelled`].
pub fn page_of_fit(
    outcome: &Outcome,
    input: Option<&Path>,
    command: Option<&str>,
    progress: &dyn Progress,
) -> Result<String> {
    let source = input.map(super::Source::file);
    let about = About {
        command,
        ..About::now()?
    };
    page_of_source(outcome, source.as_ref(), about, progress)
}

/// What a page says about its making.
#[derive(Clone, Copy, Debug)]
pub struct About<'a> {
    /// Title and notes.
    pub heading: &'a Heading,
    /// The command line.
    pub command: Option<&'a str>,
    /// The date.
    pub date: Timestamp,
}

impl About<'static> {
    /// No heading and no command, at the date of [`Timestamp::now`].
    ///
    /// # Errors
    /// [`Error::Invalid`] if `SOURCE_DATE_EPOCH` is no date.
    pub fn now() -> Result<Self> {
        const PLAIN: &Heading = &Heading {
            title: None,
            notes: Vec::new(),
        };
        Ok(Self {
            heading: PLAIN,
            command: None,
            date: Timestamp::now()?,
        })
    }
}

/// [`page_of_fit`] for any source of a scan.
pub(super) fn page_of_source(
    outcome: &Outcome,
    input: Option<&super::Source>,
    about: About,
    progress: &dyn Progress,
) -> Result<String> {
    page(&document_of_fit(outcome, input, about, progress)?)
}

/// The data of the page of a fit, for [`page`](crate::report::page()) or for another viewer; with name and hash of the
/// `input`, if there is one.
///
/// # Errors
/// As [`page_of_fit`].
pub fn document_of_fit(
    outcome: &Outcome,
    input: Option<&super::Source>,
    About {
        heading,
        command,
        date,
    }: About,
    progress: &dyn Progress,
) -> Result<Document> {
    let name = |input: &super::Source| name_of(input.path());
    let kinds = kinds(&outcome.edges);
    let subject = Subject {
        kind: Kind::Fit,
        title: &input.map_or_else(|| outcome.input.path.clone(), name),
        command,
        heading: Some(heading),
        date: Some(date),
        inputs: &input
            .map(super::Source::identity)
            .transpose()?
            .flatten()
            .into_iter()
            .collect::<Vec<_>>(),
        outcome: &json_of(outcome)?,
        unit: outcome.input.unit,
        model: Some(&outcome.model),
        kinds: (!kinds.is_empty()).then_some(&kinds[..]),
        scan: Some(measured(&outcome.per_point, outcome.input.spacing)),
        triangles: None,
        origin: outcome.origin,
    };
    document(&subject, progress)
}

/// The page of the deviation of a scan from a CAD file, with name and hash of those of the `inputs` that are files.
///
/// # Errors
/// As [`page_of_fit`].
pub fn page_of_deviation(
    compared: &Compared,
    inputs: &[super::Source],
    about: About,
    progress: &dyn Progress,
) -> Result<String> {
    page(&document_of_deviation(compared, inputs, about, progress)?)
}

/// The data of the page of a comparison, with name and hash of those of the `inputs` that are files.
///
/// # Errors
/// As [`page_of_fit`].
pub fn document_of_deviation(
    compared: &Compared,
    inputs: &[super::Source],
    About {
        heading,
        command,
        date,
    }: About,
    progress: &dyn Progress,
) -> Result<Document> {
    let names = [&compared.input.path, &compared.cad.path];
    let [scan, cad] = names.map(|path| name_of(Path::new(path)));
    let hashed: Result<Vec<_>> = inputs.iter().map(super::Source::identity).collect();
    let subject = Subject {
        kind: Kind::Deviation,
        title: &format!("{scan} against {cad}"),
        command,
        heading: Some(heading),
        date: Some(date),
        inputs: &hashed?.into_iter().flatten().collect::<Vec<_>>(),
        outcome: &json_of(compared)?,
        unit: compared.input.unit,
        model: Some(&compared.model),
        kinds: None,
        scan: Some(measured(&compared.per_point, compared.input.spacing)),
        triangles: None,
        origin: compared.origin,
    };
    document(&subject, progress)
}

/// The points of a fit or a comparison as a report takes them.
#[must_use]
pub fn measured(points: &PerPoint, spacing: Option<f64>) -> Measured<'_> {
    Measured {
        points: &points.points,
        indices: &points.indices,
        deviation: Some(&points.deviation),
        held_out: &points.held_out,
        triangles: &points.triangles,
        unused: &points.unused,
        records: Some(&points.records),
        spacing: spacing.unwrap_or(0.0),
    }
}

/// The name of a file without its folder.
pub(super) fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// The JSON of a verb.
pub(super) fn json_of(outcome: &impl serde::Serialize) -> Result<serde_json::Value> {
    serde_json::to_value(outcome)
        .map_err(|e| Error::invalid(format!("the figures cannot be put into JSON: {e}")))
}
