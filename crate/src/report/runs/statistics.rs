//! Statistics of many runs.

use std::sync::Arc;

use serde::Serialize;

use super::agents::{AgentGroupReport, AgentsReport};
use super::draws::{Draws, average, mean};
use super::group::{Group, Runs};
use super::reference::ReferenceReport;
use super::run::{Run, Unread};
use crate::error::Result;
use crate::metric::Object;
use crate::metric::stats::{
    Sample, probability_of_improvement, quantile_window_mean, trimmed_mean,
};

/// All values in the tables and figures (schema `tracklens/report/1`).
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RunsReport {
    /// `tracklens/report/1`.
    pub schema: String,
    /// The version that computed it.
    pub version: String,
    /// What the intervals are.
    pub intervals: String,
    /// The groups, by name.
    pub groups: Vec<GroupReport>,
    /// The probability, for each object, that a run of one group has a lower error than one of
    /// another.
    pub improvement: Vec<ImprovementReport>,
    /// The agents, where there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub agents: Option<AgentsReport>,
    /// Run folders that cannot be read; they belong to no group.
    pub unread: Vec<Unread>,
    /// Cautions about comparing the groups.
    pub notes: Vec<String>,
    /// How the runs compare with published numbers, where these were given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<ReferenceReport>,
}

/// One group of a [`RunsReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct GroupReport {
    /// Its name.
    pub name: String,
    /// Complete runs, which all statistics are over.
    pub complete: usize,
    /// The others.
    pub incomplete: Vec<IncompleteRun>,
    /// Epochs of the complete runs.
    pub epochs: u32,
    /// The size that frames are resized to, e.g. `64 x 64`; null where it is not known or not the
    /// same for all.
    pub input: Option<String>,
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
#[non_exhaustive]
pub struct RunReport {
    /// Its folder.
    pub name: String,
    /// The architecture.
    pub architecture: String,
    /// Its seed; null where it is not known.
    pub seed: Option<u64>,
    /// Whole epochs; 0 for a detector that was scored as it is.
    pub epochs: usize,
    /// TC at the end, with the thresholds of the report.
    pub tc: f64,
    /// Tracking errors at the end, in the order of the objects.
    pub errors: Vec<Option<f64>>,
    /// Validation reconstruction loss at the end; null for a detector that was scored as it is.
    pub reconstruction: Option<f64>,
}

/// A run of a [`GroupReport`] that does not count.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IncompleteRun {
    /// Its folder.
    pub name: String,
    /// Its seed.
    pub seed: Option<u64>,
    /// Whole epochs in its log.
    pub epochs: usize,
    /// Why it does not count.
    pub reason: String,
}

/// One object of a [`GroupReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
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
    /// Their variance, with n - 1 in the denominator.
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
    /// The statistics of `runs`, with intervals of `resamples` draws; `unread` is listed with
    /// them.
    ///
    /// # Errors
    /// When an error in a log is not a number.
    pub fn new(runs: &Runs, unread: Vec<Unread>, resamples: usize, seed: u64) -> Result<Self> {
        let draws = Draws { resamples, seed };
        let groups = runs.groups.iter();
        let groups: Vec<GroupReport> = groups
            .map(|group| GroupReport::new(group, &runs.objects, draws))
            .collect::<Result<_>>()?;
        let agents = (!runs.agents.is_empty()).then(|| AgentsReport::new(&runs.agents, draws));
        let agents = agents.transpose()?;
        let mut notes = notes(runs);
        notes.extend(agents.iter().flat_map(AgentsReport::notes));
        let mut improvement = Vec::new();
        for (k, object) in runs.objects.iter().enumerate() {
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
                        object: object.name.clone(),
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
            intervals: format!(
                "95 % percentile bootstrap over runs, {resamples} resamples, seed {seed}"
            ),
            groups,
            improvement,
            agents,
            unread,
            notes,
            reference: None,
        })
    }

    /// The objects, as the first group has them.
    pub fn objects(&self) -> &[ObjectRunsReport] {
        self.groups.first().map_or(&[], |group| &group.objects)
    }

    /// The number of complete runs.
    pub fn complete(&self) -> usize {
        let agents = self.agent_groups().iter().map(|group| group.complete);
        agents.chain(self.groups.iter().map(|g| g.complete)).sum()
    }

    /// The groups of agents.
    pub fn agent_groups(&self) -> &[AgentGroupReport] {
        self.agents.as_ref().map_or(&[], |agents| &agents.groups)
    }

    /// Whether a group has more than one run. Otherwise statistics over runs say nothing that the
    /// errors do not.
    pub fn has_spread(&self) -> bool {
        self.groups.iter().any(|group| group.complete > 1)
    }

    /// The names of runs that do not count, with the reason.
    pub fn not_counted(&self) -> impl Iterator<Item = (&str, &str)> {
        let incomplete = self.groups.iter().flat_map(|group| &group.incomplete);
        let agents = self.agent_groups().iter();
        let agents = agents.flat_map(|group| &group.incomplete);
        incomplete
            .map(|run| (run.name.as_str(), run.reason.as_str()))
            .chain(agents.map(|run| (run.name.as_str(), run.reason.as_str())))
            .chain(
                self.unread
                    .iter()
                    .map(|run| (run.name.as_str(), run.reason.as_str())),
            )
    }
}

