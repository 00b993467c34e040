//! Source of an input: a file on the disk, bytes in memory, or what was read before.
//!
//! All verbs read through [`Source`], so that standard input, pipes and objects of a program behave like files. The
//! content determines the format; the extension decides only where the content is ambiguous.

use crate::report;
use nurbskin_cad::io::file::{CadFile, CadFormat, is_cad_file, read_cad, read_cad_from};
use nurbskin_geometry::files::read_file;
use nurbskin_geometry::files::sniff::{self, begins_as_cad};
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::Scan;
use nurbskin_scan::io::{SCAN_INPUTS, read_scan, read_scan_from};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest size of a stream in bytes, four times the largest scans in use; a stream stays in memory.
const MOST_STREAMED: u64 = 8 << 30;

/// A scan or a CAD file to read: a file on the disk, bytes from another source, such as standard input, or a scan or CAD
/// file that was read already.
#[derive(Clone, Debug)]
pub struct Source {
    /// The file, or its name in messages.
    path: PathBuf,
    held: Held,
}

/// Where the content of a source is.
#[derive(Clone, Debug)]
enum Held {
    File,
    Bytes(Streamed),
    Scan(Arc<Scan>),
    Cad(Arc<CadFile>),
}

#[derive(Clone, Debug)]
struct Streamed {
    bytes: Arc<Vec<u8>>,
    /// The equivalent of the extension, in lower case.
    format: Option<String>,
}

impl Source {
    /// The file at `path`; reading is deferred.
    #[must_use]
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            held: Held::File,
        }
    }

    /// A scan in memory; `name` is its name in messages and results.
    #[must_use]
    pub fn scan(name: &str, scan: Arc<Scan>) -> Self {
        Self {
            path: name.into(),
            held: Held::Scan(scan),
        }
    }

    /// A CAD file that was read, or a model that could be one; `name` is its name in messages and results.
    #[must_use]
    pub fn cad(name: &str, file: Arc<CadFile>) -> Self {
        Self {
            path: name.into(),
            held: Held::Cad(file),
        }
    }

    /// Bytes in memory; `name` is their name in messages and results. `format` is the equivalent of a file extension
    /// (`ply`, `step`, ...). As with files, the content takes precedence; without a `format` it decides alone.
    ///
    /// # Errors
    /// [`Error::Invalid`] for an unknown format.
    pub fn bytes(name: &str, bytes: Vec<u8>, format: Option<&str>) -> Result<Self> {
        let format = format.map(|format| format.trim_start_matches('.').to_ascii_lowercase());
        if let Some(format) = &format
            && CadFormat::from_extension(format).is_none()
            && !SCAN_INPUTS.contains(&format.as_str())
        {
            let known: Vec<&str> = CadFormat::EXTENSIONS
                .into_iter()
                .chain(SCAN_INPUTS)
                .collect();
            return Err(Error::invalid(format!(
                "unknown format {format}: use one of {}",
                known.join(", ")
            )));
        }
        Ok(Self {
            path: name.into(),
            held: Held::Bytes(Streamed {
                bytes: Arc::new(bytes),
                format,
            }),
        })
    }

    /// The complete content of `reader`, as [`bytes`](Self::bytes).
    ///
    /// # Errors
    /// [`Error::Read`] if reading fails or the content exceeds 8 GiB; errors of [`bytes`](Self::bytes).
    pub fn stream(name: &str, reader: impl Read, format: Option<&str>) -> Result<Self> {
        // An unknown format is refused before the reader blocks.
        Self::bytes(name, Vec::new(), format)?;
        Self::bytes(name, read_most(name, reader, MOST_STREAMED)?, format)
    }

    /// The file at `path`. A pipe, such as the `<(command)` of a shell, and a file with a `format`, as for
    /// [`bytes`](Self::bytes), are read into memory immediately.
    ///
    /// # Errors
    /// As [`stream`](Self::stream) for a pipe; as [`read_file`] and [`bytes`](Self::bytes) for a file with a `format`. Other
    /// errors of a file are reported when it is read.
    pub fn open(path: impl Into<PathBuf>, format: Option<&str>) -> Result<Self> {
        let path = path.into();
        let name = path.display().to_string();
        if !is_pipe(&path) {
            if format.is_none() {
                return Ok(Self::file(path));
            }
            // An unknown format is refused before the file is read.
            Self::bytes(&name, Vec::new(), format)?;
            return Self::bytes(&name, read_file(&path)?, format);
        }
        let failed = |e: std::io::Error| Error::read(&path, "", format!("it cannot be read ({e})"));
        let pipe = std::fs::File::open(&path).map_err(failed)?;
        let extension = sniff::extension(&path);
        let known = CadFormat::from_extension(&extension).is_some()
            || SCAN_INPUTS.contains(&extension.as_str());
        Self::stream(&name, pipe, format.or(known.then_some(extension.as_str())))
    }

    /// The path of the file, or the name of the bytes.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the source is a file on the disk.
    #[must_use]
    pub fn is_file(&self) -> bool {
        matches!(self.held, Held::File)
    }

    /// Whether the source is a CAD file, by its name, its format or the beginning of its content.
    #[must_use]
    pub fn is_cad(&self) -> bool {
        match &self.held {
            Held::File => is_cad_file(&self.path),
            Held::Bytes(Streamed { bytes, format }) => {
                let named = format.as_deref().and_then(CadFormat::from_extension);
                named.is_some() || begins_as_cad(bytes)
            }
            Held::Scan(_) => false,
            Held::Cad(_) => true,
        }
    }

    /// Reads the source as a scan.
    ///
    /// # Errors
    /// As [`read_scan`]; [`Error::Unsupported`] for a CAD file, with the verbs that accept one.
    pub fn read_scan(&self) -> Result<Scan> {
        match &self.held {
            Held::File => read_scan(&self.path),
            Held::Scan(scan) => Ok((**scan).clone()),
            Held::Cad(_) => Err(not_a_scan(&self.path)),
            Held::Bytes(Streamed { bytes, format }) => {
                let format = format.as_deref();
                if format.and_then(CadFormat::from_extension).is_some() {
                    return Err(not_a_scan(&self.path));
                }
                let name = self.path.to_string_lossy();
                read_scan_from(&name, bytes.to_vec(), format)
            }
        }
    }

    /// Reads the source as a CAD file.
    ///
    /// # Errors
    /// As [`read_cad`]; [`Error::Read`] for a scan.
    pub fn read_cad(&self) -> Result<CadFile> {
        match &self.held {
            Held::File => read_cad(&self.path),
            Held::Cad(file) => Ok((**file).clone()),
            Held::Scan(_) => {
                let what = "this is a scan, not a CAD file: use `fit` to make a CAD file from it";
                Err(Error::read(&self.path, "", what))
            }
            Held::Bytes(Streamed { bytes, .. }) => read_cad_from(bytes.to_vec(), &self.path),
        }
    }

    /// Name, size and hash, for a report; `None` for what is no file and has no bytes.
    ///
    /// # Errors
    /// [`Error::Read`] if the file no longer exists.
    pub fn identity(&self) -> Result<Option<report::Source>> {
        match &self.held {
            Held::File => report::Source::of(&self.path).map(Some),
            Held::Bytes(Streamed { bytes, .. }) => {
                Ok(Some(report::Source::of_bytes(&self.path, bytes)))
            }
            Held::Scan(_) | Held::Cad(_) => Ok(None),
        }
    }
}

