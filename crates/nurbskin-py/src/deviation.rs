//! Deviations of points.

use crate::arrays;
use crate::errors::Raised;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use nurbskin::deviation::measure::{Deviation as Measured, Place, PointDeviation};
use nurbskin::{DVec2, DVec3, Error};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// The deviation of points from a surface.
#[pyclass(module = "nurbskin", frozen)]
pub(crate) struct Deviation(pub(crate) Measured);

impl Deviation {
    /// Refuses points that are nowhere.
    pub(crate) fn check(py: Python<'_>, points: &[DVec3]) -> PyResult<()> {
        match points.iter().position(|p| !p.is_finite()) {
            None => Ok(()),
            Some(k) => Err(Error::invalid(format!("point {k} is not finite"))).or_raise(py),
        }
    }

    fn each<'py, T: numpy::Element>(
        &self,
        py: Python<'py>,
        f: impl Fn(&PointDeviation) -> T,
    ) -> Bound<'py, PyArray1<T>> {
        self.0
            .points
            .iter()
            .map(f)
            .collect::<Vec<T>>()
            .into_pyarray(py)
    }
}

#[pymethods]
impl Deviation {
    /// Distance of each point, positive outside, shape (n,).
    #[getter]
    fn signed<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.each(py, PointDeviation::signed)
    }

    /// Certified lower bound of the distance, shape (n,).
    #[getter]
    fn lower<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.each(py, |d| d.lower)
    }

    /// Distance to the foot: an upper bound, shape (n,).
    #[getter]
    fn upper<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.each(py, |d| d.upper)
    }

    /// (u, v) of the feet, shape (n, 2).
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let feet: Vec<DVec2> = self.0.points.iter().map(|d| DVec2::new(d.u, d.v)).collect();
        arrays::of_parameters(py, &feet)
    }

    /// Number of the surface that the foot lies on, shape (n,).
    #[getter]
    fn face<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.each(py, |d| d.face)
    }

    /// Whether the foot lies on a free border, shape (n,).
    #[getter]
    fn free_edge<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.each(py, |d| d.place == Place::FreeEdge)
    }

    /// Largest distance.
    #[getter]
    fn max(&self) -> f64 {
        self.0.statistics.max
    }

    /// Root mean square distance.
    #[getter]
    fn rms(&self) -> f64 {
        self.0.statistics.rms
    }

    /// A dictionary. Of the distances, which have no sign: ``count``, ``max``, ``mean``, ``rms``, ``p50``, ``p95``, ``p99``. Of
    /// the signed deviations: ``signed_min``, ``signed_max``, ``signed_mean``, ``signed_std``. And, None without a tolerance, the
    /// share (0 to 1) of the points within it, ``within_tolerance``, and the numbers of those beyond it on the outside and on the
    /// inside, ``above_tolerance`` and ``below_tolerance``.
    #[getter]
    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        loaded(py, &self.0.statistics)
    }

    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        arrays::converted(self.signed(py).into_any(), dtype, copy)
    }

    fn __reduce__<'py>(
        this: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let (py, all) = (this.py(), &this.get().0);
        let stored = rmp_serde::to_vec(&(&all.points, &all.statistics, &all.free_edges))
            .map_err(|e| Error::invalid(e.to_string()))
            .or_raise(py)?;
        Ok((
            this.get_type().getattr("_restored")?,
            (PyBytes::new(py, &stored),),
        ))
    }

    #[staticmethod]
    fn _restored(py: Python<'_>, stored: &[u8]) -> PyResult<Self> {
        let (points, statistics, free_edges) = rmp_serde::from_slice(stored)
            .map_err(|e| Error::invalid(e.to_string()))
            .or_raise(py)?;
        Ok(Self(Measured {
            points,
            statistics,
            free_edges,
        }))
    }

    fn __len__(&self) -> usize {
        self.0.points.len()
    }

    fn __repr__(&self) -> String {
        let s = &self.0.statistics;
        format!(
            "Deviation({} points: max {:.4e}, 95 % {:.4e}, rms {:.4e})",
            s.count, s.max, s.p95, s.rms
        )
    }
}

/// What serialises, as the objects that `json.loads` makes of it.
pub(crate) fn loaded<'py>(
    py: Python<'py>,
    value: &impl serde::Serialize,
) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value)
        .map_err(|e| Error::invalid(e.to_string()))
        .or_raise(py)?;
    py.import("json")?.call_method1("loads", (text,))
}
