//! Fits and what they produced.

use crate::arrays;
use crate::cad::CadModel;
use crate::deviation::{Deviation, loaded};
use crate::edge::FaceEdge;
use crate::errors::Raised;
use crate::phrases;
use crate::picture::mesh_of;
use crate::scan::Scan;
use crate::source::{FileParts, SourceFile};
use crate::surface::Surface;
use crate::watch::watched;
use crate::words;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use nurbskin::cad::ClosestOnModel;
use nurbskin::chart::Topology;
use nurbskin::deviation::measure::{Deviation as Measured, measure_model};
use nurbskin::pipeline::{
    self, Options, Outcome, Output, OutputOptions, REPORT_FORMATS, SURFACE_FORMATS, check_outputs,
};
use nurbskin::progress::Progress;
use nurbskin::report::display_mesh;
use nurbskin::unit::counted;
use nurbskin::{DVec3, NurbsSurface};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// What a fit produced and measured.
#[pyclass(name = "Result", module = "nurbskin", frozen, weakref)]
pub(crate) struct FitResult {
    outcome: Arc<Outcome>,
    /// The file that was fitted, if it was one.
    file: Option<SourceFile>,
    /// Made when they are asked for, once.
    surfaces: PyOnceLock<Vec<Py<Surface>>>,
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
    let (name, file) = (scan.get().name(), scan.get().file.clone());
    let scan = Arc::clone(&scan.get().scan);
    let outcome = watched(py, progress, move |progress| {
        let start = Instant::now();
        let outcome = pipeline::fit_scan((*scan).clone(), &name, &options, progress)?;
        checked(outcome, start, progress)
    })?;
    Ok(FitResult::new(outcome, file))
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
    let file = SourceFile::new(&path);
    let outcome = watched(py, progress, move |progress| {
        let start = Instant::now();
        let outcome = pipeline::fit(&path, &[], &options, progress)?;
        checked(outcome, start, progress)
    })?;
    Ok(FitResult::new(outcome, Some(file)))
}

/// The outcome with the check of its surfaces, which the command makes of the file that it writes.
fn checked(
    mut outcome: Outcome,
    start: Instant,
    progress: &dyn Progress,
) -> nurbskin::Result<Outcome> {
    pipeline::check_fitted(&mut outcome, progress)?;
    phrases::translate(&mut outcome);
    outcome.time.total = start.elapsed().as_secs_f64();
    Ok(outcome)
}

fn options_of(keywords: Option<&Bound<'_, PyDict>>) -> PyResult<Options> {
    keywords.map_or_else(|| Ok(Options::default()), words::options)
}

impl FitResult {
    fn new(outcome: Outcome, file: Option<SourceFile>) -> Self {
        Self {
            outcome: Arc::new(outcome),
            file,
            surfaces: PyOnceLock::new(),
        }
    }

    /// All surfaces, in the coordinates of the scan.
    fn placed(&self, py: Python<'_>) -> PyResult<&Vec<Py<Surface>>> {
        self.surfaces.get_or_try_init(py, || {
            let (origin, unit) = (self.outcome.origin, self.outcome.input.unit);
            let of = |surface: &NurbsSurface| {
                let placed = match origin == DVec3::ZERO {
                    true => surface.clone(),
                    false => surface.map_points(|p| p + origin).or_raise(py)?,
                };
                Py::new(py, Surface::new_in(placed, unit))
            };
            self.outcome.geometry.iter().map(of).collect()
        })
    }

    /// The trimmed faces, in the coordinates of the scan.
    pub(crate) fn model(&self, py: Python<'_>) -> PyResult<CadModel> {
        let origin = self.outcome.origin;
        let model = self.outcome.model.clone();
        let placed = model.map_points(|p| p + origin).or_raise(py)?;
        let name = format!("the surfaces of {}", self.outcome.input.path);
        Ok(CadModel::of_model(placed, name))
    }

