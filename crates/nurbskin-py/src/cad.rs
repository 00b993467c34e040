//! CAD files, and what else can be taken for one: the surfaces of a fit, or a surface.

use crate::arrays;
use crate::deviation::{Deviation, loaded};
use crate::errors::Raised;
use crate::outcome::FitResult;
use crate::picture::mesh_of;
use crate::scan::Scan;
use crate::source::{FileParts, SourceFile};
use crate::surface::{ClosestArrays, Surface, closest_arrays};
use crate::watch::{refuse_fork, watched};
use crate::words;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use nurbskin::cad::{ClosestOnModel, Extent, Mass, Model, ModelFoot, extent, mass, tessellate};
use nurbskin::deviation::measure::measure_model;
use nurbskin::io::cad::{CadFile, CadHeader};
use nurbskin::pipeline::{self, Source};
use nurbskin::report::display_mesh;
use nurbskin::scan::binary;
use nurbskin::unit::{UnitSource, counted};
use nurbskin::{DVec3, Error, Unit};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBytes, PyDict};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// A mesh of more triangles helps nobody.
const MOST_TRIANGLES: usize = 20_000_000;
/// Chordal tolerance of meshes, as a share of the diagonal.
const CHORD: f64 = 1e-4;
/// Identifier of a stored model.
const KIND: &str = "CAD model";

/// The contents of a CAD file: trimmed faces, with the edges that they share. See :func:`read_cad` and :attr:`Result.model`.
///
/// ``len(model)`` is the number of faces.
#[pyclass(module = "nurbskin", frozen, weakref)]
pub(crate) struct CadModel {
    file: Arc<CadFile>,
    /// What stands for it in messages and reports.
    name: String,
    /// The file that it was read from.
    source: Option<SourceFile>,
    /// Made when they are asked for, once.
    surfaces: PyOnceLock<Vec<Py<Surface>>>,
}

/// Points, triangles and their faces.
type Triangles<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<u32>>,
    Bound<'py, PyArray1<u32>>,
);

/// A model that goes between processes.
#[derive(serde::Serialize, serde::Deserialize)]
struct Stored {
    is_step: bool,
    model: Model,
    unit_source: UnitSource,
    entities: BTreeMap<String, usize>,
    unread: BTreeMap<String, usize>,
    header: CadHeader,
    warnings: Vec<String>,
    name: String,
}

impl CadModel {
    fn new(file: Arc<CadFile>, name: String, source: Option<SourceFile>) -> Self {
        Self {
            file,
            name,
            source,
            surfaces: PyOnceLock::new(),
        }
    }

    /// The model of a fit or of a surface, as the STEP file that would be written.
    pub(crate) fn of_model(model: Model, name: String) -> Self {
        let file = CadFile {
            format: "step",
            model,
            unit_source: UnitSource::File,
            ..CadFile::default()
        };
        Self::new(Arc::new(file), name, None)
    }

    pub(crate) fn source(&self) -> Source {
        Source::cad(&self.name, Arc::clone(&self.file))
    }

    /// The box around the faces.
    fn extent(&self, py: Python<'_>) -> PyResult<Extent> {
        let file = Arc::clone(&self.file);
        watched(py, None, move |_| extent(&file.model))
    }

    fn mass(&self, py: Python<'_>) -> PyResult<Mass> {
        let file = Arc::clone(&self.file);
        watched(py, None, move |_| mass(&file.model))
    }

    fn diagonal(&self, py: Python<'_>) -> PyResult<f64> {
        self.extent(py).map(|extent| extent.diagonal())
    }
}

/// An input of a verb: a scan, a CAD model, the model of a fit, a surface, or the path of a file; with it the file that it
/// was read from, if there is one.
pub(crate) fn source_of(value: &Bound<'_, PyAny>) -> PyResult<(Source, Option<SourceFile>)> {
    let py = value.py();
    refuse_fork(py)?;
    if let Ok(scan) = value.cast::<Scan>() {
        let scan = scan.get();
        let held = Source::scan(&scan.name(), Arc::clone(&scan.scan));
        return Ok((held, scan.file.clone()));
    }
    if let Ok(model) = value.cast::<CadModel>() {
        let model = model.get();
        return Ok((model.source(), model.source.clone()));
    }
    if let Ok(result) = value.cast::<FitResult>() {
        return Ok((result.get().model(py)?.source(), None));
    }
    if let Ok(surface) = value.cast::<Surface>() {
        let model = surface.get().model("surface").or_raise(py)?;
        return Ok((CadModel::of_model(model, "surface".into()).source(), None));
    }
    let path = value.extract::<PathBuf>()?;
    // Before it is read: what changes meanwhile is another file.
    let file = SourceFile::new(&path);
    let source = Source::open(path, None).or_raise(py)?;
    let file = source.is_file().then_some(file);
    Ok((source, file))
}

