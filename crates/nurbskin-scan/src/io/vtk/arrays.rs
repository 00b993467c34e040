//! The arrays of XML files: text, base64, or bytes after the XML, compressed or not.

use super::super::bytes::Number;
use super::super::lines::{number, shown};
use super::AGAIN;
use flate2::read::ZlibDecoder;
use nurbskin_geometry::files::gzip::MOST;
use std::io::Read;

/// How a file stores binary numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Storage {
    pub(super) big_endian: bool,
    /// Lengths have 64 bits and not 32.
    pub(super) wide: bool,
    pub(super) compressed: bool,
}

/// How much memory the arrays of a file may take.
#[derive(Debug)]
pub(super) struct Budget {
    left: u64,
}

impl Budget {
    /// For a file of this size: as much as for one that is compressed with gzip.
    pub(super) fn of(size: usize) -> Self {
        Self {
            left: MOST * size as u64 + (1 << 20),
        }
    }

    fn take(&mut self, bytes: u64) -> Result<(), String> {
        self.left = self.left.checked_sub(bytes).ok_or_else(|| {
            format!(
                "its arrays would take more than {MOST} times the size of the file, which no scan does: if it is one, \
                 save it without compression"
            )
        })?;
        Ok(())
    }
}

/// Numbers that are written as text.
pub(super) fn from_text(text: &str, budget: &mut Budget) -> Result<Vec<f64>, String> {
    let mut values = Vec::new();
    for word in text.split_ascii_whitespace() {
        let value = number(word.as_bytes())
            .ok_or_else(|| format!("\"{}\" is not a number", shown(word.as_bytes())))?;
        values.push(value);
    }
    budget.take(8 * values.len() as u64)?;
    Ok(values)
}

/// Bytes that are read one after another.
#[derive(Debug)]
pub(super) enum Stream<'a> {
    /// As they are.
    Raw(&'a [u8]),
    /// In base64: the text, and what the last four letters gave more than was asked for.
    Base64(&'a [u8], Vec<u8>),
}

impl Stream<'_> {
    /// The next `count` bytes.
    fn take(&mut self, count: usize) -> Result<Vec<u8>, String> {
        let left = match self {
            Self::Raw(bytes) => bytes.len(),
            Self::Base64(text, over) => text.len() + over.len(),
        };
        let ended = || {
            format!(
                "{count} bytes are announced, but fewer follow: the file is truncated or a length is wrong; {AGAIN}"
            )
        };
        if count > left {
            return Err(ended());
        }
        match self {
            Self::Raw(bytes) => {
                let (taken, rest) = bytes.split_at(count);
                *bytes = rest;
                Ok(taken.to_vec())
            }
            Self::Base64(text, over) => {
                let mut taken = std::mem::take(over);
                while taken.len() < count {
                    let before = taken.len();
                    quad(text, &mut taken)?;
                    if taken.len() == before {
                        return Err(ended());
                    }
                }
                *over = taken.split_off(count);
                Ok(taken)
            }
        }
    }
}

/// The bytes of the next four letters, of which padding may replace two: padded parts may follow each other. None at
/// the end.
fn quad(text: &mut &[u8], bytes: &mut Vec<u8>) -> Result<(), String> {
    let (mut bits, mut letters, mut padding) = (0_u32, 0, 0);
    while letters + padding < 4 {
        let Some((&letter, rest)) = text.split_first() else {
            break;
        };
        *text = rest;
        let value = match letter {
            b'A'..=b'Z' => letter - b'A',
            b'a'..=b'z' => letter - b'a' + 26,
            b'0'..=b'9' => letter - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            b'=' => {
                padding += 1;
                continue;
            }
            _ if letter.is_ascii_whitespace() => continue,
            _ => {
                return Err(format!(
                    "\"{}\" is not a letter of base64; {AGAIN}",
                    shown(&[letter])
                ));
            }
        };
        bits = bits << 6 | u32::from(value);
        letters += 1;
    }
    let whole = (bits << (6 * (4 - letters))).to_be_bytes();
    let count = [0, 0, 1, 2, 3][letters];
    bytes.extend_from_slice(&whole[1..=count]);
    Ok(())
}

/// Binary numbers of this kind: their length, or the lengths of their compressed blocks, stands before them.
pub(super) fn from_bytes(
    stream: &mut Stream<'_>,
    kind: Number,
    storage: Storage,
    budget: &mut Budget,
) -> Result<Vec<f64>, String> {
    let bytes = if storage.compressed {
        blocks(stream, storage, budget)?
    } else {
        let [length] = lengths(stream, 1, storage)?[..] else {
            return Ok(Vec::new());
        };
        stream.take(length)?
    };
    let count = bytes.len() / kind.size();
    budget.take(8 * count as u64)?;
    let value = |k: usize| kind.read(&bytes, k * kind.size(), storage.big_endian);
    Ok((0..count).map(value).collect())
}

/// Guard: longer arrays are beyond any file: 2^50 bytes, and where addresses have 32 bits, 2^31.
const LONGEST: usize = 1 << (if usize::BITS > 50 { 50 } else { 31 });

/// Lengths of the file's own width.
fn lengths(stream: &mut Stream<'_>, count: usize, storage: Storage) -> Result<Vec<usize>, String> {
    let kind = if storage.wide {
        Number::U64
    } else {
        Number::U32
    };
    let bytes = stream.take(count.saturating_mul(kind.size()))?;
    let each = (0..count).map(|k| kind.read(&bytes, k * kind.size(), storage.big_endian));
    let sized = each.map(|x| super::index(x, LONGEST).unwrap_or(usize::MAX));
    Ok(sized.collect())
}

/// Blocks that are compressed with zlib: their number, their size, the size of the last where it is another, and the
/// compressed sizes; then the blocks.
fn blocks(
    stream: &mut Stream<'_>,
    storage: Storage,
    budget: &mut Budget,
) -> Result<Vec<u8>, String> {
    let [count, full, last] = lengths(stream, 3, storage)?[..] else {
        return Ok(Vec::new());
    };
    let sizes = lengths(stream, count, storage)?;
    let mut content = Vec::new();
    for (k, &size) in sizes.iter().enumerate() {
        let block = stream.take(size)?;
        let wanted = if k + 1 == count && last > 0 {
            last
        } else {
            full
        };
        budget.take(wanted as u64)?;
        let before = content.len();
        ZlibDecoder::new(&block[..])
            .take(wanted as u64)
            .read_to_end(&mut content)
            .map_err(|e| format!("block {k} cannot be decompressed ({e}); {AGAIN}"))?;
        if content.len() - before != wanted {
            return Err(format!(
                "block {k} has {} bytes and not the {wanted} that are announced; {AGAIN}",
                content.len() - before
            ));
        }
    }
    Ok(content)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn padded_parts_of_base64_follow_each_other() {
        let mut stream = Stream::Base64(b"AQ==AgM=\n BAUG", Vec::new());
        assert_eq!(stream.take(2).unwrap(), [1, 2]);
        assert_eq!(stream.take(4).unwrap(), [3, 4, 5, 6]);
        assert!(stream.take(1).is_err());
        assert!(Stream::Base64(b"A?==", Vec::new()).take(1).is_err());
        assert!(
            Stream::Base64(b"AAAA", Vec::new())
                .take(usize::MAX)
                .is_err()
        );
    }
}
