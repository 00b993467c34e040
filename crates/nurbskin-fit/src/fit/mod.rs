//! From ordered or charted points to a surface.
//!
//! Three ways: interpolation of a grid of points (`interpolate`, `rarefied`), least squares (`least_squares` on given
//! knots, `approximate` with knots where the error is), and recognition of a surface of revolution (`revolution`).

pub mod approximate;
pub mod interpolate;
pub mod least_squares;
pub mod rarefied;
pub mod revolution;
