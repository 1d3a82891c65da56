//! The `tracklens` command.

#[path = "../shared/agents.rs"]
mod agent_runs;
#[path = "../shared/runs.rs"]
mod runs;

#[cfg(all(feature = "train", unix))]
mod agent_sweep;
mod agents;
mod binary;
mod cli;
mod cli_checkpoint;
mod convert;
mod detector;
mod doctor;
mod evaluation;
#[cfg(all(feature = "train", unix))]
mod integrity;
mod memory;
mod mutations;
mod public;
mod recorder;
mod recordings;
mod report;
mod space;
#[cfg(all(feature = "train", unix))]
mod sweep;
