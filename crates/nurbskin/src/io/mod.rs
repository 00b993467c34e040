//! Files: scans in, CAD files in and out.

pub mod atomic;
mod bytes;
pub mod cad;
mod cad_text;
mod e57;
mod far;
pub mod glb;
mod grid;
mod gzip;
pub mod iges;
mod las;
mod lines;
pub mod npy;
pub mod obj;
pub mod off;
pub mod pcd;
pub mod ply;
pub mod ptx;
pub mod scan;
mod sniff;
pub mod step;
pub mod stl;
pub mod text;
mod timestamp;
mod vtk;

pub use cad_text::Written;
pub(crate) use scan::{ARRAY, read_file};
pub use scan::{SCAN_INPUTS, in_memory, read_scan, read_scan_from, write_scan, write_scan_to};
pub(crate) use sniff::extension;
pub use timestamp::Timestamp;

#[cfg(test)]
mod round_trip_tests;
