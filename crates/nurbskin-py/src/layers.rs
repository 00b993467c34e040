//! The lower layers: the paper's stages, and least squares.

use crate::arrays;
use crate::errors::Raised;
use crate::knots::knot_vectors;
use crate::surface::{Surface, diagonal_of};
use crate::watch::watched;
use crate::words;
use numpy::{IntoPyArray, PyArray1};
use nurbskin::chart::{Chart, Topology};
use nurbskin::fit::approximate as fitting;
use nurbskin::fit::interpolate as through;
use nurbskin::fit::interpolate::parameters::{Parameterization, parameters_u, parameters_v};
use nurbskin::fit::least_squares::least_squares;
use nurbskin::fit::rarefied::{Options as ToTolerance, rarefy_to_tolerance};
use nurbskin::pipeline::Rarefaction;
use nurbskin::rarefy::{self as paper, Thresholds};
use nurbskin::{Error, Unit, enrich as subdivision};
use pyo3::prelude::*;

/// The topology, a sheet where none is said.
fn topology_of(said: &str) -> nurbskin::Result<Topology> {
    words::word::<Option<Topology>>("topology", said).map(Option::unwrap_or_default)
}

/// A list of numbers.
type Numbers<'py> = Bound<'py, PyArray1<f64>>;
/// A surface and the parameters of the lines that it goes through.
type Through<'py> = (Surface, Numbers<'py>, Numbers<'py>);
/// A surface, residuals, weights, the noise, and why the tolerance is not met.
type Near<'py> = (Surface, Numbers<'py>, Numbers<'py>, f64, Option<String>);

/// The surface through every point of a grid, with the parameters of its lines.
#[pyfunction]
#[pyo3(signature = (grid, degree=None, parameters="auto", topology="disk", u=None, v=None, knots_u=None, knots_v=None))]
pub(crate) fn interpolate<'py>(
    py: Python<'py>,
    grid: &Bound<'py, PyAny>,
    degree: Option<&Bound<'py, PyAny>>,
    parameters: &str,
    topology: &str,
    u: Option<&Bound<'py, PyAny>>,
    v: Option<&Bound<'py, PyAny>>,
    knots_u: Option<&Bound<'py, PyAny>>,
    knots_v: Option<&Bound<'py, PyAny>>,
) -> PyResult<Through<'py>> {
    let grid = arrays::grid(grid, "grid")?;
    let said = degree;
    let degree = words::degree(said)?;
    let topology = topology_of(topology).or_raise(py)?;
    let kind = words::word::<Option<Parameterization>>("parameters", parameters).or_raise(py)?;
    let given = [(u, "u"), (v, "v")];
    let [given_u, given_v] = given.map(|(t, name)| t.map(|t| arrays::numbers(t, name)).transpose());
    let (given_u, given_v) = (given_u?, given_v?);
    let knots = match (knots_u, knots_v) {
        (Some(u), Some(v)) => Some(knot_vectors(u, v, said, None)?),
        (None, None) => None,
        _ => {
            let what = "knots_u and knots_v: give both or none";
            return Err(Error::invalid(what)).or_raise(py);
        }
    };
    if knots.is_some() && topology != Topology::Disk {
        let what = "knots are for open directions: give none with this topology";
        return Err(Error::invalid(what)).or_raise(py);
    }
    let (surface, u, v) = watched(py, None, move |_| {
        let closed = topology.closed();
        let kind = match kind {
            Some(kind) => kind,
            None if given_u.is_some() && given_v.is_some() => Default::default(),
            None => through::choose_parameterization(&grid, topology, degree)?.kind,
        };
        let u = given_u.map_or_else(|| parameters_u(&grid, closed[0], kind), Ok)?;
        let v = given_v.map_or_else(|| parameters_v(&grid, closed[1], kind), Ok)?;
        let surface = match &knots {
            Some([knots_u, knots_v]) => {
                through::interpolate_on(&grid, [knots_u, knots_v], [&u, &v])?
            }
            None => through::interpolate_at(&grid, topology, degree, [&u, &v])?,
        };
        Ok((surface, u, v))
    })?;
    Ok((surface.into(), u.into_pyarray(py), v.into_pyarray(py)))
}

/// The surface within a tolerance of points with parameters: with it their residuals and weights, the noise, and why the
/// tolerance is not met.
#[pyfunction]
#[pyo3(signature = (points, parameters, tolerance, degree=None, topology="disk", max_control_points=None, noise=None, size=None, progress=None))]
pub(crate) fn approximate<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    parameters: &Bound<'py, PyAny>,
    tolerance: f64,
    degree: Option<&Bound<'py, PyAny>>,
    topology: &str,
    max_control_points: Option<usize>,
    noise: Option<f64>,
    size: Option<&Bound<'py, PyAny>>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Near<'py>> {
    let points = arrays::points(points, "points")?;
    let parameters = arrays::parameters(parameters, "parameters")?;
    let Some(&first) = points.first() else {
        return Err(Error::invalid("points: there are none")).or_raise(py);
    };
    let [low, high] = points
        .iter()
        .fold([first; 2], |[a, b], &p| [a.min(p), b.max(p)]);
    let square = [low.distance(high) / std::f64::consts::SQRT_2; 2];
    let options = fitting::ApproximateOptions {
        degree: words::degree(degree)?,
        max_control_points,
        noise,
        ..fitting::ApproximateOptions::new(tolerance)
    };
    let chart = Chart {
        topology: topology_of(topology).or_raise(py)?,
        parameters,
        size: words::pair("size", size, square)?,
        reason: String::new(),
    };
    let found = watched(py, progress, move |progress| {
        fitting::approximate(&points, &chart, &options, progress)
    })?;
    let not_met = match found.status {
        fitting::Status::Met => None,
        fitting::Status::NotMet(why) => Some(why.to_string()),
    };
    Ok((
        found.surface.into(),
        found.residuals.into_pyarray(py),
        found.weights.into_pyarray(py),
        found.sigma,
        not_met,
    ))
}

