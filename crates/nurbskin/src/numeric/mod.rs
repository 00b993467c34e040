//! Small numerical kernels: banded systems, contours, robust statistics.

pub mod banded;
pub(crate) mod bias;
pub(crate) mod bucket_sort;
pub mod cholesky;
pub mod conjugate_gradients;
pub mod contours;
pub mod cyclic;
pub(crate) mod disjoint_sets;
pub mod eigen;
mod multigrid;
pub(crate) mod parallel;
pub mod statistics;
