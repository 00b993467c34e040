//! The Python package: arrays in, surfaces out, and the other verbs of the command. A thin front end of the library's
//! pipeline and of its lower layers; what Python does better (other libraries' objects, notebooks, clusters) is in
//! `python/nurbskin`.

mod arrays;
mod cad;
mod comparison;
mod curve;
mod deviation;
mod edge;
mod errors;
mod knots;
mod layers;
mod measurement;
mod outcome;
mod phrases;
mod picture;
mod scan;
mod source;
mod sums;
mod surface;
mod verbs;
mod watch;
mod words;

use pyo3::prelude::*;

/// The compiled part of the package; use `nurbskin`.
#[pymodule]
mod _nurbskin {
    use super::*;

    #[pymodule_export]
    use super::cad::{CadModel, read_cad};
    #[pymodule_export]
    use super::comparison::{Comparison, deviation};
    #[pymodule_export]
    use super::curve::Curve;
    #[pymodule_export]
    use super::deviation::Deviation;
    #[pymodule_export]
    use super::edge::FaceEdge;
    #[pymodule_export]
    use super::layers::{approximate, approximate_on, enrich, interpolate, rarefy};
    #[pymodule_export]
    use super::measurement::Measurement;
    #[pymodule_export]
    use super::outcome::{FitResult, fit, fit_file};
    #[pymodule_export]
    use super::picture::render;
    #[pymodule_export]
    use super::scan::{Scan, read, simulate};
    #[pymodule_export]
    use super::sums::NormalSums;
    #[pymodule_export]
    use super::surface::Surface;
    #[pymodule_export]
    use super::verbs::{check, convert, info, view};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