/// The message for a CAD file in place of a scan.
pub(super) fn not_a_scan(path: &Path) -> Error {
    Error::Unsupported(sniff::not_a_scan(path))
}

/// Reads a stream of at most this many bytes.
fn read_most(name: &str, reader: impl Read, most: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let read = reader.take(most + 1).read_to_end(&mut bytes);
    read.map_err(|e| Error::read(name, "", format!("it cannot be read ({e})")))?;
    if bytes.len() as u64 > most {
        let what = format!(
            "it gives more than {} GiB, the most that is read from a stream: save it to a file, and name the file",
            most >> 30
        );
        return Err(Error::read(name, "", what));
    }
    if bytes.is_empty() {
        return Err(Error::read(name, "", "it is empty: nothing was sent to it"));
    }
    Ok(bytes)
}

/// Whether there is a named pipe at this path.
fn is_pipe(path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        std::fs::metadata(path).is_ok_and(|known| known.file_type().is_fifo())
    }
    #[cfg(not(unix))]
    {
        let _ = path;
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_read_as_files_are() {
        let text = b"0 0 0\n1 0 0\n0 1 0\n1 1 0\n";
        for format in [None, Some("xyz"), Some(".XYZ"), Some("ply")] {
            let source = Source::stream("standard input", &text[..], format).unwrap();
            assert!(!source.is_file() && !source.is_cad());
            let read = source.read_scan();
            if format == Some("ply") {
                let error = read.unwrap_err().to_string();
                assert!(error.starts_with("standard input, line 1"), "{error}");
            } else {
                assert_eq!(read.unwrap().points.len(), 4, "{format:?}");
            }
        }
        let error = Source::bytes("-", Vec::new(), Some("foo")).unwrap_err();
        assert!(
            error
                .to_string()
                .contains("unknown format foo: use one of step"),
            "{error}"
        );
    }

    #[test]
    fn cad_files_are_told_by_format_and_content() {
        let source = Source::bytes("-", b"ISO-10303-21;".to_vec(), None).unwrap();
        assert!(source.is_cad());
        let error = source.read_scan().unwrap_err().to_string();
        assert!(
            error.contains("is a CAD file, not a scan: use `check`"),
            "{error}"
        );
        let source = Source::bytes("-", b"?".to_vec(), Some("igs")).unwrap();
        assert!(source.is_cad());
        assert!(
            source
                .read_scan()
                .unwrap_err()
                .to_string()
                .contains("is a CAD file")
        );
    }

    #[test]
    fn what_was_read_is_a_source() {
        let source = Source::bytes("-", b"0 0 0\n1 0 0\n0 1 0\n".to_vec(), None).unwrap();
        let scan = Source::scan("points", Arc::new(source.read_scan().unwrap()));
        assert!(!scan.is_file() && !scan.is_cad());
        assert_eq!(scan.read_scan().unwrap().points.len(), 3);
        assert_eq!(scan.identity().unwrap(), None);
        let error = scan.read_cad().unwrap_err().to_string();
        assert!(
            error.starts_with("points: this is a scan, not a CAD file"),
            "{error}"
        );
        let cad = Source::cad("part", Arc::new(CadFile::default()));
        assert!(!cad.is_file() && cad.is_cad());
        assert!(cad.read_cad().unwrap().model.faces().is_empty());
        let error = cad.read_scan().unwrap_err().to_string();
        assert!(error.starts_with("part is a CAD file"), "{error}");
    }

    #[test]
    fn streams_have_an_end() {
        let error = read_most("standard input", std::io::repeat(b' '), 1 << 16).unwrap_err();
        assert!(error.to_string().contains("save it to a file"), "{error}");
        let error = read_most("standard input", std::io::empty(), 1 << 16).unwrap_err();
        assert!(error.to_string().contains("nothing was sent"), "{error}");
        assert_eq!(read_most("-", &b"abc"[..], 3).unwrap(), b"abc");
    }
}
