//! From a cleaned scan to one NURBS surface: (u, v) for every point, then interpolation or approximation.
//!
//! | module | does |
//! |---|---|
//! | [`chart`] | which shape of domain a scan has, and (u, v) for every point |
//! | [`rarefy`], [`enrich`] | the paper's logical rarefaction and Catmull-Clark enrichment |
//! | [`fit`] | interpolation, rarefaction to tolerance, approximation to tolerance, exact surfaces of revolution |
//! | [`charting`] | the chart of any cleaned part: by projection, or over a mesh |
//!
//! It implements P. Pal and R. Ballav, *Object shape reconstruction through NURBS surface interpolation*,
//! Int. J. Production Research 45(2), 2007, 287-307 (DOI 10.1080/00207540600688481).

// Results are the same on every machine: elementary functions are those of `math`.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod chart;
pub mod charting;
pub mod enrich;
pub mod fit;
pub mod rarefy;

/// Compiles and runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
