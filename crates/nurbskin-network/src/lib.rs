#![doc = include_str!("../README.md")]
// Results are the same on every machine: elementary functions are those of `math`.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod cholesky;
pub mod fit;
pub mod layout;
