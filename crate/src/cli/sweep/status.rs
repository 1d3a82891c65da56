//! `tracklens sweep status`.

use std::fs;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::cluster::{self, SUBMISSION};
use super::plan::open;
use super::states::{lines, states};
use crate::error::{Error, Result};
use crate::sweep::{State, Submission};

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
    /// Epochs that it is to have.
    planned_epochs: u32,
    #[serde(flatten)]
    state: State,
}

pub(super) fn run(arguments: &StatusArguments) -> Result<()> {
    let (plan, folder) = open(&arguments.sweep)?;
    let states = states(&plan, &folder);
    if arguments.json {
        let runs = plan.runs.iter().zip(&states).enumerate();
        let runs: Vec<RunStatus> = runs
            .map(|(i, (run, (planned_epochs, state)))| RunStatus {
                line: i + 1,
                run: &run.run,
                planned_epochs: *planned_epochs,
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
        for (i, (run, (planned, state))) in plan.runs.iter().zip(&states).enumerate() {
            let text = match state {
                State::Done | State::Missing => continue,
                State::Running { holder, epochs } => {
                    format!("running, epoch {epochs} of {planned}: {holder}")
                }
                State::Failed { error, epochs } => {
                    format!("failed after epoch {epochs} of {planned}: {error}")
                }
                State::Stopped { epochs } => format!("stopped after epoch {epochs} of {planned}"),
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
    cluster::sbatch(&submission, &lines(&states, ended), &folder, false)
}