/// What the frames of a group are resized to.
fn input(group: &Group) -> Option<String> {
    let size = |run: &Run| Some(run.config.as_ref()?.input_size);
    let mut sizes = group.complete().map(size);
    let first = sizes.next().flatten()?;
    let same = sizes.all(|size| size == Some(first));
    same.then(|| first.map(|side| side.to_string()).join(" x "))
}

/// Differences that groups by settings do not show, or that other groups hide.
fn notes(runs: &Runs) -> Vec<String> {
    let mut notes = Vec::new();
    for group in &runs.groups {
        let values = |of: &dyn Fn(&Run) -> Option<String>| {
            let mut values: Vec<String> = group.complete().filter_map(of).collect();
            values.sort();
            values.dedup();
            values
        };
        let builds = values(&|run| {
            let config = run.config.as_ref()?;
            let commit = config.git_hash.as_deref().unwrap_or("of no commit");
            Some(format!(
                "{} ({})",
                config.version,
                commit.get(..8).unwrap_or(commit)
            ))
        });
        let lengths = values(&|run| (!run.epochs.is_empty()).then(|| run.epochs.len().to_string()));
        let devices = values(&|run| {
            let config = run.config.as_ref()?;
            Some(
                config
                    .adapter
                    .as_ref()
                    .map_or_else(|| "CPU".to_owned(), |adapter| adapter.name.clone()),
            )
        });
        for (what, values) in [
            ("builds", builds),
            ("numbers of epochs", lengths),
            ("devices", devices),
        ] {
            if values.len() > 1 {
                notes.push(format!(
                    "{} has runs of different {what}: {}",
                    group.name,
                    values.join(", ")
                ));
            }
        }
    }
    notes
}

impl ObjectRunsReport {
    /// Whether a run with this error tracks the object.
    pub(super) fn is_tracked(&self, error: Option<f64>) -> bool {
        error.is_some_and(|error| error <= self.threshold)
    }
}

impl RunReport {
    fn new(run: &Run, objects: &[Object]) -> Self {
        let errors: Vec<Option<f64>> = objects.iter().map(|o| run.error(&o.name)).collect();
        let tracked = errors
            .iter()
            .zip(objects)
            .filter(|(error, object)| error.is_some_and(|error| error <= object.threshold));
        Self {
            name: run.name.clone(),
            architecture: run.architecture.clone(),
            seed: run.seed,
            epochs: run.epochs.len(),
            tc: tracked.count() as f64 / objects.len().max(1) as f64,
            reconstruction: run.epochs.last().map(|e| e.reconstruction),
            errors,
        }
    }
}

impl ObjectRunsReport {
    /// The statistics of `errors`, one a run in which the object was visible.
    fn new(object: &Object, errors: &[f64], draws: Draws) -> Result<Self> {
        let tracked: Vec<f64> = errors
            .iter()
            .map(|e| f64::from(u8::from(*e <= object.threshold)))
            .collect();
        let sample = (!errors.is_empty())
            .then(|| Sample::of(errors))
            .transpose()?;
        Ok(Self {
            name: object.name.clone(),
            threshold: object.threshold,
            count: errors.len(),
            tc: mean(&tracked),
            tc_interval: draws.interval(&tracked, average)?,
            mean: sample.map(|s| s.mean),
            variance: sample.map(|s| s.variance).filter(|v| v.is_finite()),
            quartiles: sample.map(|s| s.quartiles),
            iqm_trimmed: sample.map(|_| trimmed_mean(errors)).transpose()?,
            iqm_window: sample.map(|_| quantile_window_mean(errors)).transpose()?,
            iqm_interval: draws.interval(errors, trimmed_mean)?,
        })
    }
}

impl GroupReport {
    fn new(group: &Group, objects: &[Object], draws: Draws) -> Result<Self> {
        let runs: Vec<RunReport> = group
            .complete()
            .map(|run| RunReport::new(run, objects))
            .collect();
        let capabilities: Vec<f64> = runs.iter().map(|run| run.tc).collect();
        let object = |(k, object): (usize, &Object)| {
            let errors: Vec<f64> = runs.iter().filter_map(|run| run.errors[k]).collect();
            ObjectRunsReport::new(object, &errors, draws)
        };
        let incomplete = |run: &Arc<Run>| {
            Some(IncompleteRun {
                name: run.name.clone(),
                seed: run.seed,
                epochs: run.epochs.len(),
                reason: run.incomplete.clone()?,
            })
        };
        let epochs = group.complete().map(|run| run.epochs.len() as u32);
        Ok(Self {
            name: group.name.clone(),
            complete: runs.len(),
            incomplete: group.runs.iter().filter_map(incomplete).collect(),
            input: input(group),
            epochs: epochs.max().unwrap_or(0),
            tc: mean(&capabilities),
            tc_interval: draws.interval(&capabilities, average)?,
            objects: objects
                .iter()
                .enumerate()
                .map(object)
                .collect::<Result<_>>()?,
            runs,
        })
    }

    /// The errors of its one run, with the objects.
    pub(super) fn only_errors(&self) -> impl Iterator<Item = (Option<f64>, &ObjectRunsReport)> {
        let errors = self.runs.first().map(|run| run.errors.as_slice());
        let error = move |k: usize| errors.and_then(|errors| errors.get(k).copied().flatten());
        self.objects
            .iter()
            .enumerate()
            .map(move |(k, object)| (error(k), object))
    }

    /// The statistics of an object.
    pub fn object(&self, name: &str) -> Option<&ObjectRunsReport> {
        self.objects.iter().find(|object| object.name == name)
    }
}
