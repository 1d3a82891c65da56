//! `tracklens sweep plan`, and the plan of a sweep with the states of its runs.

use std::fs;
use std::path::{Path, PathBuf};

use clap::{ArgAction, Args, CommandFactory as _, Parser};

use super::agent;
use crate::atomic;
use crate::cli::train::TrainArguments;
use crate::error::{Error, ErrorKind, Result};
use crate::sweep::{
    AgentSweep, Plan, PlannedRun, Progress, RunPlace, Setting, SettingKind, State, SweepFile,
};

pub(super) const PLAN: &str = "plan.jsonl";

/// What a sweep decides for every run.
const NOT_SETTINGS: [&str; 8] = [
    "data", "arch", "out", "seed", "resume", "threads", "quiet", "help",
];
/// The options of a training whose values are files.
const PATHS: [&str; 3] = ["truth", "first-layer", "weights"];

#[derive(Debug, Args)]
pub(in crate::cli) struct PlanArguments {
    /// The sweep file
    #[arg(value_name = "SWEEP.toml")]
    file: PathBuf,
    /// Folder of the sweep; default: `out` of the file, else `runs` in its folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write another plan over one that is there; runs are known by their names
    #[arg(long)]
    replace: bool,
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

pub(super) fn training(run: &PlannedRun, more: &[String]) -> Result<TrainArguments> {
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

/// How far a run is to come.
pub(super) fn goal(run: &PlannedRun) -> Result<Progress> {
    if !run.program.is_empty() {
        return agent::steps(run).map(Progress::Steps);
    }
    let training = training(run, &["--out".to_owned(), run.run.clone()])?;
    Ok(Progress::Epochs(training.config()?.epochs.into()))
}

pub(super) fn plan(arguments: &PlanArguments) -> Result<()> {
    let failed = |e: std::io::Error| Error::io(arguments.file.display(), &e);
    let text = fs::read_to_string(&arguments.file).map_err(failed)?;
    // Jobs run elsewhere than here, so that every path is absolute.
    let file = std::path::absolute(&arguments.file).map_err(failed)?;
    let folder = file.parent().unwrap_or(Path::new("/"));
    let in_file = |e: Error| e.at(arguments.file.display());
    let agents = AgentSweep::parse(&text, folder, agent::options).map_err(in_file)?;
    let (plan, own_out) = match agents {
        Some(sweep) => (sweep.plan().map_err(in_file)?, sweep.out),
        None => plan_trainings(arguments, &text, folder)?,
    };
    let out = match &arguments.out {
        Some(out) => std::path::absolute(out).map_err(|e| Error::io(out.display(), &e))?,
        None => own_out,
    };
    check_folder(&out)?;
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

/// The plan of trainings, and the folder of the sweep that the file names.
fn plan_trainings(arguments: &PlanArguments, text: &str, folder: &Path) -> Result<(Plan, PathBuf)> {
    let sweep =
        SweepFile::parse(text, folder, &settings()).map_err(|e| e.at(arguments.file.display()))?;
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
            .map_err(|e| e.at(&run.run))?;
    }
    Ok((plan, sweep.out))
}

/// Refuses a folder whose path would break the scripts and lists of commands that name it.
fn check_folder(folder: &Path) -> Result<()> {
    match folder.to_string_lossy().contains(char::is_control) {
        true => Err(Error::input(format!(
            "the folder of the sweep, {folder:?}, has a line break or another control character in its path; use another \
             folder"
        ))),
        false => Ok(()),
    }
}

/// The plan of a sweep, and its folder as an absolute path.
pub(super) fn open(sweep: &Path) -> Result<(Plan, PathBuf)> {
    let folder = std::path::absolute(sweep).map_err(|e| Error::io(sweep.display(), &e))?;
    check_folder(&folder)?;
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

/// How far a run is to come, and its state. A run whose arguments cannot be read has failed.
pub(super) fn state(folder: &Path, run: &PlannedRun) -> (Progress, State) {
    match goal(run) {
        Ok(goal) => (goal, RunPlace::new(folder, &run.run).state(goal)),
        Err(e) => {
            let (error, done) = (e.to_string(), Progress::Epochs(0));
            (done, State::Failed { error, done })
        }
    }
}

pub(super) fn states(plan: &Plan, folder: &Path) -> Vec<(Progress, State)> {
    plan.runs.iter().map(|run| state(folder, run)).collect()
}

/// The lines, counted from 1, of the runs in a state.
pub(super) fn lines(states: &[(Progress, State)], wanted: impl Fn(&State) -> bool) -> Vec<usize> {
    let found = states
        .iter()
        .enumerate()
        .filter(|(_, (_, state))| wanted(state));
    found.map(|(i, _)| i + 1).collect()
}
