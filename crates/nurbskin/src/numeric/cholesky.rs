//! Symmetric positive definite banded systems: Cholesky.
