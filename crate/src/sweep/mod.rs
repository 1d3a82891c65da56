//! Many runs: sweep files and plans, the state of the folder of each run, and scripts for clusters.
//!
//! A sweep lives in one folder: `plan.jsonl` with a line a run, and a folder a run,
//! `ARCHITECTURE/seed-S` of trainings and `STATE/ENCODER/seed-S` of agents. A run is trained in `….partial`, which takes its final name when the run
//! is complete: whatever has the final name is whole.

mod agents;
mod folder;
mod plan;
mod reader;
mod slurm;

pub use agents::{AgentOptions, AgentProgram, AgentSweep};
pub use folder::{Progress, RunPlace, State};
pub use plan::{Plan, PlannedRun, SweepFile, architecture_named};
pub use reader::{Setting, SettingKind};
pub use slurm::{Submission, script};
