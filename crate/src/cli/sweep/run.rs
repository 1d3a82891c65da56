//! `tracklens sweep run`: the runs of a plan, trained here.

use std::collections::VecDeque;
use std::fmt;
use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use clap::Args;
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

use super::agent;
use super::plan::{PLAN, goal, open, state, training};
use crate::cli::extract::cancel_on_interrupt;
use crate::cli::{signals, train};
use crate::error::{Error, ErrorKind, Result};
use crate::sweep::{Plan, PlannedRun, Progress, RunPlace, State};
use crate::train::RunLock;

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
    let Some(claim) = place.claim(goal(run)?)? else {
        eprintln!("{} is complete", run.run);
        return Ok(());
    };
    let trained = match run.program.is_empty() {
        true => train_here(arguments, run, claim.lock()),
        false => agent::train(run, claim.lock(), arguments.threads),
    };
    match trained {
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

/// Trains an encoder in this process.
fn train_here(arguments: &RunArguments, run: &PlannedRun, lock: &RunLock) -> Result<()> {
    let mut more = vec![
        "--out".to_owned(),
        lock.folder().to_string_lossy().into_owned(),
        "--resume".to_owned(),
    ];
    if let Some(threads) = arguments.threads {
        more.push(format!("--threads={threads}"));
    }
    if arguments.quiet {
        more.push("--quiet".to_owned());
    }
    train::run_in(lock, &training(run, &more)?)
}

/// A run that is trained by a process of its own.
struct Job<'a> {
    run: &'a PlannedRun,
    place: RunPlace,
    process: Child,
    goal: Progress,
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
    let cancel = cancel_on_interrupt()?;
    let mut work = Work::new(arguments, &plan, &folder)?;
    loop {
        if cancel.is_cancelled() {
            work.stop();
        }
        work.start_waiting();
        if work.jobs.is_empty() {
            break;
        }
        std::thread::sleep(LOOK);
        work.look()?;
    }
    work.outcome()
}

/// All runs of a sweep, some at work in processes of their own.
struct Work<'a> {
    plan: &'a Plan,
    folder: &'a Path,
    program: PathBuf,
    threads: usize,
    /// How many jobs there may be.
    most: usize,
    /// Lines of the plan, counted from 1, and their runs.
    waiting: VecDeque<(usize, &'a PlannedRun)>,
    jobs: Vec<Job<'a>>,
    complete: u64,
    /// How many were complete at the start.
    already: u64,
    /// Runs that others work on, in words.
    elsewhere: Vec<String>,
    failed: Vec<&'a str>,
    asked_to_stop: Option<Instant>,
    bars: MultiProgress,
    overall: ProgressBar,
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or(ProgressStyle::default_bar())
}

impl<'a> Work<'a> {
    fn new(arguments: &RunArguments, plan: &'a Plan, folder: &'a Path) -> Result<Self> {
        let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        let (mut waiting, mut already, mut elsewhere) = (VecDeque::new(), 0, Vec::new());
        for (i, run) in plan.runs.iter().enumerate() {
            match state(folder, run).1 {
                State::Done => already += 1,
                State::Running { holder, .. } => elsewhere.push(worked_on(run, &holder)),
                _ => waiting.push_back((i + 1, run)),
            }
        }
        let bars = MultiProgress::new();
        if arguments.quiet {
            bars.set_draw_target(indicatif::ProgressDrawTarget::hidden());
        }
        let overall = bars.add(ProgressBar::new(plan.runs.len() as u64));
        overall.set_style(style("runs {wide_bar} {pos}/{len} ({elapsed})"));
        overall.set_position(already);
        Ok(Self {
            plan,
            folder,
            program: std::env::current_exe().map_err(|e| Error::io("tracklens", &e))?,
            threads: arguments
                .threads
                .map_or((cores / arguments.jobs).max(1), NonZeroUsize::get),
            most: arguments.jobs.get(),
            waiting,
            jobs: Vec::new(),
            complete: already,
            already,
            elsewhere,
            failed: Vec::new(),
            asked_to_stop: None,
            bars,
            overall,
        })
    }

