//! Training of the spatial autoencoders, as the paper's authors train them.
//!
//! A batch is a number of *snippets* of three consecutive frames; all their frames pass the encoder
//! together, so that batch norm sees them all. The loss is the mean squared error of the
//! reconstructions, plus, for `-vel`, 0.1 times the mean squared change of the keypoints' velocity
//! within a snippet. Every epoch ends with the metric on sequences that are not trained on, on the
//! first frame of every snippet. A run that is interrupted goes on after its last whole epoch.
//!
//! Without the feature `train` there are the configuration and the records of runs, to read them.

mod config;
#[cfg(feature = "train")]
mod dataset;
#[cfg(feature = "train")]
mod events;
#[cfg(feature = "train")]
mod lock;
#[cfg(feature = "train")]
mod optimizer;
mod record;
#[cfg(feature = "train")]
mod run;
#[cfg(feature = "train")]
mod state;
#[cfg(feature = "train")]
mod trainer;
#[cfg(feature = "train")]
mod validation;

pub use crate::data::Split;
pub use config::{
    BackgroundStart, FirstLayer, StartWeights, TargetFilter, TrainConfig, ValidationFrames,
};
#[cfg(feature = "train")]
pub use dataset::{DEFAULT_CACHE, Dataset, Sequence};
#[cfg(feature = "train")]
pub use lock::{LOCK, RunLock, holder};
pub use record::{CONFIG, EpochLog, LOG, Losses, RunConfig, SUMMARY, TrainSummary, read_log};
#[cfg(feature = "train")]
pub use run::{Existing, RunOptions, train};
#[cfg(feature = "train")]
pub use trainer::Trainer;

/// Frames in a snippet.
pub const SNIPPET: usize = 3;
