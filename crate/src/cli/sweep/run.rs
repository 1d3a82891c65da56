//! `tracklens sweep run`: the runs of a plan, trained here.

use std::collections::VecDeque;
use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use clap::Args;
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

use super::plan::{PLAN, epochs, open, training};
use super::states::state;
use crate::cli::extract::cancel_on_interrupt;
use crate::cli::{signals, train};
use crate::error::{Error, ErrorKind, Result};
use crate::sweep::{PlannedRun, RunPlace, State};

#[derive(Debug, Args)]
pub(in crate::cli) struct RunArguments {
    /// Folder of the sweep
    #[arg(value_name = "DIR")]
    sweep: PathBuf,
    /// Only the run of this line of the plan, counted from 1, in this process
    #[arg(long, value_name = "K", conflicts_with = "jobs")]
    line: Option<usize>,
    /// Runs at a time, each a process
    #[arg(short, long, value_name = "N", default_value = "1")]
    jobs: NonZeroUsize,
    /// Threads a run; default: the cores, shared among the jobs
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// No progress bars
    #[arg(long)]
    quiet: bool,
}

pub(super) fn run(arguments: &RunArguments) -> Result<()> {
    match arguments.line {
        Some(line) => run_line(arguments, line),
        None => run_all(arguments),
    }
}

fn run_line(arguments: &RunArguments, line: usize) -> Result<()> {
    let (plan, folder) = open(&arguments.sweep)?;
    let run = plan
        .line(line)
        .map_err(|e| e.at(folder.join(PLAN).display()))?;
    let place = RunPlace::new(&folder, &run.run);
    let Some(claim) = place.claim(epochs(run)?)? else {
        eprintln!("{} is complete", run.run);
        return Ok(());
    };
    let mut more = vec![
        "--out".to_owned(),
        claim.lock().folder().to_string_lossy().into_owned(),
        "--resume".to_owned(),
    ];
    if let Some(threads) = arguments.threads {
        more.push(format!("--threads={threads}"));
    }
    if arguments.quiet {
        more.push("--quiet".to_owned());
    }
    match training(run, &more).and_then(|training| train::run_in(claim.lock(), &training)) {
        Ok(()) => claim.finish(),
        // It goes on some other time: nothing is wrong with it.
        Err(error) if error.kind() == ErrorKind::Cancelled => Err(error.at(&run.run)),
        Err(error) => {
            // A full disk may have been the reason, so that this may fail as well.
            if let Err(e) = claim.fail(&error) {
                eprintln!("warning: {e}");
            }
            Err(error.at(&run.run))
        }
    }
}

/// A run that is trained by a process of its own.
struct Job<'a> {
    run: &'a PlannedRun,
    place: RunPlace,
    process: Child,
    bar: ProgressBar,
}

impl Drop for Job<'_> {
    /// A training whose sweep ends with an error ends as well.
    fn drop(&mut self) {
        if let Ok(None) = self.process.try_wait() {
            signals::end(&self.process);
        }
    }
}

/// How often the logs of running trainings are looked at.
const LOOK: Duration = Duration::from_millis(200);
/// How long trainings may take to end by themselves after a signal. Killing them loses the epoch at
/// work, nothing else.
const PATIENCE: Duration = Duration::from_secs(20);

