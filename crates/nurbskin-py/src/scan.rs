//! Scans: read from files, made of arrays, simulated.

use crate::arrays;
use crate::errors::Raised;
use crate::phrases::in_python;
use crate::source::{FileParts, SourceFile};
use crate::watch::watched;
use crate::words;
use numpy::PyArray2;
use nurbskin::io::{in_memory, write_scan};
use nurbskin::pipeline::{SCAN_FORMATS, Source, check_folders, check_outputs, enriched, rarefied};
use nurbskin::scan::simulate::{
    Body, BodyOptions, Layout, Order, ScanOptions, Shape, scan as scanned, scan_body,
};
use nurbskin::scan::{GridLayout, Organisation, Scan as Read};
use nurbskin::unit::UnitSource;
use nurbskin::{DVec3, Error, Unit};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;
use std::sync::Arc;

/// A scan: points and what is known of their order.
///
/// Parameters
/// ----------
/// points : (n, 3), or (m, n, 3) in order with u along the first axis and NaN in cells without a point.
/// triangles : (t, 3) indices of a mesh; a grid has none.
/// normals : in the shape of the points.
/// unit : ``mm``, ``cm``, ``m``, ``um``, ``in`` or ``ft``; mm is assumed where None.
///
/// ``np.asarray(scan)`` is ``scan.points``.
#[pyclass(module = "nurbskin", frozen)]
#[derive(Clone)]
pub(crate) struct Scan {
    pub(crate) scan: Arc<Read>,
    /// The file that it was read from.
    pub(crate) file: Option<SourceFile>,
}

impl Scan {
    fn of(scan: Read) -> Self {
        Self {
            scan: Arc::new(scan),
            file: None,
        }
    }

    /// What was made of another scan, with what was said meanwhile in the words of Python.
    fn with_warnings(mut scan: Read, warnings: Vec<String>) -> Self {
        let said = warnings.iter().map(|sentence| in_python(sentence));
        scan.warnings = said.collect();
        Self::of(scan)
    }

    /// What stands for it in messages and reports.
    pub(crate) fn name(&self) -> String {
        match &self.file {
            Some(file) => file.said(),
            None => format!("{} points", self.scan.points.len()),
        }
    }
}

/// Reads a scan.
#[pyfunction]
#[pyo3(signature = (path, format=None))]
pub(crate) fn read(py: Python<'_>, path: PathBuf, format: Option<String>) -> PyResult<Scan> {
    // Before it is read: what changes meanwhile is another file.
    let file = SourceFile::new(&path);
    let scan = watched(py, None, move |_| {
        Source::open(path, format.as_deref())?.read_scan()
    })?;
    Ok(Scan {
        scan: Arc::new(scan),
        file: Some(file),
    })
}

