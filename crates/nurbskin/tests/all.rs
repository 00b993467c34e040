//! One integration binary; each module a theme.

mod book;
mod cad;
mod enrichment;
mod formats;
mod four_shapes;
mod interpolation;
mod laws;
mod layers;
mod paper;
mod rarefaction;
mod regressions;
mod threads;
mod truth;
