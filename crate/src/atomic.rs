//! Files that are written whole or not at all.

use std::io::Write as _;
use std::path::Path;

#[cfg(feature = "cli")]
use crate::error::ErrorKind;
use crate::error::{Error, Result};

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
    let failed = |e: std::io::Error| Error::io(path.display(), &e);
    let mut file = tempfile::NamedTempFile::new_in(folder_of(path)).map_err(failed)?;
    file.write_all(bytes).map_err(failed)?;
    file.as_file().sync_all().map_err(failed)?;
    #[cfg(unix)]
    {
        // Temporary files are private; a result is as readable as any other file.
        use std::os::unix::fs::PermissionsExt as _;
        file.as_file()
            .set_permissions(std::fs::Permissions::from_mode(0o644))
            .map_err(failed)?;
    }
    file.persist(path).map_err(|e| failed(e.error))?;
    Ok(())
}
