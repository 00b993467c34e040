//! Numpy's arrays as points, and back.

use crate::errors::{Raised, unfit};
use numpy::ndarray::{ArrayBase, ArrayView, Dim, Dimension, ShapeBuilder, ViewRepr};
use numpy::{
    Element, IntoPyArray, PyArray, PyArray1, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods,
    PyReadonlyArrayDyn,
};
use nurbskin::{ControlNet, DVec2, DVec3, Error, PointGrid};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::IntoPyDict;

/// The refusal of what numpy makes no numbers of, with its reason.
fn no_numbers(py: Python<'_>, why: PyErr) -> PyErr {
    unfit(py, why, |why| {
        format!("numbers are needed: {}", why.value(py))
    })
}

/// Anything that numpy takes for real numbers, as an array of f64 in C order: the same one where it is that already.
/// Masked ones are NaN. Buffers of other processes may lie at any address; numbers must not.
pub(crate) fn float64<'py>(value: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let refuse = |why| no_numbers(py, why);
    let mut array = numpy.call_method1("asanyarray", (value,)).map_err(refuse)?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if !"biufO".contains(&kind) {
        let what = format!(
            "numbers are needed: not an array of {}",
            array.getattr("dtype")?
        );
        return Err(Error::invalid(what)).or_raise(py);
    }
    let float = numpy.getattr("float64")?;
    if array.hasattr("filled")? {
        array = array
            .call_method1("astype", (&float,))
            .and_then(|array| array.call_method1("filled", (f64::NAN,)))
            .map_err(refuse)?;
    }
    let array = numpy
        .call_method1("require", (array, float, ["C", "A"]))
        .map_err(refuse)?;
    Ok(array.cast_into::<PyArrayDyn<f64>>()?.readonly())
}

