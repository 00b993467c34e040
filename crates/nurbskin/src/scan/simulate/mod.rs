//! A virtual scanner: shapes of exactly known surface and distance, scanned with noise, outliers and holes.

pub mod scanner;
pub mod shapes;