#[pymethods]
impl Scan {
    #[new]
    #[pyo3(signature = (points, triangles=None, normals=None, unit=None))]
    fn new(
        points: &Bound<'_, PyAny>,
        triangles: Option<&Bound<'_, PyAny>>,
        normals: Option<&Bound<'_, PyAny>>,
        unit: Option<&str>,
    ) -> PyResult<Self> {
        let py = points.py();
        let array = arrays::float64(points)?;
        let shape = array.as_array().shape().to_vec();
        let is_grid = shape.len() == 3;
        if !is_grid && shape.len() != 2 {
            return arrays::refused(py, "points", "(n, 3) or (m, n, 3)", &shape);
        }
        // The points of a grid in the library's order, u fastest.
        let listed = |value: &Bound<'_, PyAny>, what| match is_grid {
            true => arrays::cells(value, what),
            false => arrays::points(value, what).map(|list| ([list.len(), 1], list)),
        };
        let ([m, n], points) = listed(array.as_any(), "points")?;
        let organisation = match (is_grid, triangles) {
            (true, Some(_)) => {
                return Err(Error::invalid("a grid has no triangles of its own")).or_raise(py);
            }
            (true, None) => {
                let layout = GridLayout::complete(m, n)
                    .ok_or_else(|| Error::invalid("the grid is too large"))
                    .or_raise(py)?;
                Organisation::Grid(layout)
            }
            (false, Some(triangles)) => Organisation::Mesh(arrays::triangles(triangles)?),
            (false, None) => Organisation::Unordered,
        };
        let normals = normals.map(|n| listed(n, "normals").map(|(_, list)| list));
        let normals = normals.transpose()?;
        let unit = words::word::<Option<Unit>>("unit", unit.unwrap_or("auto")).or_raise(py)?;
        let scan = Read {
            points,
            organisation,
            normals,
            unit: unit.unwrap_or_default(),
            unit_source: unit.map_or(UnitSource::Assumed, |_| UnitSource::Option),
            ..Read::default()
        };
        in_memory(scan).or_raise(py).map(Self::of)
    }

    /// The points in the coordinates of the file, shape (n, 3); those of a grid column by column of ``array``
    /// (``array[:, 0]``, then ``array[:, 1]``), empty cells left out.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let origin = self.scan.origin;
        let points: Vec<DVec3> = self.scan.points.iter().map(|&p| p + origin).collect();
        arrays::of_points(py, points)
    }

    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        arrays::converted(self.points(py)?.into_any(), dtype, copy)
    }

    /// The points of a grid, shape (m, n, 3), u along the first axis, NaN in empty cells; None where there is no grid.
    #[getter]
    fn array<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Organisation::Grid(layout) = &self.scan.organisation else {
            return Ok(None);
        };
        let (scan, [m, n]) = (&self.scan, [layout.count_u, layout.count_v]);
        let point = |cell: &Option<u32>| {
            cell.and_then(|k| scan.points.get(k as usize))
                .map_or(DVec3::NAN, |&p| p + scan.origin)
        };
        let cells = layout.cells.iter().map(point).collect();
        arrays::of_cells(py, [m, n], cells).map(Some)
    }

    /// Triangles between them, shape (t, 3), or None.
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<u32>>>> {
        match &self.scan.organisation {
            Organisation::Mesh(triangles) => arrays::of_triangles(py, triangles.clone()).map(Some),
            _ => Ok(None),
        }
    }

    /// One normal for each point, shape (n, 3), or None.
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let normals = self.scan.normals.clone();
        normals.map(|n| arrays::of_points(py, n)).transpose()
    }

    /// ``unordered``, ``rows``, ``grid`` or ``mesh``.
    #[getter]
    fn organisation(&self) -> &'static str {
        self.scan.organisation.name()
    }

    /// Points along u and v of a grid, or None.
    #[getter]
    fn grid(&self) -> Option<(usize, usize)> {
        match &self.scan.organisation {
            Organisation::Grid(layout) => Some((layout.count_u, layout.count_v)),
            _ => None,
        }
    }

    /// Unit of the coordinates: ``mm``, ``cm``, ``m``, ``um``, ``in`` or ``ft``.
    #[getter]
    fn unit(&self) -> &'static str {
        self.scan.unit.symbol()
    }

    /// The file that it was read from, absolute, or None.
    #[getter]
    fn path(&self) -> Option<PathBuf> {
        self.file.as_ref().map(|file| file.path().to_owned())
    }

    /// What was assumed in reading, and what is doubtful.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.scan.warnings.clone()
    }

    /// The paper's logical rarefaction (section 4.2) of an ordered scan: a scan of the lines that its shape needs, a grid.
    ///
    /// The order is found as :func:`fit` finds it: rows need not be of one length, and the points of ``grid=(M, N)`` are N rows
    /// of M points. ``rarefy``, ``tolerance`` and ``parameters`` are those of :func:`fit`; :func:`rarefy` returns the indices
    /// of the lines.
    ///
    /// Raises
    /// ------
    /// UnsupportedError : for a scan without order.
    #[pyo3(signature = (rarefy=None, *, tolerance=None, grid=None, topology=None, degree=None, parameters=None, unit=None))]
    fn rarefy(
        &self,
        py: Python<'_>,
        rarefy: Option<&Bound<'_, PyAny>>,
        tolerance: Option<&Bound<'_, PyAny>>,
        grid: Option<&Bound<'_, PyAny>>,
        topology: Option<&str>,
        degree: Option<&Bound<'_, PyAny>>,
        parameters: Option<&str>,
        unit: Option<&str>,
    ) -> PyResult<Self> {
        let keywords = PyDict::new(py);
        keywords.set_item("rarefy", rarefy)?;
        keywords.set_item("tolerance", tolerance)?;
        keywords.set_item("grid", grid)?;
        keywords.set_item("topology", topology)?;
        keywords.set_item("degree", degree)?;
        keywords.set_item("parameters", parameters)?;
        keywords.set_item("unit", unit)?;
        let options = words::options(&keywords)?;
        let source = Source::scan(&self.name(), Arc::clone(&self.scan));
        let (scan, done) = watched(py, None, move |progress| {
            rarefied(&source, &options, progress)
        })?;
        Ok(Self::with_warnings(scan, done.warnings))
    }

    /// Catmull-Clark enrichment (the paper's section 4.1) of a sparse ordered scan: a denser scan, a grid. ``levels`` is 0 to 6;
    /// each doubles the points along u and v. The order is found as for :meth:`rarefy`.
    ///
    /// Raises
    /// ------
    /// UnsupportedError : for a scan without order.
    #[pyo3(signature = (levels=1, *, grid=None, topology=None, unit=None))]
    fn enrich(
        &self,
        py: Python<'_>,
        levels: usize,
        grid: Option<&Bound<'_, PyAny>>,
        topology: Option<&str>,
        unit: Option<&str>,
    ) -> PyResult<Self> {
        let keywords = PyDict::new(py);
        keywords.set_item("enrich", levels)?;
        keywords.set_item("grid", grid)?;
        keywords.set_item("topology", topology)?;
        keywords.set_item("unit", unit)?;
        let options = words::options(&keywords)?;
        let source = Source::scan(&self.name(), Arc::clone(&self.scan));
        let (scan, done) = watched(py, None, move |progress| {
            enriched(&source, &options, progress)
        })?;
        Ok(Self::with_warnings(scan, done.warnings))
    }

    /// Writes the scan: .ply, .xyz, .txt, .asc, .csv. Returns what the format could not hold.
    ///
    /// Raises
    /// ------
    /// WriteError : if the disk refuses; nothing is left behind then.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<Vec<String>> {
        let scan = Arc::clone(&self.scan);
        watched(py, None, move |_| {
            let paths = std::slice::from_ref(&path);
            check_outputs(&[], paths, &SCAN_FORMATS)?;
            check_folders(paths)?;
            write_scan(&path, &scan)
        })
    }

    fn __reduce__<'py>(
        this: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = this.py();
        let stored = this.get().scan.to_bytes().or_raise(py)?;
        let file = this.get().file.clone().map(SourceFile::into_parts);
        let parts = (PyBytes::new(py, &stored), file);
        let restore = this.get_type().getattr("_restored")?;
        Ok((restore, parts.into_pyobject(py)?.into_any()))
    }

    #[staticmethod]
    fn _restored(py: Python<'_>, stored: &[u8], file: Option<FileParts>) -> PyResult<Self> {
        let scan = Arc::new(Read::from_bytes(stored).or_raise(py)?);
        let file = file.map(SourceFile::from_parts);
        Ok(Self { scan, file })
    }

    fn __len__(&self) -> usize {
        self.scan.points.len()
    }

    fn __repr__(&self) -> String {
        let (kind, unit) = (self.scan.organisation.name(), self.scan.unit);
        format!("Scan({} points, {kind}, {unit})", self.scan.points.len())
    }
}

