//! `tracklens sweep status`.

use std::fs;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::cluster::{SUBMISSION, sbatch};
use super::plan::{lines, open, states};
use crate::error::{Error, Result};
use crate::sweep::{Progress, State, Submission};

#[derive(Debug, Args)]
pub(in crate::cli) struct StatusArguments {
    /// Folder of the sweep
    #[arg(value_name = "DIR")]
    sweep: PathBuf,
    /// As JSON
    #[arg(long)]
    json: bool,
    /// Submit the failed and stopped runs again, as they were submitted before
    #[arg(long)]
    resubmit: bool,
}

/// One run of `sweep status --json`.
#[derive(Serialize)]
struct RunStatus<'a> {
    line: usize,
    run: &'a str,
    /// Epochs that a training is to have.
    #[serde(skip_serializing_if = "Option::is_none")]
    planned_epochs: Option<u64>,
    /// Steps that an agent is to have.
    #[serde(skip_serializing_if = "Option::is_none")]
    planned_steps: Option<u64>,
    #[serde(flatten)]
    state: State,
}

pub(super) fn status(arguments: &StatusArguments) -> Result<()> {
    let (plan, folder) = open(&arguments.sweep)?;
    let states = states(&plan, &folder);
    if arguments.json {
        let runs = plan.runs.iter().zip(&states).enumerate();
        let runs: Vec<RunStatus> = runs
            .map(|(i, (run, (goal, state)))| RunStatus {
                line: i + 1,
                run: &run.run,
                planned_epochs: match goal {
                    Progress::Epochs(epochs) => Some(*epochs),
                    Progress::Steps(_) => None,
                },
                planned_steps: match goal {
                    Progress::Steps(steps) => Some(*steps),
                    Progress::Epochs(_) => None,
                },
                state: state.clone(),
            })
            .collect();
        let text = serde_json::to_string_pretty(&runs).map_err(|e| Error::input(e.to_string()))?;
        say!("{text}");
    } else {
        let count = |is: fn(&State) -> bool| states.iter().filter(|(_, state)| is(state)).count();
        say!(
            "{} runs: {} done, {} running, {} failed, {} stopped, {} missing",
            states.len(),
            count(|s| matches!(s, State::Done)),
            count(|s| matches!(s, State::Running { .. })),
            count(|s| matches!(s, State::Failed { .. })),
            count(|s| matches!(s, State::Stopped { .. })),
            count(|s| matches!(s, State::Missing)),
        );
        for (i, (run, (goal, state))) in plan.runs.iter().zip(&states).enumerate() {
            let so_far =
                |done: &Progress| format!("{} {} of {}", goal.unit(), done.count(), goal.count());
            let text = match state {
                State::Done | State::Missing => continue,
                State::Running { holder, done } => format!("running, {}: {holder}", so_far(done)),
                State::Failed { error, done } => format!("failed after {}: {error}", so_far(done)),
                State::Stopped { done } => format!("stopped after {}", so_far(done)),
            };
            say!("{:>5}  {}  {text}", i + 1, run.run);
        }
    }
    if !arguments.resubmit {
        return Ok(());
    }
    let path = folder.join(SUBMISSION);
    let submission = fs::read(&path).map_err(|_| {
        Error::input("was not submitted before; use `tracklens sweep submit`")
            .at(arguments.sweep.display())
    })?;
    let submission: Submission = serde_json::from_slice(&submission)
        .map_err(|e| Error::input(e.to_string()).at(path.display()))?;
    let ended = |state: &State| matches!(state, State::Failed { .. } | State::Stopped { .. });
    sbatch(&submission, &lines(&states, ended), &folder, false)
}
