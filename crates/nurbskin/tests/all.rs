//! One integration binary; each module a theme.

mod book;
mod cad;
mod distance;
mod formats;
mod laws;
mod layers;
mod paper;
mod regressions;
mod threads;
mod truth;
