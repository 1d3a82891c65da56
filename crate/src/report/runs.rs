//! Runs by what their folders hold, and what many of them come to.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::error::{Error, Result};
use crate::metric::Transform;
use crate::metric::stats::{
    Sample, probability_of_improvement, quantile_window_mean, stratified_interval, trimmed_mean,
};
use crate::train::{EpochLog, RunConfig, TrainSummary, read_log};

/// The share of resamples between the ends of an interval.
const LEVEL: f64 = 0.95;

/// One run.
#[derive(Debug, Clone)]
pub struct Run {
    /// What it is called: its folder.
    pub name: String,
    /// How it trained.
    pub config: RunConfig,
    /// Its epochs, as far as the log can be read.
    pub epochs: Vec<EpochLog>,
    /// Why it does not count; `None` for a complete run.
    pub incomplete: Option<String>,
}

impl Run {
    /// A run from the bytes of its `config.json`, `log.jsonl` and `summary.json`, the last one where it is there. A log that
    /// is cut is read up to the break; the run is incomplete then.
    ///
    /// # Errors
    /// When the configuration or the summary is not what a run writes.
    pub fn parse(name: &str, config: &[u8], log: &[u8], summary: Option<&[u8]>) -> Result<Self> {
        let wrong =
            |file: &str, e: &serde_json::Error| Error::input(e.to_string()).at(format!("{name}/{file}"));
        let config: RunConfig = serde_json::from_slice(config).map_err(|e| wrong("config.json", &e))?;
        let summary: Option<TrainSummary> = summary
            .map(serde_json::from_slice)
            .transpose()
            .map_err(|e| wrong("summary.json", &e))?;
        let (epochs, broken) = read_log(log);
        let planned = config.train.epochs;
        let incomplete = match (broken, summary) {
            (Some(error), _) => Some(format!(
                "its log breaks off ({error}), after epoch {}",
                epochs.len()
            )),
            (None, Some(summary)) if !summary.interrupted && epochs.len() as u32 >= planned => None,
            _ => Some(format!("it stopped after epoch {} of {planned}", epochs.len())),
        };
        Ok(Self {
            name: name.to_owned(),
            config,
            epochs,
            incomplete,
        })
    }

    /// The affine tracking error of an object at the end; `None` where it was visible in no frame.
    pub fn error(&self, object: &str) -> Option<f64> {
        self.epochs.last().and_then(|epoch| error(epoch, object))
    }
}

/// The affine tracking error of an object in an epoch; `None` where it was visible in no frame.
pub(super) fn error(epoch: &EpochLog, object: &str) -> Option<f64> {
    epoch
        .errors
        .get(Transform::Affine.name())?
        .get(object)
        .copied()
        .flatten()
}

/// Runs that differ in their seed alone.
#[derive(Debug, Clone)]
pub struct Group {
    /// The architecture; with what else tells it from another group, where there are several of one.
    pub name: String,
    /// The runs, complete ones first.
    pub runs: Vec<Run>,
}

impl Group {
    /// The complete runs.
    pub fn complete(&self) -> impl Iterator<Item = &Run> + Clone {
        self.runs.iter().filter(|run| run.incomplete.is_none())
    }
}

/// Runs in groups, and the objects that all of them have.
#[derive(Debug, Clone)]
pub struct Runs {
    /// The objects with their thresholds.
    pub objects: Vec<(String, f64)>,
    /// The groups, by name.
    pub groups: Vec<Group>,
}

