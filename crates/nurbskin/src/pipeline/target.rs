//! Target of an output: a file, or bytes in memory.
//!
//! The counterpart of [`Source`](super::Source). All writers write through [`Target`], so that an output is complete or
//! absent, whether it goes to a file or to the caller.

use super::Output;
use super::output::{described, extension};
use nurbskin_geometry::files::atomic::write_whole;
use nurbskin_geometry::{Error, Result};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Name of an output in memory, in messages and results.
pub const STREAMED: &str = "-";

/// Target of an output.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// A file; the format follows its extension.
    File(PathBuf),
    /// Memory, in the format of this extension (`step`, `ply`, ...): [`Output::content`] then has the bytes, for
    /// standard output or a network.
    Memory(String),
    /// Memory, under the name of a file: the format follows its extension, and CAD files state the name, as they do in a
    /// file of it. [`Output::content`] then has the bytes.
    Named(PathBuf),
}

impl Target {
    /// Targets for these files.
    #[must_use]
    pub fn files(paths: &[PathBuf]) -> Vec<Self> {
        paths.iter().cloned().map(Self::File).collect()
    }

    /// The file or its name, or `-`.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::File(path) | Self::Named(path) => path,
            Self::Memory(_) => Path::new(STREAMED),
        }
    }

    /// The file, if it is one.
    #[must_use]
    pub fn as_file(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::Memory(_) | Self::Named(_) => None,
        }
    }

    /// The extension that determines the format, in lower case and without the dot.
    #[must_use]
    pub fn format(&self) -> String {
        match self {
            Self::File(path) | Self::Named(path) => extension(path),
            Self::Memory(format) => format.trim_start_matches('.').to_ascii_lowercase(),
        }
    }

    /// The file name with and without its extension; both empty if there is none.
    pub(super) fn names(&self) -> [String; 2] {
        let name = |part: Option<&std::ffi::OsStr>| {
            part.map(|n| n.to_string_lossy().into_owned())
                .unwrap_or_default()
        };
        let path = match self {
            Self::File(path) | Self::Named(path) => Some(path),
            Self::Memory(_) => None,
        };
        [
            name(path.and_then(|path| path.file_name())),
            name(path.and_then(|path| path.file_stem())),
        ]
    }

    /// Writes the output of `fill`, completely or not at all; `format` is the name of the format.
    ///
    /// # Errors
    /// [`Error::Write`], and errors of `fill`.
    pub(super) fn write<T>(
        &self,
        format: &'static str,
        fill: impl FnOnce(&mut dyn Write) -> Result<T>,
    ) -> Result<(Output, T)> {
        match self {
            Self::File(path) => {
                let replaced = path.exists();
                let value = write_whole(path, fill)?;
                let output = Output {
                    replaced,
                    ..described(path, format)?
                };
                Ok((output, value))
            }
            Self::Memory(_) | Self::Named(_) => {
                let mut content = Vec::new();
                let value = fill(&mut content)?;
                let output = Output {
                    path: self.path().to_owned(),
                    format: format.into(),
                    bytes: content.len() as u64,
                    replaced: false,
                    content: Some(content),
                };
                Ok((output, value))
            }
        }
    }

    /// [`write`](Self::write) for given bytes.
    pub(super) fn write_bytes(&self, format: &'static str, bytes: &[u8]) -> Result<Output> {
        let path = self.path();
        let written = self.write(format, |out| {
            out.write_all(bytes)
                .map_err(|e| Error::write(path, e.to_string()))
        });
        Ok(written?.0)
    }
}
