//! The folder of one run of a sweep: which process works on it, and how far it is.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::atomic;
use crate::error::{Error, Result};
use crate::run::{ERROR, LOCK, LOG, SUMMARY, TrainSummary, partial_folder};

/// Where a run is while it is worked on, and when it is complete.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunPlace {
    /// The complete run.
    pub finished: PathBuf,
    /// The run that is not complete.
    pub partial: PathBuf,
}

/// What state a run is in.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase", tag = "state")]
pub enum State {
    /// Complete.
    Done,
    /// A process works on it.
    Running {
        /// The process, as it names itself.
        holder: String,
        /// Whole epochs so far.
        epochs: u64,
    },
    /// The last attempt ended with an error.
    Failed {
        /// The error.
        error: String,
        /// Whole epochs so far.
        epochs: u64,
    },
    /// Started, and ended from outside: killed, out of time, the machine switched off.
    Stopped {
        /// Whole epochs so far.
        epochs: u64,
    },
    /// Not started.
    Missing,
}

/// The right to work on a run, which ends when it is dropped or its process ends.
#[derive(Debug)]
pub struct Claim {
    place: RunPlace,
    /// Unlocked when it is closed.
    _lock: File,
}

impl RunPlace {
    /// The place of the run `name` in the folder of a sweep.
    pub fn new(sweep: &Path, name: &str) -> Self {
        let finished = sweep.join(name);
        Self {
            partial: partial_folder(&finished),
            finished,
        }
    }

    /// What state the run is in, when it is to have `epochs` epochs. A run with a file that cannot
    /// be read has failed, with the reason.
    pub fn state(&self, epochs: u32) -> State {
        self.read_state(epochs).unwrap_or_else(|e| State::Failed {
            error: e.to_string(),
            epochs: self.epochs(),
        })
    }

    fn read_state(&self, epochs: u32) -> Result<State> {
        if self.is_complete(epochs)? {
            return Ok(State::Done);
        }
        let so_far = self.epochs();
        if !self.partial.exists() {
            return Ok(match so_far {
                0 => State::Missing,
                epochs => State::Stopped { epochs },
            });
        }
        if let Some(holder) = self.holder()? {
            return Ok(State::Running {
                holder,
                epochs: so_far,
            });
        }
        // Between the two looks it may have become complete.
        if self.is_complete(epochs)? {
            return Ok(State::Done);
        }
        Ok(match fs::read_to_string(self.partial.join(ERROR)) {
            Ok(error) => State::Failed {
                error: error.trim_end().to_owned(),
                epochs: so_far,
            },
            Err(_) => State::Stopped { epochs: so_far },
        })
    }

    /// Whole epochs in the log.
    pub fn epochs(&self) -> u64 {
        let log = fs::read(self.partial.join(LOG)).or_else(|_| fs::read(self.finished.join(LOG)));
        log.map_or(0, |log| log.iter().filter(|b| **b == b'\n').count() as u64)
    }

    /// Takes the run, which is to have `epochs` epochs, to work on it in [`RunPlace::partial`];
    /// nothing when it is complete. A run that is complete with fewer epochs is taken up again.
    ///
    /// # Errors
    /// When somebody else has it (with who), or the folder cannot be written.
    pub fn claim(&self, epochs: u32, holder: &str) -> Result<Option<Claim>> {
        if self.is_complete(epochs)? {
            return Ok(None);
        }
        let failed = |e: std::io::Error| Error::io(self.partial.display(), &e);
        let is_new = !self.partial.exists();
        fs::create_dir_all(&self.partial).map_err(failed)?;
        let path = self.partial.join(LOCK);
        let mut lock = open(&path).map_err(failed)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let holder = self
                    .holder()?
                    .unwrap_or_else(|| "another process".to_owned());
                return Err(Error::mismatch(format!(
                    "is being worked on by {holder}; wait for it or end it"
                ))
                .at(self.partial.display()));
            }
            Err(TryLockError::Error(e)) => return Err(failed(e)),
        }
        // Whoever had the lock may have completed the run in the meantime.
        if self.is_complete(epochs)? {
            if is_new || !self.partial.join(LOG).exists() {
                fs::remove_dir_all(&self.partial).map_err(failed)?;
            }
            return Ok(None);
        }
        if self.finished.exists() {
            self.take_up_again()?;
        }
        lock.set_len(0)
            .and_then(|()| lock.seek(SeekFrom::Start(0)))
            .and_then(|_| lock.write_all(holder.as_bytes()))
            .map_err(failed)?;
        let error = self.partial.join(ERROR);
        if error.exists() {
            fs::remove_file(&error).map_err(failed)?;
        }
        Ok(Some(Claim {
            place: self.clone(),
            _lock: lock,
        }))
    }

    /// Moves the files of a complete run back to where it is worked on.
    fn take_up_again(&self) -> Result<()> {
        let failed = |e: std::io::Error| Error::io(self.finished.display(), &e);
        for entry in fs::read_dir(&self.finished).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            fs::rename(entry.path(), self.partial.join(entry.file_name())).map_err(failed)?;
        }
        fs::remove_dir(&self.finished).map_err(failed)
    }

    fn is_complete(&self, epochs: u32) -> Result<bool> {
        let path = self.finished.join(SUMMARY);
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(false),
            Err(e) => return Err(Error::io(path.display(), &e)),
        };
        let summary: TrainSummary = serde_json::from_slice(&bytes).map_err(|e| {
            let remedy = "delete the folder of the run to train it again";
            Error::input(format!("cannot be read ({e}); {remedy}")).at(path.display())
        })?;
        Ok(summary.epochs >= epochs)
    }

    /// Who works on the run, if anybody does.
    fn holder(&self) -> Result<Option<String>> {
        let path = self.partial.join(LOCK);
        if !path.exists() {
            return Ok(None);
        }
        let failed = |e: std::io::Error| Error::io(path.display(), &e);
        let mut lock = open(&path).map_err(failed)?;
        match lock.try_lock_shared() {
            Ok(()) => Ok(None),
            Err(TryLockError::WouldBlock) => {
                let mut holder = String::new();
                lock.read_to_string(&mut holder).map_err(failed)?;
                Ok(Some(holder))
            }
            Err(TryLockError::Error(e)) => Err(failed(e)),
        }
    }
}

impl Claim {
    /// The folder to work in.
    pub fn folder(&self) -> &Path {
        &self.place.partial
    }

    /// Gives the run its final name.
    ///
    /// # Errors
    /// When it cannot be renamed.
    pub fn finish(self) -> Result<()> {
        let failed = |e: std::io::Error| Error::io(self.place.finished.display(), &e);
        fs::remove_file(self.place.partial.join(LOCK)).map_err(failed)?;
        fs::rename(&self.place.partial, &self.place.finished).map_err(failed)
    }

    /// Leaves a note of why the attempt failed.
    ///
    /// # Errors
    /// When the note cannot be written.
    pub fn fail(self, error: &Error) -> Result<()> {
        atomic::write(
            &self.place.partial.join(ERROR),
            format!("{error}\n").as_bytes(),
        )
    }
}

fn open(path: &Path) -> std::io::Result<File> {
    OpenOptions::new()
        .create(true)
        .truncate(false)
        .read(true)
        .write(true)
        .open(path)
}