impl Runs {
    /// Puts runs that differ in their seed alone into groups.
    ///
    /// # Errors
    /// When there is no complete run, or runs are of different objects or numbers of sequences: these are not the same data
    /// set, and their errors cannot be compared.
    pub fn new(mut runs: Vec<Run>, threshold: impl Fn(&str) -> f64) -> Result<Self> {
        if let Some(first) = runs.first() {
            let data = |run: &Run| {
                let config = &run.config;
                let sequences = (config.training_sequences.len(), config.validation_sequences.len());
                (config.objects.clone(), sequences)
            };
            let of_first = data(first);
            if let Some(other) = runs.iter().find(|run| data(run) != of_first) {
                let describe = |run: &Run| {
                    let (objects, (training, validation)) = data(run);
                    format!(
                        "{} ({}; {training} + {validation} sequences)",
                        run.name,
                        objects.join(", ")
                    )
                };
                return Err(Error::mismatch(format!(
                    "the runs are of different data sets: {} and {}; report on them one by one",
                    describe(first),
                    describe(other)
                )));
            }
        }
        if !runs.iter().any(|run| run.incomplete.is_none()) {
            let why: Vec<String> = runs
                .iter()
                .take(3)
                .filter_map(|run| Some(format!("{}: {}", run.name, run.incomplete.as_ref()?)))
                .collect();
            return Err(Error::numeric(match why.is_empty() {
                true => "there is no run; expected folders that `tracklens train` wrote, or folders with such folders"
                    .to_owned(),
                false => format!(
                    "none of the {} runs is complete ({}); finish them with --resume",
                    runs.len(),
                    why.join("; ")
                ),
            }));
        }
        runs.sort_by(|a, b| {
            (a.incomplete.is_some(), a.config.train.seed, &a.name).cmp(&(
                b.incomplete.is_some(),
                b.config.train.seed,
                &b.name,
            ))
        });
        let objects = runs[0].config.objects.iter();
        let objects = objects.map(|name| (name.clone(), threshold(name))).collect();
        let mut groups: BTreeMap<String, Vec<Group>> = BTreeMap::new();
        for run in runs {
            let name = run.config.train.sae.name();
            let alike = groups.entry(name.clone()).or_default();
            match alike
                .iter_mut()
                .find(|group| settings(&group.runs[0]) == settings(&run))
            {
                Some(group) => group.runs.push(run),
                None => alike.push(Group {
                    name,
                    runs: vec![run],
                }),
            }
        }
        let mut all: Vec<Group> = Vec::new();
        for (name, mut alike) in groups {
            if alike.len() > 1 {
                let described: Vec<Vec<(String, String)>> =
                    alike.iter().map(|group| describe(&group.runs[0])).collect();
                for (group, own) in alike.iter_mut().zip(&described) {
                    let differs = |at: &usize| described.iter().any(|other| other.get(*at) != own.get(*at));
                    let told = (0..own.len())
                        .filter(differs)
                        .map(|at| format!("{} {}", own[at].0, own[at].1));
                    group.name = format!("{name} ({})", told.collect::<Vec<_>>().join(", "));
                }
            }
            all.extend(alike);
        }
        all.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(Self { objects, groups: all })
    }
}

/// What runs of one group have in common.
fn settings(run: &Run) -> (String, crate::train::TrainConfig) {
    let mut train = run.config.train.clone();
    train.seed = 0;
    (run.config.version.clone(), train)
}

/// The settings of a run with their values, all runs' in the same order.
fn describe(run: &Run) -> Vec<(String, String)> {
    let (version, train) = settings(run);
    let mut flat = vec![("version".to_owned(), version)];
    let value = serde_json::to_value(&train).unwrap_or_default();
    for (key, value) in value.as_object().into_iter().flatten() {
        match value.as_object() {
            Some(inner) => flat.extend(inner.iter().map(|(key, value)| (key.clone(), value.to_string()))),
            None => flat.push((key.clone(), value.to_string())),
        }
    }
    flat
}

/// Everything that the tables and figures say (schema `tracklens/report/1`).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunsReport {
    /// `tracklens/report/1`.
    pub schema: String,
    /// The version that computed it.
    pub version: String,
    /// What the intervals are.
    pub intervals: String,
    /// The groups, by name.
    pub groups: Vec<GroupReport>,
    /// Of each object, how probable it is that a run of one group has a lower error than one of another.
    pub improvement: Vec<ImprovementReport>,
}

/// One group of a [`RunsReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GroupReport {
    /// Its name.
    pub name: String,
    /// Complete runs; all numbers are over these.
    pub complete: usize,
    /// The others, with the reason.
    pub incomplete: Vec<String>,
    /// Epochs of the complete runs.
    pub epochs: u32,
    /// Mean TC over the runs, and its interval; null without a complete run.
    pub tc: Option<f64>,
    /// 95 % interval of the mean TC.
    pub tc_interval: Option<[f64; 2]>,
    /// The objects.
    pub objects: Vec<ObjectRunsReport>,
    /// The runs that count.
    pub runs: Vec<RunReport>,
}

/// One run of a [`GroupReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunReport {
    /// Its folder.
    pub name: String,
    /// Its seed.
    pub seed: u64,
    /// TC at the end, with the thresholds of the report.
    pub tc: f64,
    /// Tracking errors at the end, in the order of the objects.
    pub errors: Vec<Option<f64>>,
    /// Validation reconstruction loss at the end.
    pub reconstruction: f64,
}

/// One object of a [`GroupReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ObjectRunsReport {
    /// Its name.
    pub name: String,
    /// Its threshold.
    pub threshold: f64,
    /// Runs in which it was visible.
    pub count: usize,
    /// TC_k: the share of runs that track it.
    pub tc: Option<f64>,
    /// 95 % interval of TC_k.
    pub tc_interval: Option<[f64; 2]>,
    /// Mean of the tracking errors.
    pub mean: Option<f64>,
    /// Their variance, with one less than their number below.
    pub variance: Option<f64>,
    /// Minimum, lower quartile, median, upper quartile, maximum.
    pub quartiles: Option<[f64; 5]>,
    /// Interquartile mean as rliable has it: trimmed by a quarter on both sides.
    pub iqm_trimmed: Option<f64>,
    /// Interquartile mean between the quartiles.
    pub iqm_window: Option<f64>,
    /// 95 % interval of the trimmed interquartile mean.
    pub iqm_interval: Option<[f64; 2]>,
}

