//! Deviations of scans from CAD files.

use crate::arrays;
use crate::cad::source_of;
use crate::deviation::{Deviation, loaded};
use crate::errors::Raised;
use crate::phrases;
use crate::picture::mesh_of;
use crate::source::SourceFile;
use crate::watch::watched;
use crate::words;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use nurbskin::cad::ClosestOnModel;
use nurbskin::deviation::measure::{Deviation as Measured, measure_model};
use nurbskin::pipeline::{self, Compared, DeviationOptions, Length, Source, Target};
use nurbskin::report::display_mesh;
use nurbskin::unit::counted;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

/// The deviation of a scan from a CAD model, and its verdict: what :func:`deviation` returns.
#[pyclass(module = "nurbskin", frozen, weakref)]
pub(crate) struct Comparison {
    compared: Arc<Compared>,
    /// The files that the inputs were read from.
    files: Vec<SourceFile>,
}

impl Comparison {
    /// Those of the files that are still there and the same.
    fn unchanged(&self) -> Vec<Source> {
        let paths = self.files.iter().filter_map(SourceFile::unchanged);
        paths.map(Source::file).collect()
    }
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
) -> PyResult<Comparison> {
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
    Ok(Comparison {
        compared: Arc::new(compared),
        files: scan_file.into_iter().chain(cad_file).collect(),
    })
}

#[pymethods]
impl Comparison {
    /// ``pass``, ``fail``, ``cannot_tell`` or ``not_asked`` (there was no tolerance, and nothing else fails): the worst of the
    /// deviation, the part of the nominal's area that has data, and the sanity of units and sizes.
    #[getter]
    fn verdict(&self) -> &'static str {
        self.compared.verdict.name()
    }

    /// The first of the reasons in words; for ``pass`` and ``not_asked`` a sentence with the figures.
    #[getter]
    fn reason(&self) -> &str {
        &self.compared.reason
    }

    /// Why the verdict is not ``pass``, the gravest first: dictionaries with ``what``, ``where`` and ``next``, as those of
    /// :attr:`Result.reasons`.
    #[getter]
    fn reasons<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        loaded(py, &self.compared.reasons)
    }

    /// The tolerance asked for, in ``unit``; None where none was.
    #[getter]
    fn tolerance(&self) -> Option<f64> {
        self.compared.tolerance
    }

    /// Share (0 to 1) of the points that had to be within the tolerance; None without a tolerance.
    #[getter]
    fn within(&self) -> Option<f64> {
        self.compared.within
    }

    /// Unit of all lengths, that of the scan.
    #[getter]
    fn unit(&self) -> &'static str {
        self.compared.input.unit.symbol()
    }

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

    /// What changes the answer: assumptions, doubts, what was left out.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.compared.warnings.clone()
    }

    /// Everything measured, as ``nurbskin deviation --json`` prints it. ``outputs`` is empty: files are no part of it.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        loaded(py, &*self.compared)
    }

    /// The points that were compared, after the alignment, shape (k, 3).
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let origin = self.compared.origin;
        let points = self.compared.per_point.points.iter();
        arrays::of_points(py, points.map(|&p| p + origin).collect())
    }

    /// Their indices in ``scan.points``, shape (k,).
    #[getter]
    fn indices<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.compared.per_point.indices.clone().into_pyarray(py)
    }

    /// Certified distance of each compared point, or of other (n, 3) points in the coordinates of the model, to the trimmed
    /// faces; positive outside.
    #[pyo3(signature = (points=None))]
    fn deviation(&self, py: Python<'_>, points: Option<&Bound<'_, PyAny>>) -> PyResult<Deviation> {
        let tolerance = self.compared.tolerance;
        let Some(points) = points else {
            let known = self.compared.per_point.deviation.clone();
            return Ok(Deviation(Measured::new(known, tolerance)));
        };
        let mut points = arrays::points(points, "points")?;
        Deviation::check(py, &points)?;
        points.iter_mut().for_each(|p| *p -= self.compared.origin);
        let compared = Arc::clone(&self.compared);
        watched(py, None, move |progress| {
            let model = ClosestOnModel::new(&compared.model)?;
            measure_model(&model, &points, None, tolerance, progress)
        })
        .map(Deviation)
    }

    /// Writes deviation reports, each in the format of its extension: .html (a page with the surface in 3-D that works
    /// offline), .json or .csv. A page tells the checksums of the files that were compared.
    #[pyo3(signature = (*paths))]
    fn report(&self, py: Python<'_>, paths: Vec<PathBuf>) -> PyResult<()> {
        let (compared, inputs) = (Arc::clone(&self.compared), self.unchanged());
        let read: Vec<Source> = self.files.iter().map(|f| Source::file(f.path())).collect();
        watched(py, None, move |progress| {
            // Also a file that has changed is not to be overwritten.
            pipeline::check_targets(&read, &Target::files(&paths), &pipeline::REPORT_FORMATS)?;
            let mut compared = (*compared).clone();
            let about = pipeline::About::now()?;
            pipeline::write_deviation(&mut compared, &inputs, &paths, about, progress)
        })
    }

    /// The report as one page of HTML, which a notebook shows in a frame.
    fn page<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (compared, inputs) = (Arc::clone(&self.compared), self.unchanged());
        let page = watched(py, None, move |progress| {
            pipeline::page_of_deviation(&compared, &inputs, pipeline::About::now()?, progress)
        })?;
        py.import("nurbskin._types")?
            .getattr("Page")?
            .call1((page,))
    }

    /// Triangles of the model for display, as those of ``CadModel._mesh`` with ``deviation``.
    fn _mesh<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let compared = Arc::clone(&self.compared);
        let mesh = watched(py, None, move |progress| {
            let scan = pipeline::measured(&compared.per_point, compared.input.spacing);
            display_mesh(&compared.model, Some(scan), progress)
        })?;
        mesh_of(py, mesh, self.compared.origin)
    }

    /// A figure of matplotlib: the model with the deviation as its colour, and the histogram of the deviations.
    ///
    /// ``elevation`` and ``azimuth`` are those of the viewer, in degrees; z is up. ``figure`` is drawn into, a new one where
    /// None. Returns the figure.
    #[pyo3(signature = (elevation=30.0, azimuth=-60.0, figure=None))]
    fn plot<'py>(
        this: &Bound<'py, Self>,
        elevation: f64,
        azimuth: f64,
        figure: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let picture = this.py().import("nurbskin._picture")?;
        picture.call_method1("plot", (this, elevation, azimuth, figure))
    }

    /// The model as a ``pyvista.PolyData`` with point data as of :meth:`Result.to_pyvista`.
    fn to_pyvista<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let convert = this.py().import("nurbskin._convert")?;
        convert.call_method1("mesh_to_pyvista", (this,))
    }

    fn _repr_html_<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let picture = this.py().import("nurbskin._picture")?;
        picture.call_method1("comparison_to_html", (this,))
    }

    fn __repr__(&self) -> String {
        let c = &self.compared;
        let s = &c.deviation.scan_to_surface;
        format!(
            "Comparison({}: {}, 95 % within {}, max {})",
            c.verdict.name(),
            counted(s.count, "point", "points"),
            c.input.unit.length(s.p95),
            c.input.unit.length(s.max)
        )
    }
}
