//! Files written whole or not at all.

use crate::{Error, Result};
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes a file through `write`, so that after any failure the path holds what it held before: the bytes go to a
/// temporary file in the same folder, which takes the name only when all of them are on disk.
///
/// A file that already exists keeps its permissions, and a link keeps pointing where it did.
///
/// # Errors
/// [`Error::Write`] if the path is a directory or a device, its folder does not exist, or the disk refuses.
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<()> {
    let refused = |e: std::io::Error| Error::write(path, reason(&e));
    // Through a link to the file itself: renaming would replace the link.
    let target = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    let existing = target.metadata().ok();
    if let Some(known) = &existing
        && !known.is_file()
    {
        return Err(Error::write(
            path,
            "it is a directory or a device; name a file",
        ));
    }
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return Err(Error::write(
            path,
            format!("the folder {} does not exist; create it", folder.display()),
        ));
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(".nurbskin-");
    #[cfg(unix)]
    let everyone: std::fs::Permissions = std::os::unix::fs::PermissionsExt::from_mode(0o666);
    #[cfg(unix)]
    builder.permissions(match &existing {
        Some(known) => known.permissions(),
        // As for any new file, the process's mask takes its part away.
        None => everyone,
    });
    let mut file = builder.tempfile_in(folder).map_err(refused)?;
    let mut buffered = BufWriter::with_capacity(1 << 16, file.as_file_mut());
    write(&mut buffered)
        .and_then(|()| buffered.flush())
        .map_err(refused)?;
    drop(buffered);
    file.as_file().sync_all().map_err(refused)?;
    file.persist(&target).map_err(|e| refused(e.error))?;
    Ok(())
}

/// What an I/O error means to the user, and what to do.
fn reason(error: &std::io::Error) -> String {
    use std::io::ErrorKind;
    match error.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
            format!("{error}; free some space or choose another disk")
        }
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            format!("{error}; choose a place where you may write")
        }
        _ => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("part.xyz");
        write_whole(&path, |w| w.write_all(b"old")).unwrap();
        let failed = write_whole(&path, |w| {
            w.write_all(b"half")?;
            Err(std::io::Error::other("the cable fell out"))
        });
        assert!(matches!(failed, Err(Error::Write { .. })));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        write_whole(&path, |w| w.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn directories_and_missing_folders_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let message = |path: &Path| write_whole(path, |_| Ok(())).unwrap_err().to_string();
        assert!(message(folder.path()).contains("name a file"));
        assert!(message(&folder.path().join("no/such/x.ply")).contains("does not exist"));
    }

    #[cfg(unix)]
    #[test]
    fn permissions_and_links_are_kept() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("a"), folder.path().join("b"));
        std::fs::write(&path, b"1").unwrap();
        std::fs::set_permissions(&path, PermissionsExt::from_mode(0o640)).unwrap();
        std::os::unix::fs::symlink(&path, &link).unwrap();
        write_whole(&link, |w| w.write_all(b"2")).unwrap();
        assert!(link.symlink_metadata().unwrap().is_symlink());
        assert_eq!(std::fs::read(&path).unwrap(), b"2");
        let mode = path.metadata().unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o640);
    }
}