fn run_all(arguments: &RunArguments) -> Result<()> {
    let (plan, folder) = open(&arguments.sweep)?;
    let program = std::env::current_exe().map_err(|e| Error::io("tracklens", &e))?;
    let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let threads = arguments
        .threads
        .map_or((cores / arguments.jobs).max(1), NonZeroUsize::get);
    let mut waiting = VecDeque::new();
    let (mut complete, mut elsewhere, mut failed) = (0, Vec::new(), Vec::new());
    for (i, run) in plan.runs.iter().enumerate() {
        match state(&folder, run).1 {
            State::Done => complete += 1,
            State::Running { holder, .. } => {
                elsewhere.push(format!("{}: {holder} works on it", run.run))
            }
            _ => waiting.push_back((i + 1, run)),
        }
    }
    let cancel = cancel_on_interrupt()?;
    let bars = MultiProgress::new();
    if arguments.quiet {
        bars.set_draw_target(indicatif::ProgressDrawTarget::hidden());
    }
    let style = |template: &str| {
        ProgressStyle::with_template(template).unwrap_or(ProgressStyle::default_bar())
    };
    let overall = bars.add(ProgressBar::new(plan.runs.len() as u64));
    overall.set_style(style("runs {wide_bar} {pos}/{len} ({elapsed})"));
    overall.set_position(complete);
    let already = complete;
    let mut jobs: Vec<Job> = Vec::new();
    let mut asked_to_stop = None;
    loop {
        if cancel.is_cancelled() && asked_to_stop.is_none() {
            asked_to_stop = Some(Instant::now());
            waiting.clear();
            for job in &jobs {
                signals::end(&job.process);
            }
        }
        while jobs.len() < arguments.jobs.get() {
            let Some((line, run)) = waiting.pop_front() else {
                break;
            };
            let place = RunPlace::new(&folder, &run.run);
            let process = match start(&program, &folder, &place, line, threads) {
                Ok(process) => process,
                Err(e) => {
                    overall.suspend(|| eprintln!("{}: {e}", run.run));
                    failed.push(run.run.as_str());
                    continue;
                }
            };
            let planned = state(&folder, run).0;
            let bar = bars.insert_before(&overall, ProgressBar::new(planned.into()));
            bar.set_style(style("{msg} {wide_bar} epoch {pos}/{len} ({eta} left)"));
            bar.set_message(run.run.clone());
            jobs.push(Job {
                run,
                place,
                process,
                bar,
            });
        }
        if jobs.is_empty() {
            break;
        }
        std::thread::sleep(LOOK);
        let mut still = Vec::new();
        for mut job in jobs {
            job.bar.set_position(job.place.epochs());
            let ended = job
                .process
                .try_wait()
                .map_err(|e| Error::io(&job.run.run, &e))?;
            let Some(status) = ended else {
                if asked_to_stop.is_some_and(|when| when.elapsed() > PATIENCE) {
                    job.process
                        .kill()
                        .map_err(|e| Error::io(&job.run.run, &e))?;
                }
                still.push(job);
                continue;
            };
            job.bar.finish_and_clear();
            if status.success() {
                complete += 1;
                overall.set_position(complete);
            } else if asked_to_stop.is_none() {
                let why = match state(&folder, job.run).1 {
                    State::Failed { error, .. } => error,
                    // Another process was faster.
                    State::Running { holder, .. } => {
                        elsewhere.push(format!("{}: {holder} works on it", job.run.run));
                        continue;
                    }
                    _ => format!("ended with {status}; see {}", said(&job.place).display()),
                };
                overall.suspend(|| eprintln!("{}: {why}", job.run.run));
                failed.push(job.run.run.as_str());
            }
        }
        jobs = still;
    }
    overall.finish_and_clear();
    for run in &elsewhere {
        eprintln!("{run}");
    }
    let total = plan.runs.len();
    eprintln!(
        "{complete} of {total} runs are complete ({already} were before), {} failed, {} are worked on elsewhere",
        failed.len(),
        elsewhere.len()
    );
    if asked_to_stop.is_some() {
        return Err(Error::cancelled().at("the same command goes on"));
    }
    if !failed.is_empty() {
        return Err(Error::new(
            ErrorKind::Numeric,
            format!(
                "{} of {total} runs failed: {}",
                failed.len(),
                failed.join(", ")
            ),
        ));
    }
    Ok(())
}

/// The standard error of a run. The file lies next to the folder of the run, since it exists before
/// the folder does.
fn said(place: &RunPlace) -> PathBuf {
    place.finished.with_extension("stderr.txt")
}

fn start(
    program: &Path,
    folder: &Path,
    place: &RunPlace,
    line: usize,
    threads: usize,
) -> Result<Child> {
    let path = said(place);
    let failed = |e: std::io::Error| Error::io(path.display(), &e);
    let parent = path.parent().unwrap_or(folder);
    fs::create_dir_all(parent).map_err(failed)?;
    let stderr = fs::OpenOptions::new()
        .create(true)
        .append(true)
        .open(&path)
        .map_err(failed)?;
    Command::new(program)
        .args(["sweep", "run"])
        .arg(folder)
        .args([
            "--quiet",
            "--line",
            &line.to_string(),
            "--threads",
            &threads.to_string(),
        ])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(stderr)
        .spawn()
        .map_err(|e| Error::io(program.display(), &e))
}
