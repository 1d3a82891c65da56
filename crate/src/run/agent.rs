//! What a run of an agent records, as `tools/rl` writes it.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;

/// What the schema of an agent's configuration begins with.
pub(super) const AGENT_SCHEMA: &str = "tracklens/rl-run/";

/// `config.json` of an agent: what the run depends on.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct AgentConfig {
    /// `tracklens/rl-run/1`.
    pub schema: String,
    /// What is to be done: `push` or `reach`.
    pub task: String,
    /// `sparse` or `dense`.
    pub reward: String,
    /// What the agent sees: `keypoints`, `keypoints+robot`, `points`, `points+robot` or `full`.
    pub state: String,
    /// Seeds everything random.
    pub seed: u64,
    /// Steps of the environments together that it is to have.
    pub steps: u64,
    /// The encoder's checkpoint; null for states without keypoints.
    pub checkpoint: Option<AgentCheckpoint>,
    /// The name of its file.
    pub checkpoint_file: Option<String>,
    /// What is known of the encoder; runs of older versions have none.
    #[serde(default)]
    pub encoder: Option<AgentEncoder>,
    /// Every other setting.
    #[serde(flatten)]
    pub settings: BTreeMap<String, Value>,
}

/// The checkpoint that an agent sees by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub struct AgentCheckpoint {
    /// CRC-32 of the file.
    pub crc32: u32,
}

/// What an agent's configuration says of its encoder.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct AgentEncoder {
    /// The path of the checkpoint, as it was given.
    pub path: String,
    /// The name of the architecture; null where it is not an SAE.
    pub architecture: Option<String>,
    /// How well it tracks, where that was given (`--evaluation`).
    #[serde(default)]
    pub evaluation: Option<EncoderEvaluation>,
}

/// The part of an evaluation (`tracklens eval --json`) that a run of an agent keeps.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct EncoderEvaluation {
    /// The objects.
    pub objects: Vec<EncoderObject>,
}

/// One object of an [`EncoderEvaluation`].
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct EncoderObject {
    /// Its name.
    pub name: String,
    /// The tracking error of the best keypoint; null where it was visible nowhere.
    pub error: Option<f64>,
}

/// One line of an agent's `log.jsonl`: an evaluation.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct AgentEvaluation {
    /// Steps of the environments together before it.
    pub step: u64,
    /// The share of episodes that were solved.
    pub success: f64,
    /// The mean return of the episodes.
    #[serde(rename = "return")]
    pub mean_return: f64,
}

/// `summary.json` of an agent.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct AgentSummary {
    /// Whether it was cancelled before its last step.
    pub interrupted: bool,
    /// Steps done.
    pub steps: u64,
}