/// Reads a CAD file.
#[pyfunction]
#[pyo3(signature = (path, format=None))]
pub(crate) fn read_cad(
    py: Python<'_>,
    path: PathBuf,
    format: Option<String>,
) -> PyResult<CadModel> {
    // Before it is read: what changes meanwhile is another file.
    let source = SourceFile::new(&path);
    let file = watched(py, None, move |_| {
        Source::open(path, format.as_deref())?.read_cad()
    })?;
    Ok(CadModel::new(Arc::new(file), source.said(), Some(source)))
}

#[pymethods]
impl CadModel {
    /// ``step`` or ``iges``.
    #[getter]
    fn format(&self) -> &'static str {
        self.file.format
    }

    /// Unit of all lengths: ``mm``, ``cm``, ``m``, ``um``, ``in`` or ``ft``.
    #[getter]
    fn unit(&self) -> &'static str {
        self.file.model.unit.symbol()
    }

    /// The file that it was read from, absolute, or None.
    #[getter]
    fn path(&self) -> Option<PathBuf> {
        self.source.as_ref().map(|file| file.path().to_owned())
    }

    /// ``author``, ``organization``, ``system`` and ``date`` of the file's header; empty where it does not say.
    #[getter]
    fn header<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        loaded(py, &self.file.header)
    }

    /// What was assumed in reading, and what is doubtful.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.file.warnings.clone()
    }

    /// The surface of each face, without its trimming.
    #[getter]
    fn surfaces(&self, py: Python<'_>) -> PyResult<Vec<Py<Surface>>> {
        let model = &self.file.model;
        let all = self.surfaces.get_or_try_init(py, || {
            let faces = model.faces().iter();
            faces
                .map(|face| Py::new(py, Surface::new_in(face.surface.clone(), model.unit)))
                .collect::<PyResult<Vec<_>>>()
        })?;
        Ok(all.iter().map(|s| s.clone_ref(py)).collect())
    }

    /// Smallest and largest coordinates of the trimmed faces, shape (2, 3).
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let around = self.extent(py)?;
        arrays::of_points(py, vec![around.low, around.high])
    }

    /// Area of all faces, in ``unit`` squared.
    #[getter]
    fn area(&self, py: Python<'_>) -> PyResult<f64> {
        self.mass(py).map(|mass| mass.area)
    }

    /// Volume inside closed shells, in ``unit`` cubed; None where no shell is closed.
    #[getter]
    fn volume(&self, py: Python<'_>) -> PyResult<Option<f64>> {
        self.mass(py).map(|mass| mass.volume)
    }

    /// Whether the faces, taken together, enclose a volume: every edge is shared by two.
    #[getter]
    fn closed(&self) -> bool {
        let all: Vec<usize> = (0..self.file.model.faces().len()).collect();
        !all.is_empty() && self.file.model.is_closed(&all)
    }

    /// What is in the file, as ``nurbskin info --json`` prints it: the same as ``nurbskin.info(model)``.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let source = self.source();
        let found = watched(py, None, move |progress| {
            pipeline::info_from(&source, progress)
        })?;
        loaded(py, &found)
    }

    /// Certified distance of each of (n, 3) points to the trimmed faces; positive outside.
    ///
    /// ``tolerance`` is for the share within, in the statistics, which is None without one: a number in ``unit``, or as
    /// ``"0.1mm"`` or ``"0.1%"`` (of the diagonal of the faces).
    #[pyo3(signature = (points, tolerance=None))]
    fn deviation(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        tolerance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Deviation> {
        let points = arrays::points(points, "points")?;
        Deviation::check(py, &points)?;
        let unit = self.file.model.unit;
        let tolerance = words::length("tolerance", tolerance, unit, self.diagonal(py)?)?;
        let file = Arc::clone(&self.file);
        watched(py, None, move |progress| {
            let target = target_of(&file.model)?;
            measure_model(&target, &points, None, tolerance, progress)
        })
        .map(Deviation)
    }

    /// The nearest point of the trimmed faces for each point of shape (..., 3): the points, their parameters (u, v) on
    /// their faces, the distances, and the indices of the faces.
    fn closest_point<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (points, shape) = arrays::places(points, "points")?;
        Deviation::check(py, &points)?;
        let file = Arc::clone(&self.file);
        let feet: Vec<ModelFoot> = watched(py, None, move |progress| {
            target_of(&file.model)?.closest_all(&points, None, progress)
        })?;
        let found = ClosestArrays {
            points: feet.iter().map(|f| f.foot.point).collect(),
            parameters: feet.iter().map(|f| [f.foot.u, f.foot.v]).collect(),
            distance: feet.iter().map(|f| f.foot.distance).collect(),
            face: feet.iter().map(|f| f.face).collect(),
        };
        closest_arrays(py, found, &shape)
    }

    /// A watertight mesh within a chordal tolerance (a ten-thousandth of the diagonal where None): points (k, 3), triangles
    /// (t, 3), and the face of each triangle (t,).
    #[pyo3(signature = (tolerance=None))]
    fn triangles<'py>(&self, py: Python<'py>, tolerance: Option<f64>) -> PyResult<Triangles<'py>> {
        let chord = match tolerance {
            Some(tolerance) => tolerance,
            None => CHORD * self.diagonal(py)?,
        };
        let file = Arc::clone(&self.file);
        let mesh = watched(py, None, move |_| {
            let mesh = tessellate(&file.model, chord, MOST_TRIANGLES)?;
            match mesh.left_out.first() {
                None => Ok(mesh),
                Some((face, why)) => Err(Error::NoSolution(format!(
                    "face {face} has no triangles: {why}"
                ))),
            }
        })?;
        Ok((
            arrays::of_points(py, mesh.points)?,
            arrays::of_triangles(py, mesh.triangles)?,
            mesh.faces.into_pyarray(py),
        ))
    }

    /// The quality of the model, as ``nurbskin check --json`` prints it: the same as ``nurbskin.check(model)``.
    fn check<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let source = self.source();
        let found = watched(py, None, move |progress| {
            pipeline::check_from(&source, progress)
        })?;
        loaded(py, &found)
    }

    /// Writes the model, each path in the format of its extension, with the options of ``nurbskin.convert``: .step, .stp,
    /// .igs, .iges, .stl, .obj, .ply or .glb. Returns the warnings.
    ///
    /// Raises
    /// ------
    /// WriteError : if the disk refuses; nothing is left behind then.
    #[pyo3(signature = (*paths, tolerance=None, to_unit="auto", step_schema=None, author=None, organization=None))]
    fn write(
        this: &Bound<'_, Self>,
        paths: Vec<PathBuf>,
        tolerance: Option<&Bound<'_, PyAny>>,
        to_unit: &str,
        step_schema: Option<&str>,
        author: Option<&str>,
        organization: Option<&str>,
    ) -> PyResult<Vec<String>> {
        let options = words::convert_options(
            this.py(),
            tolerance,
            "auto",
            to_unit,
            step_schema,
            author,
            organization,
        )?;
        let done = crate::verbs::converted(this.as_any(), paths, options)?;
        Ok(done.warnings)
    }

    /// Triangles for display as a dictionary of arrays: ``points``, ``triangles``, ``normals``, ``parameters``, ``face``,
    /// ``mean_curvature``, ``gaussian_curvature``.
    fn _mesh<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let file = Arc::clone(&self.file);
        let mesh = watched(py, None, move |progress| {
            display_mesh(&file.model, None, progress)
        })?;
        mesh_of(py, mesh, DVec3::ZERO)
    }

    /// The model as a ``trimesh.Trimesh`` within a chordal tolerance.
    #[pyo3(signature = (tolerance=None))]
    fn to_trimesh<'py>(
        this: &Bound<'py, Self>,
        tolerance: Option<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let convert = this.py().import("nurbskin._convert")?;
        convert.call_method1("surface_to_trimesh", (this, tolerance))
    }

    /// The trimmed faces as a ``pyvista.PolyData``, with the point data ``normals``, ``parameters``, ``face``,
    /// ``mean_curvature`` (positive where convex seen from outside) and ``gaussian_curvature``.
    fn to_pyvista<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let convert = this.py().import("nurbskin._convert")?;
        convert.call_method1("mesh_to_pyvista", (this,))
    }

    fn _repr_html_<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let convert = this.py().import("nurbskin._picture")?;
        convert.call_method1("model_to_html", (this,))
    }

    fn __reduce__<'py>(
        this: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, model) = (this.py(), this.get());
        let file = &*model.file;
        let stored = Stored {
            is_step: file.format == "step",
            model: file.model.clone(),
            unit_source: file.unit_source,
            entities: file.entities.clone(),
            unread: file.unread.clone(),
            header: file.header.clone(),
            warnings: file.warnings.clone(),
            name: model.name.clone(),
        };
        let stored = binary::to_bytes(KIND, &stored).or_raise(py)?;
        let source = model.source.clone().map(SourceFile::into_parts);
        let parts = (PyBytes::new(py, &stored), source);
        let restore = this.get_type().getattr("_restored")?;
        Ok((restore, parts.into_pyobject(py)?.into_any()))
    }

    #[staticmethod]
    fn _restored(py: Python<'_>, stored: &[u8], source: Option<FileParts>) -> PyResult<Self> {
        let stored: Stored = binary::from_bytes(KIND, stored).or_raise(py)?;
        let file = CadFile {
            format: if stored.is_step { "step" } else { "iges" },
            model: stored.model,
            unit_source: stored.unit_source,
            entities: stored.entities,
            unread: stored.unread,
            header: stored.header,
            warnings: stored.warnings,
        };
        let source = source.map(SourceFile::from_parts);
        Ok(Self::new(Arc::new(file), stored.name, source))
    }

    fn __len__(&self) -> usize {
        self.file.model.faces().len()
    }

    fn __repr__(&self) -> String {
        let unit: Unit = self.file.model.unit;
        let faces = counted(self.file.model.faces().len(), "face", "faces");
        format!("CadModel({faces}, {unit})")
    }
}

/// The faces to search.
fn target_of(model: &Model) -> nurbskin::Result<ClosestOnModel<'_>> {
    if model.faces().is_empty() {
        return Err(Error::invalid("the model has no faces"));
    }
    ClosestOnModel::new(model)
}
