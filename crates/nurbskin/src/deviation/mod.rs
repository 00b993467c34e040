//! How close the surface comes to the scan, and the scan to the surface.

pub mod align;
pub mod coverage;
pub mod measure;
pub mod verdict;
pub mod worst;
