//! `tracklens report`.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;

use super::files::TruthArguments;
use super::painter::Painter;
use super::score::ThresholdArguments;
use super::trajectories;
use crate::atomic;
use crate::error::{Error, ErrorKind, Result};
use crate::evaluation::EvaluationReport;
use crate::report::draw::Figure;
use crate::report::runs::{
    AgentRun, Agents, Grouping, Reference, Run, Runs, RunsReport, Unread, Weights, agents_csv,
    errors_csv, runs_csv, runs_figures, runs_latex, runs_markdown, runs_page, success_csv,
};
use crate::run::{FoundRun, RunFiles, RunKind, find_runs};
use crate::weights::read;

/// Folders below the given ones that are searched for runs.
const DEPTH: usize = 6;

#[derive(Debug, Args)]
pub(super) struct ReportArguments {
    /// Run folders of trainings and agents, or folders with run folders in them
    #[arg(required = true, value_name = "RUNS")]
    runs: Vec<PathBuf>,
    /// Folder to write the tables and figures into
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    thresholds: ThresholdArguments,
    /// What the runs of a group have in common: settings (all but the seed), architecture, name (of
    /// the folder above the runs), or one setting by its name in config.json
    #[arg(long, value_name = "WHAT", default_value = "settings")]
    group_by: Grouping,
    /// Draws of the runs for the intervals
    #[arg(long, value_name = "N", default_value_t = 2000)]
    resamples: usize,
    /// Seeds the draws
    #[arg(long, value_name = "SEED", default_value_t = 0)]
    seed: u64,
    /// Published numbers to compare with (TOML, e.g. sweeps/paper-results.toml)
    #[arg(long, value_name = "FILE.toml")]
    reference: Option<PathBuf>,
    /// How well the encoder of agents tracks: its checkpoint, and what `tracklens eval --json` found;
    /// not needed for the checkpoints of trainings that are given as well. May be repeated
    #[arg(long = "evaluation", value_name = "CHECKPOINT=FILE.json")]
    evaluations: Vec<String>,
    /// The data set of the runs, for trajectories on its frames: a folder of image sequences or a
    /// recording
    #[arg(long, value_name = "DATA")]
    frames: Option<PathBuf>,
    /// Ground truth of the frames; default: ground_truth.csv in their folder, or the points of the
    /// recording
    #[arg(long, value_name = "GT.csv", requires = "frames")]
    truth: Option<PathBuf>,
    /// Sequences whose trajectories are drawn; default: those four of the run's validation
    /// sequences in which the objects move furthest
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "frames")]
    sequences: Vec<String>,
    #[command(flatten)]
    reading: TruthArguments,
}

pub(super) fn run(arguments: &ReportArguments) -> Result<()> {
    // Before the long work.
    let thresholds = arguments.thresholds.parse()?;
    let reference = arguments.reference.as_deref().map(read_reference);
    let reference = reference.transpose()?;
    let evaluations = arguments
        .evaluations
        .iter()
        .map(|text| read_evaluation(text));
    let evaluations: Vec<(u32, EvaluationReport)> = evaluations.collect::<Result<_>>()?;
    let (runs, mut agents, unread) = read_runs(&arguments.runs)?;
    for (crc32, evaluation) in &evaluations {
        agents.add_evaluation(*crc32, evaluation);
    }
    let runs = Runs::new(runs, &agents, &thresholds, &arguments.group_by)?;
    let mut report = RunsReport::new(&runs, unread, arguments.resamples, arguments.seed)?;
    if let Some(reference) = &reference {
        report.compare_with(reference);
    }
    let mut figures = runs_figures(&runs, &report)?;
    if let Some(path) = &arguments.frames {
        let frames = arguments.reading.open(path)?;
        let truth = arguments.reading.need_in_image(
            arguments.truth.as_deref(),
            path,
            &*frames,
            "drawing trajectories",
        )?;
        figures.extend(trajectories::figures(
            &runs,
            &*frames,
            &truth.points,
            &arguments.sequences,
        )?);
    }
    let out = &arguments.out;
    let files = files_of(&report, &figures)?;
    fs::create_dir_all(out).map_err(|e| Error::io(out.display(), &e))?;
    for (name, bytes) in &files {
        atomic::write(&out.join(name), bytes)?;
    }
    summarize(&report, out);
    Ok(())
}

