//! Small numerical kernels: banded systems, robust statistics.

pub mod banded;
pub mod cholesky;
pub mod conjugate_gradients;
pub mod cyclic;
pub(crate) mod disjoint_sets;
pub mod eigen;
mod multigrid;
pub mod statistics;
