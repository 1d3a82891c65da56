//! `tracklens sweep submit` and `sweep export`: the runs that are left, handed to a cluster.

use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::Command;

use clap::Args;

use super::plan::open;
use super::states::{lines, states};
use crate::atomic;
use crate::error::{Error, ErrorKind, Result};
use crate::sweep::{State, Submission, script};

pub(super) const SUBMISSION: &str = "submission.json";
const SCRIPT: &str = "sweep.sbatch";
const COMMANDS: &str = "commands.txt";

#[derive(Debug, Args)]
pub(in crate::cli) struct SubmitArguments {
    /// Folder of the sweep
    #[arg(value_name = "DIR")]
    sweep: PathBuf,
    /// As a job array of Slurm
    #[arg(long, required = true)]
    slurm: bool,
    /// Jobs that run at a time
    #[arg(long, value_name = "N")]
    throttle: Option<u32>,
    /// CPUs a job, which are its threads
    #[arg(long, value_name = "N")]
    cpus: Option<u32>,
    /// GPUs a job
    #[arg(long, value_name = "N")]
    gpus: Option<u32>,
    /// Time limit of a job, e.g. 02:30:00; a run that needs more goes on when it is submitted again
    #[arg(long, value_name = "TIME")]
    time: Option<String>,
    /// Memory of a job, e.g. 4G
    #[arg(long, value_name = "SIZE")]
    mem: Option<String>,
    /// Partition
    #[arg(long, value_name = "NAME")]
    partition: Option<String>,
    /// Another option for sbatch, as it is, e.g. --sbatch=--account=lab; may be repeated
    #[arg(long = "sbatch", value_name = "OPTION", allow_hyphen_values = true)]
    options: Vec<String>,
    /// Write the script and do not submit it
    #[arg(long)]
    dry_run: bool,
}

#[derive(Debug, Args)]
pub(in crate::cli) struct ExportArguments {
    /// Folder of the sweep
    #[arg(value_name = "DIR")]
    sweep: PathBuf,
    /// For GNU parallel
    #[arg(long, required = true)]
    parallel: bool,
    /// Threads a run
    #[arg(long, value_name = "N", default_value = "1")]
    threads: NonZeroUsize,
}

/// Neither complete nor worked on.
fn is_left(state: &State) -> bool {
    !matches!(state, State::Done | State::Running { .. })
}

pub(super) fn submit(arguments: &SubmitArguments) -> Result<()> {
    let (plan, folder) = open(&arguments.sweep)?;
    let submission = Submission {
        throttle: arguments.throttle,
        cpus: arguments.cpus,
        gpus: arguments.gpus,
        time: arguments.time.clone(),
        memory: arguments.mem.clone(),
        partition: arguments.partition.clone(),
        options: arguments.options.clone(),
    };
    let left = lines(&states(&plan, &folder), is_left);
    let json = serde_json::to_vec_pretty(&submission).map_err(|e| Error::input(e.to_string()))?;
    atomic::write(&folder.join(SUBMISSION), &json)?;
    sbatch(&submission, &left, &folder, arguments.dry_run)
}

pub(super) fn sbatch(
    submission: &Submission,
    lines: &[usize],
    folder: &Path,
    dry_run: bool,
) -> Result<()> {
    if lines.is_empty() {
        eprintln!("no run is left to submit");
        return Ok(());
    }
    let program = std::env::current_exe().map_err(|e| Error::io("tracklens", &e))?;
    let logs = folder.join("slurm");
    fs::create_dir_all(&logs).map_err(|e| Error::io(logs.display(), &e))?;
    let path = folder.join(SCRIPT);
    atomic::write(
        &path,
        script(submission, lines, folder, &program)?.as_bytes(),
    )?;
    if dry_run {
        eprintln!("{} runs in {}, not submitted", lines.len(), path.display());
        return Ok(());
    }
    let done = Command::new("sbatch").arg("--parsable").arg(&path).output().map_err(|e| {
        Error::new(
            ErrorKind::Io,
            format!(
                "sbatch cannot be run here ({e}); submit {} where Slurm is, or train here with `tracklens sweep run`",
                path.display()
            ),
        )
    })?;
    if !done.status.success() {
        let said = String::from_utf8_lossy(&done.stderr);
        return Err(Error::new(
            ErrorKind::Io,
            format!("Slurm did not take the job array: {}", said.trim()),
        )
        .at(path.display()));
    }
    let job = String::from_utf8_lossy(&done.stdout);
    eprintln!("{} runs submitted as job {}", lines.len(), job.trim());
    say!("{}", job.trim());
    Ok(())
}

pub(super) fn export(arguments: &ExportArguments) -> Result<()> {
    let (plan, folder) = open(&arguments.sweep)?;
    let left = lines(&states(&plan, &folder), is_left);
    if left.is_empty() {
        eprintln!("no run is left");
        return Ok(());
    }
    let program = std::env::current_exe().map_err(|e| Error::io("tracklens", &e))?;
    let quote = |path: &Path| -> Result<String> {
        let text = path.to_string_lossy();
        let quoted = shlex::try_quote(&text)
            .map_err(|e| Error::input(format!("{}: {e}", path.display())))?;
        Ok(quoted.into_owned())
    };
    let (program, sweep, threads) = (quote(&program)?, quote(&folder)?, arguments.threads);
    let command = |line: &usize| {
        format!("{program} sweep run {sweep} --line {line} --threads {threads} --quiet\n")
    };
    let path = folder.join(COMMANDS);
    atomic::write(
        &path,
        left.iter().map(command).collect::<String>().as_bytes(),
    )?;
    eprintln!(
        "{} runs; start them with: parallel --jobs N < {}",
        left.len(),
        quote(&path)?
    );
    say!("{}", path.display());
    Ok(())
}
