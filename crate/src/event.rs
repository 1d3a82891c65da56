//! Progress of long work, and how to cancel it.
//!
//! Extraction and training report [`Event`]s, which the terminal shows as a progress bar. The page
//! extracts frame by frame in its workers and counts them itself.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};

/// One message from work that is going on.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// Work of `total` steps (frames, batches) has begun.
    Started {
        /// What is being done, in words: `extracting keypoints`.
        what: String,
        /// Number of steps.
        total: u64,
    },
    /// `done` of the announced steps are finished.
    Progress {
        /// Steps finished so far.
        done: u64,
        /// A remark on the last step, e.g. the loss; may be empty.
        note: String,
    },
    /// Something a person should know; the work goes on.
    Warning(String),
    /// The work ended.
    Done,
}

/// A switch that stops long work between two frames or batches. Clones share the switch.
#[derive(Debug, Clone, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// Asks the work to stop.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the work was asked to stop.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// An error once the work was asked to stop.
    ///
    /// # Errors
    /// [`ErrorKind::Cancelled`](crate::error::ErrorKind::Cancelled).
    pub fn check(&self) -> Result<()> {
        if self.is_cancelled() {
            return Err(Error::cancelled());
        }
        Ok(())
    }
}
