//! Least squares over chunks of points.

use crate::arrays;
use crate::errors::Raised;
use crate::surface::{Surface, knot_vector};
use crate::watch::watched;
use crate::words;
use numpy::PyArray1;
use nurbskin::DVec3;
use nurbskin::fit::least_squares::NormalSums as Sums;
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What points say of the least-squares surface on given knots: sums that add up over any chunks of the points.
///
/// Parameters
/// ----------
/// knots_u, knots_v : clamped or periodic knot vectors.
/// degree : in u and v.
/// periodic : which of them are periodic.
/// origin : a place near the points, the same for all chunks.
#[pyclass(module = "nurbskin", frozen)]
pub(crate) struct NormalSums(Arc<Mutex<Sums>>);

impl NormalSums {
    fn of(sums: Sums) -> Self {
        Self(Arc::new(Mutex::new(sums)))
    }

    fn sums(&self) -> MutexGuard<'_, Sums> {
        locked(&self.0)
    }
}

/// The sums; they are whole whatever happened to who had them last, since nothing is added where there is an error.
fn locked(sums: &Mutex<Sums>) -> MutexGuard<'_, Sums> {
    sums.lock().unwrap_or_else(PoisonError::into_inner)
}

#[pymethods]
impl NormalSums {
    #[new]
    #[pyo3(signature = (knots_u, knots_v, degree=None, periodic=(false, false), origin=[0.0; 3]))]
    fn new(
        knots_u: &Bound<'_, PyAny>,
        knots_v: &Bound<'_, PyAny>,
        degree: Option<&Bound<'_, PyAny>>,
        periodic: (bool, bool),
        origin: [f64; 3],
    ) -> PyResult<Self> {
        let [p, q] = degree.map_or(Ok([3, 3]), words::degree)?;
        let knots_u = knot_vector(knots_u, p, periodic.0, "knots_u")?;
        let py = knots_v.py();
        let knots_v = knot_vector(knots_v, q, periodic.1, "knots_v")?;
        Sums::new(knots_u, knots_v, DVec3::from_array(origin))
            .or_raise(py)
            .map(Self::of)
    }

    /// Adds (n, 3) points with (n, 2) parameters and, if there are any, (n,) weights; nothing where there is an error. The sums
    /// stay as large as they are.
    #[pyo3(signature = (points, parameters, weights=None))]
    fn add(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        parameters: &Bound<'_, PyAny>,
        weights: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let points = arrays::points(points, "points")?;
        let parameters = arrays::parameters(parameters, "parameters")?;
        let weights = weights.map(|w| arrays::numbers(w, "weights")).transpose()?;
        let sums = Arc::clone(&self.0);
        watched(py, None, move |_| {
            locked(&sums).add(&points, &parameters, weights.as_deref())
        })
    }

    /// Adds the sums of other points on the same knots with the same origin.
    fn merge(&self, py: Python<'_>, other: &Self) -> PyResult<()> {
        // A copy, since these may be the same sums, or be merged into each other by two threads.
        let other = other.sums().clone();
        self.sums().merge(&other).or_raise(py)
    }

    /// Sums of their own that are equal to these.
    fn copy(&self) -> Self {
        Self::of(self.sums().clone())
    }

    /// Number of points.
    #[getter]
    fn count(&self) -> u64 {
        self.sums().count()
    }

    /// Sum of their weights.
    #[getter]
    fn weight(&self) -> f64 {
        self.sums().weight()
    }

    /// What the points are taken relative to.
    #[getter]
    fn origin(&self) -> (f64, f64, f64) {
        self.sums().origin().into()
    }

    /// The raw sums, shape (k,): what travels between processes.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.sums().values())
    }

    /// The surface that minimises ``sum w |X - S(u, v)|^2 / sum w + smoothing * E(S)``, E the thin-plate energy for a
    /// domain that stands for ``size`` lengths; with it the root mean square residual.
    ///
    /// Raises
    /// ------
    /// NoSolutionError : if the points do not determine it.
    #[pyo3(signature = (smoothing=0.0, size=(1.0, 1.0)))]
    fn solve(&self, py: Python<'_>, smoothing: f64, size: (f64, f64)) -> PyResult<(Surface, f64)> {
        let sums = self.sums().clone();
        let found = watched(py, None, move |_| sums.solve(smoothing, [size.0, size.1]))?;
        Ok((Surface(Arc::new(found.surface)), found.rms))
    }

    fn __reduce__<'py>(
        this: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = this.py();
        let sums = this.get().sums();
        let [u, v] = sums.knots();
        let parts = (
            PyArray1::from_slice(py, u.knots()),
            PyArray1::from_slice(py, v.knots()),
            (u.degree(), v.degree()),
            (u.is_periodic(), v.is_periodic()),
            sums.origin().to_array(),
            PyArray1::from_slice(py, sums.values()),
        );
        let restore = this.get_type().getattr("_restored")?;
        Ok((restore, parts.into_pyobject(py)?.into_any()))
    }

    #[staticmethod]
    fn _restored(
        knots_u: &Bound<'_, PyAny>,
        knots_v: &Bound<'_, PyAny>,
        degree: (usize, usize),
        periodic: (bool, bool),
        origin: [f64; 3],
        values: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let knots_u = knot_vector(knots_u, degree.0, periodic.0, "knots_u")?;
        let knots_v = knot_vector(knots_v, degree.1, periodic.1, "knots_v")?;
        let list = arrays::numbers(values, "values")?;
        Sums::from_values(knots_u, knots_v, DVec3::from_array(origin), list)
            .or_raise(values.py())
            .map(Self::of)
    }

    /// The memory that it takes: what a cluster asks.
    fn __sizeof__(&self) -> usize {
        size_of_val(self.sums().values())
    }

    fn __repr__(&self) -> String {
        let sums = self.sums();
        let [u, v] = sums.knots();
        format!(
            "NormalSums({} points, {} x {} control points)",
            sums.count(),
            u.control_point_count(),
            v.control_point_count()
        )
    }
}
