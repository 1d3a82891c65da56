//! The files of a run folder, and which folders are run folders.

use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::agent::AGENT_SCHEMA;

/// The configuration as JSON: a [`RunConfig`](super::RunConfig), or an agent's
/// [`AgentConfig`](super::AgentConfig).
pub const CONFIG: &str = "config.json";
/// The log: an [`EpochLog`](super::EpochLog) a line, or an
/// [`AgentEvaluation`](super::AgentEvaluation).
pub const LOG: &str = "log.jsonl";
/// The summary as JSON: a [`TrainSummary`](super::TrainSummary), or an
/// [`AgentSummary`](super::AgentSummary).
pub const SUMMARY: &str = "summary.json";
/// Why the last attempt of a run of a sweep failed.
pub const ERROR: &str = "error.txt";
/// The weights of the epoch with the lowest validation loss.
pub const CHECKPOINT_BEST: &str = "checkpoint_best.safetensors";
/// The weights of the last epoch.
pub const CHECKPOINT_FINAL: &str = "checkpoint_final.safetensors";
/// What a resumed run starts from.
pub const STATE: &str = "state.safetensors";
/// The files of an agent that nothing here reads: its networks, and what it goes on from.
const AGENT_FILES: [&str; 3] = ["model.zip", "model_best.zip", "state.pt"];
/// Locked while a process works on the run; names the process.
pub const LOCK: &str = "lock";
/// The names of TensorBoard event files begin with it.
pub const EVENTS_PREFIX: &str = "events.out.tfevents.";
/// The ending of the folder of a sweep's run that is not complete.
pub const PARTIAL: &str = "partial";

/// The folder that the run in `finished` is trained in until it is complete.
pub fn partial_folder(finished: &Path) -> PathBuf {
    let mut name = finished.as_os_str().to_owned();
    name.push(".");
    name.push(PARTIAL);
    name.into()
}

/// What a run trains.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunKind {
    /// A spatial autoencoder.
    Encoder,
    /// An agent that learns by reinforcement (`tools/rl`).
    Agent,
}

/// The contents of the files that describe a run, where they exist.
#[derive(Debug, Clone, Copy, Default)]
pub struct RunFiles<'a> {
    /// [`CONFIG`].
    pub config: Option<&'a [u8]>,
    /// [`LOG`].
    pub log: Option<&'a [u8]>,
    /// [`SUMMARY`].
    pub summary: Option<&'a [u8]>,
    /// [`ERROR`].
    pub error: Option<&'a [u8]>,
}

impl RunFiles<'_> {
    /// What the run trains; an encoder where its configuration does not say.
    pub fn kind(&self) -> RunKind {
        #[derive(Deserialize)]
        struct Head {
            schema: Option<String>,
        }
        let head = |config| serde_json::from_slice::<Head>(config).ok()?.schema;
        match self.config.and_then(head) {
            Some(schema) if schema.starts_with(AGENT_SCHEMA) => RunKind::Agent,
            _ => RunKind::Encoder,
        }
    }
}

/// One run folder among other files. The files are positions in the list that was searched.
#[derive(Debug, Clone, PartialEq, Eq, Default, serde::Serialize)]
pub struct FoundRun {
    /// The path of the folder; empty for files without one.
    pub folder: String,
    /// [`CONFIG`].
    pub config: Option<usize>,
    /// [`LOG`].
    pub log: Option<usize>,
    /// [`SUMMARY`].
    pub summary: Option<usize>,
    /// [`ERROR`].
    pub error: Option<usize>,
    /// [`CHECKPOINT_BEST`].
    pub best: Option<usize>,
    /// [`CHECKPOINT_FINAL`].
    pub last: Option<usize>,
}

/// The run folders among a list of files.
#[derive(Debug, Clone, PartialEq, Eq, Default, serde::Serialize)]
pub struct FoundRuns {
    /// The run folders, by path.
    pub runs: Vec<FoundRun>,
    /// The positions of the files that belong to no run.
    pub rest: Vec<usize>,
}

