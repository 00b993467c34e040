//! Files: scans in, CAD files in and out.

#[cfg(feature = "files")]
pub mod atomic;
pub mod iges;
#[cfg(feature = "files")]
mod lines;
#[cfg(feature = "files")]
pub mod obj;
#[cfg(feature = "files")]
pub mod ply;
#[cfg(feature = "files")]
pub mod scan;
#[cfg(feature = "files")]
mod sniff;
#[cfg(feature = "files")]
pub mod stl;
#[cfg(feature = "files")]
pub mod text;

#[cfg(feature = "files")]
pub use scan::{read_scan, write_scan};
