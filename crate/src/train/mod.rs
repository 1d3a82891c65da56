//! Training of the spatial autoencoders, as the paper's authors train them.
//!
//! A batch is a number of *snippets* of three consecutive frames; all their frames pass the encoder
//! together, so that batch norm sees them all. The loss is the mean squared error of the
//! reconstructions, plus, for `-vel`, 0.1 times the mean squared change of the keypoints' velocity
//! within a snippet. Every epoch ends with the metric on sequences that are not trained on, on the
//! first frame of every snippet. An interrupted run resumes after its last whole epoch.

mod dataset;
mod digest;
mod events;
mod lock;
mod optimizer;
mod run;
mod state;
mod targets;
mod trainer;
mod validation;

pub use dataset::{DEFAULT_CACHE, Dataset, Sequence};
pub use lock::{RunLock, holder};
pub use run::{Existing, RunOptions, train};
pub use trainer::Trainer;

/// Frames in a snippet.
pub const SNIPPET: usize = 3;
