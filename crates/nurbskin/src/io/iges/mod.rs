//! IGES 5.3: rational B-spline surfaces (entity 128) and the curves around them.

pub mod read;
pub mod write;
