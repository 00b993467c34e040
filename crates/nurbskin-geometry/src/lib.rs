//! NURBS curves and surfaces, and the numerical and spatial tools under them.
//!
//! | module | does |
//! |---|---|
//! | [`nurbs`] | knot vectors, basis functions, curves, surfaces, refinement, certified closest points |
//! | [`math`] | sines, logarithms and the like with the same last digit on every machine |
//! | [`numeric`] | banded and sparse solvers, robust statistics, parallel maps with the same results on any number of threads |
//! | [`spatial`] | nearest points, nearest places on triangles, boxes that overlap |
//! | [`files`] | files read and written whole, told apart by their content |
//! | [`mod@unit`], [`error`], [`progress`], [`notes`] | lengths, one error type, progress and cancelling, warnings |
//!
//! Names follow L. Piegl and W. Tiller, *The NURBS Book*, 2nd ed., Springer 1997.
//!
//! ```
//! use nurbskin_geometry::nurbs::conic;
//! use nurbskin_geometry::DVec3;
//! let sphere = conic::sphere(DVec3::ZERO, 2.0)?;
//! assert!((sphere.point(0.3, 0.8).length() - 2.0).abs() < 1e-14);
//! # Ok::<(), nurbskin_geometry::Error>(())
//! ```

// Results are the same on every machine: elementary functions are those of `math`.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod error;
pub mod files;
pub mod math;
pub mod notes;
pub mod numeric;
pub mod nurbs;
pub mod point_grid;
pub mod progress;
pub mod spatial;
pub mod unit;

pub use error::{Error, Result};
pub use glam::{DVec2, DVec3, DVec4};
pub use nurbs::{ControlNet, KnotVector, NurbsCurve, NurbsSurface};
pub use point_grid::PointGrid;
pub use unit::Unit;

/// Compiles and runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
