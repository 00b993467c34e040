//! `check`, `convert`, `info` and `view`, with the command's JSON as dictionaries.

use crate::cad::source_of;
use crate::deviation::loaded;
use crate::watch::watched;
use crate::words;
use nurbskin::pipeline::{self, ConvertOptions, Converted, Source, Target};
use pyo3::prelude::*;
use std::path::PathBuf;

/// Checks the quality of a CAD file.
#[pyfunction]
pub(crate) fn check<'py>(cad: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let (source, _) = source_of(cad)?;
    let found = watched(cad.py(), None, move |progress| {
        pipeline::check_from(&source, progress)
    })?;
    loaded(cad.py(), &found)
}

/// What is in a scan or a CAD file.
#[pyfunction]
pub(crate) fn info<'py>(file: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let (source, _) = source_of(file)?;
    let found = watched(file.py(), None, move |progress| {
        pipeline::info_from(&source, progress)
    })?;
    loaded(file.py(), &found)
}

/// Converts a scan or a CAD file.
#[pyfunction]
#[pyo3(signature = (file, outputs, tolerance=None, unit="auto", to_unit="auto", step_schema=None, author=None, organization=None))]
pub(crate) fn convert<'py>(
    file: &Bound<'py, PyAny>,
    outputs: Vec<PathBuf>,
    tolerance: Option<&Bound<'py, PyAny>>,
    unit: &str,
    to_unit: &str,
    step_schema: Option<&str>,
    author: Option<&str>,
    organization: Option<&str>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = file.py();
    let options = words::convert_options(
        py,
        tolerance,
        unit,
        to_unit,
        step_schema,
        author,
        organization,
    )?;
    loaded(py, &converted(file, outputs, options)?)
}

/// The conversion of any input.
pub(crate) fn converted(
    file: &Bound<'_, PyAny>,
    outputs: Vec<PathBuf>,
    options: ConvertOptions,
) -> PyResult<Converted> {
    let (source, on_disk) = source_of(file)?;
    watched(file.py(), None, move |progress| {
        let targets = Target::files(&outputs);
        // What is in memory came from a file that is not to be overwritten.
        let inputs: Vec<Source> = on_disk.iter().map(|f| Source::file(f.path())).collect();
        pipeline::check_targets(&inputs, &targets, &pipeline::CONVERT_FORMATS)?;
        pipeline::convert_from(&source, &targets, &options, progress)
    })
}

/// Writes a page of a scan or a CAD file, and tells where it is.
#[pyfunction]
#[pyo3(signature = (file, output=None))]
pub(crate) fn view(file: &Bound<'_, PyAny>, output: Option<PathBuf>) -> PyResult<PathBuf> {
    let (source, on_disk) = source_of(file)?;
    watched(file.py(), None, move |progress| {
        // A page has the checksum of a file.
        let unchanged = on_disk.as_ref().and_then(|f| f.unchanged());
        let source = unchanged.map_or(source, Source::file);
        let viewed = pipeline::view_from(&source, output.as_deref(), None, progress)?;
        Ok(viewed.output.path)
    })
}
