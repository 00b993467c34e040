//! Files compressed with gzip.

use crate::{Error, Result};
use flate2::read::MultiGzDecoder;
use std::io::Read;
use std::path::Path;

/// Largest ratio of the content to its compressed file. Guard: text of coordinates is four times as large as its file,
/// that of a mostly empty grid thirty times; gzip reaches a thousand, with which a small file fills any memory.
pub const MOST: u64 = 64;

/// Whether the file is compressed.
pub fn is_gzip(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x1f, 0x8b])
}

/// What the first bytes of a compressed file hold, as far as they go.
pub fn head(bytes: &[u8]) -> Vec<u8> {
    let mut content = Vec::new();
    // They end too early, for sure; what was there before counts.
    let _ = MultiGzDecoder::new(bytes)
        .take(bytes.len() as u64)
        .read_to_end(&mut content);
    content
}

/// The content of a compressed file, all of its members one after another.
///
/// # Errors
/// [`Error::Read`] for a damaged or truncated file, and for one whose content is out of proportion.
pub fn inflate(bytes: &[u8], path: &Path) -> Result<Vec<u8>> {
    let most = MOST * bytes.len() as u64 + (1 << 20);
    let mut content = Vec::new();
    let outcome = MultiGzDecoder::new(bytes)
        .take(most + 1)
        .read_to_end(&mut content);
    if let Err(error) = outcome {
        let what = format!(
            "the gzip data are damaged or end too early ({error}); compress or copy the file again"
        );
        return Err(Error::read(
            path,
            format!("byte {} of the content", content.len()),
            what,
        ));
    }
    if content.len() as u64 > most {
        let what = format!(
            "the content is more than {MOST} times as large as the file, which no scan is: if it is one, unpack it \
             with gunzip first"
        );
        return Err(Error::read(path, "", what));
    }
    Ok(content)
}
