//! Fits and what they produced.

use crate::arrays;
use crate::deviation::{Deviation, loaded};
use crate::errors::Raised;
use crate::scan::Scan;
use crate::surface::Surface;
use crate::watch::watched;
use crate::words;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use nurbskin::cad::ClosestOnModel;
use nurbskin::deviation::measure::{Deviation as Measured, measure_model};
use nurbskin::pipeline::{self, Options, Outcome};
use nurbskin::{DVec3, NurbsSurface};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;

/// What a fit produced and measured.
#[pyclass(name = "Result", module = "nurbskin", frozen, weakref)]
pub(crate) struct FitResult {
    outcome: Outcome,
    /// The file that was fitted, if it was one.
    path: Option<PathBuf>,
}

/// Fits a surface to a scan.
#[pyfunction]
#[pyo3(signature = (scan, progress=None, **options))]
pub(crate) fn fit(
    py: Python<'_>,
    scan: &Bound<'_, Scan>,
    progress: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<FitResult> {
    let options = options_of(options)?;
    let scan = scan.get();
    let outcome = watched(py, progress, |progress| {
        pipeline::fit_scan((*scan.scan).clone(), &scan.name(), &options, progress)
    })?;
    Ok(FitResult {
        outcome,
        path: scan.path.clone(),
    })
}

/// Fits a surface to the scan in a file.
#[pyfunction]
#[pyo3(signature = (path, progress=None, **options))]
pub(crate) fn fit_file(
    py: Python<'_>,
    path: PathBuf,
    progress: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<FitResult> {
    let options = options_of(options)?;
    let outcome = watched(py, progress, |progress| {
        pipeline::fit(&path, &[], &options, progress)
    })?;
    Ok(FitResult {
        outcome,
        path: Some(path),
    })
}

fn options_of(keywords: Option<&Bound<'_, PyDict>>) -> PyResult<Options> {
    keywords.map_or_else(|| Ok(Options::default()), words::options)
}

impl FitResult {
    /// A surface in the coordinates of the scan.
    fn placed(&self, py: Python<'_>, surface: &NurbsSurface) -> PyResult<Surface> {
        let origin = self.outcome.origin;
        if origin == DVec3::ZERO {
            return Ok(Surface(surface.clone()));
        }
        surface.map_points(|p| p + origin).or_raise(py).map(Surface)
    }

    /// The outcome as it is before anything is written: files are no part of it.
    fn write_to(
        &self,
        py: Python<'_>,
        outputs: &[PathBuf],
        options: &Options,
    ) -> PyResult<Outcome> {
        watched(py, None, |progress| {
            let mut outcome = self.outcome.clone();
            let path = self.path.as_deref();
            pipeline::write(&mut outcome, path, outputs, options, progress)?;
            Ok(outcome)
        })
    }
}

#[pymethods]
impl FitResult {
    /// The surface, of several parts the largest one's, in the coordinates of the scan; without its trimming.
    #[getter]
    fn surface(&self, py: Python<'_>) -> PyResult<Surface> {
        let Some(first) = self.outcome.geometry.first() else {
            return Err(nurbskin::Error::invalid("there is no surface")).or_raise(py);
        };
        self.placed(py, first)
    }

    /// The surface of each separate part of the scan, the largest first.
    #[getter]
    fn surfaces(&self, py: Python<'_>) -> PyResult<Vec<Surface>> {
        let all = self.outcome.geometry.iter();
        all.map(|surface| self.placed(py, surface)).collect()
    }

    /// ``pass``, ``fail`` or ``cannot_tell``.
    #[getter]
    fn verdict(&self) -> &'static str {
        self.outcome.verdict.name()
    }

    /// The reason of the verdict, a sentence.
    #[getter]
    fn reason(&self) -> &str {
        &self.outcome.reason
    }

    /// ``disk``, ``tube``, ``sphere`` or ``torus``.
    #[getter]
    fn topology(&self) -> &'static str {
        self.outcome.surface.topology.name()
    }

    /// The tolerance aimed at, in ``unit``.
    #[getter]
    fn tolerance(&self) -> f64 {
        self.outcome.tolerance
    }

    /// Unit of all lengths.
    #[getter]
    fn unit(&self) -> &'static str {
        self.outcome.input.unit.symbol()
    }

    /// What the user should know: assumptions, choices, doubts.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.outcome.warnings.clone()
    }

    /// The file that was fitted, or None.
    #[getter]
    fn path(&self) -> Option<PathBuf> {
        self.path.clone()
    }

    /// Everything measured, as ``nurbskin fit --json`` prints it.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        loaded(py, &self.outcome)
    }

    /// The points that were used, shape (k, 3), in the order of the scan.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let origin = self.outcome.origin;
        let points = self.outcome.per_point.points.iter();
        arrays::of_points(py, points.map(|&p| p + origin).collect())
    }

    /// Their indices in the scan, shape (k,).
    #[getter]
    fn indices<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.outcome.per_point.indices.clone().into_pyarray(py)
    }

    /// Certified distance of each used point, or of other (n, 3) points, to the trimmed surfaces; positive outside.
    #[pyo3(signature = (points=None))]
    fn deviation(&self, py: Python<'_>, points: Option<&Bound<'_, PyAny>>) -> PyResult<Deviation> {
        let tolerance = self.outcome.tolerance;
        let Some(points) = points else {
            let known = self.outcome.per_point.deviation.clone();
            return Ok(Deviation(Measured::new(known, tolerance)));
        };
        let mut points = arrays::points(points, "points")?;
        Deviation::check(py, &points)?;
        points.iter_mut().for_each(|p| *p -= self.outcome.origin);
        watched(py, None, |progress| {
            let model = ClosestOnModel::new(&self.outcome.model)?;
            measure_model(&model, &points, None, tolerance, progress)
        })
        .map(Deviation)
    }

    /// Writes the surfaces, trimmed, each path in the format of its extension: .step, .stp, .igs, .iges, .stl, .obj, .ply, .glb.
    ///
    /// ``step_schema`` is ``ap214`` or ``ap242``, ``iges_layout`` ``exact`` or ``paper``; ``with_points`` puts the scan's points
    /// into CAD files, too. Returns the quality checks of the CAD files written, None without any.
    ///
    /// Raises
    /// ------
    /// InvalidError : for an extension that is not known.
    /// WriteError : if the disk refuses; nothing is left behind then.
    #[pyo3(signature = (*paths, step_schema=None, iges_layout=None, with_points=false))]
    fn write<'py>(
        &self,
        py: Python<'py>,
        paths: Vec<PathBuf>,
        step_schema: Option<&str>,
        iges_layout: Option<&str>,
        with_points: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let keywords = PyDict::new(py);
        keywords.set_item("step_schema", step_schema)?;
        keywords.set_item("iges_layout", iges_layout)?;
        keywords.set_item("with_points", with_points)?;
        let options = words::options(&keywords)?;
        let outcome = self.write_to(py, &paths, &options)?;
        loaded(py, &outcome.check)
    }

    /// Writes deviation reports, each in the format of its extension: .html (a page with the surface in 3-D that works
    /// offline), .json or .csv.
    #[pyo3(signature = (*paths))]
    fn report(&self, py: Python<'_>, paths: Vec<PathBuf>) -> PyResult<()> {
        let options = Options {
            reports: paths,
            ..Options::default()
        };
        self.write_to(py, &[], &options).map(|_| ())
    }

    /// The report as one page of HTML.
    fn page(&self, py: Python<'_>) -> PyResult<String> {
        let path = self.path.as_deref().filter(|path| path.exists());
        watched(py, None, |progress| {
            pipeline::page_of_fit(&self.outcome, path, None, progress)
        })
    }

    fn _repr_html_<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let convert = this.py().import("nurbskin._convert")?;
        convert.call_method1("result_to_html", (this,))
    }

    fn __reduce__<'py>(
        this: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = this.py();
        let stored = this.get().outcome.to_bytes().or_raise(py)?;
        let parts = (PyBytes::new(py, &stored), this.get().path.clone());
        let restore = this.get_type().getattr("_restored")?;
        Ok((restore, parts.into_pyobject(py)?.into_any()))
    }

    #[staticmethod]
    fn _restored(py: Python<'_>, stored: &[u8], path: Option<PathBuf>) -> PyResult<Self> {
        let outcome = Outcome::from_bytes(stored).or_raise(py)?;
        Ok(Self { outcome, path })
    }

    fn __repr__(&self) -> String {
        let o = &self.outcome;
        let [m, n] = o.surface.control_points;
        let parts = match o.geometry.len() {
            1 => String::new(),
            many => format!("{many} surfaces, the largest a "),
        };
        let s = &o.deviation.scan_to_surface;
        format!(
            "Result({}: {parts}{} of {m} x {n} control points; {} points, max {:.4e}, 95 % {:.4e} {})",
            o.verdict.name(),
            o.surface.topology.name(),
            s.count,
            s.max,
            s.p95,
            o.input.unit
        )
    }
}
