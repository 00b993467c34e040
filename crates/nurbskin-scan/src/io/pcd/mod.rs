//! PCD, the point clouds of the Point Cloud Library.
//!
//! Read here: `pcd-rs` reserves what a header claims (gigabytes for a few bytes of `binary_compressed`, or for one
//! padding field), which ends the process, and names no line.

mod header;
mod lzf;
mod read;

pub use read::read;
