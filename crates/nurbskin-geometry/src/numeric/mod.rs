//! Small numerical kernels: banded systems, contours, robust statistics.

pub mod banded;
pub mod bias;
pub mod bucket_sort;
pub mod cholesky;
pub mod conjugate_gradients;
pub mod contours;
pub mod cyclic;
pub mod disjoint_sets;
pub mod eigen;
mod multigrid;
pub mod parallel;
pub mod quadrature;
pub mod statistics;
