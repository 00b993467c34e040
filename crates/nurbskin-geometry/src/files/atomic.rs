//! Files are written whole or not at all.

use crate::{Error, Result};
use std::fs;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Writes a file whole or not at all: `fill` writes to a temporary file in the same folder, which takes the place of
/// `path` only after all of it is on the disk. Whatever goes wrong, an older file of that name stays as it was and
/// nothing else is left behind.
///
/// A new file gets the permissions that any new file gets; a replaced one keeps its own. A symbolic link is followed:
/// its target is replaced.
///
/// ```
/// use nurbskin_geometry::files::atomic::write_whole;
/// use std::io::Write;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("points.xyz");
/// write_whole(&path, |out| {
///     writeln!(out, "0 0 0").map_err(|e| nurbskin_geometry::Error::write("points.xyz", e.to_string()))
/// })?;
/// assert_eq!(std::fs::read_to_string(&path)?, "0 0 0\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`Error::Write`] about `path` if it is a directory or a device, its folder does not exist or may not be written to,
/// or the disk is full; and whatever `fill` returns, an [`Error::Write`] of it with its path set to `path`.
pub fn write_whole<T>(
    path: impl AsRef<Path>,
    fill: impl FnOnce(&mut dyn Write) -> Result<T>,
) -> Result<T> {
    let asked = path.as_ref();
    let refuse = |what: String| Error::write(asked, what);
    let path = target(asked)?;
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return Err(refuse(format!(
            "the folder {} does not exist; make it first",
            folder.display()
        )));
    }
    let old = fs::metadata(&path).ok();
    if old.as_ref().is_some_and(|old| old.permissions().readonly()) {
        return Err(refuse(
            "the file exists and is write-protected; choose another name or lift the protection"
                .into(),
        ));
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(".nurbskin-").suffix(".part");
    // As for any new file: what the user's mask leaves of "everybody may read and write".
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut temporary = builder
        .tempfile_in(folder)
        .map_err(|e| refuse(sentence(&e)))?;

    let (filled, failure) = {
        let mut out = Recorder {
            inner: BufWriter::with_capacity(1 << 16, temporary.as_file_mut()),
            failure: None,
        };
        let filled = fill(&mut out);
        // The recorder keeps what goes wrong here.
        let _ = out.flush();
        (filled, out.failure.take())
    };
    if let Some(failure) = failure {
        return Err(refuse(failure));
    }
    let value = filled.map_err(|error| match error {
        Error::Write { what, .. } => refuse(what),
        other => other,
    })?;

    if let Some(old) = old {
        // Without them the new file would still be right: no reason to fail.
        let _ = fs::set_permissions(temporary.path(), old.permissions());
    }
    // Some disks report that they are full only now.
    temporary
        .as_file()
        .sync_all()
        .map_err(|e| refuse(sentence(&e)))?;
    temporary
        .persist(&path)
        .map_err(|e| refuse(sentence(&e.error)))?;
    Ok(value)
}

/// The file that `path` means, symbolic links followed.
///
/// # Errors
/// [`Error::Write`] if it cannot be a file: a directory, a device, a pipe.
fn target(path: &Path) -> Result<PathBuf> {
    let refuse = |what: &str| Err(Error::write(path, what));
    if path.as_os_str().is_empty() {
        return refuse("the file name is empty");
    }
    let separated = path
        .to_str()
        .is_some_and(|text| text.ends_with(std::path::is_separator));
    if separated || path.file_name().is_none() {
        return refuse("it is a directory; name a file in it");
    }
    match fs::metadata(path) {
        Ok(data) if data.is_dir() => refuse("it is a directory; name a file in it"),
        Ok(data) if !data.is_file() => refuse(
            "it is a device or a pipe, and a file is written whole or not at all; name a file",
        ),
        Ok(_) => fs::canonicalize(path).map_err(|e| Error::write(path, sentence(&e))),
        // A link that leads nowhere would be replaced by the file, and its owner surprised.
        Err(_) if fs::symlink_metadata(path).is_ok() => {
            refuse("it is a symbolic link that leads nowhere; remove it or name another file")
        }
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(path.to_owned()),
        Err(error) => Err(Error::write(path, sentence(&error))),
    }
}

