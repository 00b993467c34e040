//! What fits and comparisons have in common: the deviation of a scan from faces, and a verdict on it.

use crate::arrays;
use crate::deviation::{Deviation, loaded};
use crate::picture::mesh_of;
use crate::source::SourceFile;
use crate::watch::watched;
use crate::words;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use nurbskin::DVec3;
use nurbskin::cad::{ClosestOnModel, Model};
use nurbskin::deviation::measure::{Deviation as Measured, Statistics, measure_model};
use nurbskin::deviation::verdict::{Reason, Verdict};
use nurbskin::pipeline::{
    self, About, Compared, Heading, Input, Options, Outcome, OutputOptions, PerPoint,
    REPORT_FORMATS, Source, Target,
};
use nurbskin::progress::Progress;
use nurbskin::report::display_mesh;
use nurbskin::unit::counted;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

/// What was measured.
#[derive(Clone)]
pub(crate) enum Found {
    Fit(Arc<Outcome>),
    Comparison(Arc<Compared>),
}

/// The parts that both have.
struct Common<'a> {
    input: &'a Input,
    verdict: Verdict,
    reason: &'a str,
    reasons: &'a [Reason],
    tolerance: Option<f64>,
    within: Option<f64>,
    warnings: &'a [String],
    details: &'a [String],
    statistics: &'a Statistics,
    per_point: &'a PerPoint,
    model: &'a Model,
    origin: DVec3,
}

impl Found {
    fn common(&self) -> Common<'_> {
        macro_rules! common {
            ($of:expr) => {
                Common {
                    input: &$of.input,
                    verdict: $of.verdict,
                    reason: &$of.reason,
                    reasons: &$of.reasons,
                    tolerance: $of.tolerance,
                    within: $of.within,
                    warnings: &$of.warnings,
                    details: &$of.details,
                    statistics: &$of.deviation.scan_to_surface,
                    per_point: &$of.per_point,
                    model: &$of.model,
                    origin: $of.origin,
                }
            };
        }
        match self {
            Self::Fit(outcome) => common!(outcome),
            Self::Comparison(compared) => common!(compared),
        }
    }

    /// The page, with the checksums of those of the `inputs` that are files.
    fn page(
        &self,
        inputs: &[Source],
        heading: &Heading,
        progress: &dyn Progress,
    ) -> nurbskin::Result<String> {
        let about = About {
            heading,
            ..About::now()?
        };
        match self {
            Self::Fit(outcome) => {
                let document = pipeline::document_of_fit(outcome, inputs.first(), about, progress)?;
                nurbskin::report::page(&document)
            }
            Self::Comparison(compared) => {
                pipeline::page_of_deviation(compared, inputs, about, progress)
            }
        }
    }

    /// Writes reports. What is recorded of them is no part of the result itself.
    fn write_reports(
        &self,
        inputs: &[Source],
        reports: Vec<PathBuf>,
        heading: Heading,
        progress: &dyn Progress,
    ) -> nurbskin::Result<()> {
        match self {
            Self::Fit(outcome) => {
                let output = OutputOptions {
                    reports,
                    heading,
                    ..OutputOptions::default()
                };
                let options = Options {
                    output,
                    ..Options::default()
                };
                let input = inputs.first().map(Source::path);
                pipeline::write(&mut (**outcome).clone(), input, &[], &options, progress)
            }
            Self::Comparison(compared) => {
                let about = About {
                    heading: &heading,
                    ..About::now()?
                };
                let compared = &mut (**compared).clone();
                pipeline::write_deviation(compared, inputs, &reports, about, progress)
            }
        }
    }
}

/// The deviation of a scan from faces, and the verdict on it: what a :class:`Result` and a :class:`Comparison` have in common.
#[pyclass(module = "nurbskin", frozen, weakref, subclass)]
pub(crate) struct Measurement {
    found: Found,
    /// The files that the inputs were read from.
    files: Vec<SourceFile>,
}

