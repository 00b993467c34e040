//! Files, whatever they hold: read whole, told apart by their content, written whole or not at all.

pub mod atomic;
pub mod gzip;
pub mod sniff;

use crate::error::NO_SUCH_FILE;
use crate::{Error, Result};
use std::io::ErrorKind;
use std::path::Path;

/// The content of a file.
///
/// # Errors
/// [`Error::Read`] for what is no file or cannot be read.
pub fn read_file(path: &Path) -> Result<Vec<u8>> {
    let refused = |e: std::io::Error| {
        let what = match e.kind() {
            ErrorKind::NotFound => NO_SUCH_FILE.to_owned(),
            ErrorKind::PermissionDenied => "permission denied: change its permissions".to_owned(),
            _ => format!("it cannot be read ({e})"),
        };
        Error::read(path, "", what)
    };
    let known = std::fs::metadata(path).map_err(refused)?;
    if known.is_dir() {
        return Err(Error::read(path, "", "this is a directory; name a file"));
    }
    if !known.is_file() {
        // A pipe or a device may never end.
        return Err(Error::read(
            path,
            "",
            "this is not a regular file; save the scan to one",
        ));
    }
    std::fs::read(path).map_err(refused)
}
