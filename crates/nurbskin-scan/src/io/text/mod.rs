//! Delimited text: XYZ, ASC, TXT, CSV, PTS.

mod columns;
mod read;
mod separator;
mod write;

pub use read::read;
pub use write::write;