/// Finds the run folders among `paths`, whose parts are separated by `/`.
///
/// A folder is a run folder when it holds a [`LOG`] or a [`SUMMARY`], or, as a sweep leaves it, when
/// its name ends in `.partial` and it holds a [`CONFIG`] or an [`ERROR`]. Checkpoints, an agent's
/// networks, state, lock and event files in a run folder belong to the run.
pub fn find_runs<'a>(paths: impl IntoIterator<Item = &'a str> + Clone) -> FoundRuns {
    let folders: HashSet<&str> = paths
        .clone()
        .into_iter()
        .map(split)
        .filter(|(folder, name)| {
            let is_partial = Path::new(folder).extension().is_some_and(|e| e == PARTIAL);
            [LOG, SUMMARY].contains(name) || is_partial && [CONFIG, ERROR].contains(name)
        })
        .map(|(folder, _)| folder)
        .collect();
    let mut runs: BTreeMap<&str, FoundRun> = BTreeMap::new();
    let mut rest = Vec::new();
    for (position, path) in paths.into_iter().enumerate() {
        let (folder, name) = split(path);
        if !folders.contains(folder) {
            rest.push(position);
            continue;
        }
        let run = runs.entry(folder).or_insert_with(|| FoundRun {
            folder: folder.to_owned(),
            ..FoundRun::default()
        });
        match name {
            CONFIG => run.config = Some(position),
            LOG => run.log = Some(position),
            SUMMARY => run.summary = Some(position),
            ERROR => run.error = Some(position),
            CHECKPOINT_BEST => run.best = Some(position),
            CHECKPOINT_FINAL => run.last = Some(position),
            STATE | LOCK => {}
            name if AGENT_FILES.contains(&name) || name.starts_with(EVENTS_PREFIX) => {}
            _ => rest.push(position),
        }
    }
    FoundRuns {
        runs: runs.into_values().collect(),
        rest,
    }
}

/// A path as its folder and its name.
fn split(path: &str) -> (&str, &str) {
    path.rsplit_once('/').unwrap_or(("", path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_or_a_summary_makes_a_run_folder_and_so_does_what_a_sweep_leaves() {
        let paths = [
            "runs/a/config.json",
            "runs/a/log.jsonl",
            "runs/a/checkpoint_final.safetensors",
            "runs/a/notes.md",
            "runs/b/log.jsonl",
            "runs/c.partial/error.txt",
            "runs/c.partial/lock",
            "other/config.json",
            "other/error.txt",
            "summary.json",
        ];
        let found = find_runs(paths);
        let folders: Vec<&str> = found.runs.iter().map(|run| run.folder.as_str()).collect();
        assert_eq!(folders, ["", "runs/a", "runs/b", "runs/c.partial"]);
        assert_eq!(found.rest, [3, 7, 8]);
        let [_, a, b, c] = &found.runs[..] else {
            panic!("four runs")
        };
        assert_eq!((a.config, a.log, a.last), (Some(0), Some(1), Some(2)));
        assert_eq!((b.config, b.log, c.error), (None, Some(4), Some(5)));
    }

    #[test]
    fn the_folder_of_an_agent_holds_its_networks_and_says_what_it_is() {
        let paths = [
            "a/config.json",
            "a/log.jsonl",
            "a/model.zip",
            "a/state.pt",
            "b/model.zip",
        ];
        let found = find_runs(paths);
        assert_eq!((found.runs.len(), &found.rest[..]), (1, &[4][..]));
        let kind = |config: &str| {
            let config = Some(config.as_bytes());
            let files = RunFiles {
                config,
                ..RunFiles::default()
            };
            files.kind()
        };
        assert_eq!(kind(r#"{"schema": "tracklens/rl-run/1"}"#), RunKind::Agent);
        assert_eq!(kind(r#"{"version": "0.1.0"}"#), RunKind::Encoder);
        assert_eq!(kind("{"), RunKind::Encoder);
    }

    #[test]
    fn a_run_is_trained_in_a_folder_with_another_ending() {
        assert_eq!(
            partial_folder(Path::new("runs/basic/seed-0.5")),
            Path::new("runs/basic/seed-0.5.partial")
        );
    }
}
