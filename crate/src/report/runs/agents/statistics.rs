//! Statistics of agents: success over steps and at the end, and beside the tracking of their
//! encoders.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::Serialize;

use super::encoders::{Agent, AgentGroup, AnyEncoder, Encoder};
use crate::error::Result;
use crate::metric::stats::{rank_correlation, smooth, trimmed_mean};
use crate::report::runs::draws::{Draws, SMOOTHING, mean};
use crate::report::runs::grouping::by_settings;

/// The statistics of agents, a part of [`RunsReport`](super::super::RunsReport).
///
/// Success is the share of an evaluation's episodes that are solved, smoothed over the evaluations
/// of its run. Aggregates over runs are interquartile means, as rliable has them.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AgentsReport {
    /// Standard deviation of the Gaussian that success is smoothed by, in evaluations.
    pub smoothing: f64,
    /// The groups, the one with the highest success at the end first.
    pub groups: Vec<AgentGroupReport>,
    /// The objects whose errors are known of the encoders.
    pub objects: Vec<String>,
    /// Their thresholds.
    pub thresholds: Vec<f64>,
    /// The encoders, once for each setting of the agents that see by them.
    pub encoders: Vec<EncoderReport>,
    /// How far the order of the encoders by their tracking is that by success.
    pub correlations: Vec<CorrelationReport>,
}

/// One group of an [`AgentsReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AgentGroupReport {
    /// Its name.
    pub name: String,
    /// What the agents see; null where it is not the same for all.
    pub state: Option<String>,
    /// The architecture of their encoders; null without one, or where it is not the same for all.
    pub architecture: Option<String>,
    /// The task; null where it is not the same for all.
    pub task: Option<String>,
    /// Complete runs, which all statistics are over.
    pub complete: usize,
    /// The others.
    pub incomplete: Vec<IncompleteAgent>,
    /// The last step at which all of them were evaluated.
    pub steps: u64,
    /// Mean TC of the encoders of the runs; null where it is not known.
    pub tc: Option<f64>,
    /// Success over steps.
    pub curve: Vec<SuccessPoint>,
    /// Success at the end: the last point of the curve.
    pub success: Option<f64>,
    /// 95 % interval of the success at the end.
    pub success_interval: Option<[f64; 2]>,
    /// Interquartile mean of the runs' mean success over their evaluations, which is higher for
    /// agents that learn earlier.
    pub mean_success: Option<f64>,
    /// Its 95 % interval.
    pub mean_success_interval: Option<[f64; 2]>,
    /// The runs that count.
    pub runs: Vec<AgentReport>,
}

/// The success of a group at a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SuccessPoint {
    /// Steps of the environments together.
    pub step: u64,
    /// Interquartile mean over the runs.
    pub iqm: f64,
    /// 95 % interval, by a bootstrap that is stratified by task; null of a single run.
    pub interval: Option<[f64; 2]>,
}

/// One run of an [`AgentGroupReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AgentReport {
    /// Its folder.
    pub name: String,
    /// Its task.
    pub task: String,
    /// What it sees.
    pub state: String,
    /// The checkpoint that it sees by; null without one.
    pub encoder: Option<String>,
    /// Its seed.
    pub seed: u64,
    /// TC of its encoder; null where it is not known.
    pub tc: Option<f64>,
    /// Steps done.
    pub steps: u64,
    /// Success at the end.
    pub success: f64,
    /// Success in the last evaluation alone, without smoothing.
    pub last_success: f64,
    /// Mean success over its evaluations.
    pub mean_success: f64,
}

/// A run of an [`AgentGroupReport`] that does not count.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct IncompleteAgent {
    /// Its folder.
    pub name: String,
    /// Its seed.
    pub seed: u64,
    /// Steps up to its last evaluation.
    pub steps: u64,
    /// Why it does not count.
    pub reason: String,
}