/// A list of numbers.
pub(crate) fn numbers(value: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<f64>> {
    let array = float64(value)?;
    if array.as_array().ndim() != 1 {
        return refused(value.py(), what, "(n,)", array.as_array().shape());
    }
    Ok(array.as_slice()?.to_vec())
}

/// The refusal of an array of the wrong shape.
pub(crate) fn refused<T>(py: Python<'_>, what: &str, wanted: &str, shape: &[usize]) -> PyResult<T> {
    let shape: Vec<String> = shape.iter().map(ToString::to_string).collect();
    let comma = if shape.len() == 1 { "," } else { "" };
    Err(Error::invalid(format!(
        "{what}: an array of shape {wanted} is needed, not ({}{comma})",
        shape.join(", ")
    )))
    .or_raise(py)
}

/// (n, 3) numbers as points.
pub(crate) fn points(value: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<DVec3>> {
    let array = float64(value)?;
    match array.as_array().shape() {
        [_, 3] => Ok(bytemuck::cast_slice(array.as_slice()?).to_vec()),
        shape => refused(value.py(), what, "(n, 3)", shape),
    }
}

/// (..., 3) numbers as points, and the shape before the last axis.
pub(crate) fn places(value: &Bound<'_, PyAny>, what: &str) -> PyResult<(Vec<DVec3>, Vec<usize>)> {
    let array = float64(value)?;
    match array.as_array().shape() {
        [before @ .., 3] => Ok((
            bytemuck::cast_slice(array.as_slice()?).to_vec(),
            before.to_vec(),
        )),
        shape => refused(value.py(), what, "(..., 3)", shape),
    }
}

/// (t, 3) indices as triangles.
pub(crate) fn triangles(value: &Bound<'_, PyAny>) -> PyResult<Vec<[u32; 3]>> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let array = numpy
        .call_method1("asanyarray", (value,))
        .map_err(|why| no_numbers(py, why))?;
    let masked = numpy.getattr("ma")?.call_method1("is_masked", (&array,))?;
    if masked.is_truthy()? {
        return Err(Error::invalid(
            "triangles: some are masked; leave these out",
        ))
        .or_raise(py);
    }
    let array = numpy.call_method1("require", (array, py.None(), ["C", "A"]))?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let [_, 3] = shape[..] else {
        return refused(py, "triangles", "(t, 3)", &shape);
    };
    let what = "triangles: whole numbers are needed, from 0 to 4294967295";
    if shape[0] > 0 {
        let within = |end: &str| array.call_method0(end)?.extract::<u32>();
        if !"iu".contains(&kind) || within("min").is_err() || within("max").is_err() {
            return Err(Error::invalid(what)).or_raise(py);
        }
    }
    let array = array.call_method1("astype", ("uint32",))?;
    let array = array.cast_into::<PyArrayDyn<u32>>()?.readonly();
    Ok(bytemuck::cast_slice(array.as_slice()?).to_vec())
}

/// (n, 2) numbers as parameters.
pub(crate) fn parameters(value: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<DVec2>> {
    let array = float64(value)?;
    match array.as_array().shape() {
        [_, 2] => Ok(array
            .as_slice()?
            .chunks_exact(2)
            .map(DVec2::from_slice)
            .collect()),
        shape => refused(value.py(), what, "(n, 2)", shape),
    }
}

/// (m, n, 3) numbers, u along the first axis, with u fastest; they may be NaN.
pub(crate) fn cells(value: &Bound<'_, PyAny>, what: &str) -> PyResult<([usize; 2], Vec<DVec3>)> {
    let array = float64(value)?;
    let &[m, n, 3] = array.as_array().shape() else {
        return refused(value.py(), what, "(m, n, 3)", array.as_array().shape());
    };
    let all: &[DVec3] = bytemuck::cast_slice(array.as_slice()?);
    let turned = (0..n).flat_map(|j| (0..m).map(move |i| all[i * n + j]));
    Ok(([m, n], turned.collect()))
}

/// (m, n, 3) numbers as a grid.
pub(crate) fn grid(value: &Bound<'_, PyAny>, what: &str) -> PyResult<PointGrid> {
    let ([m, n], all) = cells(value, what)?;
    PointGrid::new(m, n, all).or_raise(value.py())
}

/// (m, n) weights with u fastest.
pub(crate) fn weights(value: &Bound<'_, PyAny>, [m, n]: [usize; 2]) -> PyResult<Vec<f64>> {
    let array = float64(value)?;
    let all = array.as_slice()?;
    if array.as_array().shape() != [m, n] {
        let wanted = format!("({m}, {n})");
        return refused(value.py(), "weights", &wanted, array.as_array().shape());
    }
    Ok((0..n)
        .flat_map(|j| (0..m).map(move |i| all[i * n + j]))
        .collect())
}

/// A new array as numpy asks for it with `__array__`.
pub(crate) fn converted<'py>(
    array: Bound<'py, PyAny>,
    dtype: Option<&Bound<'py, PyAny>>,
    copy: Option<bool>,
) -> PyResult<Bound<'py, PyAny>> {
    if copy == Some(false) {
        let what = "the array is made anew each time: copy=False cannot be had";
        return Err(PyValueError::new_err(what));
    }
    match dtype {
        Some(dtype) => array.call_method1("astype", (dtype,)),
        None => Ok(array),
    }
}

/// Points as an (n, 3) array, which takes their memory over.
pub(crate) fn of_points(py: Python<'_>, points: Vec<DVec3>) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let count = points.len();
    let numbers: Vec<[f64; 3]> = bytemuck::allocation::cast_vec(points);
    numbers
        .into_flattened()
        .into_pyarray(py)
        .reshape([count, 3])
}

/// Parameters as an (n, 2) array.
pub(crate) fn of_parameters<'py>(
    py: Python<'py>,
    parameters: &[DVec2],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let count = parameters.len();
    let numbers: Vec<f64> = parameters.iter().flat_map(|t| [t.x, t.y]).collect();
    numbers.into_pyarray(py).reshape([count, 2])
}

/// Triangles as a (t, 3) array.
pub(crate) fn of_triangles(
    py: Python<'_>,
    triangles: Vec<[u32; 3]>,
) -> PyResult<Bound<'_, PyArray2<u32>>> {
    let count = triangles.len();
    triangles
        .into_flattened()
        .into_pyarray(py)
        .reshape([count, 3])
}

