//! STEP (ISO 10303-21 exchange files of AP203, AP214 and AP242): faces on NURBS surfaces.

mod assembly_in;
mod curve_in;
mod instance;
mod parse;
mod place;
mod read;
mod surface_in;
mod topology_in;
mod units_in;

pub use read::read;

#[cfg(test)]
mod read_tests;
