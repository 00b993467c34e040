//! Deviations of scans from CAD files.

use crate::cad::source_of;
use crate::errors::Raised;
use crate::measurement::{Found, Measurement};
use crate::phrases;
use crate::watch::watched;
use crate::words;
use numpy::{IntoPyArray, PyArrayMethods};
use nurbskin::pipeline::{self, Compared, DeviationOptions, Length};
use pyo3::prelude::*;
use std::sync::Arc;

/// A :class:`Measurement` of a scan against a CAD model: what :func:`deviation` returns.
#[pyclass(module = "nurbskin", extends = Measurement, frozen)]
pub(crate) struct Comparison {
    compared: Arc<Compared>,
}

/// Measures the deviation of a scan from a CAD model.
#[pyfunction]
#[pyo3(signature = (scan, cad, tolerance=None, within=None, min_coverage=None, align=false, unit="auto", progress=None))]
pub(crate) fn deviation(
    scan: &Bound<'_, PyAny>,
    cad: &Bound<'_, PyAny>,
    tolerance: Option<&Bound<'_, PyAny>>,
    within: Option<&Bound<'_, PyAny>>,
    min_coverage: Option<&Bound<'_, PyAny>>,
    align: bool,
    unit: &str,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Py<Comparison>> {
    let py = scan.py();
    let ((scan, scan_file), (cad, cad_file)) = (source_of(scan)?, source_of(cad)?);
    let tolerance = tolerance.map(|t| words::parsed::<Length>("tolerance", t));
    let share = |name, value: Option<&Bound<'_, PyAny>>| {
        value.map(|value| words::share(name, value)).transpose()
    };
    let options = DeviationOptions {
        tolerance: tolerance.transpose()?,
        within: share("within", within)?,
        min_coverage: share("min_coverage", min_coverage)?,
        unit: words::word("unit", unit).or_raise(py)?,
        align,
        ..DeviationOptions::default()
    };
    let compared = watched(py, progress, move |progress| {
        let mut compared = pipeline::deviation_from(&scan, &cad, &options, progress)?;
        phrases::translate_comparison(&mut compared);
        Ok(compared)
    })?;
    let compared = Arc::new(compared);
    let found = Found::Comparison(Arc::clone(&compared));
    let files = scan_file.into_iter().chain(cad_file).collect();
    let measurement = PyClassInitializer::from(Measurement::new(found, files));
    Py::new(py, measurement.add_subclass(Comparison { compared }))
}

#[pymethods]
impl Comparison {
    /// The rigid motion that moved the scan to where it fits best, a (4, 4) matrix for columns ``(x, y, z, 1)``; None where it
    /// was not aligned.
    #[getter]
    fn alignment<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(found) = &self.compared.alignment else {
            return Ok(None);
        };
        let mut rows = found.matrix.as_flattened().to_vec();
        rows.extend([0.0, 0.0, 0.0, 1.0]);
        Ok(Some(rows.into_pyarray(py).reshape([4, 4])?.into_any()))
    }

    fn _repr_html_<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let picture = this.py().import("nurbskin._picture")?;
        picture.call_method1("comparison_to_html", (this,))
    }

    fn __repr__(this: PyRef<'_, Self>) -> String {
        let verdict = this.compared.verdict.name();
        format!("Comparison({verdict}: {})", this.as_super().figures())
    }
}
