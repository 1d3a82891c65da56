//! Training of the spatial autoencoders, as the paper's authors train them.
//!
//! A batch is a number of *snippets* of three consecutive frames; all their frames pass the encoder together, so that
//! batch norm sees them all. The loss is the mean squared error of the reconstructions, plus, for `-vel`, 0.1 times
//! the mean squared change of the keypoints' velocity within a snippet. Every epoch ends with the metric on sequences
//! that are not trained on, on the first frame of every snippet. A run that is interrupted goes on after its last whole epoch.

mod config;
mod dataset;
mod events;
mod optimizer;
mod run;
mod state;
mod trainer;
mod validation;

pub use crate::data::Split;
pub use config::{FirstLayer, TargetFilter, TrainConfig, ValidationFrames};
pub use dataset::{DEFAULT_CACHE, Dataset, Sequence};
pub use run::{EpochLog, Existing, RunOptions, TrainSummary, train};
pub use trainer::{Losses, Trainer};

/// Frames in a snippet.
pub const SNIPPET: usize = 3;
