//! The one error type of the library. Each kind answers whose fault it is, and each text says what to do.

use std::path::PathBuf;

/// The message for a file that does not exist.
pub(crate) const NO_SUCH_FILE: &str = "there is no such file; check the name";

/// What can go wrong, in the user's words.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read, or does not say what its format demands.
    #[error("{}{}: {what}", path.display(), if at.is_empty() { String::new() } else { format!(", {at}") })]
    Read {
        /// The file.
        path: PathBuf,
        /// The line or record, as in "line 12" or "element vertex, row 3"; empty where the whole file is meant.
        at: String,
        /// What is wrong and what to do.
        what: String,
    },
    /// A file could not be written; nothing was left behind.
    #[error("cannot write {}: {what}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What is wrong and what to do.
        what: String,
    },
    /// The caller's values contradict each other or the definition of what they describe.
    #[error("{0}")]
    Invalid(String),
    /// A legitimate wish that this version cannot fulfil.
    #[error("{0}")]
    Unsupported(String),
    /// The computation has no solution with these data and options: what, by how much, what to try.
    #[error("{0}")]
    NoSolution(String),
    /// The caller's [`Progress`](crate::progress::Progress) asked to stop.
    #[error("cancelled")]
    Cancelled,
}

impl Error {
    /// An [`Error::Invalid`] with this text.
    pub fn invalid(what: impl Into<String>) -> Self {
        Error::Invalid(what.into())
    }
    /// Whether the reason is that a file to read does not exist, or the folder of a file to write.
    ///
    /// ```
    /// use nurbskin_geometry::files::read_file;
    /// assert!(read_file("nowhere.ply".as_ref()).unwrap_err().is_missing());
    /// assert!(!read_file(".".as_ref()).unwrap_err().is_missing());
    /// ```
    #[must_use]
    pub fn is_missing(&self) -> bool {
        match self {
            Error::Read { what, .. } => what == NO_SUCH_FILE,
            Error::Write { path, .. } => path
                .parent()
                .is_some_and(|folder| !folder.as_os_str().is_empty() && !folder.is_dir()),
            _ => false,
        }
    }
    /// An [`Error::Read`] about `path`; `at` may be empty.
    pub fn read(path: impl Into<PathBuf>, at: impl Into<String>, what: impl Into<String>) -> Self {
        Error::Read {
            path: path.into(),
            at: at.into(),
            what: what.into(),
        }
    }
    /// An [`Error::Write`] about `path`.
    pub fn write(path: impl Into<PathBuf>, what: impl Into<String>) -> Self {
        Error::Write {
            path: path.into(),
            what: what.into(),
        }
    }
}

/// `Result` with the library's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;
