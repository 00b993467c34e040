//! One integration binary; each module a theme.

#[cfg(feature = "scan")]
mod approximation;
mod book;
mod cad;
mod formats;
mod laws;
mod layers;
mod paper;
mod regressions;
mod threads;
mod truth;
