//! What long work tells whoever waits for it.
//!
//! Extraction and training speak through one enum, so that the terminal's progress bar, the run log
//! and the page's `postMessage` are translations of the same conversation.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};

/// One message from running work to its face.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// Work of `total` steps (frames, batches) has begun.
    Started {
        /// What is being done, for a person: `extracting keypoints`.
        what: String,
        /// Number of steps.
        total: u64,
    },
    /// `done` of the announced steps are finished.
    Progress {
        /// Steps finished so far.
        done: u64,
        /// What there is to say about the last step, e.g. the loss; empty when there is nothing.
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
