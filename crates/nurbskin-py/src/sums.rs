//! Least squares over chunks of points.

use crate::arrays;
use crate::errors::Raised;
use crate::knots::knot_vectors;
use crate::surface::Surface;
use crate::watch::watched;
use crate::words;
use numpy::PyArray1;
use nurbskin::DVec3;
use nurbskin::fit::least_squares::NormalSums as Sums;
use pyo3::prelude::*;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What points say of the least-squares surface on given knots: sums that add up over any chunks of the points.
///
/// Parameters
/// ----------
/// knots_u, knots_v : clamped or periodic knot vectors.
/// degree : in u and v; 3 where None.
/// periodic : which of them are periodic, two truth values; none where None.
/// origin : a place near the points, the same for all chunks; zero where None. Coordinates far from it lose digits.
#[pyclass(module = "nurbskin", frozen)]
pub(crate) struct NormalSums(Mutex<Sums>);

impl NormalSums {
    fn of(sums: Sums) -> Self {
        Self(Mutex::new(sums))
    }

    /// The sums; they are whole whatever happened to who had them last, since nothing is added where there is an error.
    /// They are held for no longer than it takes to add others or to copy them.
    fn sums(&self) -> MutexGuard<'_, Sums> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Empty sums on the same knots.
    fn like(&self, py: Python<'_>) -> PyResult<Sums> {
        let sums = self.sums();
        let [u, v] = sums.knots().clone();
        Sums::new(u, v, sums.origin()).or_raise(py)
    }
}

#[pymethods]
impl NormalSums {
    #[new]
    #[pyo3(signature = (knots_u, knots_v, degree=None, periodic=None, origin=None))]
    fn new(
        knots_u: &Bound<'_, PyAny>,
        knots_v: &Bound<'_, PyAny>,
        degree: Option<&Bound<'_, PyAny>>,
        periodic: Option<&Bound<'_, PyAny>>,
        origin: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let [u, v] = knot_vectors(knots_u, knots_v, degree, periodic)?;
        let origin = words::place("origin", origin)?;
        Sums::new(u, v, origin).or_raise(knots_u.py()).map(Self::of)
    }

    /// Adds (n, 3) points with (n, 2) parameters and, if there are any, (n,) weights; nothing where there is an error, or
    /// after Ctrl-C. Takes the memory of the sums once more meanwhile; they stay as large as they are.
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
        let mut new = self.like(py)?;
        // Apart from the sums, which nobody waits for meanwhile and work that is no longer heard cannot change.
        let new = watched(py, None, move |_| {
            new.add(&points, &parameters, weights.as_deref())?;
            Ok(new)
        })?;
        py.detach(|| self.sums().merge(&new)).or_raise(py)
    }

    /// Adds the sums of other points on the same knots with the same origin.
    fn merge(&self, py: Python<'_>, other: &Self) -> PyResult<()> {
        // A copy, since these may be the same sums, or be merged into each other by two threads.
        py.detach(|| {
            let other = other.sums().clone();
            self.sums().merge(&other)
        })
        .or_raise(py)
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
        let values = self.sums().values().to_vec();
        PyArray1::from_vec(py, values)
    }

    /// The surface that minimises ``sum w |X - S(u, v)|^2 / sum w + smoothing * E(S)``, E the thin-plate energy for a
    /// domain that stands for ``size`` lengths, 1 and 1 where None; with it the root mean square residual. That comes from
    /// differences of sums, which resolve about 2e-7 of the distance of the points from the origin; below, this limit is
    /// given.
    ///
    /// Raises
    /// ------
    /// NoSolutionError : if the points do not determine it.
    #[pyo3(signature = (smoothing=0.0, size=None))]
    fn solve(
        &self,
        py: Python<'_>,
        smoothing: f64,
        size: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(Surface, f64)> {
        let size = words::pair("size", size, [1.0, 1.0])?;
        let sums = self.sums().clone();
        let found = watched(py, None, move |_| sums.solve(smoothing, size))?;
        Ok((found.surface.into(), found.rms.max(found.rms_resolution)))
    }

    fn __reduce__<'py>(
        this: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = this.py();
        // A copy, so that nobody waits for Python's objects to be made.
        let sums = this.get().sums().clone();
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
        degree: &Bound<'_, PyAny>,
        periodic: &Bound<'_, PyAny>,
        origin: [f64; 3],
        values: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let [u, v] = knot_vectors(knots_u, knots_v, Some(degree), Some(periodic))?;
        let list = arrays::numbers(values, "values")?;
        Sums::from_values(u, v, DVec3::from_array(origin), list)
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
