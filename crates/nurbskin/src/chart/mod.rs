//! Which shape of domain a scan has, and (u, v) for every point.

pub mod grid;
#[cfg(feature = "scan")]
pub mod plane;
mod topology;

pub use topology::Topology;
