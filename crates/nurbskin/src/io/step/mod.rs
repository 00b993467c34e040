//! STEP (ISO 10303-21 exchange files of AP203, AP214 and AP242): faces on NURBS surfaces.

pub mod write;

pub use write::{Schema, Validation, WriteOptions, Written, write};
