//! What was saved, in JavaScript: an evaluation, and many runs with the tables and figures of
//! `tracklens report`, without paths.

use std::collections::BTreeMap;
use std::sync::Arc;

use js_sys::{Object, Reflect, Uint8Array};
use serde::{Deserialize, Serialize};
use wasm_bindgen::prelude::*;

use super::options::from_js;
use super::thresholds::thresholds;
use super::{JsResult, js_error, to_js};
use crate::error::Error;
use crate::evaluation::EvaluationReport;
use crate::report::draw::Figure;
use crate::report::runs::{
    AgentRun, Agents, Grouping, Run, Runs, RunsReport, Unread, Weights, agents_csv, data_sets,
    errors_csv, runs_csv, runs_figures, runs_markdown, runs_page, runs_tables, success_csv,
};
use crate::run::{RunFiles, RunKind};

/// Draws of the runs for the intervals, as `tracklens report` makes them.
const RESAMPLES: usize = 2000;

/// Reads the JSON of an evaluation.
///
/// # Errors
/// As [`EvaluationReport::parse`].
#[wasm_bindgen(js_name = parseEvaluation)]
pub fn parse_evaluation(bytes: &[u8], name: &str) -> JsResult<JsValue> {
    to_js(&EvaluationReport::parse(bytes, name).map_err(|e| js_error(&e))?)
}

/// CRC-32 of a checkpoint, by which agents know their encoders.
#[wasm_bindgen(js_name = checkpointCrc32)]
pub fn checkpoint_crc32(bytes: &[u8]) -> u32 {
    crc32fast::hash(bytes)
}

/// Runs that are to be compared: trainings, detectors that were scored, and agents.
#[wasm_bindgen]
#[derive(Default)]
pub struct Comparison {
    runs: Vec<Arc<Run>>,
    agents: Agents,
    unread: Vec<Unread>,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct CompareOptions {
    data_set: usize,
    thresholds: BTreeMap<String, f64>,
    group_by: Option<String>,
    resamples: Option<usize>,
    seed: u64,
}

#[derive(Serialize)]
struct DataSet<'a> {
    reason: Option<&'a str>,
    objects: &'a [String],
    trained: bool,
    settings: Vec<String>,
    runs: Vec<RunLine<'a>>,
}

#[derive(Serialize)]
struct RunLine<'a> {
    name: &'a str,
    architecture: &'a str,
    seed: Option<u64>,
    epochs: usize,
    incomplete: Option<&'a str>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct AgentLine<'a> {
    name: &'a str,
    state: &'a str,
    sees_by_checkpoint: bool,
    seed: u64,
    steps: u64,
    incomplete: Option<&'a str>,
}

#[wasm_bindgen]
impl Comparison {
    /// Without any run.
    #[wasm_bindgen(constructor)]
    pub fn new() -> Comparison {
        Self::default()
    }

    /// Adds the folder of a run: `files` holds the bytes of `config`, `log`, `summary` and `error`,
    /// as far as they are there.
    ///
    /// # Errors
    /// When `files` holds something else than bytes. A folder that cannot be read is not an
    /// error: it is counted.
    #[wasm_bindgen(js_name = addRun)]
    pub fn add_run(&mut self, name: &str, files: &Object) -> JsResult<()> {
        let bytes = |key: &str| -> JsResult<Option<Vec<u8>>> {
            let value = Reflect::get(files, &key.into())?;
            if value.is_undefined() || value.is_null() {
                return Ok(None);
            }
            let bytes = value.dyn_into::<Uint8Array>().map_err(|_| {
                js_error(&Error::input(format!(
                    "`{key}` of {name} is not a Uint8Array; expected the bytes of the file"
                )))
            })?;
            Ok(Some(bytes.to_vec()))
        };
        let [config, log, summary, error] = [
            bytes("config")?,
            bytes("log")?,
            bytes("summary")?,
            bytes("error")?,
        ];
        let files = RunFiles {
            config: config.as_deref(),
            log: log.as_deref(),
            summary: summary.as_deref(),
            error: error.as_deref(),
        };
        let read = match files.kind() {
            RunKind::Encoder => Run::parse(name, &files).map(|run| self.runs.push(Arc::new(run))),
            RunKind::Agent => AgentRun::parse(name, &files).map(|run| self.agents.push(run)),
        };
        if let Err(why) = read {
            self.unread.push(why);
        }
        Ok(())
    }

    /// Says which checkpoints the training `name` has, by their CRC-32.
    #[wasm_bindgen(js_name = addCheckpoints)]
    pub fn add_checkpoints(&mut self, name: &str, best: Option<u32>, last: Option<u32>) {
        let Some(run) = self.runs.iter().find(|run| run.name == name) else {
            return;
        };
        for (crc32, weights) in [(best, Weights::Best), (last, Weights::Last)] {
            if let Some(crc32) = crc32 {
                self.agents.add_training(crc32, run, weights);
            }
        }
    }

    /// Adds a detector that was scored; without an architecture it is called what its name begins
    /// with.
    ///
    /// # Errors
    /// When `evaluation` is not one.
    #[wasm_bindgen(js_name = addEvaluation)]
    pub fn add_evaluation(
        &mut self,
        name: &str,
        evaluation: JsValue,
        architecture: Option<String>,
    ) -> JsResult<()> {
        let evaluation = serde_wasm_bindgen::from_value(evaluation)
            .map_err(|e| js_error(&Error::input(format!("the evaluation of {name}: {e}"))))?;
        self.runs
            .push(Arc::new(Run::scored(name, architecture, evaluation)));
        Ok(())
    }

