//! NURBS surfaces.

use crate::arrays::{self, Places};
use crate::curve::Curve;
use crate::deviation::Deviation;
use crate::errors::Raised;
use crate::knots::knot_vectors;
use crate::watch::{refuse_fork, watched};
use crate::words;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use nurbskin::cad::{Model, extent, mass};
use nurbskin::deviation::measure::{Outside, measure};
use nurbskin::io::Timestamp;
use nurbskin::io::cad::{CadWriteOptions, write_cad};
use nurbskin::nurbs::closest::ClosestPoint;
use nurbskin::nurbs::refine::Direction;
use nurbskin::nurbs::tessellate::tessellate;
use nurbskin::{ControlNet, DVec2, DVec3, Error, NurbsSurface, Unit};
use pyo3::prelude::*;
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// Fewer places than this are not worth a second thread.
const FEW: usize = 2048;
/// Places between two looks for Ctrl-C: some tens of milliseconds.
const SLICE: usize = 1 << 18;
/// A mesh of more triangles helps nobody.
const MOST_TRIANGLES: usize = 20_000_000;
/// Sides of a surface that are one, as a share of its diagonal.
const SAME: f64 = 1e-9;
/// Chordal tolerance of meshes, as a share of the diagonal.
const CHORD: f64 = 1e-4;

/// Points, triangles and parameters of a mesh.
type Triangles<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<u32>>,
    Bound<'py, PyArray2<f64>>,
);

/// A tensor-product NURBS surface S(u, v).
///
/// ``surface(u, v, du=0, dv=0)`` gives points, or derivatives by u ``du`` times and by v ``dv`` times (``du + dv`` at most
/// 2), shape ``(..., 3)``: ``u`` and ``v`` broadcast against each other. Outside the domain they are taken at its end, or
/// one turn on where the direction is periodic.
///
/// Parameters
/// ----------
/// control_points : (m, n, 3), u along the first axis.
/// knots_u, knots_v : knot vectors of m + p + 1 and n + q + 1 knots, clamped or not.
/// degree : p and q, one number for both; 3 where None.
/// weights : (m, n), positive; none for a polynomial surface.
/// periodic : two truth values: directions whose knots continue themselves and whose last p control points repeat the
///     first p; none where None.
/// unit : of the coordinates, for files.
///
/// Raises
/// ------
/// InvalidError : if the counts disagree or numbers are out of range.
///
/// Examples
/// --------
/// >>> import numpy as np, nurbskin
/// >>> x, y = np.meshgrid(np.arange(4.0), np.arange(4.0), indexing="ij")
/// >>> net = np.stack([x, y, x * y], axis=-1)
/// >>> knots = [0, 0, 0, 0, 1, 1, 1, 1]
/// >>> surface = nurbskin.NurbsSurface(net, knots, knots)
/// >>> surface(0.5, 0.5)
/// array([1.5 , 1.5 , 2.25])
#[pyclass(name = "NurbsSurface", module = "nurbskin", frozen, weakref)]
#[derive(Clone)]
pub(crate) struct Surface {
    surface: Arc<NurbsSurface>,
    /// Of its coordinates, for files.
    unit: Unit,
}

impl From<NurbsSurface> for Surface {
    fn from(surface: NurbsSurface) -> Self {
        Self::new_in(surface, Unit::default())
    }
}

impl Surface {
    pub(crate) fn new_in(surface: NurbsSurface, unit: Unit) -> Self {
        Self {
            surface: Arc::new(surface),
            unit,
        }
    }

    /// `f` of every place, `width` numbers each.
    fn map(
        &self,
        py: Python<'_>,
        places: &Places,
        width: usize,
        f: impl Fn(&NurbsSurface, DVec2, &mut [f64]) + Sync,
    ) -> PyResult<Vec<f64>> {
        refuse_fork(py)?;
        let (surface, all) = (&*self.surface, &places.parameters);
        let mut out = vec![0.0; width * all.len()];
        for (out, all) in out.chunks_mut(width * SLICE).zip(all.chunks(SLICE)) {
            py.detach(|| {
                out.par_chunks_mut(width)
                    .zip(all)
                    .with_min_len(FEW)
                    .for_each(|(out, &at)| f(surface, at, out));
            });
            py.check_signals()?;
        }
        Ok(out)
    }

