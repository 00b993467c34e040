//! From ordered or charted points to a surface.

pub mod approximate;
pub mod interpolate;
pub mod least_squares;
pub mod rarefied;
pub mod revolution;
