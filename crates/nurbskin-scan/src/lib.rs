//! What a scan is, and what one must know of it before a surface is fitted.

pub mod binary;
pub mod clean;
mod cloud;
pub mod io;
pub mod mesh;
pub mod normals;
pub mod simulate;
mod stored;

pub use clean::noise;
pub use clean::{CleanOptions, CleanScan, Parts, Scrap, clean};
pub use cloud::{GridLayout, Organisation, Reason, Rejected, Scan, Viewpoint};

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
