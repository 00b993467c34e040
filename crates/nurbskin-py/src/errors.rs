//! The library's errors as Python's exceptions, with the same sentences.

use crate::phrases::in_python;
use nurbskin::Error;
use pyo3::exceptions::{PyOverflowError, PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;

/// An exception of the class that `nurbskin._errors` has for this kind of error.
pub(crate) fn raised(py: Python<'_>, error: &Error) -> PyErr {
    let class = match error {
        Error::Read { .. } if error.is_missing() => "MissingFileError",
        Error::Write { .. } if error.is_missing() => "MissingFolderError",
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
        .and_then(|class| class.call1((in_python(&error.to_string()),)));
    match made {
        Ok(exception) => PyErr::from_value(exception),
        // Without its Python half the package still says what is wrong.
        Err(_) => PyRuntimeError::new_err(error.to_string()),
    }
}

/// The refusal of a value that is none of what is asked for; anything else that went wrong with it, as Ctrl-C, is raised as
/// it is.
pub(crate) fn unfit(py: Python<'_>, why: PyErr, what: impl FnOnce(&PyErr) -> String) -> PyErr {
    let of_value = why.is_instance_of::<PyTypeError>(py)
        || why.is_instance_of::<PyValueError>(py)
        || why.is_instance_of::<PyOverflowError>(py);
    if of_value {
        raised(py, &Error::invalid(what(&why)))
    } else {
        why
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
