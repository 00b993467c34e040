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
mod fixtures;
mod formats;
mod interpolation;
mod laws;
mod layers;
mod least_squares_noise;
mod networks;
mod paper;
mod rarefaction;
mod real_scans;
mod real_topology;
mod regressions;
mod revolution;
mod scan_lines;
mod sheets;
mod simulated_scans;
mod thin_walls;
mod threads;
mod tolerance;
mod trade;
mod verdicts;
