//! CAD files: IGES 5.3 and STEP (ISO 10303-21) read and written, GLB written.

pub mod file;
pub mod glb;
pub mod iges;
pub mod step;
mod text;
mod timestamp;

pub use file::*;
pub use text::Written;
pub use timestamp::Timestamp;

#[cfg(test)]
mod round_trip_tests;