/// One encoder of an [`AgentsReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct EncoderReport {
    /// Its checkpoint.
    pub name: String,
    /// CRC-32 of the checkpoint.
    pub crc32: u32,
    /// What the agents have in common that see by it: the state, and settings that tell it from
    /// others.
    pub setting: String,
    /// Complete runs.
    pub runs: usize,
    /// Its TC; null where it is not known.
    pub tc: Option<f64>,
    /// Its tracking errors, in the order of the objects.
    pub errors: Vec<Option<f64>>,
    /// Which of them are at most the threshold of their object.
    pub tracked: Vec<bool>,
    /// Interquartile mean of the runs' success at the end.
    pub success: f64,
    /// Its 95 % interval; null of a single run.
    pub success_interval: Option<[f64; 2]>,
}

/// The order of encoders by a measure of tracking, and that by success.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CorrelationReport {
    /// What the agents have in common.
    pub setting: String,
    /// The object whose tracking error it is; null for TC.
    pub object: Option<String>,
    /// Encoders of which both are known.
    pub encoders: usize,
    /// Spearman's rank correlation; null where the encoders are fewer than three or have no order.
    pub rho: Option<f64>,
    /// 95 % interval by a bootstrap over encoders; a draw without an order counts as 0.
    pub interval: Option<[f64; 2]>,
    /// Pairs of encoders that track differently well.
    pub pairs: usize,
    /// Those in which the one that tracks better has the higher success.
    pub in_order: usize,
}

impl AgentsReport {
    /// The statistics of groups of agents.
    ///
    /// # Errors
    /// When a statistic cannot be computed.
    pub(in crate::report::runs) fn new(groups: &[AgentGroup], draws: Draws) -> Result<Self> {
        let complete = || groups.iter().flat_map(AgentGroup::complete);
        let (mut objects, mut thresholds) = (Vec::new(), Vec::new());
        for encoder in complete().filter_map(|agent| agent.encoder.as_ref()) {
            for (object, _) in &encoder.errors {
                if !objects.contains(&object.name) {
                    objects.push(object.name.clone());
                    thresholds.push(object.threshold);
                }
            }
        }
        let encoders = encoders(complete(), &objects, draws)?;
        let reports = groups
            .iter()
            .map(|group| AgentGroupReport::new(group, draws));
        let mut reports: Vec<AgentGroupReport> = reports.collect::<Result<_>>()?;
        reports.sort_by(|a, b| {
            let success = |group: &AgentGroupReport| group.success.unwrap_or(-1.0);
            success(b).total_cmp(&success(a))
        });
        Ok(Self {
            smoothing: SMOOTHING,
            groups: reports,
            correlations: correlations(&encoders, &objects, draws)?,
            objects,
            thresholds,
            encoders,
        })
    }

    /// The settings of agents with encoders, in the order in which they are shown.
    pub(in crate::report::runs) fn settings(&self) -> Vec<&str> {
        settings(&self.encoders)
    }

    /// Cautions about the agents.
    pub(in crate::report::runs) fn notes(&self) -> Vec<String> {
        let mut unknown: Vec<&str> = self
            .encoders
            .iter()
            .filter(|encoder| encoder.tc.is_none())
            .map(|encoder| encoder.name.as_str())
            .collect();
        unknown.sort_unstable();
        unknown.dedup();
        if unknown.is_empty() {
            return Vec::new();
        }
        vec![format!(
            "how well {} tracks is not known; add the run folder of its training, or give its \
             evaluation (--evaluation)",
            unknown.join(", ")
        )]
    }
}

/// The success of one run.
struct Curve {
    steps: Vec<u64>,
    /// Smoothed.
    success: Vec<f64>,
}

impl Curve {
    fn new(agent: &Agent) -> Result<Self> {
        let evaluations = &agent.run.evaluations;
        let success: Vec<f64> = evaluations.iter().map(|e| e.success).collect();
        // Sums of shares may come to a little more than 1.
        let smoothed = smooth(&success, SMOOTHING)?.into_iter();
        Ok(Self {
            steps: evaluations.iter().map(|e| e.step).collect(),
            success: smoothed.map(|share| share.clamp(0.0, 1.0)).collect(),
        })
    }

    fn at(&self, step: u64) -> Option<f64> {
        let at = self.steps.binary_search(&step).ok()?;
        Some(self.success[at])
    }

    fn end(&self) -> f64 {
        self.success.last().copied().unwrap_or(0.0)
    }
}

