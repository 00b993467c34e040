//! What a scan is, and what one must know of it before a surface is fitted.

pub mod clean;
mod cloud;
mod distinct;
mod elements;
mod examined;
mod faced;
mod followers;
pub mod noise;
mod noise_lines;
pub mod normals;
mod opposite;
mod orientation;
mod outliers;
mod parts;
mod sampling;
mod sides;
mod signed_sets;
pub mod simulate;
mod split;
mod stored;

pub use clean::{CleanOptions, CleanScan, clean};
pub use cloud::{GridLayout, Organisation, Reason, Rejected, Scan, Viewpoint};
pub use parts::Parts;
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
