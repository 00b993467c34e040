//! The header of a PLY file, brought into the form that the parser takes.

use nurbskin_geometry::{Error, Result};
use std::io::{BufRead, Read};
use std::path::Path;

/// The header as clean text, and where the data begin.
#[derive(Debug)]
pub(super) struct Header {
    /// UTF-8, lines ended by LF, `end_header` included.
    pub(super) text: String,
    /// Offset of the first byte after the header.
    pub(super) body: usize,
    /// Lines of the header.
    pub(super) lines: usize,
    /// Whether the data are text.
    pub(super) ascii: bool,
}

impl Header {
    /// Finds the header of `bytes`. Line ends may be LF, CR LF or CR, comments in any encoding. Of text data the
    /// declared number types are widened to `double`: the digits in the file say more than the type does, and
    /// integers written as `1.0` are common.
    pub(super) fn find(bytes: &[u8], path: &Path) -> Result<Self> {
        let start = if bytes.starts_with(b"\xef\xbb\xbf") {
            3
        } else {
            0
        };
        let end = bytes[start..]
            .iter()
            .position(|b| matches!(b, b'\n' | b'\r'))
            .map(|at| &bytes[start + at..]);
        let line_end: &[u8] = match end {
            Some([b'\r', b'\n', ..]) => b"\r\n",
            Some([b'\r', ..]) => b"\r",
            _ => b"\n",
        };
        let last = line_end[line_end.len() - 1];
        let mut header = Header {
            text: String::new(),
            body: start,
            lines: 0,
            ascii: false,
        };
        for line in bytes[start..].split_inclusive(|&b| b == last) {
            header.body += line.len();
            header.lines += 1;
            let line = String::from_utf8_lossy(line.trim_ascii());
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            match words.as_slice() {
                ["end_header"] => {
                    header.text.push_str("end_header\n");
                    return Ok(header);
                }
                ["format", "ascii", ..] => header.ascii = true,
                _ => {}
            }
            match words.as_slice() {
                ["property", "list", count, data, name, ..]
                    if header.ascii && is_type(count) && is_type(data) =>
                {
                    header.text.push_str("property list uint double ");
                    header.text.push_str(name);
                }
                ["property", kind, name, ..] if header.ascii && is_type(kind) => {
                    header.text.push_str("property double ");
                    header.text.push_str(name);
                }
                _ => header.text.push_str(&line),
            }
            header.text.push('\n');
        }
        Err(Error::read(
            path,
            "header",
            "the line end_header is missing: the file is truncated or not a PLY file; export it again",
        ))
    }
}

/// Whether this is the name of a PLY number type.
fn is_type(word: &str) -> bool {
    word.parse::<serde_ply::ScalarType>().is_ok()
}

/// The clean header, then the data as they are in the file.
#[derive(Debug)]
pub(super) struct Source<'a> {
    pub(super) header: &'a [u8],
    pub(super) body: &'a [u8],
}

impl Read for Source<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let part = if self.header.is_empty() {
            &mut self.body
        } else {
            &mut self.header
        };
        part.read(buffer)
    }
    #[inline]
    fn read_exact(&mut self, buffer: &mut [u8]) -> std::io::Result<()> {
        // The parser reads the header by lines and asks for bytes of the data only.
        self.body.read_exact(buffer)
    }
}

impl BufRead for Source<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        Ok(if self.header.is_empty() {
            self.body
        } else {
            self.header
        })
    }
    fn consume(&mut self, amount: usize) {
        let part = if self.header.is_empty() {
            &mut self.body
        } else {
            &mut self.header
        };
        *part = part.get(amount..).unwrap_or_default();
    }
}