/// The runs and agents below `folders`, and those that cannot be read.
fn read_runs(folders: &[PathBuf]) -> Result<(Vec<Arc<Run>>, Agents, Vec<Unread>)> {
    let mut search = Search::default();
    for path in folders {
        if !path.is_dir() {
            return Err(Error::new(
                ErrorKind::Io,
                "not a folder; expected a run folder, or one that holds run folders",
            )
            .at(path.display()));
        }
        let name = path.to_string_lossy();
        search.list(path, name.trim_end_matches('/'), DEPTH);
    }
    let (mut runs, mut agents) = (Vec::new(), Agents::default());
    for found in find_runs(search.names.iter().map(String::as_str)).runs {
        match search.read(&found) {
            Ok(AnyRun::Training(run)) => runs.push((run, found)),
            Ok(AnyRun::Agent(run)) => agents.push(*run),
            Err(why) => search.unread.push(why),
        }
    }
    if runs.is_empty()
        && agents.runs().is_empty()
        && let Some(first) = search.unread.first()
    {
        return Err(Error::numeric(format!(
            "none of the {} runs can be read ({}: {})",
            search.unread.len(),
            first.name,
            first.reason
        )));
    }
    search.find_encoders(&runs, &mut agents)?;
    let runs = runs.into_iter().map(|(run, _)| run).collect();
    Ok((runs, agents, search.unread))
}

/// A run of either kind.
enum AnyRun {
    Training(Arc<Run>),
    Agent(Box<AgentRun>),
}

/// The CRC-32 of a checkpoint with its evaluation, from `CHECKPOINT=FILE.json`.
fn read_evaluation(text: &str) -> Result<(u32, EvaluationReport)> {
    let (checkpoint, file) = text.rsplit_once('=').ok_or_else(|| {
        Error::input(format!(
            "--evaluation {text} names no evaluation; expected CHECKPOINT=FILE.json"
        ))
    })?;
    let report = EvaluationReport::parse(&read(Path::new(file))?, file)?;
    Ok((crc32fast::hash(&read(Path::new(checkpoint))?), report))
}

/// The files of the report by name, the page that shows everything last.
fn files_of(report: &RunsReport, figures: &[Figure]) -> Result<Vec<(String, Vec<u8>)>> {
    let painter = Painter::new();
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for figure in figures {
        let name = &figure.name;
        files.push((format!("{name}.png"), painter.png(&figure.svg)?));
        files.push((format!("{name}.svg"), figure.svg.clone().into_bytes()));
    }
    let json = serde_json::to_string_pretty(report).map_err(|e| Error::input(e.to_string()))?;
    let mut documents = Vec::new();
    if !report.groups.is_empty() {
        documents.push(("runs.csv", runs_csv(report)));
        documents.push(("errors.csv", errors_csv(report)));
    }
    if report.agents.is_some() {
        documents.push(("agents.csv", agents_csv(report)));
        documents.push(("success.csv", success_csv(report)));
    }
    documents.extend([
        ("report.md", runs_markdown(report, figures)),
        ("tables.tex", runs_latex(report)),
        ("report.json", json),
        ("report.html", runs_page(report, figures)),
    ]);
    let documents = documents.into_iter();
    files.extend(documents.map(|(name, text)| (name.to_owned(), text.into_bytes())));
    Ok(files)
}

