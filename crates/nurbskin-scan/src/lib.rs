//! 3-D scans: read, cleaned, triangulated and simulated.
//!
//! | module | does |
//! |---|---|
//! | [`Scan`] | points at their original index, what the file says of their order, unit, viewpoints |
//! | [`io`] | files of scans, read and written |
//! | [`mod@clean`] | duplicates, outliers, separate parts, oriented normals, spacing |
//! | [`noise`] | the standard deviation of the points across the surface |
//! | [`mesh`] | triangles between points: made, repaired, holes filled, handles cut, decimated |
//! | [`simulate`] | a virtual scanner and shapes of exactly known surface |
//! | [`normals`] | planes and axes of few points |
//! | [`binary`] | values as bytes that name their kind and version |

// Results are the same on every machine: elementary functions are those of `math`.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod binary;
pub mod clean;
mod cloud;
pub mod io;
pub mod mesh;
pub mod normals;
mod sides;
pub mod simulate;
mod stored;

pub use clean::noise;
pub use clean::{CleanOptions, CleanScan, Parts, Scrap, clean};
pub use cloud::{GridLayout, Organisation, Reason, Records, Rejected, Scan, Viewpoint};

/// A cloud without order, cleaned.
#[cfg(test)]
fn cleaned(points: Vec<nurbskin_geometry::DVec3>) -> nurbskin_geometry::Result<CleanScan> {
    let scan = Scan {
        points,
        ..Scan::default()
    };
    clean::clean(
        &scan,
        &CleanOptions::default(),
        &nurbskin_geometry::progress::Silent,
    )
}

/// Compiles and runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
