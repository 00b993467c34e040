//! PLY meshes, points and range grids.

mod content;
mod header;
mod read;
mod rows;
mod write;

pub use read::read;
pub use write::write;
