//! The page in real browsers.

#[path = "../../../shared/agents.rs"]
mod agent_runs;
#[path = "../../../shared/runs.rs"]
mod runs;

mod accessibility;
mod comparison;
mod detectors;
mod doctor;
mod embedding;
mod formats;
mod gpu;
mod inputs;
mod live;
mod marking;
mod offline;
mod pool;
mod results;
mod saved;
mod scoring;
mod space;
mod viewer;
mod workspace;
