//! Agents with what is known of their encoders.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::run::AgentRun;
use crate::error::Result;
use crate::evaluation::{EvaluationReport, Thresholds};
use crate::metric::Object;
use crate::report::runs::grouping::{Grouping, Member, Settings, grouped, has_setting};
use crate::report::runs::run::{Run, family};
use crate::run::{AgentEncoder, CHECKPOINT_BEST, CHECKPOINT_FINAL};

/// Tracking errors by object; `None` where it was visible nowhere.
type Errors = Vec<(String, Option<f64>)>;
/// The name of the group that a training belongs to, if it is in one.
type Family<'a> = &'a dyn Fn(&Arc<Run>) -> Option<String>;

/// A checkpoint in the folder of a training.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weights {
    /// Of the epoch with the lowest validation loss.
    Best,
    /// Of the last epoch.
    Last,
}

/// Runs of agents, and what is known of the encoders that they see by.
#[derive(Debug, Clone, Default)]
pub struct Agents {
    runs: Vec<Arc<AgentRun>>,
    /// By the CRC-32 of the checkpoint.
    trained: BTreeMap<u32, (Arc<Run>, Weights)>,
    scored: BTreeMap<u32, Errors>,
}

/// An agent and its encoder.
#[derive(Debug, Clone)]
pub struct Agent {
    /// Its run.
    pub run: Arc<AgentRun>,
    /// What it sees by; `None` for states without keypoints.
    pub encoder: Option<Encoder>,
}

/// What is known of an encoder.
#[derive(Debug, Clone, PartialEq)]
pub struct Encoder {
    /// CRC-32 of its checkpoint.
    pub crc32: u32,
    /// Its checkpoint.
    pub name: String,
    /// The group that its training belongs to; otherwise what its path begins with.
    pub family: String,
    /// Its architecture, or, where that is not known, its family.
    pub architecture: String,
    /// The objects with its tracking errors; empty where they are not known.
    pub errors: Vec<(Object, Option<f64>)>,
}

/// Agents of one group.
#[derive(Debug, Clone)]
pub struct AgentGroup {
    /// Its name; by settings the state with the family of the encoder.
    pub name: String,
    /// The agents, complete ones first.
    pub agents: Vec<Arc<Agent>>,
}

impl AgentGroup {
    /// The agents whose runs are complete.
    pub fn complete(&self) -> impl Iterator<Item = &Arc<Agent>> + Clone {
        let is_complete = |agent: &&Arc<Agent>| agent.run.incomplete.is_none();
        self.agents.iter().filter(is_complete)
    }
}

impl Agents {
    /// Adds a run.
    pub fn push(&mut self, run: AgentRun) {
        self.runs.push(Arc::new(run));
    }

    /// The runs.
    pub fn runs(&self) -> &[Arc<AgentRun>] {
        &self.runs
    }

    /// CRC-32 of every checkpoint that an agent sees by.
    pub fn checkpoints(&self) -> BTreeSet<u32> {
        let checkpoint = |run: &Arc<AgentRun>| Some(run.config.checkpoint?.crc32);
        self.runs.iter().filter_map(checkpoint).collect()
    }

    /// Says that the checkpoint of this CRC-32 is of a training.
    pub fn add_training(&mut self, crc32: u32, run: &Arc<Run>, weights: Weights) {
        self.trained.insert(crc32, (Arc::clone(run), weights));
    }

    /// Says how well the encoder tracks whose checkpoint has this CRC-32.
    pub fn add_evaluation(&mut self, crc32: u32, evaluation: &EvaluationReport) {
        let errors = evaluation.objects.iter();
        let errors = errors.map(|object| (object.name.clone(), object.error));
        self.scored.insert(crc32, errors.collect());
    }

    /// The objects whose errors are known of an encoder.
    pub(in crate::report::runs) fn objects(&self) -> Vec<String> {
        let errors = self.runs.iter().filter_map(|run| self.errors(run));
        errors
            .max_by_key(Vec::len)
            .into_iter()
            .flatten()
            .map(|(name, _)| name)
            .collect()
    }

    /// Whether the agents can be grouped in this way.
    pub(in crate::report::runs) fn have_setting(&self, grouping: &Grouping) -> bool {
        let agents = self.resolved(&|_| None, &Thresholds::default());
        has_setting(&agents, grouping)
    }

    /// The agents in groups, by name, where `family` names the group of a training. Those without
    /// the setting that is to be grouped by are grouped by all settings, if other runs have it.
    ///
    /// # Errors
    /// When nothing has the setting.
    pub(in crate::report::runs) fn grouped(
        &self,
        family: Family<'_>,
        thresholds: &Thresholds,
        grouping: &Grouping,
        others_can: bool,
    ) -> Result<Vec<AgentGroup>> {
        let mut agents = self.resolved(family, thresholds);
        agents.sort_by(|a, b| {
            let key = |agent: &Agent| (agent.run.incomplete.is_some(), agent.run.config.seed);
            (key(a), &a.run.name).cmp(&(key(b), &b.run.name))
        });
        let grouping = match others_can && !has_setting(&agents, grouping) {
            true => &Grouping::Settings,
            false => grouping,
        };
        let groups = grouped(agents, grouping)?.into_iter();
        Ok(groups
            .map(|(name, agents)| AgentGroup { name, agents })
            .collect())
    }

