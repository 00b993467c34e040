//! One integration binary; each module a theme.

mod book;
mod cad;
mod formats;
mod interpolation;
mod laws;
mod layers;
mod paper;
mod regressions;
mod threads;
mod truth;
