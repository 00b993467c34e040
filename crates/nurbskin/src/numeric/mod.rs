//! Small numerical kernels: banded systems, robust statistics.

pub mod banded;
pub mod cholesky;
pub mod cyclic;
pub mod statistics;