impl Measurement {
    pub(crate) fn new(found: Found, files: Vec<SourceFile>) -> Self {
        Self { found, files }
    }

    pub(crate) fn files(&self) -> &[SourceFile] {
        &self.files
    }

    /// Those of the files that are still there and the same.
    fn unchanged(&self) -> Vec<Source> {
        let paths = self.files.iter().filter_map(SourceFile::unchanged);
        paths.map(Source::file).collect()
    }

    /// The figures at the end of a representation.
    pub(crate) fn figures(&self) -> String {
        let Common {
            statistics, input, ..
        } = self.found.common();
        format!(
            "{}, 95 % within {}, max {}",
            counted(statistics.count, "point", "points"),
            input.unit.length(statistics.p95),
            input.unit.length(statistics.max)
        )
    }
}

#[pymethods]
impl Measurement {
    /// ``pass``, ``fail``, ``cannot_tell`` or ``not_asked`` (there was no tolerance, and nothing else fails): the worst of the
    /// deviation, the sanity of units and sizes, and, of a fit, the check of the surfaces and the part of the scan that got one,
    /// of a comparison the part of the nominal's area that has data.
    #[getter]
    fn verdict(&self) -> &'static str {
        self.found.common().verdict.name()
    }

    /// The first of the reasons in words; for ``pass`` and ``not_asked`` a sentence with the figures.
    #[getter]
    fn reason(&self) -> &str {
        self.found.common().reason
    }

    /// Why the verdict is not ``pass``, the gravest first: dictionaries with ``what`` (a sentence), ``where`` (a point in the
    /// coordinates of ``points``, or None) and ``next`` (one thing to do, or None). Empty for ``pass`` and ``not_asked``.
    #[getter]
    fn reasons<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        loaded(py, &self.found.common().reasons)
    }

    /// The tolerance asked for, in ``unit``; None where none was.
    #[getter]
    fn tolerance(&self) -> Option<f64> {
        self.found.common().tolerance
    }

    /// Share (0 to 1) of the points that had to be within the tolerance; None without a tolerance.
    #[getter]
    fn within(&self) -> Option<f64> {
        self.found.common().within
    }

    /// Unit of all lengths, that of the scan.
    #[getter]
    fn unit(&self) -> &'static str {
        self.found.common().input.unit.symbol()
    }

    /// What changes the answer: assumptions, doubts, points and parts left out, holes closed, options without effect.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.found.common().warnings.to_vec()
    }

    /// The chronicle: what was repaired, and what was chosen and why.
    #[getter]
    fn details(&self) -> Vec<String> {
        self.found.common().details.to_vec()
    }

    /// Everything measured, as ``nurbskin fit --json`` or ``nurbskin deviation --json`` prints it; of a fit with the check of the
    /// surfaces. ``outputs`` is empty: files are no part of it.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match &self.found {
            Found::Fit(outcome) => loaded(py, &**outcome),
            Found::Comparison(compared) => loaded(py, &**compared),
        }
    }

    /// The points that were used, shape (k, 3), in the order of the scan; of a comparison after the alignment.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let found = self.found.common();
        let points = found.per_point.points.iter();
        arrays::of_points(py, points.map(|&p| p + found.origin).collect())
    }

    /// Their indices in ``scan.points``, shape (k,).
    #[getter]
    fn indices<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        let found = self.found.common();
        found.per_point.indices.clone().into_pyarray(py)
    }

    /// Certified distance of each used point, or of other (n, 3) points in the coordinates of ``points``, to the trimmed faces;
    /// positive outside.
    ///
    /// ``tolerance`` is for the share within, in the statistics: a number in ``unit``, or as ``"0.1mm"`` or ``"0.1%"`` (of the
    /// diagonal of the scan); where None, that of the measurement; without either there is no share.
    #[pyo3(signature = (points=None, tolerance=None))]
    fn deviation(
        &self,
        py: Python<'_>,
        points: Option<&Bound<'_, PyAny>>,
        tolerance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Deviation> {
        let found = self.found.common();
        let [low, high] = found.input.bounding_box.map(DVec3::from);
        let diagonal = low.distance(high);
        let given = words::length("tolerance", tolerance, found.input.unit, diagonal)?;
        let tolerance = given.or(found.tolerance);
        let Some(points) = points else {
            let known = found.per_point.deviation.clone();
            return Ok(Deviation(Measured::new(known, tolerance)));
        };
        let mut points = arrays::points(points, "points")?;
        Deviation::check(py, &points)?;
        points.iter_mut().for_each(|p| *p -= found.origin);
        let found = self.found.clone();
        watched(py, None, move |progress| {
            let model = ClosestOnModel::new(found.common().model)?;
            measure_model(&model, &points, None, tolerance, progress)
        })
        .map(Deviation)
    }

    /// Writes deviation reports, each in the format of its extension: .html (a page with the surface in 3-D that works
    /// offline), .json or .csv. A page tells the checksums of the files that were read, as long as they are there unchanged.
    ///
    /// ``title`` is the title of the page, the name of the scan where None. ``notes`` are its fields, a dictionary of texts such
    /// as ``{"part": "R-7", "operator": "A. Lovelace"}``: ``part``, ``drawing``, ``revision``, ``operator`` and ``alignment``
    /// come first, others after them. The date, and the alignment of a comparison, are there without being named.
    ///
    /// Raises
    /// ------
    /// InvalidError : for an extension that is not known, and for a note that is empty or longer than 500 characters.
    /// WriteError : if the disk refuses; nothing is left behind then.
    #[pyo3(signature = (*paths, title=None, notes=None))]
    fn report(
        &self,
        py: Python<'_>,
        paths: Vec<PathBuf>,
        title: Option<String>,
        notes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        let heading = words::heading(title, notes)?;
        let (found, inputs) = (self.found.clone(), self.unchanged());
        let read: Vec<Source> = self.files.iter().map(|f| Source::file(f.path())).collect();
        watched(py, None, move |progress| {
            // Also a file that has changed is not to be overwritten.
            pipeline::check_targets(&read, &Target::files(&paths), &REPORT_FORMATS)?;
            found.write_reports(&inputs, paths, heading, progress)
        })
    }

    /// The report as one page of HTML, which a notebook shows in a frame; ``title`` and ``notes`` as of ``report``.
    #[pyo3(signature = (*, title=None, notes=None))]
    fn page<'py>(
        &self,
        py: Python<'py>,
        title: Option<String>,
        notes: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let heading = words::heading(title, notes)?;
        let (found, inputs) = (self.found.clone(), self.unchanged());
        let page = watched(py, None, move |progress| {
            found.page(&inputs, &heading, progress)
        })?;
        py.import("nurbskin._types")?
            .getattr("Page")?
            .call1((page,))
    }

    /// Triangles of the trimmed faces for display, as those of ``CadModel._mesh`` with ``deviation``.
    fn _mesh<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = self.found.clone();
        let mesh = watched(py, None, move |progress| {
            let found = found.common();
            let scan = pipeline::measured(found.per_point, found.input.spacing);
            display_mesh(found.model, Some(scan), progress)
        })?;
        mesh_of(py, mesh, self.found.common().origin)
    }

    /// A figure of matplotlib: the trimmed faces with the deviation as their colour, and the histogram of the deviations.
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

    /// The trimmed faces as a ``pyvista.PolyData`` with the point data ``deviation`` (signed, of the scan near each vertex;
    /// NaN where it has no points), ``normals`` (outward), ``mean_curvature`` (positive where convex seen from outside),
    /// ``gaussian_curvature``, ``parameters`` and ``face``.
    fn to_pyvista<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let convert = this.py().import("nurbskin._convert")?;
        convert.call_method1("mesh_to_pyvista", (this,))
    }
}
