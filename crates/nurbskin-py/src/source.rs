//! Files that scans were read from.

use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// Size of a file, and when it was changed last in nanoseconds: enough to see that another file has its name.
type State = (u64, u128);
/// What travels between processes.
pub(crate) type FileParts = (PathBuf, PathBuf, Option<State>);

/// A file as it was when it was read.
#[derive(Clone)]
pub(crate) struct SourceFile {
    /// As it was named.
    said: PathBuf,
    /// Absolute, as the folder may change.
    path: PathBuf,
    state: Option<State>,
}

impl SourceFile {
    pub(crate) fn new(said: &Path) -> Self {
        let path = std::path::absolute(said).unwrap_or_else(|_| said.to_owned());
        Self {
            said: said.to_owned(),
            state: state_of(&path),
            path,
        }
    }

    /// Its name in messages and reports.
    pub(crate) fn said(&self) -> String {
        self.said.display().to_string()
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The path, if the file is still there and the same.
    pub(crate) fn unchanged(&self) -> Option<&Path> {
        (self.state.is_some() && state_of(&self.path) == self.state).then_some(&*self.path)
    }

    pub(crate) fn into_parts(self) -> FileParts {
        (self.said, self.path, self.state)
    }

    pub(crate) fn from_parts((said, path, state): FileParts) -> Self {
        Self { said, path, state }
    }
}

fn state_of(path: &Path) -> Option<State> {
    let about = path.metadata().ok()?;
    let changed = about.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
    Some((about.len(), changed.as_nanos()))
}
