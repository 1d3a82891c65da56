//! How far the runs of a plan are.

use std::path::Path;

use super::plan::epochs;
use crate::sweep::{Plan, PlannedRun, RunPlace, State};

/// The epochs that a run is to have, and its state. A run whose arguments cannot be read has failed.
pub(super) fn state(folder: &Path, run: &PlannedRun) -> (u32, State) {
    match epochs(run) {
        Ok(epochs) => (epochs, RunPlace::new(folder, &run.run).state(epochs)),
        Err(e) => {
            let error = e.to_string();
            (0, State::Failed { error, epochs: 0 })
        }
    }
}

pub(super) fn states(plan: &Plan, folder: &Path) -> Vec<(u32, State)> {
    plan.runs.iter().map(|run| state(folder, run)).collect()
}

/// The lines, counted from 1, of the runs in a state.
pub(super) fn lines(states: &[(u32, State)], wanted: impl Fn(&State) -> bool) -> Vec<usize> {
    let found = states
        .iter()
        .enumerate()
        .filter(|(_, (_, state))| wanted(state));
    found.map(|(i, _)| i + 1).collect()
}
