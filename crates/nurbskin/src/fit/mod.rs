//! From ordered or charted points to a surface.

#[cfg(feature = "scan")]
pub mod adapt;
#[cfg(feature = "scan")]
pub mod approximate;
mod collocation;
#[cfg(feature = "scan")]
pub mod fairness;
pub mod interpolate;
pub mod parameters;
pub mod rarefied;
mod tensor;
