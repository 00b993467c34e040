//! Files: scans in, CAD files in and out.

pub mod iges;
#[cfg(feature = "files")]
pub mod obj;
#[cfg(feature = "files")]
pub mod ply;
#[cfg(feature = "files")]
pub mod stl;
#[cfg(feature = "files")]
pub mod text;