/// What went wrong, in words that say what to do.
fn sentence(error: &std::io::Error) -> String {
    match error.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "the disk is full; nothing was written: make room or choose another disk".into()
        }
        ErrorKind::PermissionDenied => {
            "permission denied: you may not write in this folder; choose another".into()
        }
        ErrorKind::ReadOnlyFilesystem => "the disk is read-only; choose another".into(),
        ErrorKind::NotFound => {
            "the folder does not exist or takes no new files; choose another".into()
        }
        ErrorKind::NotADirectory => {
            "a part of the path is a file and not a folder; choose another path".into()
        }
        ErrorKind::InvalidFilename => {
            "the file name is too long or has characters that the disk does not take".into()
        }
        _ => error.to_string(),
    }
}

/// Remembers the first failure of the disk, whose kind would be lost in the words of who writes.
struct Recorder<W: Write> {
    inner: W,
    failure: Option<String>,
}

impl<W: Write> Recorder<W> {
    fn note<T>(&mut self, result: std::io::Result<T>) -> std::io::Result<T> {
        if let Err(error) = &result
            && error.kind() != ErrorKind::Interrupted
            && self.failure.is_none()
        {
            self.failure = Some(sentence(error));
        }
        result
    }
}

impl<W: Write> Write for Recorder<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let result = self.inner.write(bytes);
        self.note(result)
    }
    fn flush(&mut self) -> std::io::Result<()> {
        let result = self.inner.flush();
        self.note(result)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    fn hello(out: &mut dyn Write) -> Result<()> {
        out.write_all(b"hello")
            .map_err(|e| Error::write("x", e.to_string()))
    }

    #[test]
    fn a_file_is_new_or_replaced_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.igs");
        write_whole(&path, hello).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"hello");
        write_whole(&path, |out| {
            out.write_all(b"bye")
                .map_err(|e| Error::write("x", e.to_string()))
        })
        .unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"bye");
        assert_eq!(names(folder.path()), ["a.igs"]);
    }

    #[test]
    fn a_failure_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.igs");
        write_whole(&path, hello).unwrap();
        let error = write_whole(&path, |out| {
            hello(out)?;
            Err::<(), _>(Error::Cancelled)
        });
        assert!(matches!(error, Err(Error::Cancelled)));
        assert_eq!(fs::read(&path).unwrap(), b"hello");
        assert_eq!(names(folder.path()), ["a.igs"]);
    }

    #[test]
    fn an_error_names_the_file_that_was_asked_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.igs");
        let error = write_whole(&path, |_| Err::<(), _>(Error::write("", "no"))).unwrap_err();
        assert_eq!(
            error.to_string(),
            format!("cannot write {}: no", path.display())
        );
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn places_where_no_file_can_be_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        let refused = |path: &Path| write_whole(path, hello).unwrap_err().to_string();
        assert!(refused(path).contains("is a directory"));
        assert!(refused(&path.join("..")).contains("is a directory"));
        assert!(refused(&path.join("new/")).contains("is a directory"));
        assert!(refused(Path::new("")).contains("empty"));
        assert!(refused(&path.join("none/a.igs")).contains("does not exist"));
        write_whole(path.join("file"), hello).unwrap();
        assert!(refused(&path.join("file/a.igs")).contains("not a folder"));
        assert!(refused(&path.join("x".repeat(400))).contains("too long"));
        #[cfg(target_os = "linux")]
        {
            assert!(refused(Path::new("/dev/null")).contains("device"));
            assert!(refused(Path::new("/dev/full")).contains("device"));
        }
    }

    #[cfg(unix)]
    #[test]
    fn permissions_and_links_are_kept() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.igs");
        let plain = folder.path().join("plain");
        fs::write(&plain, "").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        write_whole(&path, hello).unwrap();
        assert_eq!(mode(&path), mode(&plain), "a new file is like any new file");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        let link = folder.path().join("link.igs");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        write_whole(&link, |out| {
            out.write_all(b"bye")
                .map_err(|e| Error::write("x", e.to_string()))
        })
        .unwrap();
        assert_eq!(mode(&path), 0o640);
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&path).unwrap(), b"bye");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o440)).unwrap();
        let error = write_whole(&path, hello).unwrap_err().to_string();
        assert!(error.contains("write-protected"), "{error}");
        let nowhere = folder.path().join("nowhere");
        std::os::unix::fs::symlink(folder.path().join("gone"), &nowhere).unwrap();
        assert!(write_whole(&nowhere, hello).is_err());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_said_so() {
        let Ok(full) = fs::OpenOptions::new().write(true).open("/dev/full") else {
            return;
        };
        let mut out = Recorder {
            inner: full,
            failure: None,
        };
        assert!(out.write_all(b"x").is_err());
        assert!(out.failure.unwrap().starts_with("the disk is full"));
    }
}
