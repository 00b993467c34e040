//! Files: scans in, CAD files in and out.

#[cfg(feature = "files")]
pub mod atomic;
pub mod iges;
#[cfg(feature = "files")]
pub mod obj;
#[cfg(feature = "files")]
pub mod ply;
#[cfg(feature = "files")]
pub mod stl;
#[cfg(feature = "files")]
pub mod text;