    /// Asks the trainings to end, once, and starts no other.
    fn stop(&mut self) {
        if self.asked_to_stop.is_none() {
            self.asked_to_stop = Some(Instant::now());
            self.waiting.clear();
            for job in &self.jobs {
                signals::end(&job.process);
            }
        }
    }

    fn start_waiting(&mut self) {
        while self.jobs.len() < self.most {
            let Some((line, run)) = self.waiting.pop_front() else {
                break;
            };
            let place = RunPlace::new(self.folder, &run.run);
            match start(&self.program, self.folder, &place, line, self.threads) {
                Ok(process) => {
                    let goal = state(self.folder, run).0;
                    let bar = ProgressBar::new(goal.count());
                    let bar = self.bars.insert_before(&self.overall, bar);
                    let unit = goal.unit();
                    let shown =
                        format!("{{msg}} {{wide_bar}} {unit} {{pos}}/{{len}} ({{eta}} left)");
                    bar.set_style(style(&shown));
                    bar.set_message(run.run.clone());
                    self.jobs.push(Job {
                        run,
                        place,
                        process,
                        goal,
                        bar,
                    });
                }
                Err(e) => self.fail(run, &e),
            }
        }
    }

    fn fail(&mut self, run: &'a PlannedRun, why: &dyn fmt::Display) {
        self.overall.suspend(|| eprintln!("{}: {why}", run.run));
        self.failed.push(&run.run);
    }

    /// How far the jobs are, and which ended.
    fn look(&mut self) -> Result<()> {
        for mut job in std::mem::take(&mut self.jobs) {
            job.bar.set_position(job.place.done(job.goal).count());
            let failed = |e: std::io::Error| Error::io(&job.run.run, &e);
            if let Some(status) = job.process.try_wait().map_err(failed)? {
                job.bar.finish_and_clear();
                self.ended(&job, status);
            } else {
                if self
                    .asked_to_stop
                    .is_some_and(|when| when.elapsed() > PATIENCE)
                {
                    job.process.kill().map_err(failed)?;
                }
                self.jobs.push(job);
            }
        }
        Ok(())
    }

    fn ended(&mut self, job: &Job<'a>, status: ExitStatus) {
        if status.success() {
            self.complete += 1;
            self.overall.set_position(self.complete);
        } else if self.asked_to_stop.is_none() {
            match state(self.folder, job.run).1 {
                State::Failed { error, .. } => self.fail(job.run, &error),
                // Another process was faster, and is at work or done.
                State::Done => {
                    self.complete += 1;
                    self.overall.set_position(self.complete);
                }
                State::Running { holder, .. } => {
                    self.elsewhere.push(worked_on(job.run, &holder));
                }
                _ => {
                    let said = said(&job.place);
                    let why = format!("ended with {status}; see {}", said.display());
                    self.fail(job.run, &why);
                }
            }
        }
    }

    /// Says how many runs are complete; an error when not all of them could be.
    fn outcome(self) -> Result<()> {
        self.overall.finish_and_clear();
        for run in &self.elsewhere {
            eprintln!("{run}");
        }
        let (total, failed) = (self.plan.runs.len(), self.failed.len());
        eprintln!(
            "{} of {total} runs are complete ({} were before), {failed} failed, {} are worked on elsewhere",
            self.complete,
            self.already,
            self.elsewhere.len()
        );
        if self.asked_to_stop.is_some() {
            return Err(Error::cancelled().at("the same command goes on"));
        }
        if failed > 0 {
            return Err(Error::new(
                ErrorKind::Numeric,
                format!(
                    "{failed} of {total} runs failed: {}",
                    self.failed.join(", ")
                ),
            ));
        }
        Ok(())
    }
}

fn worked_on(run: &PlannedRun, holder: &impl fmt::Display) -> String {
    format!("{}: {holder} works on it", run.run)
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
