//! What a run records: `config.json`, `log.jsonl` and `summary.json`.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::TrainConfig;
use crate::device::Adapter;
use crate::error::Error;
use crate::evaluation::EvaluationReport;

/// The parts of the loss.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Losses {
    /// What is minimised: reconstruction + weight * velocity.
    pub total: f64,
    /// The mean squared error of the reconstructions.
    pub reconstruction: f64,
    /// The mean squared change of the keypoints' velocity, before it is weighted.
    pub velocity: f64,
}

impl Losses {
    /// The total of `reconstruction` and `velocity` with its weight, and the two.
    pub fn new(reconstruction: f64, velocity: f64, velocity_weight: f64) -> Self {
        Self {
            total: reconstruction + velocity_weight * velocity,
            reconstruction,
            velocity,
        }
    }
}

/// `config.json`: everything that a run depends on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunConfig {
    /// The version that trained.
    pub version: String,
    /// The commit that was built; null when it was not built from a repository.
    pub git_hash: Option<String>,
    /// Version of burn.
    pub burn: String,
    /// Architecture and operating system of the machine.
    pub target: String,
    /// Threads of the training.
    pub threads: usize,
    /// The GPU; left out on the CPU.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adapter: Option<Adapter>,
    /// How it trained.
    #[serde(flatten)]
    pub train: TrainConfig,
    /// The `[width, height]` that frames are resized to.
    pub input_size: [usize; 2],
    /// The objects of the ground truth, in the order of every table.
    pub objects: Vec<String>,
    /// Names of the sequences that it trained on.
    pub training_sequences: Vec<String>,
    /// Names of the sequences that the metric of every epoch is computed on.
    pub validation_sequences: Vec<String>,
}

/// One line of `log.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EpochLog {
    /// Counted from 1.
    pub epoch: u32,
    /// Wall time of the epoch, training and validation.
    pub seconds: f64,
    /// Means over the steps.
    pub training: Losses,
    /// On the validation sequences.
    pub validation: Losses,
    /// Tracking capability on the validation sequences (affine map, fitted and scored on the same
    /// frames).
    pub tc: f64,
    /// Tracking error there of the best keypoint, by the map (`identity`, `scale-translate`,
    /// `affine`) and the object; null when the object is visible nowhere.
    pub errors: BTreeMap<String, BTreeMap<String, Option<f64>>>,
}

/// The result of a training; `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrainSummary {
    /// The version that trained.
    pub version: String,
    /// Whether it was cancelled before its last epoch.
    pub interrupted: bool,
    /// Whole epochs done.
    pub epochs: u32,
    /// The epoch with the lowest validation loss: `checkpoint_best.safetensors`.
    pub best_epoch: u32,
    /// Wall time, over all parts of a resumed run.
    pub seconds: f64,
    /// The last epoch: `checkpoint_final.safetensors`.
    pub last: Option<EpochLog>,
    /// The metric of the last epoch in full.
    pub evaluation: Option<EvaluationReport>,
}

/// The records of a `log.jsonl` (epochs, or an agent's evaluations) up to the first line that cannot
/// be read, and what is wrong with that line. A run that ends while it writes leaves such a line.
pub fn read_log<T: DeserializeOwned>(bytes: &[u8]) -> (Vec<T>, Option<Error>) {
    let mut records = Vec::new();
    for (i, line) in bytes.split(|b| *b == b'\n').enumerate() {
        if line.is_empty() {
            continue;
        }
        match serde_json::from_slice(line) {
            Ok(record) => records.push(record),
            Err(e) => return (records, Some(Error::input(format!("line {}: {e}", i + 1)))),
        }
    }
    (records, None)
}
