//! Deviation: the distances of scan and surface, both ways, and the verdict on them.
//!
//! [`measure`] computes the distance of every point from the surface, [`coverage`] that of the surface from the scan,
//! [`worst`] the worst places, and [`verdict`] the decision against a tolerance. [`align`] moves a scan to the best fit
//! first.

pub mod align;
pub mod coverage;
pub mod measure;
pub mod verdict;
pub mod worst;