/// A grid as an (m, n, 3) array, u along the first axis: a view with its own memory.
pub(crate) fn of_grid(py: Python<'_>, grid: PointGrid) -> PyResult<Bound<'_, PyAny>> {
    let counts = grid.counts();
    of_cells(py, counts, grid.into_points())
}

/// Points of m x n cells, u fastest, as an (m, n, 3) array.
pub(crate) fn of_cells(
    py: Python<'_>,
    [m, n]: [usize; 2],
    cells: Vec<DVec3>,
) -> PyResult<Bound<'_, PyAny>> {
    let numbers: Vec<[f64; 3]> = bytemuck::allocation::cast_vec(cells);
    let array = numbers
        .into_flattened()
        .into_pyarray(py)
        .reshape([n, m, 3])?;
    array.call_method1("transpose", (1, 0, 2))
}

/// Control points of a surface as an (m, n, 3) array that shares their memory; `owner` keeps them.
pub(crate) fn net_of<'py>(
    net: &ControlNet,
    owner: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let [m, n] = net.counts();
    let shape = (m, n, 3).strides((3, 3 * m, 1));
    let view = ArrayView::from_shape(shape, bytemuck::cast_slice(net.points()));
    shared(view, owner)
}

/// Weights as an (m, n) array that shares their memory.
pub(crate) fn weights_of<'py>(
    weights: &[f64],
    [m, n]: [usize; 2],
    owner: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let view = ArrayView::from_shape((m, n).strides((1, m)), weights);
    shared(view, owner)
}

/// Numbers as an array that shares their memory.
pub(crate) fn numbers_of<'py, T: Element>(
    numbers: &[T],
    owner: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<T>>> {
    shared(ArrayView::from_shape(numbers.len(), numbers), owner)
}

/// A read-only array over the memory of an object that never changes, and which it keeps alive.
fn shared<'py, T: Element, const D: usize>(
    view: Result<ArrayBase<ViewRepr<&T>, Dim<[usize; D]>>, numpy::ndarray::ShapeError>,
    owner: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray<T, Dim<[usize; D]>>>>
where
    Dim<[usize; D]>: Dimension,
{
    let py = owner.py();
    let view = view
        .map_err(|e| Error::invalid(e.to_string()))
        .or_raise(py)?;
    // SAFETY: `owner` is frozen and holds the memory until it is dropped, and the array holds `owner`.
    #[allow(
        unsafe_code,
        reason = "there is no safe way to share memory with numpy"
    )]
    let array = unsafe { PyArray::borrow_from_array(&view, owner) };
    let locked = [("write", false)].into_py_dict(py)?;
    array.call_method("setflags", (), Some(&locked))?;
    Ok(array)
}

/// Parameters of any shapes that go together.
pub(crate) struct Places {
    pub(crate) parameters: Vec<DVec2>,
    shape: Vec<usize>,
}

impl Places {
    /// u and v as numpy broadcasts them.
    pub(crate) fn new(u: &Bound<'_, PyAny>, v: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = u.py();
        let numpy = py.import("numpy")?;
        // Numbers first: broadcasting forgets masks.
        let each = (float64(u)?, float64(v)?);
        let both = numpy
            .call_method1("broadcast_arrays", (each.0.as_any(), each.1.as_any()))
            .map_err(|why| no_numbers(py, why))?;
        let (u, v) = (float64(&both.get_item(0)?)?, float64(&both.get_item(1)?)?);
        let shape = u.as_array().shape().to_vec();
        let pairs = u.as_slice()?.iter().zip(v.as_slice()?);
        let parameters: Vec<DVec2> = pairs.map(|(&u, &v)| DVec2::new(u, v)).collect();
        if let Some(k) = parameters.iter().position(|t| !t.is_finite()) {
            return Err(Error::invalid(format!("parameter {k} is not finite"))).or_raise(py);
        }
        Ok(Self { parameters, shape })
    }

    /// Values, `width` per place (0: one, without an axis of its own), in the shape of the places.
    pub(crate) fn shaped<'py>(
        &self,
        py: Python<'py>,
        values: Vec<f64>,
        width: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut shape = self.shape.clone();
        if width > 0 {
            shape.push(width);
        }
        Ok(values.into_pyarray(py).reshape(shape)?.into_any())
    }
}
