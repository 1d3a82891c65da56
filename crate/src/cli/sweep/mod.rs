//! `tracklens sweep …`.

mod agent;
mod cluster;
mod plan;
mod run;
mod status;

use clap::Subcommand;

use self::cluster::{ExportArguments, SubmitArguments};
use self::plan::PlanArguments;
use self::run::RunArguments;
use self::status::StatusArguments;
use crate::error::Result;

#[derive(Debug, Subcommand)]
pub(super) enum SweepCommand {
    /// Write the plan of a sweep, a line a run: every architecture with every variant and every
    /// seed, or every state of agents with every encoder and every seed.
    Plan(PlanArguments),
    /// Train the runs of a plan here, or one of them; complete runs are skipped, started ones go
    /// on.
    Run(RunArguments),
    /// Say which runs are done, running, failed, stopped or missing.
    Status(StatusArguments),
    /// Hand the runs that are left to a cluster.
    Submit(SubmitArguments),
    /// Write the runs that are left as commands, one a line.
    Export(ExportArguments),
}

pub(super) fn run(command: &SweepCommand) -> Result<()> {
    match command {
        SweepCommand::Plan(arguments) => plan::plan(arguments),
        SweepCommand::Run(arguments) => run::run(arguments),
        SweepCommand::Status(arguments) => status::status(arguments),
        SweepCommand::Submit(arguments) => cluster::submit(arguments),
        SweepCommand::Export(arguments) => cluster::export(arguments),
    }
}
