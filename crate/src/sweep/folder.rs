//! The folder of one run of a sweep: which process works on it, and how far it is.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::atomic;
use crate::error::{Error, Result};
use crate::run::{ERROR, LOCK, LOG, SUMMARY, TrainSummary, partial_folder};
use crate::train::{RunLock, holder};

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
    lock: RunLock,
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
        if let Some(holder) = holder(&self.partial)? {
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
    pub fn claim(&self, epochs: u32) -> Result<Option<Claim>> {
        if self.is_complete(epochs)? {
            return Ok(None);
        }
        let lock = RunLock::take(&self.partial)?;
        let failed = |e: std::io::Error| Error::io(self.partial.display(), &e);
        // Whoever had the lock may have completed the run in the meantime.
        if self.is_complete(epochs)? {
            if !self.partial.join(LOG).exists() {
                fs::remove_dir_all(&self.partial).map_err(failed)?;
            }
            return Ok(None);
        }
        if self.finished.exists() {
            self.take_up_again()?;
        }
        let error = self.partial.join(ERROR);
        if error.exists() {
            fs::remove_file(&error).map_err(failed)?;
        }
        Ok(Some(Claim {
            place: self.clone(),
            lock,
        }))
    }

    /// Moves the files of a complete run back to where it is worked on.
    fn take_up_again(&self) -> Result<()> {
        let failed = |e: std::io::Error| Error::io(self.finished.display(), &e);
        for entry in fs::read_dir(&self.finished).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            if entry.file_name() == LOCK {
                // Of a process that was killed as it finished; the one that is held lies in
                // `partial`.
                fs::remove_file(entry.path()).map_err(failed)?;
                continue;
            }
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
}

impl Claim {
    /// The lock of the folder to work in.
    pub fn lock(&self) -> &RunLock {
        &self.lock
    }

    /// Gives the run its final name.
    ///
    /// # Errors
    /// When it cannot be renamed.
    pub fn finish(self) -> Result<()> {
        self.lock.rename_folder(&self.place.finished)
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
