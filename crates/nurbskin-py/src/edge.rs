//! Edges of networks of faces.

use crate::arrays;
use crate::errors::Raised;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1};
use nurbskin::{DVec3, NurbsCurve, pipeline};
use pyo3::prelude::*;

/// An edge of a network: the curve along which one or two faces end.
#[pyclass(name = "FaceEdge", module = "nurbskin", frozen)]
pub(crate) struct FaceEdge {
    curve: Option<NurbsCurve>,
    origin: DVec3,
    edge: pipeline::FaceEdge,
    faces: Vec<usize>,
}

impl FaceEdge {
    pub(crate) fn new(
        curve: Option<NurbsCurve>,
        origin: DVec3,
        edge: &pipeline::FaceEdge,
        faces: Vec<usize>,
    ) -> Self {
        Self {
            curve,
            origin,
            edge: *edge,
            faces,
        }
    }

    fn shifted(&self, points: Vec<DVec3>) -> Vec<DVec3> {
        points.into_iter().map(|p| p + self.origin).collect()
    }
}

#[pymethods]
impl FaceEdge {
    /// ``smooth``, ``sharp`` or ``open``.
    #[getter]
    fn kind(&self) -> &'static str {
        self.edge.kind.name()
    }

    /// No angle between the normals of the two faces along the edge is larger, in degrees; None for an open edge.
    #[getter]
    fn jump(&self) -> Option<f64> {
        self.edge.jump
    }

    /// Numbers of the faces in ``Result.surfaces``: two, or one at a border.
    #[getter]
    fn faces(&self) -> Vec<usize> {
        self.faces.clone()
    }

    /// Control points of the curve, shape (n, 3).
    #[getter]
    fn control_points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = self.curve.iter().flat_map(|c| c.control_points().to_vec());
        arrays::of_points(py, self.shifted(points.collect()))
    }

    /// Knots of the curve, over 0 to 1.
    #[getter]
    fn knots<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let knots = self.curve.iter().flat_map(|c| c.knots().knots().to_vec());
        knots.collect::<Vec<f64>>().into_pyarray(py)
    }

    /// Points of the curve at parameters from 0 to 1, shape (n, 3).
    fn points<'py>(
        &self,
        py: Python<'py>,
        t: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let parameters = t
            .as_slice()
            .map_err(|_| nurbskin::Error::invalid("t: a list of numbers is needed"));
        let parameters = parameters.or_raise(py)?;
        let inside = |t: f64| if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
        let curve = self.curve.iter();
        let points = curve.flat_map(|c| parameters.iter().map(|&t| c.point(inside(t))));
        arrays::of_points(py, self.shifted(points.collect()))
    }

    fn __repr__(&self) -> String {
        let jump = self
            .edge
            .jump
            .map_or(String::new(), |jump| format!(", {jump:.3} degrees"));
        format!("FaceEdge({}{jump})", self.edge.kind.name())
    }
}
