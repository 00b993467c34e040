//! The library's errors as Python's exceptions, with the same sentences.

use nurbskin::Error;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// An exception of the class that `nurbskin._errors` has for this kind of error.
pub(crate) fn raised(py: Python<'_>, error: &Error) -> PyErr {
    let class = match error {
        Error::Read { .. } => "ReadError",
        Error::Write { .. } => "WriteError",
        Error::Invalid(_) => "InvalidError",
        Error::Unsupported(_) => "UnsupportedError",
        Error::NoSolution(_) => "NoSolutionError",
        _ => "Error",
    };
    let made = py
        .import("nurbskin._errors")
        .and_then(|module| module.getattr(class))
        .and_then(|class| class.call1((error.to_string(),)));
    match made {
        Ok(exception) => PyErr::from_value(exception),
        // Without its Python half the package still says what is wrong.
        Err(_) => PyRuntimeError::new_err(error.to_string()),
    }
}

/// A result of the library as one of Python's.
pub(crate) trait Raised<T> {
    /// The value, or the exception.
    fn or_raise(self, py: Python<'_>) -> PyResult<T>;
}

impl<T> Raised<T> for nurbskin::Result<T> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T> {
        self.map_err(|error| raised(py, &error))
    }
}
