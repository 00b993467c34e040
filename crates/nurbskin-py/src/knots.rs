//! Knot vectors of Python's arguments.

use crate::errors::Raised;
use crate::{arrays, words};
use nurbskin::{Error, KnotVector};
use pyo3::prelude::*;

/// Those of a surface, along u and v.
pub(crate) fn knot_vectors(
    knots_u: &Bound<'_, PyAny>,
    knots_v: &Bound<'_, PyAny>,
    degree: Option<&Bound<'_, PyAny>>,
    periodic: Option<&Bound<'_, PyAny>>,
) -> PyResult<[KnotVector; 2]> {
    let [p, q] = words::degree(degree)?;
    let [u, v] = words::pair("periodic", periodic, [false, false])?;
    Ok([
        knot_vector(knots_u, p, u, "knots_u")?,
        knot_vector(knots_v, q, v, "knots_v")?,
    ])
}

/// One, for the argument `what`.
pub(crate) fn knot_vector(
    knots: &Bound<'_, PyAny>,
    degree: usize,
    periodic: bool,
    what: &str,
) -> PyResult<KnotVector> {
    let list = arrays::numbers(knots, what)?;
    let made = if periodic {
        KnotVector::from_periodic_knots(degree, list)
    } else {
        KnotVector::new(degree, list)
    };
    let named = |error: Error| match error {
        Error::Invalid(text) => Error::invalid(format!("{what}: {text}")),
        other => other,
    };
    made.map_err(named).or_raise(knots.py())
}
