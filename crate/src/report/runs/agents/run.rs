//! One run of an agent, by what its folder holds.

use crate::report::runs::run::{Unread, config_of, failure, incomplete, read_json};
use crate::run::{AgentConfig, AgentEvaluation, AgentSummary, RunFiles, read_log};

/// One run of an agent.
#[derive(Debug, Clone)]
pub struct AgentRun {
    /// Its folder.
    pub name: String,
    /// What it depends on.
    pub config: AgentConfig,
    /// Its evaluations, as far as the log can be read.
    pub evaluations: Vec<AgentEvaluation>,
    /// Why it does not count; `None` for a complete run.
    pub incomplete: Option<String>,
}

impl AgentRun {
    /// A run from what its folder holds; see [`Run::parse`](super::super::Run::parse).
    ///
    /// # Errors
    /// When there is no configuration, the configuration or the summary is not what a run writes,
    /// or an evaluation is impossible.
    pub fn parse(name: &str, files: &RunFiles) -> Result<Self, Unread> {
        let config: AgentConfig = read_json(name, "config.json", config_of(name, files)?)?;
        let summary = files
            .summary
            .map(|bytes| read_json(name, "summary.json", bytes));
        let summary: Option<AgentSummary> = summary.transpose()?;
        let (evaluations, broken) = read_log(files.log.unwrap_or_default());
        check(&evaluations).map_err(|reason| Unread {
            name: name.to_owned(),
            reason,
        })?;
        let planned = config.steps;
        let whole = !evaluations.is_empty()
            && summary.is_some_and(|s| !s.interrupted && s.steps >= planned);
        let done = evaluations.last().map_or(0, |last| last.step);
        let so_far = format!("step {done} of {planned}");
        Ok(Self {
            name: name.to_owned(),
            incomplete: incomplete(broken, whole, failure(files), &so_far),
            config,
            evaluations,
        })
    }

    /// The settings that tell runs apart, but for the seed and the encoder, with their values.
    pub(super) fn settings(&self) -> Vec<(String, String)> {
        /// What decides no number.
        const ASIDE: [&str; 3] = ["versions", "target", "threads"];
        let config = &self.config;
        let own = [
            ("state", config.state.clone()),
            ("task", config.task.clone()),
            ("reward", config.reward.clone()),
            ("steps", config.steps.to_string()),
        ];
        let own = own.map(|(key, value)| (key.to_owned(), value));
        let more = config.settings.iter();
        let more = more.filter(|(key, value)| !ASIDE.contains(&key.as_str()) && !value.is_null());
        let more = more.map(|(key, value)| {
            let text = value.as_str().map(str::to_owned);
            (key.clone(), text.unwrap_or_else(|| value.to_string()))
        });
        own.into_iter().chain(more).collect()
    }
}

/// Says what is impossible about evaluations.
fn check(evaluations: &[AgentEvaluation]) -> Result<(), String> {
    for (i, evaluation) in evaluations.iter().enumerate() {
        let (line, success, step) = (i + 1, evaluation.success, evaluation.step);
        if !(0.0..=1.0).contains(&success) {
            return Err(format!(
                "log.jsonl, line {line}: the success is {success}; expected a share between 0 and 1"
            ));
        }
        if i > 0 && step <= evaluations[i - 1].step {
            return Err(format!(
                "log.jsonl, line {line}: step {step} does not come after the step before"
            ));
        }
    }
    Ok(())
}
