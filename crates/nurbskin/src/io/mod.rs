//! Files: scans in, CAD files in and out.

pub use nurbskin_cad::io::{Timestamp, Written, file as cad, glb, iges, step};
pub use nurbskin_geometry::files::atomic;
pub use nurbskin_scan::io::{
    SCAN_INPUTS, in_memory, npy, obj, off, pcd, ply, ptx, read_scan, read_scan_from, scan, stl,
    text, write_scan, write_scan_to,
};
