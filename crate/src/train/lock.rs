//! Who works on a run folder.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use crate::error::{Error, Result};
use crate::run::LOCK;

/// How often a lock that somebody holds is tried again, and how long after. Whoever looks for the
/// holder holds the lock for a moment.
const TRIES: u32 = 10;
const PAUSE: Duration = Duration::from_millis(20);

/// The right to work on the run in a folder. It ends when it is dropped, or with its process.
#[derive(Debug)]
pub struct RunLock {
    folder: PathBuf,
    /// Locked until it is closed here and in every process that shares it.
    file: File,
    /// Whether the folder was made for the lock.
    is_new: bool,
}

impl RunLock {
    /// Takes the right to work on the run in `folder`, which is created if necessary. The lock
    /// belongs to this process: nobody else, and no other `RunLock`, has it until it is dropped.
    ///
    /// # Errors
    /// When somebody else works on the run (with who), or the folder cannot be written.
    pub fn take(folder: &Path) -> Result<Self> {
        let path = folder.join(LOCK);
        let failed = |e: std::io::Error| Error::io(path.display(), &e);
        let is_new = !folder.exists();
        let mut tries = 0;
        loop {
            fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), &e))?;
            let mut file = OpenOptions::new()
                .create(true)
                .truncate(false)
                .write(true)
                .open(&path)
                .map_err(failed)?;
            match file.try_lock() {
                // Its last holder has removed or moved the file since it was opened.
                Ok(()) if !is_at(&file, &path) => {}
                Ok(()) => {
                    file.set_len(0)
                        .and_then(|()| file.write_all(this_process().as_bytes()))
                        .map_err(failed)?;
                    return Ok(Self {
                        folder: folder.to_owned(),
                        file,
                        is_new,
                    });
                }
                Err(TryLockError::WouldBlock) if tries < TRIES => {
                    tries += 1;
                    std::thread::sleep(PAUSE);
                }
                Err(TryLockError::WouldBlock) => {
                    let holder = holder(folder)?.unwrap_or_else(|| "another process".to_owned());
                    return Err(Error::mismatch(format!(
                        "is being worked on by {holder}; wait for it or end it"
                    ))
                    .at(folder.display()));
                }
                Err(TryLockError::Error(e)) => return Err(failed(e)),
            }
        }
    }

    /// The folder of the run.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The lock as the standard input of another process, which then holds it as well, as long as
    /// it lives: it works on the run even when this process is killed.
    ///
    /// # Errors
    /// When the system has no file handle left.
    pub fn share(&self) -> Result<Stdio> {
        let file = self.file.try_clone();
        let file = file.map_err(|e| Error::io(self.folder.join(LOCK).display(), &e))?;
        Ok(file.into())
    }

    /// Gives the folder another name and ends the right to work on it.
    ///
    /// # Errors
    /// When it cannot be renamed.
    pub fn rename_folder(mut self, to: &Path) -> Result<()> {
        fs::rename(&self.folder, to).map_err(|e| Error::io(to.display(), &e))?;
        to.clone_into(&mut self.folder);
        Ok(())
    }
}

impl Drop for RunLock {
    fn drop(&mut self) {
        // The file goes before its lock does. When it cannot be removed, it stops nobody.
        let _ = fs::remove_file(self.folder.join(LOCK));
        if self.is_new {
            // Fails, as it should, when there is anything in it.
            let _ = fs::remove_dir(&self.folder);
        }
    }
}

/// Who works on the run in `folder`, if anybody does.
///
/// # Errors
/// When its lock cannot be read.
pub fn holder(folder: &Path) -> Result<Option<String>> {
    let path = folder.join(LOCK);
    let failed = |e: std::io::Error| Error::io(path.display(), &e);
    let mut file = match File::open(&path) {
        Ok(file) => file,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(failed(e)),
    };
    match file.try_lock_shared() {
        Ok(()) => Ok(None),
        Err(TryLockError::WouldBlock) => {
            let mut holder = String::new();
            file.read_to_string(&mut holder).map_err(failed)?;
            Ok(Some(holder))
        }
        Err(TryLockError::Error(e)) => Err(failed(e)),
    }
}

/// Whether `path` still leads to `file`.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    match (file.metadata(), fs::metadata(path)) {
        (Ok(file), Ok(there)) => (file.dev(), file.ino()) == (there.dev(), there.ino()),
        _ => false,
    }
}

/// An open file cannot be replaced here.
#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

/// This process, for whoever finds the run locked.
fn this_process() -> String {
    let host = fs::read_to_string("/proc/sys/kernel/hostname")
        .ok()
        .or_else(|| std::env::var("HOSTNAME").ok())
        .or_else(|| std::env::var("COMPUTERNAME").ok());
    let host = host.as_deref().map(str::trim).unwrap_or("this machine");
    let job = match (
        std::env::var("SLURM_ARRAY_JOB_ID"),
        std::env::var("SLURM_ARRAY_TASK_ID"),
    ) {
        (Ok(job), Ok(task)) => format!(", Slurm job {job}_{task}"),
        _ => String::new(),
    };
    format!("process {} on {host}{job}", std::process::id())
}