    /// The outcome with what is written: files are no part of the result itself.
    fn write_to(
        &self,
        py: Python<'_>,
        outputs: Vec<PathBuf>,
        options: Options,
    ) -> PyResult<Outcome> {
        let (outcome, file) = (Arc::clone(&self.outcome), self.file.clone());
        watched(py, None, move |progress| {
            // Also one that has changed is not to be overwritten.
            let input: Vec<PathBuf> = file.iter().map(|file| file.path().to_owned()).collect();
            check_outputs(&input, &outputs, &SURFACE_FORMATS)?;
            check_outputs(&input, &options.output.reports, &REPORT_FORMATS)?;
            let mut outcome = (*outcome).clone();
            let path = file.as_ref().and_then(SourceFile::unchanged);
            pipeline::write(&mut outcome, path, &outputs, &options, progress)?;
            Ok(outcome)
        })
    }
}

#[pymethods]
impl FitResult {
    /// The surface, of several parts the largest one's, in the coordinates of the scan; without its trimming.
    #[getter]
    fn surface(&self, py: Python<'_>) -> PyResult<Py<Surface>> {
        match self.placed(py)?.first() {
            Some(first) => Ok(first.clone_ref(py)),
            None => Err(nurbskin::Error::invalid("there is no surface")).or_raise(py),
        }
    }

    /// The surface of each separate part of the scan, the largest first; of a network, that of each face.
    #[getter]
    fn surfaces(&self, py: Python<'_>) -> PyResult<Vec<Py<Surface>>> {
        Ok(self.placed(py)?.iter().map(|s| s.clone_ref(py)).collect())
    }

    /// The trimmed faces with their edges, as :func:`read_cad` reads them from the file that ``write`` makes.
    #[getter(model)]
    fn get_model(&self, py: Python<'_>) -> PyResult<CadModel> {
        self.model(py)
    }

