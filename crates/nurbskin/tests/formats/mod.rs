//! Good, odd, truncated and mangled files.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::float_cmp,
    reason = "helpers of tests may do what tests may, and what is read must be exact"
)]

mod damaged;
mod make;
mod mangled;
mod real;
mod round_trip;
mod scanners;
mod speed;
mod streams;
mod vtk;
