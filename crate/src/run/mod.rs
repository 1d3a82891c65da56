//! What a run of training is on disk, of an encoder or of an agent: its configuration, its records
//! and its files, to write them and to read them without training.

mod agent;
mod config;
mod folder;
mod preset;
mod record;

pub use crate::data::{Split, SplitBy};
pub use agent::{
    AgentCheckpoint, AgentConfig, AgentEncoder, AgentEvaluation, AgentSummary, EncoderEvaluation,
    EncoderObject,
};
pub use config::{
    BackgroundStart, ColorError, EncoderStart, FirstLayer, StartWeights, TargetFilter, TrainConfig,
    ValidationFrames,
};
pub use folder::{
    CHECKPOINT_BEST, CHECKPOINT_FINAL, CONFIG, ERROR, EVENTS_PREFIX, FoundRun, FoundRuns, LOCK,
    LOG, PARTIAL, RunFiles, RunKind, STATE, SUMMARY, find_runs, partial_folder,
};
pub use preset::Preset;
pub use record::{EpochLog, Losses, RunConfig, TrainSummary, read_log};
