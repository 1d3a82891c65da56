//! Many runs: sweep files and plans, the state of the folder of each run, and scripts for clusters.
//!
//! A sweep lives in one folder: `plan.jsonl` with a line a run, and a folder a run,
//! `ARCHITECTURE/seed-S`. A run is trained in `….partial`, which takes its final name when the run
//! is complete: whatever has the final name is whole.

mod folder;
mod plan;
mod slurm;

pub use folder::{RunPlace, State};
pub use plan::{Plan, PlannedRun, Setting, SettingKind, SweepFile, architecture_named};
pub use slurm::{Submission, script};