/// Scans a known shape with a virtual scanner.
#[pyfunction]
#[pyo3(signature = (shape, points=None, noise=0.0, outliers=0.0, holes=0, seed=0, shuffled=false, opening=false, mesh=false, unaligned=false))]
pub(crate) fn simulate(
    py: Python<'_>,
    shape: &str,
    points: Option<usize>,
    noise: f64,
    outliers: f64,
    holes: usize,
    seed: u64,
    shuffled: bool,
    opening: bool,
    mesh: bool,
    unaligned: bool,
) -> PyResult<Scan> {
    if unaligned && !mesh {
        return Err(Error::invalid(
            "unaligned: it is a kind of mesh; add mesh=True",
        ))
        .or_raise(py);
    }
    if let Some(body) = Body::from_name(shape) {
        let options = BodyOptions {
            points,
            layout: match (mesh, unaligned) {
                (false, _) => Layout::Cloud,
                (true, false) => Layout::Mesh,
                (true, true) => Layout::Unaligned,
            },
            noise,
            outliers,
            holes,
            seed,
        };
        let mut simulated = watched(py, None, move |_| scan_body(body, &options))?;
        simulated.scan.unit_source = UnitSource::File;
        return Ok(Scan::of(simulated.scan));
    }
    let bodies = Body::ALL.map(Body::name);
    let Some(shape) = Shape::from_name(shape) else {
        let known = [&Shape::ALL.map(Shape::name)[..], &bodies[..]].concat();
        return Err(Error::invalid(format!(
            "no shape is called {shape}: use one of {}",
            known.join(", ")
        )))
        .or_raise(py);
    };
    if mesh {
        return Err(Error::invalid(format!(
            "a {} has no mesh: use one of {}",
            shape.name(),
            bodies.join(", ")
        )))
        .or_raise(py);
    }
    let options = ScanOptions {
        points,
        noise,
        outliers,
        holes,
        seed,
        order: if shuffled {
            Order::Shuffled
        } else {
            Order::Ordered
        },
        opening,
        ..ScanOptions::default()
    };
    let mut simulated = watched(py, None, move |_| scanned(shape, &options))?;
    // The scanner knows its unit.
    simulated.scan.unit_source = UnitSource::File;
    Ok(Scan::of(simulated.scan))
}
