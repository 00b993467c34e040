//! Input files, identified by their content.
//!
//! The page lists path, size and SHA-256 of each input, so that a report can be matched to its files.

use nurbskin_geometry::{Error, Result};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Bytes read at a time.
const BLOCK: usize = 1 << 16;

/// An input file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Source {
    /// Its path as given.
    pub path: String,
    /// Its size.
    pub bytes: u64,
    /// SHA-256 of its content, in lower-case hexadecimal digits.
    pub sha256: String,
}

impl Source {
    /// The file at `path`, read again in small blocks.
    ///
    /// # Errors
    /// [`Error::Read`] if it no longer exists.
    ///
    /// Source of the hash: FIPS 180-4.
    pub fn of(path: &Path) -> Result<Self> {
        let refused =
            |e: std::io::Error| Error::read(path, "", format!("it cannot be read again ({e})"));
        let mut file = File::open(path).map_err(refused)?;
        let mut hash = Sha256::new();
        let mut block = vec![0; BLOCK];
        let mut bytes = 0;
        loop {
            let count = file.read(&mut block).map_err(refused)?;
            if count == 0 {
                break;
            }
            hash.update(block.get(..count).unwrap_or_default());
            bytes += count as u64;
        }
        Ok(Self::hashed(path, bytes, hash))
    }

    /// An input in memory; `path` is its name.
    #[must_use]
    pub fn of_bytes(path: &Path, bytes: &[u8]) -> Self {
        let mut hash = Sha256::new();
        hash.update(bytes);
        Self::hashed(path, bytes.len() as u64, hash)
    }

    fn hashed(path: &Path, bytes: u64, hash: Sha256) -> Self {
        let mut sha256 = String::with_capacity(64);
        for byte in hash.finalize() {
            // Writing to a string cannot fail.
            let _ = write!(sha256, "{byte:02x}");
        }
        Self {
            path: path.display().to_string(),
            bytes,
            sha256,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_that_of_the_standard() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("abc");
        std::fs::write(&path, "abc").unwrap();
        let found = Source::of(&path).unwrap();
        assert_eq!(found.bytes, 3);
        // FIPS 180-2, appendix B.1.
        assert_eq!(
            found.sha256,
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
        assert!(Source::of(&folder.path().join("none")).is_err());
    }
}
