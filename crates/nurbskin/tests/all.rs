//! One integration binary; each module a theme.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test that fails shall panic, and one that skips says why"
)]

mod approximation;
mod book;
mod cad;
mod distance;
mod enrichment;
mod formats;
mod four_shapes;
mod interpolation;
mod laws;
mod layers;
mod noise_law;
mod paper;
mod rarefaction;
mod real;
mod real_shapes;
mod regressions;
mod revolution;
mod scan_lines;
mod sheets;
mod thin_walls;
mod threads;
mod tolerance;
mod trade;
mod truth;
mod verdicts;