/// One object and two groups of a [`RunsReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImprovementReport {
    /// The object.
    pub object: String,
    /// The group that is asked about.
    pub group: String,
    /// The group that it is compared with.
    pub over: String,
    /// The probability that a run of `group` has a lower error than one of `over`.
    pub probability: f64,
}

impl RunsReport {
    /// The statistics of `runs`, with intervals of `resamples` draws.
    ///
    /// # Errors
    /// When an error in a log is not a number.
    pub fn new(runs: &Runs, resamples: usize, seed: u64) -> Result<Self> {
        let groups: Vec<GroupReport> = runs
            .groups
            .iter()
            .map(|group| GroupReport::new(group, &runs.objects, resamples, seed))
            .collect::<Result<_>>()?;
        let mut improvement = Vec::new();
        for (k, (object, _)) in runs.objects.iter().enumerate() {
            let errors = |group: &GroupReport| {
                group
                    .runs
                    .iter()
                    .filter_map(|run| run.errors[k])
                    .collect::<Vec<f64>>()
            };
            for group in &groups {
                for over in groups.iter().filter(|over| over.name != group.name) {
                    let (a, b) = (errors(group), errors(over));
                    if a.is_empty() || b.is_empty() {
                        continue;
                    }
                    improvement.push(ImprovementReport {
                        object: object.clone(),
                        group: group.name.clone(),
                        over: over.name.clone(),
                        probability: probability_of_improvement(&a, &b)?,
                    });
                }
            }
        }
        Ok(Self {
            schema: "tracklens/report/1".to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            intervals: format!("95 % percentile bootstrap over runs, {resamples} resamples, seed {seed}"),
            groups,
            improvement,
        })
    }
}

impl GroupReport {
    fn new(group: &Group, objects: &[(String, f64)], resamples: usize, seed: u64) -> Result<Self> {
        let runs: Vec<RunReport> = group
            .complete()
            .map(|run| {
                let errors: Vec<Option<f64>> = objects.iter().map(|(name, _)| run.error(name)).collect();
                let tracked = errors
                    .iter()
                    .zip(objects)
                    .filter(|(e, (_, threshold))| e.is_some_and(|e| e <= *threshold));
                RunReport {
                    name: run.name.clone(),
                    seed: run.config.train.seed,
                    tc: tracked.count() as f64 / objects.len().max(1) as f64,
                    reconstruction: run
                        .epochs
                        .last()
                        .map_or(f64::NAN, |e| e.validation.reconstruction),
                    errors,
                }
            })
            .collect();
        let mean = |values: &[f64]| -> Option<f64> {
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        // Of one value there is no interval.
        let interval = |values: &[f64],
                        statistic: &dyn Fn(&[f64]) -> Result<f64>|
         -> Result<Option<[f64; 2]>> {
            let strata = [values.to_vec()];
            (values.len() > 1)
                .then(|| stratified_interval(&strata, resamples, LEVEL, seed, |drawn| statistic(&drawn[0])))
                .transpose()
        };
        let average = |values: &[f64]| Ok(mean(values).unwrap_or(f64::NAN));
        let capabilities: Vec<f64> = runs.iter().map(|run| run.tc).collect();
        let mut reports = Vec::new();
        for (k, (name, threshold)) in objects.iter().enumerate() {
            let errors: Vec<f64> = runs.iter().filter_map(|run| run.errors[k]).collect();
            let tracked: Vec<f64> = errors
                .iter()
                .map(|e| f64::from(u8::from(e <= threshold)))
                .collect();
            let sample = (!errors.is_empty()).then(|| Sample::of(&errors)).transpose()?;
            reports.push(ObjectRunsReport {
                name: name.clone(),
                threshold: *threshold,
                count: errors.len(),
                tc: mean(&tracked),
                tc_interval: interval(&tracked, &average)?,
                mean: sample.map(|s| s.mean),
                variance: sample.map(|s| s.variance).filter(|v| v.is_finite()),
                quartiles: sample.map(|s| s.quartiles),
                iqm_trimmed: sample.map(|_| trimmed_mean(&errors)).transpose()?,
                iqm_window: sample.map(|_| quantile_window_mean(&errors)).transpose()?,
                iqm_interval: interval(&errors, &trimmed_mean)?,
            });
        }
        Ok(Self {
            name: group.name.clone(),
            complete: runs.len(),
            incomplete: group
                .runs
                .iter()
                .filter_map(|run| Some(format!("{}: {}", run.name, run.incomplete.as_ref()?)))
                .collect(),
            epochs: group
                .complete()
                .map(|run| run.epochs.len() as u32)
                .max()
                .unwrap_or(0),
            tc: mean(&capabilities),
            tc_interval: interval(&capabilities, &average)?,
            objects: reports,
            runs,
        })
    }

    /// How an object fares.
    pub fn object(&self, name: &str) -> Option<&ObjectRunsReport> {
        self.objects.iter().find(|object| object.name == name)
    }
}
