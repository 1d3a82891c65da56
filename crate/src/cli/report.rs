//! `tracklens report`.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;

use super::files::{self, TruthArguments};
use super::painter::Painter;
use super::score::parse_threshold;
use super::trajectories;
use crate::atomic;
use crate::error::{Error, ErrorKind, Result};
use crate::metric::default_threshold;
use crate::report::{
    Grouping, Reference, ReferenceReport, Run, RunFiles, Runs, RunsReport, Unread, errors_csv,
    figures, runs_csv, runs_markdown, runs_page,
};
use crate::train::{CONFIG, LOG, SUMMARY};

/// Why the last attempt of a run of a sweep failed.
const ERROR: &str = "error.txt";
/// Folders below the given ones that are searched for runs.
const DEPTH: usize = 6;

#[derive(Debug, Args)]
pub(super) struct ReportArguments {
    /// Run folders, or folders with run folders in them
    #[arg(required = true, value_name = "RUNS")]
    runs: Vec<PathBuf>,
    /// Folder to write the tables and figures into
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Threshold on an object's error (mean squared distance, ndc); repeatable. Default: cube
    /// 0.015, target 0.015, eef 0.1, others 0.015
    #[arg(long = "threshold", value_name = "NAME=VALUE", value_parser = parse_threshold)]
    thresholds: Vec<(String, f64)>,
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
    /// Published numbers to set beside these (TOML, e.g. sweeps/paper-results.toml)
    #[arg(long, value_name = "FILE.toml")]
    reference: Option<PathBuf>,
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
    let mut folders = Vec::new();
    for path in &arguments.runs {
        if !path.is_dir() {
            return Err(Error::new(
                ErrorKind::Io,
                "is no folder; expected a run folder, or one that holds run folders",
            )
            .at(path.display()));
        }
        find(path, DEPTH, &mut folders)?;
    }
    folders.sort();
    folders.dedup();
    // Before the long work.
    let reference = arguments
        .reference
        .as_deref()
        .map(read_reference)
        .transpose()?;
    let mut unread = Vec::new();
    let mut runs = Vec::new();
    for folder in &folders {
        match read(folder)? {
            Ok(run) => runs.push(Arc::new(run)),
            Err(why) => unread.push(why),
        }
    }
    if runs.is_empty()
        && let Some(first) = unread.first()
    {
        return Err(Error::numeric(format!(
            "none of the {} runs can be read ({}: {})",
            unread.len(),
            first.name,
            first.reason
        )));
    }
    for (name, _) in &arguments.thresholds {
        if let Some(run) = runs.first().filter(|run| !run.objects.contains(name)) {
            return Err(Error::mismatch(format!(
                "a threshold is given for `{name}`; the runs have the objects {}",
                run.objects.join(", ")
            )));
        }
    }
    let threshold = |object: &str| {
        let given = arguments.thresholds.iter().find(|(name, _)| name == object);
        given.map_or_else(|| default_threshold(object), |(_, value)| *value)
    };
    let runs = Runs::new(runs, threshold, &arguments.group_by)?;
    let mut report = RunsReport::new(&runs, unread, arguments.resamples, arguments.seed)?;
    report.reference = reference.map(|reference| ReferenceReport::new(&reference, &report));
    let mut figures = figures(&runs, &report)?;
    if let Some(path) = &arguments.frames {
        let frames = arguments.reading.open(path)?;
        let truth = arguments.reading.need(
            arguments.truth.as_deref(),
            path,
            &*frames,
            "drawing trajectories",
        )?;
        figures.extend(trajectories::figures(
            &runs,
            &*frames,
            &truth,
            &arguments.sequences,
        )?);
    }

    // Everything is made before anything is written, and the page that shows it all is written
    // last.
    let painter = Painter::new();
    let mut written: Vec<(String, Vec<u8>)> = Vec::new();
    for figure in &figures {
        written.push((format!("{}.png", figure.name), painter.png(&figure.svg)?));
        written.push((
            format!("{}.svg", figure.name),
            figure.svg.clone().into_bytes(),
        ));
    }
    let json = serde_json::to_vec_pretty(&report).map_err(|e| Error::input(e.to_string()))?;
    written.extend([
        ("runs.csv".to_owned(), runs_csv(&report).into_bytes()),
        ("errors.csv".to_owned(), errors_csv(&report).into_bytes()),
        (
            "report.md".to_owned(),
            runs_markdown(&report, &figures).into_bytes(),
        ),
        ("report.json".to_owned(), json),
        (
            "report.html".to_owned(),
            runs_page(&report, &figures).into_bytes(),
        ),
    ]);
    let out = &arguments.out;
    fs::create_dir_all(out).map_err(|e| Error::io(out.display(), &e))?;
    for (name, bytes) in &written {
        atomic::write(&out.join(name), bytes)?;
    }
    for (name, reason) in report.not_counted() {
        eprintln!("warning: {name}: {reason}; it does not count");
    }
    for note in &report.notes {
        eprintln!("warning: {note}");
    }
    let more = report.not_counted().count();
    eprintln!(
        "{} complete runs in {} groups{}; report written to {}",
        report.complete(),
        report.groups.len(),
        if more > 0 {
            format!(", {more} more that do not count")
        } else {
            String::new()
        },
        out.join("report.html").display()
    );
    Ok(())
}

/// Run folders in `folder`, or itself.
fn find(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> Result<()> {
    if [CONFIG, ERROR]
        .iter()
        .any(|name| folder.join(name).is_file())
    {
        found.push(folder.to_owned());
        return Ok(());
    }
    if depth == 0 {
        return Ok(());
    }
    let failed = |e: std::io::Error| Error::io(folder.display(), &e);
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() {
            find(&path, depth - 1, found)?;
        }
    }
    Ok(())
}

fn read(folder: &Path) -> Result<std::result::Result<Run, Unread>> {
    let bytes = |name: &str| {
        let path = folder.join(name);
        match fs::read(&path) {
            Ok(bytes) => Ok(Some(bytes)),
            // A run that was ended in its first epoch has no log yet.
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(e) => Err(Error::io(path.display(), &e)),
        }
    };
    let [config, log, summary, error] =
        [bytes(CONFIG)?, bytes(LOG)?, bytes(SUMMARY)?, bytes(ERROR)?];
    let files = RunFiles {
        config: config.as_deref(),
        log: log.as_deref(),
        summary: summary.as_deref(),
        error: error.as_deref(),
    };
    Ok(Run::parse(&folder.to_string_lossy(), &files))
}

fn read_reference(path: &Path) -> Result<Reference> {
    let bytes = files::read(path)?;
    let wrong = |e: &dyn std::fmt::Display| {
        Error::input(e.to_string().trim_end().to_owned()).at(path.display())
    };
    let text = std::str::from_utf8(&bytes).map_err(|e| wrong(&e))?;
    toml::from_str(text).map_err(|e| wrong(&e))
}