impl AgentGroupReport {
    fn new(group: &AgentGroup, draws: Draws) -> Result<Self> {
        let agents: Vec<&Arc<Agent>> = group.complete().collect();
        let curves = agents.iter().map(|agent| Curve::new(agent));
        let curves: Vec<Curve> = curves.collect::<Result<_>>()?;
        let by_task = |values: &[f64]| {
            let mut strata: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
            for (agent, value) in agents.iter().zip(values) {
                let stratum = strata.entry(&agent.run.config.task).or_default();
                stratum.push(*value);
            }
            strata.into_values().collect::<Vec<_>>()
        };
        let aggregate = |values: &[f64]| {
            let interval = draws.stratified(&by_task(values), trimmed_mean)?;
            Ok((trimmed_mean(values)?, interval))
        };
        let mut curve: Vec<SuccessPoint> = Vec::new();
        for &step in curves.first().map_or(&[][..], |curve| &curve.steps) {
            let values: Option<Vec<f64>> = curves.iter().map(|curve| curve.at(step)).collect();
            if let Some(values) = values {
                let (iqm, interval) = aggregate(&values)?;
                curve.push(SuccessPoint {
                    step,
                    iqm,
                    interval,
                });
            }
        }
        let runs: Vec<AgentReport> = agents
            .iter()
            .zip(&curves)
            .map(|(agent, curve)| AgentReport::new(agent, curve))
            .collect();
        let means: Vec<f64> = runs.iter().map(|run| run.mean_success).collect();
        let means = (!means.is_empty()).then(|| aggregate(&means)).transpose()?;
        let tcs: Option<Vec<f64>> = runs.iter().map(|run| run.tc).collect();
        let all = || group.agents.iter();
        Ok(Self {
            name: group.name.clone(),
            state: shared(all().map(|agent| Some(agent.run.config.state.clone()))),
            architecture: shared(
                all().map(|agent| Some(agent.encoder.as_ref()?.architecture.clone())),
            ),
            task: shared(all().map(|agent| Some(agent.run.config.task.clone()))),
            complete: runs.len(),
            incomplete: all()
                .filter_map(|agent| IncompleteAgent::new(agent))
                .collect(),
            steps: curve.last().map_or(0, |point| point.step),
            tc: tcs.and_then(|tcs| mean(&tcs)),
            success: curve.last().map(|point| point.iqm),
            success_interval: curve.last().and_then(|point| point.interval),
            curve,
            mean_success: means.map(|(iqm, _)| iqm),
            mean_success_interval: means.and_then(|(_, interval)| interval),
            runs,
        })
    }
}

/// The value that all have.
fn shared(mut values: impl Iterator<Item = Option<String>>) -> Option<String> {
    let first = values.next()?;
    values.all(|value| value == first).then_some(first)?
}

impl AgentReport {
    fn new(agent: &Agent, curve: &Curve) -> Self {
        let (run, encoder) = (&agent.run, agent.encoder.as_ref());
        let success: Vec<f64> = run.evaluations.iter().map(|e| e.success).collect();
        Self {
            name: run.name.clone(),
            task: run.config.task.clone(),
            state: run.config.state.clone(),
            encoder: encoder.map(|encoder| encoder.name.clone()),
            seed: run.config.seed,
            tc: encoder.and_then(Encoder::tc),
            steps: curve.steps.last().copied().unwrap_or(0),
            success: curve.end(),
            last_success: success.last().copied().unwrap_or(0.0),
            mean_success: mean(&success).unwrap_or(0.0),
        }
    }
}

impl IncompleteAgent {
    fn new(agent: &Agent) -> Option<Self> {
        let run = &agent.run;
        Some(Self {
            name: run.name.clone(),
            seed: run.config.seed,
            steps: run.evaluations.last().map_or(0, |last| last.step),
            reason: run.incomplete.clone()?,
        })
    }
}

