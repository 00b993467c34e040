//! Least squares over chunks of points.

use crate::arrays;
use crate::errors::Raised;
use crate::surface::{Surface, knot_vector};
use crate::words;
use numpy::PyArray1;
use nurbskin::DVec3;
use nurbskin::fit::least_squares::NormalSums as Sums;
use pyo3::prelude::*;

/// What points say of the least-squares surface on given knots: sums that add up over any chunks of the points.
///
/// Parameters
/// ----------
/// knots_u, knots_v : clamped or periodic knot vectors.
/// degree : in u and v.
/// periodic : which of them are periodic.
/// origin : a place near the points, the same for all chunks.
#[pyclass(module = "nurbskin")]
pub(crate) struct NormalSums(Sums);

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
            .map(Self)
    }

    /// Adds (n, 3) points with (n, 2) parameters and, if there are any, (n,) weights. Memory does not grow with n.
    #[pyo3(signature = (points, parameters, weights=None))]
    fn add(
        &mut self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        parameters: &Bound<'_, PyAny>,
        weights: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let points = arrays::points(points, "points")?;
        let parameters = arrays::parameters(parameters, "parameters")?;
        let weights = weights.map(|w| arrays::numbers(w, "weights")).transpose()?;
        let sums = &mut self.0;
        py.detach(|| sums.add(&points, &parameters, weights.as_deref()))
            .or_raise(py)
    }

    /// Adds the sums of other points on the same knots with the same origin.
    fn merge(&mut self, py: Python<'_>, other: &Self) -> PyResult<()> {
        self.0.merge(&other.0).or_raise(py)
    }

    /// Sums of their own that are equal to these.
    fn copy(&self) -> Self {
        Self(self.0.clone())
    }

    /// Number of points.
    #[getter]
    fn count(&self) -> u64 {
        self.0.count()
    }

    /// Sum of their weights.
    #[getter]
    fn weight(&self) -> f64 {
        self.0.weight()
    }

    /// The raw sums, shape (k,): what travels between processes.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.values())
    }

    /// The surface that minimises ``sum w |X - S(u, v)|^2 / sum w + smoothing * E(S)``, E the thin-plate energy for a
    /// domain that stands for ``size`` lengths; with it the root mean square residual.
    ///
    /// Raises
    /// ------
    /// NoSolutionError : if the points do not determine it.
    #[pyo3(signature = (smoothing=0.0, size=(1.0, 1.0)))]
    fn solve(&self, py: Python<'_>, smoothing: f64, size: (f64, f64)) -> PyResult<(Surface, f64)> {
        let found = py
            .detach(|| self.0.solve(smoothing, [size.0, size.1]))
            .or_raise(py)?;
        Ok((Surface(found.surface), found.rms))
    }

    fn __reduce__<'py>(
        this: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = this.py();
        let sums = &this.borrow().0;
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
            .map(Self)
    }

    fn __repr__(&self) -> String {
        let [u, v] = self.0.knots();
        format!(
            "NormalSums({} points, {} x {} control points)",
            self.0.count(),
            u.control_point_count(),
            v.control_point_count()
        )
    }
}
