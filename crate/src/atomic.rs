//! Files that are written whole or not at all.
//!
//! What is being written lies beside its destination under a name of ours, and is locked while its
//! process lives. So what a killed process left behind is known, and the next one that writes into
//! the folder removes it.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::Path;

use tempfile::{Builder, NamedTempFile};

#[cfg(feature = "cli")]
use crate::error::ErrorKind;
use crate::error::{Error, Result};

/// Temporary files and folders are called `.tracklens-XXXXXX.tmp`.
const PREFIX: &str = ".tracklens-";
const SUFFIX: &str = ".tmp";

/// The folder that `path` lies in.
fn folder_of(path: &Path) -> &Path {
    path.parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
}

/// Checks, before long work, that a result can be written to `path` as far as one can tell.
#[cfg(feature = "cli")]
pub(crate) fn check(path: &Path) -> Result<()> {
    let wrong = if path.is_dir() {
        "is a folder"
    } else if !folder_of(path).is_dir() {
        "lies in no folder that exists"
    } else {
        return Ok(());
    };
    Err(Error::new(ErrorKind::Io, format!("{wrong}; expected a file to write")).at(path.display()))
}

/// Writes `bytes` to `path`: into a temporary file beside it, synced, then renamed over it.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let failed = |e: io::Error| Error::io(path.display(), &e);
    let mut file = temporary_file(folder_of(path)).map_err(failed)?;
    file.write_all(bytes).map_err(failed)?;
    file.as_file().sync_all().map_err(failed)?;
    #[cfg(unix)]
    {
        // Temporary files are private; a result is as readable as any other file.
        use std::os::unix::fs::PermissionsExt as _;
        file.as_file()
            .set_permissions(fs::Permissions::from_mode(0o644))
            .map_err(failed)?;
    }
    file.persist(path).map_err(|e| failed(e.error))?;
    Ok(())
}

/// A temporary file in `folder`, from which left-over ones are removed first.
pub(crate) fn temporary_file(folder: &Path) -> io::Result<NamedTempFile> {
    remove_left_over(folder);
    loop {
        let file = names().tempfile_in(folder)?;
        if lock(file.as_file(), file.path()) {
            return Ok(file);
        }
    }
}

/// A temporary folder in `folder`, from which left-over ones are removed first. It is known to be
/// in use for as long as the file is open.
#[cfg(feature = "cli")]
pub(crate) fn temporary_folder(folder: &Path) -> io::Result<(tempfile::TempDir, Option<File>)> {
    remove_left_over(folder);
    loop {
        let made = names().tempdir_in(folder)?;
        // Windows opens no folders, and so neither locks nor removes them.
        let Ok(file) = File::open(made.path()) else {
            return Ok((made, None));
        };
        if lock(&file, made.path()) {
            return Ok((made, Some(file)));
        }
    }
}

fn names() -> Builder<'static, 'static> {
    let mut builder = Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
    builder
}

/// Locks what was just created at `path`; false when somebody took it for left over before.
fn lock(file: &File, path: &Path) -> bool {
    // On a file system without locks nothing is ever taken for left over.
    file.lock().is_err() || path.exists()
}

/// Removes what killed processes left in `folder`. Whatever cannot be removed stays.
fn remove_left_over(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.as_encoded_bytes();
        let is_ours = name.starts_with(PREFIX.as_bytes()) && name.ends_with(SUFFIX.as_bytes());
        // A link's target or a pipe may be anybody's.
        let kind = entry.file_type().ok().filter(|k| k.is_file() || k.is_dir());
        let (true, Some(kind)) = (is_ours, kind) else {
            continue;
        };
        let path = entry.path();
        let Ok(file) = File::open(&path) else {
            continue;
        };
        if file.try_lock().is_ok() {
            let _ = match kind.is_dir() {
                true => fs::remove_dir_all(&path),
                false => fs::remove_file(&path),
            };
        }
    }
}