/// The encoders of complete runs, by setting and then as they track.
fn encoders<'a>(
    agents: impl Iterator<Item = &'a Arc<Agent>>,
    objects: &[String],
    draws: Draws,
) -> Result<Vec<EncoderReport>> {
    let seeing = agents.filter(|agent| agent.encoder.is_some());
    let seeing = seeing.map(|agent| AnyEncoder(Arc::clone(agent))).collect();
    let mut reports = Vec::new();
    for (setting, agents) in by_settings::<AnyEncoder>(seeing) {
        let mut by_encoder: BTreeMap<u32, (&Encoder, Vec<f64>)> = BTreeMap::new();
        for AnyEncoder(agent) in &agents {
            let Some(encoder) = &agent.encoder else {
                continue;
            };
            let known = by_encoder
                .entry(encoder.crc32)
                .or_insert((encoder, Vec::new()));
            known.1.push(Curve::new(agent)?.end());
        }
        let start = reports.len();
        for (encoder, success) in by_encoder.into_values() {
            let error = |object: &String| {
                let found = encoder
                    .errors
                    .iter()
                    .find(|(known, _)| known.name == *object);
                found.and_then(|(known, error)| Some((known.threshold, (*error)?)))
            };
            let errors: Vec<Option<(f64, f64)>> = objects.iter().map(error).collect();
            let is_tracked = |(threshold, error): (f64, f64)| error <= threshold;
            reports.push(EncoderReport {
                name: encoder.name.clone(),
                crc32: encoder.crc32,
                setting: setting.clone(),
                runs: success.len(),
                tc: encoder.tc(),
                tracked: errors.iter().map(|e| e.is_some_and(is_tracked)).collect(),
                errors: errors.iter().map(|e| e.map(|(_, error)| error)).collect(),
                success: trimmed_mean(&success)?,
                success_interval: draws.interval(&success, trimmed_mean)?,
            });
        }
        reports[start..].sort_by(|a, b| {
            let tc = |encoder: &EncoderReport| encoder.tc.unwrap_or(-1.0);
            tc(b)
                .total_cmp(&tc(a))
                .then(b.success.total_cmp(&a.success))
        });
    }
    Ok(reports)
}

/// The settings of encoders, which are sorted by them.
fn settings(encoders: &[EncoderReport]) -> Vec<&str> {
    let mut settings: Vec<&str> = encoders.iter().map(|e| e.setting.as_str()).collect();
    settings.dedup();
    settings
}

/// TC and the errors of every object beside success, for every setting.
fn correlations(
    encoders: &[EncoderReport],
    objects: &[String],
    draws: Draws,
) -> Result<Vec<CorrelationReport>> {
    let mut reports = Vec::new();
    for setting in settings(encoders) {
        for object in std::iter::once(None).chain((0..objects.len()).map(Some)) {
            let points = encoders.iter().filter(|encoder| encoder.setting == setting);
            let points = points.filter_map(|encoder| {
                let tracking = object.map_or(encoder.tc, |k| encoder.errors[k]);
                Some([tracking?, encoder.success])
            });
            let points: Vec<[f64; 2]> = points.collect();
            let object = object.map(|k| objects[k].clone());
            reports.push(CorrelationReport::new(setting, object, &points, draws)?);
        }
    }
    Ok(reports)
}

impl CorrelationReport {
    /// Of the tracking and the success of encoders.
    fn new(
        setting: &str,
        object: Option<String>,
        points: &[[f64; 2]],
        draws: Draws,
    ) -> Result<Self> {
        let rho = |places: &[f64]| {
            let axis = |i: usize| places.iter().map(move |at| points[*at as usize][i]);
            rank_correlation(&axis(0).collect::<Vec<_>>(), &axis(1).collect::<Vec<_>>())
        };
        let places: Vec<f64> = (0..points.len()).map(|at| at as f64).collect();
        let enough = points.len() >= 3;
        let found = enough.then(|| rho(&places)).transpose()?.flatten();
        let drawn = |places: &[f64]| Ok(rho(places)?.unwrap_or(0.0));
        let interval = found.map(|_| draws.interval(&places, drawn)).transpose()?;
        let better = |a: &[f64; 2], b: &[f64; 2]| match object {
            None => a[0] > b[0],
            Some(_) => a[0] < b[0],
        };
        let pairs = || {
            let all = points
                .iter()
                .flat_map(|a| points.iter().map(move |b| (a, b)));
            all.filter(|(a, b)| better(a, b))
        };
        Ok(Self {
            setting: setting.to_owned(),
            encoders: points.len(),
            rho: found,
            interval: interval.flatten(),
            pairs: pairs().count(),
            in_order: pairs().filter(|(a, b)| a[1] > b[1]).count(),
            object,
        })
    }
}
