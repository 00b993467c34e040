//! Fits and what they produced.

use crate::cad::CadModel;
use crate::deviation::loaded;
use crate::edge::FaceEdge;
use crate::errors::Raised;
use crate::measurement::{Found, Measurement};
use crate::phrases;
use crate::scan::Scan;
use crate::source::{FileParts, SourceFile};
use crate::surface::Surface;
use crate::watch::watched;
use crate::words;
use nurbskin::chart::Topology;
use nurbskin::pipeline::{self, Options, Outcome, Output, SURFACE_FORMATS, check_outputs};
use nurbskin::progress::Progress;
use nurbskin::unit::counted;
use nurbskin::{DVec3, NurbsSurface};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// What a fit produced and measured: a :class:`Measurement` with the surfaces.
#[pyclass(name = "Result", module = "nurbskin", extends = Measurement, frozen)]
pub(crate) struct FitResult {
    outcome: Arc<Outcome>,
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
) -> PyResult<Py<FitResult>> {
    let options = options_of(options)?;
    let (name, file) = (scan.get().name(), scan.get().file.clone());
    let scan = Arc::clone(&scan.get().scan);
    let outcome = watched(py, progress, move |progress| {
        let start = Instant::now();
        let outcome = pipeline::fit_scan((*scan).clone(), &name, &options, progress)?;
        checked(outcome, start, progress)
    })?;
    Py::new(py, FitResult::of(outcome, file))
}

/// Fits a surface to the scan in a file.
#[pyfunction]
#[pyo3(signature = (path, progress=None, **options))]
pub(crate) fn fit_file(
    py: Python<'_>,
    path: PathBuf,
    progress: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Py<FitResult>> {
    let options = options_of(options)?;
    let file = SourceFile::new(&path);
    let outcome = watched(py, progress, move |progress| {
        let start = Instant::now();
        let outcome = pipeline::fit(&path, &[], &options, progress)?;
        checked(outcome, start, progress)
    })?;
    Py::new(py, FitResult::of(outcome, Some(file)))
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
    /// The result with what it has as a measurement; `file` is the one that was fitted, if it was one.
    fn of(outcome: Outcome, file: Option<SourceFile>) -> PyClassInitializer<Self> {
        let outcome = Arc::new(outcome);
        let found = Found::Fit(Arc::clone(&outcome));
        let files = file.into_iter().collect();
        PyClassInitializer::from(Measurement::new(found, files)).add_subclass(Self {
            outcome,
            surfaces: PyOnceLock::new(),
        })
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

    /// ``disk``, ``tube``, ``sphere`` or ``torus``; None for a network of another topology.
    #[getter]
    fn topology(&self) -> Option<&'static str> {
        self.outcome.surface.topology.map(Topology::name)
    }

    /// What control points buy: dictionaries with ``control_points``, ``p95``, ``max`` and ``tolerance`` (the distance that the
    /// demanded share of the points keeps), lengths in ``unit``, of the surfaces that the fit met and of its own; ascending in
    /// control points, descending in p95. Its own alone where the points are ordered or the surface is one of revolution.
    #[getter]
    fn trade<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        loaded(py, &self.outcome.surface.trade)
    }

    /// The file that was fitted, or None.
    #[getter]
    fn path(this: PyRef<'_, Self>) -> Option<PathBuf> {
        let file = this.as_super().files().first();
        file.map(|file| file.path().to_owned())
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
        this: PyRef<'py, Self>,
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
        let outcome = Arc::clone(&this.outcome);
        let file = this.as_super().files().first().cloned();
        let outcome = watched(py, None, move |progress| {
            // Also one that has changed is not to be overwritten.
            let input: Vec<PathBuf> = file.iter().map(|file| file.path().to_owned()).collect();
            check_outputs(&input, &paths, &SURFACE_FORMATS)?;
            let mut outcome = (*outcome).clone();
            let path = file.as_ref().and_then(SourceFile::unchanged);
            pipeline::write(&mut outcome, path, &paths, &options, progress)?;
            Ok(outcome)
        })?;
        let is_cad = |output: &Output| output.format == "step" || output.format == "iges";
        let checked = outcome.check.filter(|_| outcome.outputs.iter().any(is_cad));
        loaded(py, &checked)
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
        let file = this.as_super().get().files().first().cloned();
        let parts = (PyBytes::new(py, &stored), file.map(SourceFile::into_parts));
        let restore = this.get_type().getattr("_restored")?;
        Ok((restore, parts.into_pyobject(py)?.into_any()))
    }

    #[staticmethod]
    fn _restored(py: Python<'_>, stored: &[u8], file: Option<FileParts>) -> PyResult<Py<Self>> {
        let outcome = Outcome::from_bytes(stored).or_raise(py)?;
        Py::new(py, Self::of(outcome, file.map(SourceFile::from_parts)))
    }

    /// About the memory that it takes: what a cluster asks.
    fn __sizeof__(&self) -> usize {
        const OF_POINT: usize = 100;
        OF_POINT * (self.outcome.per_point.points.len() + self.outcome.rejected.len())
    }

    fn __repr__(this: PyRef<'_, Self>) -> String {
        let o = &this.outcome;
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
        format!(
            "Result({}: {parts}{what} of {net} control points; {})",
            o.verdict.name(),
            this.as_super().figures()
        )
    }
}