    fn diagonal(&self) -> f64 {
        let [low, high] = self.surface.bounding_box();
        low.distance(high)
    }

    /// The whole surface as the face of a model.
    pub(crate) fn model(&self, name: &str) -> nurbskin::Result<Model> {
        let mut model = Model::new(name);
        model.unit = self.unit;
        let face = model.add_whole_surface(&self.surface, SAME * self.diagonal())?;
        model.add_shell_of(face)?;
        Ok(model)
    }
}

/// Nearest points, in lists.
pub(crate) struct ClosestArrays {
    pub(crate) points: Vec<DVec3>,
    pub(crate) parameters: Vec<[f64; 2]>,
    pub(crate) distance: Vec<f64>,
    pub(crate) face: Vec<usize>,
}

/// Nearest points as the named tuple of Python, for points of this shape.
pub(crate) fn closest_arrays<'py>(
    py: Python<'py>,
    found: ClosestArrays,
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    let with = |last: usize| [shape, &[last]].concat();
    let points: Vec<[f64; 3]> = bytemuck::allocation::cast_vec(found.points);
    let all = (
        points.into_flattened().into_pyarray(py).reshape(with(3))?,
        found
            .parameters
            .into_flattened()
            .into_pyarray(py)
            .reshape(with(2))?,
        found.distance.into_pyarray(py).reshape(shape.to_vec())?,
        found.face.into_pyarray(py).reshape(shape.to_vec())?,
    );
    py.import("nurbskin._types")?
        .getattr("ClosestPoints")?
        .call1(all)
}

/// An affine map of a (4, 4), (3, 4) or (3, 3) matrix.
fn affine(matrix: &Bound<'_, PyAny>) -> PyResult<impl Fn(DVec3) -> DVec3 + use<>> {
    let py = matrix.py();
    let array = arrays::float64(matrix)?;
    let all = array.as_slice()?;
    let (columns, last) = match array.as_array().shape() {
        [3, columns @ (3 | 4)] => (*columns, None),
        [4, 4] => (4, all.get(12..)),
        shape => return arrays::refused(py, "matrix", "(4, 4), (3, 4) or (3, 3)", shape),
    };
    if last.is_some_and(|last| last != [0.0, 0.0, 0.0, 1.0]) {
        let what = "matrix: the last row of an affine map is 0, 0, 0, 1";
        return Err(Error::invalid(what)).or_raise(py);
    }
    let row = |k: usize| &all[k * columns..(k + 1) * columns];
    let rows = [row(0), row(1), row(2)];
    let [x, y, z] = rows.map(DVec3::from_slice);
    let by = DVec3::from(rows.map(|row| row.get(3).copied().unwrap_or_default()));
    let volume = x.dot(y.cross(z));
    if !volume.is_finite() || !by.is_finite() || volume.abs() < f64::MIN_POSITIVE {
        let what = "matrix: a map that can be undone is needed, of finite numbers";
        return Err(Error::invalid(what)).or_raise(py);
    }
    Ok(move |p: DVec3| DVec3::new(x.dot(p), y.dot(p), z.dot(p)) + by)
}

/// The diagonal of the box around points; zero of none.
pub(crate) fn diagonal_of(points: &[DVec3]) -> f64 {
    let Some(&first) = points.first() else {
        return 0.0;
    };
    let [low, high] = points
        .iter()
        .fold([first; 2], |[a, b], &p| [a.min(p), b.max(p)]);
    low.distance(high)
}

#[pymethods]
impl Surface {
    #[new]
    #[pyo3(signature = (control_points, knots_u, knots_v, degree=None, weights=None, periodic=None, unit="mm"))]
    fn new(
        control_points: &Bound<'_, PyAny>,
        knots_u: &Bound<'_, PyAny>,
        knots_v: &Bound<'_, PyAny>,
        degree: Option<&Bound<'_, PyAny>>,
        weights: Option<&Bound<'_, PyAny>>,
        periodic: Option<&Bound<'_, PyAny>>,
        unit: &str,
    ) -> PyResult<Self> {
        let py = control_points.py();
        let ([m, n], points) = arrays::cells(control_points, "control_points")?;
        let [knots_u, knots_v] = knot_vectors(knots_u, knots_v, degree, periodic)?;
        let unit = words::word::<Option<Unit>>("unit", unit)
            .or_raise(py)?
            .unwrap_or_default();
        let weights = weights.map(|w| arrays::weights(w, [m, n])).transpose()?;
        let net = ControlNet::new(m, n, points).or_raise(py)?;
        NurbsSurface::new(knots_u, knots_v, net, weights)
            .or_raise(py)
            .map(|surface| Self::new_in(surface, unit))
    }

