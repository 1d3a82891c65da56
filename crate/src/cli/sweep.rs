//! `tracklens sweep …`.

use std::collections::VecDeque;
use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use clap::{ArgAction, Args, CommandFactory as _, Parser, Subcommand};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use serde::Serialize;

use super::extract::cancel_on_interrupt;
use super::signals;
use super::train::{self, TrainArguments};
use crate::atomic;
use crate::error::{Error, ErrorKind, Result};
use crate::sweep::{
    Plan, PlannedRun, RunPlace, Setting, SettingKind, State, Submission, SweepFile, script,
};

const PLAN: &str = "plan.jsonl";
const SUBMISSION: &str = "submission.json";
const SCRIPT: &str = "sweep.sbatch";
const COMMANDS: &str = "commands.txt";

/// What a sweep decides for every run.
const NOT_SETTINGS: [&str; 8] = [
    "data", "arch", "out", "seed", "resume", "threads", "quiet", "help",
];
/// The options of a training whose values are files.
const PATHS: [&str; 3] = ["truth", "first-layer", "weights"];

#[derive(Debug, Subcommand)]
pub(super) enum SweepCommand {
    /// Write the plan of a sweep, a line a run: every architecture with every variant and every
    /// seed.
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

#[derive(Debug, Args)]
pub(super) struct PlanArguments {
    /// The sweep file
    #[arg(value_name = "SWEEP.toml")]
    file: PathBuf,
    /// Folder of the sweep; default: `out` of the file, else `runs` beside it
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write another plan over one that is there; runs are known by their names
    #[arg(long)]
    replace: bool,
}

#[derive(Debug, Args)]
pub(super) struct RunArguments {
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

#[derive(Debug, Args)]
pub(super) struct StatusArguments {
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

#[derive(Debug, Args)]
pub(super) struct SubmitArguments {
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
pub(super) struct ExportArguments {
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

pub(super) fn run(command: &SweepCommand) -> Result<()> {
    match command {
        SweepCommand::Plan(arguments) => plan(arguments),
        SweepCommand::Run(arguments) => match arguments.line {
            Some(line) => run_line(arguments, line),
            None => run_all(arguments),
        },
        SweepCommand::Status(arguments) => status(arguments),
        SweepCommand::Submit(arguments) => submit(arguments),
        SweepCommand::Export(arguments) => export(arguments),
    }
}

/// `tracklens train` alone, to read the arguments of a run.
#[derive(Debug, Parser)]
#[command(name = "train")]
struct Training {
    #[command(flatten)]
    arguments: TrainArguments,
}

/// The options of a training that a sweep file may give: those of the command line.
fn settings() -> Vec<Setting> {
    let command = Training::command();
    let options = command.get_arguments().filter_map(|argument| {
        let name = argument.get_long()?;
        let kind = match argument.get_action() {
            ArgAction::SetTrue => SettingKind::Switch,
            _ if PATHS.contains(&name) => SettingKind::Path,
            _ => SettingKind::Value,
        };
        (!NOT_SETTINGS.contains(&name)).then(|| Setting {
            name: name.to_owned(),
            kind,
        })
    });
    options.collect()
}

fn training(run: &PlannedRun, more: &[String]) -> Result<TrainArguments> {
    let arguments = ["train".to_owned()].into_iter();
    let all = arguments
        .chain(run.arguments.iter().cloned())
        .chain(more.iter().cloned());
    Training::try_parse_from(all)
        .map(|training| training.arguments)
        .map_err(|e| {
            let text = e.to_string();
            let said = text
                .lines()
                .next()
                .unwrap_or_default()
                .trim_start_matches("error: ");
            Error::input(said).at(&run.run)
        })
}

/// Epochs that a run is to have.
fn epochs(run: &PlannedRun) -> Result<u32> {
    Ok(training(run, &["--out".to_owned(), run.run.clone()])?.epochs())
}

fn plan(arguments: &PlanArguments) -> Result<()> {
    let failed = |e: std::io::Error| Error::io(arguments.file.display(), &e);
    let text = fs::read_to_string(&arguments.file).map_err(failed)?;
    // Jobs run elsewhere than here, so that every path is absolute.
    let file = std::path::absolute(&arguments.file).map_err(failed)?;
    let folder = file.parent().unwrap_or(Path::new("/"));
    let sweep =
        SweepFile::parse(&text, folder, &settings()).map_err(|e| e.at(arguments.file.display()))?;
    if !sweep.data.exists() {
        return Err(Error::new(
            ErrorKind::Io,
            format!("the data set {} is not there", sweep.data.display()),
        )
        .at(arguments.file.display()));
    }
    let plan = sweep.plan();
    for run in &plan.runs {
        training(run, &["--out".to_owned(), run.run.clone()])?
            .config()
            .validate()
            .map_err(|e| e.at(&run.run))?;
    }
    let out = match &arguments.out {
        Some(out) => std::path::absolute(out).map_err(|e| Error::io(out.display(), &e))?,
        None => sweep.out,
    };
    fs::create_dir_all(&out).map_err(|e| Error::io(out.display(), &e))?;
    let path = out.join(PLAN);
    let text = plan.to_jsonl()?;
    if let Ok(there) = fs::read_to_string(&path)
        && there != text
        && !arguments.replace
    {
        return Err(Error::mismatch(
            "another plan is there, and jobs may be counting its lines; give --replace to write over it, or another \
             folder with --out",
        )
        .at(path.display()));
    }
    atomic::write(&path, text.as_bytes())?;
    eprintln!("{} runs planned in {}", plan.runs.len(), path.display());
    say!("{}", out.display());
    Ok(())
}

/// The plan of a sweep, and its folder as an absolute path.
fn open(sweep: &Path) -> Result<(Plan, PathBuf)> {
    let folder = std::path::absolute(sweep).map_err(|e| Error::io(sweep.display(), &e))?;
    let path = folder.join(PLAN);
    let text = fs::read_to_string(&path).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => Error::new(
            ErrorKind::Io,
            format!("holds no {PLAN}; make one with `tracklens sweep plan SWEEP.toml`"),
        )
        .at(sweep.display()),
        _ => Error::io(path.display(), &e),
    })?;
    let plan = Plan::parse(&text).map_err(|e| e.at(path.display()))?;
    Ok((plan, folder))
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
        match RunPlace::new(&folder, &run.run).state(epochs(run)?)? {
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
            let process = start(&program, &folder, &place, line, threads)?;
            let bar = bars.insert_before(&overall, ProgressBar::new(u64::from(epochs(run)?)));
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
                let why = match job.place.state(epochs(job.run)?)? {
                    State::Failed { error, .. } => error,
                    State::Running { holder, .. } => format!("{holder} works on it"),
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

/// What a run said on its standard error. It lies beside the run's folder, as it is there before
/// the folder is.
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

fn states(plan: &Plan, folder: &Path) -> Result<Vec<(u32, State)>> {
    let state = |run: &PlannedRun| -> Result<(u32, State)> {
        let epochs = epochs(run)?;
        Ok((epochs, RunPlace::new(folder, &run.run).state(epochs)?))
    };
    plan.runs.iter().map(state).collect()
}

fn status(arguments: &StatusArguments) -> Result<()> {
    let (plan, folder) = open(&arguments.sweep)?;
    let states = states(&plan, &folder)?;
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
    sbatch(&submission, &lines(&states, ended), &folder, false)
}

/// The lines, counted from 1, of the runs in a state.
fn lines(states: &[(u32, State)], wanted: impl Fn(&State) -> bool) -> Vec<usize> {
    let found = states
        .iter()
        .enumerate()
        .filter(|(_, (_, state))| wanted(state));
    found.map(|(i, _)| i + 1).collect()
}

/// Neither complete nor worked on.
fn is_left(state: &State) -> bool {
    !matches!(state, State::Done | State::Running { .. })
}

fn submit(arguments: &SubmitArguments) -> Result<()> {
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
    let left = lines(&states(&plan, &folder)?, is_left);
    let json = serde_json::to_vec_pretty(&submission).map_err(|e| Error::input(e.to_string()))?;
    atomic::write(&folder.join(SUBMISSION), &json)?;
    sbatch(&submission, &left, &folder, arguments.dry_run)
}

fn sbatch(submission: &Submission, lines: &[usize], folder: &Path, dry_run: bool) -> Result<()> {
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

fn export(arguments: &ExportArguments) -> Result<()> {
    let (plan, folder) = open(&arguments.sweep)?;
    let left = lines(&states(&plan, &folder)?, is_left);
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
