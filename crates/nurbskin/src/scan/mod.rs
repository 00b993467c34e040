//! What a scan is, and what one must know of it before a surface is fitted.

#[cfg(feature = "scan")]
mod around;
#[cfg_attr(
    not(feature = "scan"),
    allow(dead_code, reason = "scans use all of it")
)]
pub(crate) mod blocks;
#[cfg(feature = "scan")]
pub mod clean;
mod cloud;
#[cfg(feature = "scan")]
mod distinct;
#[cfg(feature = "scan")]
mod elements;
#[cfg(feature = "scan")]
mod examined;
#[cfg(feature = "scan")]
mod faced;
#[cfg(feature = "scan")]
mod followers;
#[cfg_attr(
    not(feature = "scan"),
    allow(dead_code, reason = "scans use all of it")
)]
pub(crate) mod morton;
#[cfg(feature = "scan")]
pub mod neighbours;
#[cfg(feature = "scan")]
pub mod noise;
#[cfg(feature = "scan")]
mod noise_lines;
#[cfg(feature = "scan")]
pub mod normals;
#[cfg(feature = "scan")]
mod opposite;
#[cfg(feature = "scan")]
mod orientation;
#[cfg(feature = "scan")]
mod outliers;
#[cfg(feature = "scan")]
mod parts;
#[cfg(feature = "scan")]
mod sampling;
#[cfg(feature = "scan")]
mod sides;
#[cfg(feature = "scan")]
mod signed_sets;
pub mod simulate;
#[cfg(feature = "scan")]
mod split;
#[cfg(feature = "files")]
mod stored;

#[cfg(feature = "scan")]
pub use clean::{CleanOptions, CleanScan, clean};
pub use cloud::{GridLayout, Organisation, Reason, Rejected, Scan, Viewpoint};
#[cfg(feature = "scan")]
pub use parts::Parts;
#[cfg(feature = "scan")]
pub use split::Scrap;

/// A cloud without order, cleaned.
#[cfg(test)]
fn cleaned(points: Vec<crate::DVec3>) -> crate::Result<CleanScan> {
    let scan = Scan {
        points,
        ..Scan::default()
    };
    clean::clean(&scan, &CleanOptions::default(), &crate::progress::Silent)
}