    /// Degrees in u and v.
    #[getter]
    fn degree(&self) -> (usize, usize) {
        self.surface.degree().into()
    }

    /// Which directions are periodic: the last p control points there repeat the first p.
    #[getter]
    fn periodic(&self) -> (bool, bool) {
        self.surface.periodic().into()
    }

    /// Whether it has weights.
    #[getter]
    fn rational(&self) -> bool {
        self.surface.is_rational()
    }

    /// Unit of the coordinates: ``mm``, ``cm``, ``m``, ``um``, ``in`` or ``ft``.
    #[getter]
    fn unit(&self) -> &'static str {
        self.unit.symbol()
    }

    /// Ranges of u and v: ``((u0, u1), (v0, v1))``.
    #[getter]
    fn domain(&self) -> ((f64, f64), (f64, f64)) {
        self.surface.domain().into()
    }

    /// Knot vector of u, shape (m + p + 1,); shares the memory of the surface, read-only.
    #[getter]
    fn knots_u<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        arrays::numbers_of(
            this.get().surface.knots_u().knots(),
            this.clone().into_any(),
        )
    }

    /// Knot vector of v, shape (n + q + 1,); shares the memory of the surface, read-only.
    #[getter]
    fn knots_v<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        arrays::numbers_of(
            this.get().surface.knots_v().knots(),
            this.clone().into_any(),
        )
    }

    /// Control points P[i, j], shape (m, n, 3), in the unit of the scan; shares the memory of the surface, read-only.
    #[getter]
    fn control_points<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        arrays::net_of(this.get().surface.control_points(), this.clone().into_any())
    }

    /// Weights, shape (m, n), or None; shares the memory of the surface, read-only.
    #[getter]
    fn weights<'py>(this: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let surface = &this.get().surface;
        let counts = surface.control_points().counts();
        let weights = surface.weights();
        weights
            .map(|w| arrays::weights_of(w, counts, this.clone().into_any()))
            .transpose()
    }

    // Python shows no documentation of this method: see that of the class.
    #[pyo3(signature = (u, v, du=0, dv=0))]
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        du: usize,
        dv: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let places = Places::new(u, v)?;
        let values = match (du, dv) {
            (0, 0) => self.map(py, &places, 3, |s, at, out| {
                s.point(at.x, at.y).write_to_slice(out);
            })?,
            (0..=2, 0..=2) if du + dv <= 2 => self.map(py, &places, 3, |s, at, out| {
                let d = s.derivatives(at.x, at.y);
                let value = match (du, dv) {
                    (1, 0) => d.du,
                    (0, 1) => d.dv,
                    (2, 0) => d.duu,
                    (1, 1) => d.duv,
                    _ => d.dvv,
                };
                value.write_to_slice(out);
            })?,
            _ => {
                let what = "derivatives: du + dv is 2 at most";
                return Err(Error::invalid(what)).or_raise(py);
            }
        };
        places.shaped(py, values, 3)
    }

    /// Unit normals along ``S_u x S_v``, shape ``(..., 3)``; NaN where there is none.
    fn normal<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let places = Places::new(u, v)?;
        let values = self.map(py, &places, 3, |s, at, out| {
            s.normal(at.x, at.y)
                .unwrap_or(DVec3::NAN)
                .write_to_slice(out);
        })?;
        places.shaped(py, values, 3)
    }

    /// Gaussian, mean and principal curvatures, each in the shape of the parameters; NaN where there are none.
    fn curvature<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let places = Places::new(u, v)?;
        let values = self.map(py, &places, 4, |s, at, out| {
            let all = s.curvature(at.x, at.y).map_or([f64::NAN; 4], |c| {
                [c.gaussian, c.mean, c.principal[0], c.principal[1]]
            });
            out.copy_from_slice(&all);
        })?;
        let column = |k: usize| {
            let one = values.iter().skip(k).step_by(4).copied().collect();
            places.shaped(py, one, 0)
        };
        let all = (column(0)?, column(1)?, column(2)?, column(3)?);
        py.import("nurbskin._types")?
            .getattr("Curvature")?
            .call1(all)
    }

    /// Certified distance of each of (n, 3) points to the surface, with its place; positive on the side of the normal.
    ///
    /// ``tolerance`` is for the share within, in the statistics, which is None without one: a number in ``unit``, or as
    /// ``"0.1mm"`` or ``"0.1%"`` (of the diagonal of the points). About a microsecond per point and core.
    #[pyo3(signature = (points, tolerance=None))]
    fn deviation(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        tolerance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Deviation> {
        let points = arrays::points(points, "points")?;
        Deviation::check(py, &points)?;
        let tolerance = words::length("tolerance", tolerance, self.unit, diagonal_of(&points))?;
        let surface = Arc::clone(&self.surface);
        watched(py, None, move |progress| {
            let closest = ClosestPoint::new(&surface)?;
            measure(
                &closest,
                &points,
                None,
                tolerance,
                Outside::Normal,
                progress,
            )
        })
        .map(Deviation)
    }

    /// Smallest and largest coordinates of the whole surface, shape (2, 3); closer than those of its control points.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let surface = self.clone();
        let around = watched(py, None, move |_| extent(&surface.model("surface")?))?;
        arrays::of_points(py, vec![around.low, around.high])
    }

    /// Area of the whole surface, in ``unit`` squared, to about ten digits.
    #[getter]
    fn area(&self, py: Python<'_>) -> PyResult<f64> {
        let surface = self.clone();
        let mass = watched(py, None, move |_| mass(&surface.model("surface")?))?;
        Ok(mass.area)
    }

    /// The nearest point of the whole surface for each point of shape (..., 3): the points, their parameters (u, v), the
    /// distances; the faces are all 0. :meth:`deviation` has certified bounds and signs.
    fn closest_point<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (points, shape) = arrays::places(points, "points")?;
        Deviation::check(py, &points)?;
        let surface = Arc::clone(&self.surface);
        let feet = watched(py, None, move |progress| {
            ClosestPoint::new(&surface)?.closest_all_with(&points, None, progress)
        })?;
        let found = ClosestArrays {
            points: feet.iter().map(|foot| foot.point).collect(),
            parameters: feet.iter().map(|foot| [foot.u, foot.v]).collect(),
            distance: feet.iter().map(|foot| foot.distance).collect(),
            face: vec![0; feet.len()],
        };
        closest_arrays(py, found, &shape)
    }

    /// The curve of the surface at a fixed u, which runs along v, or at a fixed v. Exact.
    #[pyo3(signature = (*, u=None, v=None))]
    fn isocurve(&self, py: Python<'_>, u: Option<f64>, v: Option<f64>) -> PyResult<Curve> {
        let (direction, t) = match (u, v) {
            (Some(u), None) => (Direction::U, u),
            (None, Some(v)) => (Direction::V, v),
            _ => {
                let what = "isocurve: give u or v, one of them";
                return Err(Error::invalid(what)).or_raise(py);
            }
        };
        if !t.is_finite() {
            return Err(Error::invalid("the parameter is not finite")).or_raise(py);
        }
        let curve = self.surface.iso_curve(direction, t).or_raise(py)?;
        Ok(curve.into())
    }

    /// The surface moved by an affine map, a matrix of shape (4, 4), (3, 4) or (3, 3) for columns ``(x, y, z, 1)``. Exact, as
    /// its control points move. A map that mirrors turns the normals to the other side.
    fn transform(&self, matrix: &Bound<'_, PyAny>) -> PyResult<Self> {
        let map = affine(matrix)?;
        let moved = self.surface.map_points(map).or_raise(matrix.py())?;
        Ok(Self::new_in(moved, self.unit))
    }

    /// A mesh within a chordal tolerance (a ten-thousandth of the diagonal where None): points (k, 3), triangles (t, 3),
    /// parameters (k, 2). Seams are closed and poles one vertex.
    #[pyo3(signature = (tolerance=None))]
    fn triangles<'py>(&self, py: Python<'py>, tolerance: Option<f64>) -> PyResult<Triangles<'py>> {
        let chord = tolerance.unwrap_or(CHORD * self.diagonal());
        let surface = Arc::clone(&self.surface);
        let mesh = watched(py, None, move |_| {
            tessellate(&surface, chord, MOST_TRIANGLES)
        })?;
        Ok((
            arrays::of_points(py, mesh.points)?,
            arrays::of_triangles(py, mesh.triangles)?,
            arrays::of_parameters(py, &mesh.parameters)?,
        ))
    }

    /// Writes the whole surface as a CAD file, STEP or IGES by the extension (.step, .stp, .igs, .iges). ``unit`` is that of
    /// the coordinates, the surface's own where None: the scan's, if it was fitted to one.
    ///
    /// Raises
    /// ------
    /// WriteError : if the disk refuses; nothing is left behind then.
    #[pyo3(signature = (path, unit=None))]
    fn write(&self, py: Python<'_>, path: PathBuf, unit: Option<&str>) -> PyResult<()> {
        let unit = words::word::<Option<Unit>>("unit", unit.unwrap_or("auto")).or_raise(py)?;
        let unit = unit.unwrap_or(self.unit);
        let name = |part: Option<&std::ffi::OsStr>| {
            part.map(|n| n.to_string_lossy().into_owned())
                .unwrap_or_default()
        };
        let surface = Self {
            unit,
            ..self.clone()
        };
        watched(py, None, move |_| {
            let model = surface.model(&name(path.file_stem()))?;
            let options = CadWriteOptions {
                product: name(path.file_stem()),
                file_name: name(path.file_name()),
                time: Timestamp::now()?,
                ..CadWriteOptions::default()
            };
            write_cad(&path, &model, &options)
        })
    }

    /// The surface as a ``scipy.interpolate.NdBSpline``, called with (n, 2) parameters: the same within the domain; beyond
    /// it scipy extrapolates.
    ///
    /// Raises
    /// ------
    /// UnsupportedError : for a rational surface.
    fn to_scipy<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let convert = this.py().import("nurbskin._convert")?;
        convert.call_method1("surface_to_scipy", (this,))
    }

    /// The surface as a ``trimesh.Trimesh`` within a chordal tolerance.
    #[pyo3(signature = (tolerance=None))]
    fn to_trimesh<'py>(
        this: &Bound<'py, Self>,
        tolerance: Option<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let convert = this.py().import("nurbskin._convert")?;
        convert.call_method1("surface_to_trimesh", (this, tolerance))
    }

    /// The surface as a ``pyvista.PolyData`` within a chordal tolerance, with ``parameters`` per point.
    #[pyo3(signature = (tolerance=None))]
    fn to_pyvista<'py>(
        this: &Bound<'py, Self>,
        tolerance: Option<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let convert = this.py().import("nurbskin._convert")?;
        convert.call_method1("surface_to_pyvista", (this, tolerance))
    }

    fn __reduce__<'py>(
        this: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let parts = (
            Self::control_points(this)?,
            Self::knots_u(this)?,
            Self::knots_v(this)?,
            this.get().degree(),
            Self::weights(this)?,
            this.get().periodic(),
            this.get().unit(),
        );
        let parts = parts.into_pyobject(this.py())?.into_any();
        Ok((this.get_type().into_any(), parts))
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.surface == other.surface && self.unit == other.unit
    }

    fn __repr__(&self) -> String {
        let ([m, n], [p, q]) = (
            self.surface.control_points().counts(),
            self.surface.degree(),
        );
        let rational = if self.surface.is_rational() {
            ", rational"
        } else {
            ""
        };
        let periodic = match self.surface.periodic() {
            [false, false] => "",
            [true, false] => ", periodic in u",
            [false, true] => ", periodic in v",
            [true, true] => ", periodic in u and v",
        };
        format!("NurbsSurface({m} x {n} control points, degree {p} x {q}{rational}{periodic})")
    }
}
