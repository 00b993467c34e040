//! Good, odd, truncated and mangled files.
#![cfg(feature = "files")]

mod mangled;
mod real;
mod round_trip;
