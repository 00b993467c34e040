//! NURBS curves.

use crate::arrays;
use crate::errors::Raised;
use crate::knots::knot_vector;
use crate::words;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use nurbskin::{Error, NurbsCurve};
use pyo3::prelude::*;
use std::sync::Arc;

/// A NURBS curve C(t).
///
/// ``curve(t, d=0)`` gives points, or derivatives by t ``d`` times (0 to 2), shape ``(..., 3)``. Outside the domain it is
/// taken at its end, or one turn on where the curve is periodic.
///
/// Parameters
/// ----------
/// control_points : (n, 3).
/// knots : n + p + 1 knots, clamped or not.
/// degree : p.
/// weights : (n,), positive; none for a polynomial curve.
/// periodic : whether the knots continue themselves and the last p control points repeat the first p.
///
/// Raises
/// ------
/// InvalidError : if the counts disagree or numbers are out of range.
#[pyclass(name = "NurbsCurve", module = "nurbskin", frozen)]
pub(crate) struct Curve(Arc<NurbsCurve>);

impl From<NurbsCurve> for Curve {
    fn from(curve: NurbsCurve) -> Self {
        Self(Arc::new(curve))
    }
}

#[pymethods]
impl Curve {
    #[new]
    #[pyo3(signature = (control_points, knots, degree=3, weights=None, periodic=false))]
    fn new(
        control_points: &Bound<'_, PyAny>,
        knots: &Bound<'_, PyAny>,
        degree: usize,
        weights: Option<&Bound<'_, PyAny>>,
        periodic: bool,
    ) -> PyResult<Self> {
        let py = control_points.py();
        let degree = words::checked_degree(py, degree)?;
        let points = arrays::points(control_points, "control_points")?;
        let knots = knot_vector(knots, degree, periodic, "knots")?;
        let weights = weights.map(|w| arrays::numbers(w, "weights")).transpose()?;
        NurbsCurve::new(knots, points, weights)
            .or_raise(py)
            .map(Self::from)
    }

    /// The degree.
    #[getter]
    fn degree(&self) -> usize {
        self.0.knots().degree()
    }

    /// Whether the curve is periodic: its last p control points repeat the first p.
    #[getter]
    fn periodic(&self) -> bool {
        self.0.knots().is_periodic()
    }

    /// Range of t.
    #[getter]
    fn domain(&self) -> (f64, f64) {
        self.0.domain()
    }

    /// Knot vector, shape (n + p + 1,); shares the memory of the curve, read-only.
    #[getter]
    fn knots<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        arrays::numbers_of(this.get().0.knots().knots(), this.clone().into_any())
    }

    /// Control points, shape (n, 3).
    #[getter]
    fn control_points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::of_points(py, self.0.control_points().to_vec())
    }

    /// Weights, shape (n,), or None; shares the memory of the curve, read-only.
    #[getter]
    fn weights<'py>(this: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        let weights = this.get().0.weights();
        weights
            .map(|w| arrays::numbers_of(w, this.clone().into_any()))
            .transpose()
    }

    // Python shows no documentation of this method: see that of the class.
    #[pyo3(signature = (t, d=0))]
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        t: &Bound<'py, PyAny>,
        d: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        if d > 2 {
            return Err(Error::invalid("derivatives: d is 2 at most")).or_raise(py);
        }
        let array = arrays::float64(t)?;
        let mut shape = array.as_array().shape().to_vec();
        let parameters = array.as_slice()?;
        if let Some(k) = parameters.iter().position(|t| !t.is_finite()) {
            return Err(Error::invalid(format!("parameter {k} is not finite"))).or_raise(py);
        }
        let at = |&t: &f64| match d {
            0 => self.0.point(t),
            _ => self.0.derivatives(t)[d],
        };
        let values: Vec<f64> = parameters.iter().flat_map(|t| at(t).to_array()).collect();
        shape.push(3);
        Ok(values.into_pyarray(py).reshape(shape)?.into_any())
    }

    fn __reduce__<'py>(
        this: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, curve) = (this.py(), this.get());
        let parts = (
            curve.control_points(py)?,
            Self::knots(this)?,
            curve.degree(),
            Self::weights(this)?,
            curve.periodic(),
        );
        Ok((
            this.get_type().into_any(),
            parts.into_pyobject(py)?.into_any(),
        ))
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.0 == other.0
    }

    fn __repr__(&self) -> String {
        let count = self.0.control_points().len();
        let rational = self.0.weights().map_or("", |_| ", rational");
        let periodic = if self.periodic() { ", periodic" } else { "" };
        format!(
            "NurbsCurve({count} control points, degree {}{rational}{periodic})",
            self.degree()
        )
    }
}
