//! The folder of one run of a sweep: which process works on it, and how far it is.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::atomic;
use crate::error::{Error, Result};
use crate::run::{
    AgentEvaluation, AgentSummary, ERROR, LOCK, LOG, SUMMARY, TrainSummary, partial_folder,
    read_log,
};
use crate::train::{RunLock, holder};

/// Where a run is while it is worked on, and when it is complete.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunPlace {
    /// The complete run.
    pub finished: PathBuf,
    /// The run that is not complete.
    pub partial: PathBuf,
}

/// How far a run is, or is to come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Progress {
    /// Whole epochs of a training.
    Epochs(u64),
    /// Steps of an agent, up to its last evaluation.
    Steps(u64),
}

impl Progress {
    /// The number of epochs or steps.
    pub fn count(self) -> u64 {
        match self {
            Self::Epochs(count) | Self::Steps(count) => count,
        }
    }

    /// What is counted.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Epochs(_) => "epoch",
            Self::Steps(_) => "step",
        }
    }
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
        /// How far it is.
        #[serde(flatten)]
        done: Progress,
    },
    /// The last attempt ended with an error.
    Failed {
        /// The error.
        error: String,
        /// How far it is.
        #[serde(flatten)]
        done: Progress,
    },
    /// Started, and ended from outside: killed, out of time, the machine switched off.
    Stopped {
        /// How far it is.
        #[serde(flatten)]
        done: Progress,
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

    /// What state the run is in, when it is to come to `goal`. A run with a file that cannot be read
    /// has failed, with the reason.
    pub fn state(&self, goal: Progress) -> State {
        self.read_state(goal).unwrap_or_else(|e| State::Failed {
            error: e.to_string(),
            done: self.done(goal),
        })
    }

    fn read_state(&self, goal: Progress) -> Result<State> {
        if self.is_complete(goal)? {
            return Ok(State::Done);
        }
        let done = self.done(goal);
        if !self.partial.exists() {
            return Ok(match done.count() {
                0 => State::Missing,
                _ => State::Stopped { done },
            });
        }
        if let Some(holder) = holder(&self.partial)? {
            return Ok(State::Running { holder, done });
        }
        // Between the two looks it may have become complete.
        if self.is_complete(goal)? {
            return Ok(State::Done);
        }
        Ok(match fs::read_to_string(self.partial.join(ERROR)) {
            Ok(error) => State::Failed {
                error: error.trim_end().to_owned(),
                done,
            },
            Err(_) => State::Stopped { done },
        })
    }

    /// How far the log is of a run that is to come to `goal`.
    pub fn done(&self, goal: Progress) -> Progress {
        let log = fs::read(self.partial.join(LOG)).or_else(|_| fs::read(self.finished.join(LOG)));
        let log = log.unwrap_or_default();
        match goal {
            Progress::Epochs(_) => {
                Progress::Epochs(log.iter().filter(|b| **b == b'\n').count() as u64)
            }
            Progress::Steps(_) => {
                let (evaluations, _) = read_log::<AgentEvaluation>(&log);
                Progress::Steps(evaluations.last().map_or(0, |last| last.step))
            }
        }
    }

    /// Takes the run, which is to come to `goal`, to work on it in [`RunPlace::partial`]; nothing
    /// when it is complete. A run that is complete with less is taken up again.
    ///
    /// # Errors
    /// When somebody else has it (with who), or the folder cannot be written.
    pub fn claim(&self, goal: Progress) -> Result<Option<Claim>> {
        if self.is_complete(goal)? {
            return Ok(None);
        }
        let lock = RunLock::take(&self.partial)?;
        let failed = |e: std::io::Error| Error::io(self.partial.display(), &e);
        // Whoever had the lock may have completed the run in the meantime.
        if self.is_complete(goal)? {
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

    fn is_complete(&self, goal: Progress) -> Result<bool> {
        let path = self.finished.join(SUMMARY);
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(false),
            Err(e) => return Err(Error::io(path.display(), &e)),
        };
        let wrong = |e: serde_json::Error| {
            let remedy = "delete the folder of the run to train it again";
            Error::input(format!("cannot be read ({e}); {remedy}")).at(path.display())
        };
        Ok(match goal {
            Progress::Epochs(goal) => {
                let summary: TrainSummary = serde_json::from_slice(&bytes).map_err(wrong)?;
                u64::from(summary.epochs) >= goal
            }
            Progress::Steps(goal) => {
                let summary: AgentSummary = serde_json::from_slice(&bytes).map_err(wrong)?;
                summary.steps >= goal
            }
        })
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