/// The least-squares surface on given knots, and the root mean square residual.
#[pyfunction]
#[pyo3(signature = (points, parameters, knots_u, knots_v, degree=None, periodic=None, weights=None, smoothing=0.0, size=None))]
pub(crate) fn approximate_on(
    py: Python<'_>,
    points: &Bound<'_, PyAny>,
    parameters: &Bound<'_, PyAny>,
    knots_u: &Bound<'_, PyAny>,
    knots_v: &Bound<'_, PyAny>,
    degree: Option<&Bound<'_, PyAny>>,
    periodic: Option<&Bound<'_, PyAny>>,
    weights: Option<&Bound<'_, PyAny>>,
    smoothing: f64,
    size: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Surface, f64)> {
    let points = arrays::points(points, "points")?;
    let parameters = arrays::parameters(parameters, "parameters")?;
    let [knots_u, knots_v] = knot_vectors(knots_u, knots_v, degree, periodic)?;
    let size = words::pair("size", size, [1.0, 1.0])?;
    let weights = weights.map(|w| arrays::numbers(w, "weights")).transpose()?;
    let found = watched(py, None, move |_| {
        let weights = weights.as_deref();
        least_squares(
            &points,
            &parameters,
            weights,
            knots_u,
            knots_v,
            smoothing,
            size,
        )
    })?;
    Ok((found.surface.into(), found.rms))
}

/// Lines along u and v, and their parameters where these belong to the choice.
type Lines<'py> = (
    Bound<'py, PyArray1<usize>>,
    Bound<'py, PyArray1<usize>>,
    Option<Numbers<'py>>,
    Option<Numbers<'py>>,
);

/// Indices of the lines that logical rarefaction keeps; with a tolerance the parameters, too, with which it is met.
#[pyfunction]
#[pyo3(signature = (grid, rarefy=None, tolerance=None, topology="disk", degree=None, unit="auto"))]
pub(crate) fn rarefy<'py>(
    py: Python<'py>,
    grid: &Bound<'py, PyAny>,
    rarefy: Option<&Bound<'py, PyAny>>,
    tolerance: Option<&Bound<'py, PyAny>>,
    topology: &str,
    degree: Option<&Bound<'py, PyAny>>,
    unit: &str,
) -> PyResult<Lines<'py>> {
    let grid = arrays::grid(grid, "grid")?;
    let unit = words::word::<Option<Unit>>("unit", unit)
        .or_raise(py)?
        .unwrap_or_default();
    let tolerance = words::length("tolerance", tolerance, unit, diagonal_of(grid.points()))?;
    let topology = topology_of(topology).or_raise(py)?;
    let degree = words::degree(degree)?;
    let rule = match rarefy {
        Some(said) => words::parsed::<Rarefaction>("rarefy", said)?,
        None => Rarefaction::Auto,
    };
    if tolerance.is_some() && rule != Rarefaction::Auto {
        let what = "rarefy: give a tolerance, or a rule, not both";
        return Err(Error::invalid(what)).or_raise(py);
    }
    let (kept, parameters) = watched(py, None, move |progress| match rule {
        Rarefaction::Auto => {
            let Some(tolerance) = tolerance else {
                return Err(Error::invalid(
                    "rarefy: give a tolerance, or degrees (as 20, or 12,18), or MxN lines",
                ));
            };
            let options = ToTolerance {
                degree,
                ..ToTolerance::default()
            };
            let found = rarefy_to_tolerance(&grid, topology, tolerance, &options, progress)?;
            let [u, v] = found.parameters;
            let u: Vec<f64> = found.kept.u.iter().map(|&i| u[i]).collect();
            let v: Vec<f64> = found.kept.v.iter().map(|&j| v[j]).collect();
            Ok((found.kept, Some((u, v))))
        }
        Rarefaction::Off => {
            let all = paper::Kept {
                u: (0..grid.count_u()).collect(),
                v: (0..grid.count_v()).collect(),
            };
            Ok((all, None))
        }
        Rarefaction::Threshold([u, v]) => {
            Ok((paper::rarefy(&grid, topology, Thresholds { u, v }), None))
        }
        Rarefaction::Counts(counts) => {
            Ok((paper::to_counts_filled(&grid, topology, counts)?.1, None))
        }
    })?;
    let (u, v) = parameters.unzip();
    Ok((
        kept.u.into_pyarray(py),
        kept.v.into_pyarray(py),
        u.map(|u| u.into_pyarray(py)),
        v.map(|v| v.into_pyarray(py)),
    ))
}

/// A denser grid through the same points, by Catmull-Clark subdivision.
#[pyfunction]
#[pyo3(signature = (grid, levels=1, topology="disk"))]
pub(crate) fn enrich<'py>(
    py: Python<'py>,
    grid: &Bound<'py, PyAny>,
    levels: usize,
    topology: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let grid = arrays::grid(grid, "grid")?;
    let topology = topology_of(topology).or_raise(py)?;
    let dense = watched(py, None, move |_| {
        if levels > 6 {
            return Err(Error::invalid("enrich: 0 to 6 levels"));
        }
        subdivision::enrich_grid(&grid, topology, levels)
    })?;
    arrays::of_grid(py, dense)
}