    /// ``single`` or ``network``.
    #[getter]
    fn layout(&self) -> &'static str {
        self.outcome.surface.layout.name()
    }

    /// The edges of networks, in the coordinates of the scan; empty for single surfaces.
    #[getter]
    fn edges(&self, py: Python<'_>) -> PyResult<Vec<Py<FaceEdge>>> {
        let model = &self.outcome.model;
        let mut faces = vec![Vec::new(); model.edges().len()];
        for (k, face) in model.faces().iter().enumerate() {
            for used in face.loops.iter().flat_map(|each| &each.uses) {
                faces[used.edge].push(k);
            }
        }
        let of = |edge: &pipeline::FaceEdge| {
            let curve = model.edges().get(edge.edge).and_then(|e| e.curve.clone());
            let faces = faces.get(edge.edge).cloned().unwrap_or_default();
            Py::new(py, FaceEdge::new(curve, self.outcome.origin, edge, faces))
        };
        self.outcome.edges.iter().map(of).collect()
    }

    /// ``pass``, ``fail``, ``cannot_tell`` or ``not_asked`` (there was no tolerance, and nothing else fails): the worst of the
    /// deviation, the check of the surfaces, the part of the scan that got one, and the sanity of units and sizes.
    #[getter]
    fn verdict(&self) -> &'static str {
        self.outcome.verdict.name()
    }

    /// The first of the reasons in words; for ``pass`` and ``not_asked`` a sentence with the figures.
    #[getter]
    fn reason(&self) -> &str {
        &self.outcome.reason
    }

    /// Why the verdict is not ``pass``, the gravest first: dictionaries with ``what`` (a sentence), ``where`` (a point in the
    /// coordinates of the scan, or None) and ``next`` (one thing to do, or None). Empty for ``pass`` and ``not_asked``.
    #[getter]
    fn reasons<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        loaded(py, &self.outcome.reasons)
    }

    /// ``disk``, ``tube``, ``sphere`` or ``torus``; None for a network of another topology.
    #[getter]
    fn topology(&self) -> Option<&'static str> {
        self.outcome.surface.topology.map(Topology::name)
    }

    /// The tolerance asked for, in ``unit``; None where none was.
    #[getter]
    fn tolerance(&self) -> Option<f64> {
        self.outcome.tolerance
    }

    /// Share (0 to 1) of the points that had to be within the tolerance; None without a tolerance.
    #[getter]
    fn within(&self) -> Option<f64> {
        self.outcome.within
    }

    /// What control points buy: dictionaries with ``control_points``, ``p95``, ``max`` and ``tolerance`` (the distance that the
    /// demanded share of the points keeps), lengths in ``unit``, of the surfaces that the fit met and of its own; ascending in
    /// control points, descending in p95. Its own alone where the points are ordered or the surface is one of revolution.
    #[getter]
    fn trade<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        loaded(py, &self.outcome.surface.trade)
    }

    /// Unit of all lengths.
    #[getter]
    fn unit(&self) -> &'static str {
        self.outcome.input.unit.symbol()
    }

    /// What changes the answer: assumptions, doubts, points and parts left out, holes closed, options without effect.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.outcome.warnings.clone()
    }

    /// The chronicle: what was repaired, and why the surface is as it is.
    #[getter]
    fn details(&self) -> Vec<String> {
        self.outcome.details.clone()
    }

    /// The file that was fitted, or None.
    #[getter]
    fn path(&self) -> Option<PathBuf> {
        self.file.as_ref().map(|file| file.path().to_owned())
    }

    /// Everything measured, as ``nurbskin fit --json`` prints it, with the check of the surfaces. ``outputs`` is empty: files
    /// are no part of the result.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        loaded(py, &*self.outcome)
    }

    /// The points that were used, shape (k, 3), in the order of the scan.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let origin = self.outcome.origin;
        let points = self.outcome.per_point.points.iter();
        arrays::of_points(py, points.map(|&p| p + origin).collect())
    }

    /// Their indices in ``scan.points``, shape (k,).
    #[getter]
    fn indices<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.outcome.per_point.indices.clone().into_pyarray(py)
    }

    /// Certified distance of each used point, or of other (n, 3) points, to the trimmed surfaces; positive outside.
    ///
    /// ``tolerance`` is for the share within, in the statistics: a number in ``unit``, or as ``"0.1mm"`` or ``"0.1%"`` (of the
    /// diagonal of the scan); the fit's own where None, and no share where that had none.
    #[pyo3(signature = (points=None, tolerance=None))]
    fn deviation(
        &self,
        py: Python<'_>,
        points: Option<&Bound<'_, PyAny>>,
        tolerance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Deviation> {
        let input = &self.outcome.input;
        let [low, high] = input.bounding_box.map(DVec3::from);
        let given = words::length("tolerance", tolerance, input.unit, low.distance(high))?;
        let tolerance = given.or(self.outcome.tolerance);
        let Some(points) = points else {
            let known = self.outcome.per_point.deviation.clone();
            return Ok(Deviation(Measured::new(known, tolerance)));
        };
        let mut points = arrays::points(points, "points")?;
        Deviation::check(py, &points)?;
        points.iter_mut().for_each(|p| *p -= self.outcome.origin);
        let outcome = Arc::clone(&self.outcome);
        watched(py, None, move |progress| {
            let model = ClosestOnModel::new(&outcome.model)?;
            measure_model(&model, &points, None, tolerance, progress)
        })
        .map(Deviation)
    }

    /// Writes the surfaces, trimmed, each path in the format of its extension: .step, .stp, .igs, .iges, .stl, .obj, .ply, .glb.
    ///
    /// ``step_schema`` is ``ap214`` or ``ap242``, ``iges_layout`` ``exact`` or ``paper``; ``with_points`` puts the scan's points
    /// into CAD files, too; ``author`` and ``organization`` go into their headers. Returns the quality checks of the CAD files written, None without any.
    ///
    /// Raises
    /// ------
    /// InvalidError : for an extension that is not known.
    /// WriteError : if the disk refuses; nothing is left behind then.
    #[pyo3(signature = (*paths, step_schema=None, iges_layout=None, with_points=false, author=None, organization=None))]
    fn write<'py>(
        &self,
        py: Python<'py>,
        paths: Vec<PathBuf>,
        step_schema: Option<&str>,
        iges_layout: Option<&str>,
        with_points: bool,
        author: Option<&str>,
        organization: Option<&str>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let keywords = PyDict::new(py);
        keywords.set_item("step_schema", step_schema)?;
        keywords.set_item("iges_layout", iges_layout)?;
        keywords.set_item("with_points", with_points)?;
        keywords.set_item("author", author)?;
        keywords.set_item("organization", organization)?;
        let options = words::options(&keywords)?;
        let outcome = self.write_to(py, paths, options)?;
        let is_cad = |output: &Output| output.format == "step" || output.format == "iges";
        let checked = outcome.check.filter(|_| outcome.outputs.iter().any(is_cad));
        loaded(py, &checked)
    }

    /// Writes deviation reports, each in the format of its extension: .html (a page with the surface in 3-D that works
    /// offline), .json or .csv. A page tells the checksum of the file that was fitted, as long as it is there unchanged.
    #[pyo3(signature = (*paths))]
    fn report(&self, py: Python<'_>, paths: Vec<PathBuf>) -> PyResult<()> {
        let options = Options {
            output: OutputOptions {
                reports: paths,
                ..OutputOptions::default()
            },
            ..Options::default()
        };
        self.write_to(py, Vec::new(), options).map(|_| ())
    }

    /// The report as one page of HTML, which a notebook shows in a frame.
    fn page<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (outcome, file) = (Arc::clone(&self.outcome), self.file.clone());
        let page = watched(py, None, move |progress| {
            let path = file.as_ref().and_then(SourceFile::unchanged);
            pipeline::page_of_fit(&outcome, path, None, progress)
        })?;
        py.import("nurbskin._types")?
            .getattr("Page")?
            .call1((page,))
    }

    /// Triangles of the trimmed faces for display, as those of ``CadModel._mesh`` with ``deviation``.
    fn _mesh<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let outcome = Arc::clone(&self.outcome);
        let mesh = watched(py, None, move |progress| {
            let scan = pipeline::measured(&outcome.per_point, outcome.input.spacing);
            display_mesh(&outcome.model, Some(scan), progress)
        })?;
        mesh_of(py, mesh, self.outcome.origin)
    }

    /// A figure of matplotlib: the trimmed surfaces with the deviation as their colour, and the histogram of the deviations.
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

    /// The trimmed surfaces as a ``pyvista.PolyData`` with the point data ``deviation`` (signed, of the scan near each vertex;
    /// NaN where it has no points), ``normals`` (outward), ``mean_curvature`` (positive where convex seen from outside),
    /// ``gaussian_curvature``, ``parameters`` and ``face``.
    fn to_pyvista<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let convert = this.py().import("nurbskin._convert")?;
        convert.call_method1("mesh_to_pyvista", (this,))
    }

    fn _repr_html_<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let picture = this.py().import("nurbskin._picture")?;
        picture.call_method1("result_to_html", (this,))
    }

    fn __reduce__<'py>(
        this: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = this.py();
        let stored = this.get().outcome.to_bytes().or_raise(py)?;
        let file = this.get().file.clone();
        let parts = (PyBytes::new(py, &stored), file.map(SourceFile::into_parts));
        let restore = this.get_type().getattr("_restored")?;
        Ok((restore, parts.into_pyobject(py)?.into_any()))
    }

    #[staticmethod]
    fn _restored(py: Python<'_>, stored: &[u8], file: Option<FileParts>) -> PyResult<Self> {
        let outcome = Outcome::from_bytes(stored).or_raise(py)?;
        Ok(Self::new(outcome, file.map(SourceFile::from_parts)))
    }

    /// About the memory that it takes: what a cluster asks.
    fn __sizeof__(&self) -> usize {
        const OF_POINT: usize = 100;
        OF_POINT * (self.outcome.per_point.points.len() + self.outcome.rejected.len())
    }

    fn __repr__(&self) -> String {
        let o = &self.outcome;
        let net: Vec<String> = o
            .surface
            .control_points
            .iter()
            .map(usize::to_string)
            .collect();
        let net = net.join(" x ");
        let parts = match o.parts.len() {
            0 => String::new(),
            many => format!("{many} surfaces, the largest a "),
        };
        let what = match (o.surface.faces, o.surface.topology) {
            (Some(faces), _) => format!("network of {}", counted(faces, "face", "faces")),
            (None, topology) => topology.map_or("surface", Topology::name).to_owned(),
        };
        let s = &o.deviation.scan_to_surface;
        format!(
            "Result({}: {parts}{what} of {net} control points; {}, 95 % within {}, max {})",
            o.verdict.name(),
            counted(s.count, "point", "points"),
            o.input.unit.length(s.p95),
            o.input.unit.length(s.max)
        )
    }
}