    /// The errors of a run's encoder, as far as they are known: those that the run records, then
    /// those that were given, then those of its training.
    fn errors(&self, run: &AgentRun) -> Option<Errors> {
        let crc32 = run.config.checkpoint?.crc32;
        let recorded = run
            .config
            .encoder
            .as_ref()
            .and_then(|e| e.evaluation.as_ref());
        if let Some(recorded) = recorded {
            let objects = recorded.objects.iter();
            return Some(objects.map(|o| (o.name.clone(), o.error)).collect());
        }
        let trained = || {
            let (run, weights) = self.trained.get(&crc32)?;
            let epoch = match weights {
                Weights::Last => run.epochs.last(),
                Weights::Best => run.epochs.get(run.best_epoch?.checked_sub(1)? as usize),
            }?;
            let errors = epoch.errors.iter().copied();
            Some(run.objects.iter().cloned().zip(errors).collect())
        };
        self.scored.get(&crc32).cloned().or_else(trained)
    }

    /// The agents with their encoders.
    fn resolved(&self, family: Family<'_>, thresholds: &Thresholds) -> Vec<Arc<Agent>> {
        let encoder = |run: &Arc<AgentRun>| {
            let crc32 = run.config.checkpoint?.crc32;
            let errors = self.errors(run).unwrap_or_default().into_iter();
            let errors = errors.map(|(name, error)| {
                let threshold = thresholds.of(&name);
                (Object::new(name, threshold), error)
            });
            let named = match self.trained.get(&crc32) {
                Some((training, weights)) => Named::trained(training, *weights, family(training)),
                None => Named::recorded(run),
            };
            Some(Encoder {
                crc32,
                name: named.name,
                family: named.family,
                architecture: named.architecture,
                errors: errors.collect(),
            })
        };
        let mut agents: Vec<Agent> = self
            .runs
            .iter()
            .map(|run| Agent {
                run: Arc::clone(run),
                encoder: encoder(run),
            })
            .collect();
        self.tell_apart(&mut agents);
        agents.into_iter().map(Arc::new).collect()
    }

    /// Adds the CRC-32 to the families of encoders that only their paths are known of, where one
    /// name stands for several.
    fn tell_apart(&self, agents: &mut [Agent]) {
        let mut families: BTreeMap<String, BTreeSet<u32>> = BTreeMap::new();
        for encoder in agents.iter().filter_map(|agent| agent.encoder.as_ref()) {
            let known = families.entry(encoder.family.clone()).or_default();
            known.insert(encoder.crc32);
        }
        for encoder in agents.iter_mut().filter_map(|agent| agent.encoder.as_mut()) {
            let is_trained = self.trained.contains_key(&encoder.crc32);
            if !is_trained && families[&encoder.family].len() > 1 {
                encoder.family += &format!(" {:08x}", encoder.crc32);
            }
        }
    }
}

/// What an encoder is called.
struct Named {
    name: String,
    family: String,
    architecture: String,
}

impl Named {
    /// By the training that made it.
    fn trained(run: &Run, weights: Weights, family: Option<String>) -> Self {
        let file = match weights {
            Weights::Best => CHECKPOINT_BEST,
            Weights::Last => CHECKPOINT_FINAL,
        };
        Self {
            name: format!("{}/{file}", run.name),
            family: family.unwrap_or_else(|| run.architecture.clone()),
            architecture: run.architecture.clone(),
        }
    }

    /// By what the run of an agent records.
    fn recorded(run: &AgentRun) -> Self {
        let config = &run.config;
        let file = || config.checkpoint_file.clone().unwrap_or_default();
        let path = |encoder: &AgentEncoder| encoder.path.clone();
        let name = config.encoder.as_ref().map_or_else(file, path);
        let family = family(&name);
        let architecture = config.encoder.as_ref().and_then(|e| e.architecture.clone());
        Self {
            architecture: architecture.unwrap_or_else(|| family.clone()),
            name,
            family,
        }
    }
}

impl Encoder {
    /// The share of the objects that it tracks; `None` where that is not known.
    pub fn tc(&self) -> Option<f64> {
        let is_tracked = |(object, error): &&(Object, Option<f64>)| {
            error.is_some_and(|error| error <= object.threshold)
        };
        let tracked = self.errors.iter().filter(is_tracked).count();
        (!self.errors.is_empty()).then(|| tracked as f64 / self.errors.len() as f64)
    }
}

impl Member for Arc<Agent> {
    fn name(&self) -> &str {
        &self.run.name
    }

    fn kind(&self) -> String {
        named(
            &self.run.config.state,
            self.encoder.as_ref().map(|e| &e.family),
        )
    }

    fn architecture(&self) -> String {
        named(
            &self.run.config.state,
            self.encoder.as_ref().map(|e| &e.architecture),
        )
    }

    fn settings(&self) -> Settings {
        self.run.settings()
    }
}

/// `basic-vel-std-bg, keypoints+robot`, or the state alone.
fn named(state: &str, encoder: Option<&String>) -> String {
    encoder.map_or_else(|| state.to_owned(), |encoder| format!("{encoder}, {state}"))
}

/// Agents that differ in their encoders at most belong together.
pub(super) struct AnyEncoder(pub Arc<Agent>);

impl Member for AnyEncoder {
    fn name(&self) -> &str {
        &self.0.run.name
    }

    fn kind(&self) -> String {
        self.0.run.config.state.clone()
    }

    fn architecture(&self) -> String {
        self.kind()
    }

    fn settings(&self) -> Settings {
        self.0.run.settings()
    }
}
