//! Files of scans: point clouds, range images and meshes, read and written.

mod bytes;
mod e57;
mod far;
mod grid;
mod las;
mod lines;
pub mod npy;
pub mod obj;
pub mod off;
pub mod pcd;
pub mod ply;
pub mod ptx;
pub mod scan;
pub mod stl;
pub mod text;
mod vtk;

pub use scan::{
    ARRAY, SCAN_INPUTS, in_memory, read_scan, read_scan_from, write_scan, write_scan_to,
};