    /// The runs by data set: the errors of one can be compared.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter, js_name = dataSets)]
    pub fn data_sets(&self) -> JsResult<JsValue> {
        let sets = data_sets(self.runs.clone());
        let described = sets.iter().map(|set| DataSet {
            reason: set.reason.as_deref(),
            objects: set.runs.first().map_or(&[][..], |run| &run.objects),
            trained: set.runs.iter().any(|run| run.config.is_some()),
            settings: differing(&set.runs),
            runs: set.runs.iter().map(|run| line(run)).collect(),
        });
        to_js(&described.collect::<Vec<_>>())
    }

    /// The runs of agents, which are compared beside every data set.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn agents(&self) -> JsResult<JsValue> {
        let lines = self.agents.runs().iter().map(|run| AgentLine {
            name: &run.name,
            state: &run.config.state,
            sees_by_checkpoint: run.config.checkpoint.is_some(),
            seed: run.config.seed,
            steps: run.evaluations.last().map_or(0, |last| last.step),
            incomplete: run.incomplete.as_deref(),
        });
        to_js(&lines.collect::<Vec<_>>())
    }

    /// Folders that cannot be read, with the reason.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn unread(&self) -> JsResult<JsValue> {
        to_js(&self.unread)
    }

    /// Compares the runs of one data set, and the agents.
    ///
    /// # Errors
    /// When an option is not understood, there is no such data set, or no run of it is complete.
    pub fn compare(&self, options: JsValue) -> JsResult<Compared> {
        let keys = ["dataSet", "thresholds", "groupBy", "resamples", "seed"];
        let options: CompareOptions = from_js(options, "the options of compare", &keys)?;
        let grouping: Grouping = match &options.group_by {
            Some(text) => text.parse().map_err(|e| js_error(&e))?,
            None => Grouping::default(),
        };
        let mut sets = data_sets(self.runs.clone());
        if options.data_set >= sets.len().max(1) {
            return Err(js_error(&Error::input(format!(
                "there is no data set {}; the runs are of {}",
                options.data_set,
                sets.len()
            ))));
        }
        let runs = match sets.is_empty() {
            true => Vec::new(),
            false => sets.swap_remove(options.data_set).runs,
        };
        let compared = || {
            let runs = Runs::new(
                runs,
                &self.agents,
                &thresholds(options.thresholds)?,
                &grouping,
            )?;
            let resamples = options.resamples.unwrap_or(RESAMPLES);
            let report = RunsReport::new(&runs, self.unread.clone(), resamples, options.seed)?;
            let figures = runs_figures(&runs, &report)?;
            Ok(Compared { report, figures })
        };
        compared().map_err(|e: Error| js_error(&e))
    }
}

/// The names of the settings in which runs differ, but for the architecture.
fn differing(runs: &[Arc<Run>]) -> Vec<String> {
    let all: Vec<Vec<(String, String)>> = runs.iter().map(|run| run.settings()).collect();
    let Some(first) = all.first() else {
        return Vec::new();
    };
    let names = all.iter().flatten().map(|(name, _)| name.as_str());
    let names: std::collections::BTreeSet<&str> =
        names.filter(|name| *name != "architecture").collect();
    let value = |settings: &[(String, String)], name: &str| {
        let found = settings.iter().find(|(key, _)| key == name);
        found.map(|(_, value)| value.clone())
    };
    let differs = |name: &&str| {
        all.iter()
            .any(|other| value(other, name) != value(first, name))
    };
    // Only what every run has can name its group.
    let shared = |name: &&str| all.iter().all(|other| value(other, name).is_some());
    names
        .into_iter()
        .filter(differs)
        .filter(shared)
        .map(str::to_owned)
        .collect()
}

fn line(run: &Run) -> RunLine<'_> {
    RunLine {
        name: &run.name,
        architecture: &run.architecture,
        seed: run.seed,
        epochs: run.epochs.len(),
        incomplete: run.incomplete.as_deref(),
    }
}

/// Compared runs: numbers, figures, and files of them.
#[wasm_bindgen]
pub struct Compared {
    report: RunsReport,
    figures: Vec<Figure>,
}

#[wasm_bindgen]
impl Compared {
    /// All numbers (schema `tracklens/report/1`).
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn report(&self) -> JsResult<JsValue> {
        to_js(&self.report)
    }

    /// The tables, as every output shows them.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn tables(&self) -> JsResult<JsValue> {
        to_js(&runs_tables(&self.report))
    }

    /// The figures as SVG documents, with their captions.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn figures(&self) -> JsResult<JsValue> {
        to_js(&self.figures)
    }

    /// Everything as one self-contained HTML document.
    #[wasm_bindgen(js_name = toHtml)]
    pub fn to_html(&self) -> String {
        runs_page(&self.report, &self.figures)
    }

    /// The tables as Markdown.
    #[wasm_bindgen(js_name = toMarkdown)]
    pub fn to_markdown(&self) -> String {
        runs_markdown(&self.report, &self.figures)
    }

    /// One line a run.
    #[wasm_bindgen(js_name = runsCsv)]
    pub fn runs_csv(&self) -> String {
        runs_csv(&self.report)
    }

    /// One line a group and object.
    #[wasm_bindgen(js_name = errorsCsv)]
    pub fn errors_csv(&self) -> String {
        errors_csv(&self.report)
    }

    /// One line an agent.
    #[wasm_bindgen(js_name = agentsCsv)]
    pub fn agents_csv(&self) -> String {
        agents_csv(&self.report)
    }

    /// One line a group of agents and step.
    #[wasm_bindgen(js_name = successCsv)]
    pub fn success_csv(&self) -> String {
        success_csv(&self.report)
    }
}