/// Prints what does not count, cautions, and where the report is.
fn summarize(report: &RunsReport, out: &Path) {
    for (name, reason) in report.not_counted() {
        eprintln!("warning: {name}: {reason}; it does not count");
    }
    for note in &report.notes {
        eprintln!("warning: {note}");
    }
    let more = match report.not_counted().count() {
        0 => String::new(),
        more => format!(", {more} more that do not count"),
    };
    eprintln!(
        "{} complete runs in {} groups{more}; report written to {}",
        report.complete(),
        report.groups.len() + report.agent_groups().len(),
        out.join("report.html").display()
    );
}

/// The files below the folders that are searched for runs.
#[derive(Default)]
struct Search {
    files: Vec<PathBuf>,
    /// The same, with `/` between their parts.
    names: Vec<String>,
    /// Folders that were listed, without links.
    listed: HashSet<PathBuf>,
    /// Folders that cannot be listed.
    unread: Vec<Unread>,
}

impl Search {
    /// Lists the files of `folder`, which is called `name`, and of the folders in it.
    fn list(&mut self, folder: &Path, name: &str, depth: usize) {
        let listed = folder.canonicalize().and_then(|own| {
            if !self.listed.insert(own) {
                return Ok(Vec::new());
            }
            fs::read_dir(folder)?.collect::<std::io::Result<Vec<_>>>()
        });
        let entries = match listed {
            Ok(entries) => entries,
            Err(e) => {
                self.unread.push(unread(name, &e));
                return;
            }
        };
        for entry in entries {
            let path = entry.path();
            let name = format!("{name}/{}", entry.file_name().to_string_lossy());
            if !path.is_dir() {
                self.files.push(path);
                self.names.push(name);
            } else if depth > 0 {
                self.list(&path, &name, depth - 1);
            }
        }
    }

    /// Reads a run; a file that cannot be read is the reason why the run is not.
    fn read(&self, found: &FoundRun) -> std::result::Result<AnyRun, Unread> {
        let bytes = |position: Option<usize>| {
            let path = position.map(|position| &self.files[position]);
            let bytes = path.map(fs::read).transpose();
            bytes.map_err(|e| unread(&found.folder, &e))
        };
        let [config, log, summary, error] = [
            bytes(found.config)?,
            bytes(found.log)?,
            bytes(found.summary)?,
            bytes(found.error)?,
        ];
        let files = RunFiles {
            config: config.as_deref(),
            log: log.as_deref(),
            summary: summary.as_deref(),
            error: error.as_deref(),
        };
        match files.kind() {
            RunKind::Encoder => {
                Run::parse(&found.folder, &files).map(|run| AnyRun::Training(Arc::new(run)))
            }
            RunKind::Agent => {
                AgentRun::parse(&found.folder, &files).map(|run| AnyRun::Agent(Box::new(run)))
            }
        }
    }

    /// Finds the checkpoints that agents see by among those of trainings.
    fn find_encoders(&self, runs: &[(Arc<Run>, FoundRun)], agents: &mut Agents) -> Result<()> {
        let wanted = agents.checkpoints();
        if wanted.is_empty() {
            return Ok(());
        }
        for (run, found) in runs {
            for (position, weights) in [(found.best, Weights::Best), (found.last, Weights::Last)] {
                let Some(position) = position else { continue };
                let crc32 = crc32fast::hash(&read(&self.files[position])?);
                if wanted.contains(&crc32) {
                    agents.add_training(crc32, run, weights);
                }
            }
        }
        Ok(())
    }
}

fn unread(name: &str, e: &std::io::Error) -> Unread {
    Unread {
        name: name.to_owned(),
        reason: format!("cannot be read: {e}"),
    }
}

fn read_reference(path: &Path) -> Result<Reference> {
    let bytes = read(path)?;
    let wrong = |e: &dyn std::fmt::Display| {
        Error::input(e.to_string().trim_end().to_owned()).at(path.display())
    };
    let text = std::str::from_utf8(&bytes).map_err(|e| wrong(&e))?;
    let reference: Reference = toml::from_str(text).map_err(|e| wrong(&e))?;
    reference.validate().map_err(|e| e.at(path.display()))?;
    Ok(reference)
}
