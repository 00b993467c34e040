//! Files that scans were read from.

use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// Size of a file, and when it was changed last in nanoseconds: enough to see that another file has its name.
type State = (u64, u128);
/// What travels between processes.
pub(crate) type FileParts = (PathBuf, Option<State>);

/// A file as it was when it was read.
#[derive(Clone)]
pub(crate) struct SourceFile {
    /// Absolute, as the folder may change.
    path: PathBuf,
    state: Option<State>,
}

impl SourceFile {
    pub(crate) fn new(path: &Path) -> Self {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let state = state_of(&path);
        Self { path, state }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The path, if the file is still there and the same.
    pub(crate) fn unchanged(&self) -> Option<&Path> {
        (self.state.is_some() && state_of(&self.path) == self.state).then_some(&*self.path)
    }

    pub(crate) fn into_parts(self) -> FileParts {
        (self.path, self.state)
    }

    pub(crate) fn from_parts((path, state): FileParts) -> Self {
        Self { path, state }
    }
}

fn state_of(path: &Path) -> Option<State> {
    let about = path.metadata().ok()?;
    let changed = about.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
    Some((about.len(), changed.as_nanos()))
}
