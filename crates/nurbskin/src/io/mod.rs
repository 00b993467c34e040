//! Files: scans in, CAD files in and out.

#[cfg(feature = "files")]
pub mod atomic;
#[cfg(feature = "files")]
mod bytes;
pub mod cad;
mod cad_text;
#[cfg(feature = "e57")]
mod e57;
#[cfg(feature = "files")]
mod far;
#[cfg(feature = "files")]
pub mod glb;
#[cfg(feature = "files")]
mod grid;
#[cfg(feature = "files")]
mod gzip;
pub mod iges;
#[cfg(feature = "las")]
mod las;
#[cfg(feature = "files")]
mod lines;
#[cfg(feature = "files")]
pub mod npy;
#[cfg(feature = "files")]
pub mod obj;
#[cfg(feature = "files")]
pub mod off;
#[cfg(feature = "files")]
pub mod pcd;
#[cfg(feature = "files")]
pub mod ply;
#[cfg(feature = "files")]
pub mod ptx;
#[cfg(feature = "files")]
pub mod scan;
#[cfg(feature = "files")]
mod sniff;
pub mod step;
#[cfg(feature = "files")]
pub mod stl;
#[cfg(feature = "files")]
pub mod text;
mod timestamp;
#[cfg(feature = "files")]
mod vtk;

pub use cad_text::Written;
#[cfg(feature = "files")]
pub(crate) use scan::{ARRAY, read_file};
#[cfg(feature = "files")]
pub use scan::{SCAN_INPUTS, in_memory, read_scan, read_scan_from, write_scan, write_scan_to};
#[cfg(feature = "files")]
pub(crate) use sniff::extension;
pub use timestamp::Timestamp;

#[cfg(test)]
mod round_trip_tests;
