//! The terminal face: parse arguments, read files, call, show.

#[macro_use]
mod terminal;

mod checkpoint;
mod convert;
mod data;
mod detector;
#[cfg(any(feature = "train", feature = "gpu"))]
mod device;
mod extract;
mod files;
mod film;
mod hints;
mod outcome;
mod painter;
mod report;
mod score;
mod signals;
#[cfg(feature = "train")]
mod sweep;
#[cfg(feature = "train")]
mod train;
mod trajectories;
mod values;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::error::{Error, ErrorKind};
pub use crate::memory::Memory;

/// Do the keypoints track the objects? Scores keypoint detectors with tracking errors and Tracking
/// Capability.
#[derive(Debug, Parser)]
#[command(name = "tracklens", version, about, after_help = EXIT_CODES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 done, 1 reading or writing failed, 2 wrong arguments, 3 bad input (a \
                          table, an image, a checkpoint), 4 inputs that do not fit each other, 5 numbers that \
                          allow no answer, 130 cancelled by Ctrl-C, SIGTERM or SIGHUP.";

#[derive(Debug, Subcommand)]
enum Command {
    /// Score a keypoint table against a ground-truth table.
    Score(score::ScoreArguments),
    /// Look into a data set, or convert it.
    #[command(subcommand)]
    Data(data::DataCommand),
    /// Extract keypoints from image sequences into a CSV table.
    Extract(extract::ExtractArguments),
    /// Extract and score in one go.
    Eval(extract::EvalArguments),
    /// Write a checkpoint in another format: .safetensors, .pth (PyTorch) or .bpk (burn).
    Convert(checkpoint::ConvertArguments),
    /// Say what a checkpoint is: architecture, sizes, parameters, training.
    Inspect(checkpoint::InspectArguments),
    /// Write the encoder of a checkpoint as an ONNX model.
    Export(checkpoint::ExportArguments),
    /// Train a spatial autoencoder on image sequences.
    #[cfg(feature = "train")]
    Train(Box<train::TrainArguments>),
    /// Tables and figures of many runs.
    Report(report::ReportArguments),
    /// Train many runs: plan, run here or on a cluster, see how far they are.
    #[cfg(feature = "train")]
    #[command(subcommand)]
    Sweep(sweep::SweepCommand),
}

/// Runs the command line and returns the exit code of the process.
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let done = match arguments.command {
        Command::Score(arguments) => score::run(&arguments),
        Command::Data(command) => data::run(&command),
        Command::Extract(arguments) => extract::run(&arguments),
        Command::Eval(arguments) => extract::run_eval(&arguments),
        Command::Convert(arguments) => checkpoint::convert(&arguments),
        Command::Inspect(arguments) => checkpoint::inspect(&arguments),
        Command::Export(arguments) => checkpoint::export(&arguments),
        #[cfg(feature = "train")]
        Command::Train(arguments) => train::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        #[cfg(feature = "train")]
        Command::Sweep(command) => sweep::run(&command),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("tracklens: {error}");
            if let Some(hint) = error.reason().and_then(hints::hint) {
                eprintln!("hint: {hint}");
            }
            ExitCode::from(exit_code(&error))
        }
    }
}

fn exit_code(error: &Error) -> u8 {
    match error.kind() {
        ErrorKind::Io => 1,
        ErrorKind::Input => 3,
        ErrorKind::Mismatch => 4,
        ErrorKind::Numeric => 5,
        ErrorKind::Cancelled => 130,
    }
}
