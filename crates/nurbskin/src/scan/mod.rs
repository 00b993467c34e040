//! What a scan is, and what one must know of it before a surface is fitted.

#[cfg(feature = "scan")]
pub mod clean;
mod cloud;
#[cfg(feature = "scan")]
pub mod neighbours;
#[cfg(feature = "scan")]
pub mod noise;
#[cfg(feature = "scan")]
pub mod normals;
#[cfg(feature = "scan")]
mod outliers;
#[cfg(feature = "scan")]
mod parts;
pub mod simulate;

#[cfg(feature = "scan")]
pub use clean::{CleanOptions, CleanScan, clean};
pub use cloud::{GridLayout, Organisation, Reason, Rejected, Scan};
#[cfg(feature = "scan")]
pub use parts::Parts;
