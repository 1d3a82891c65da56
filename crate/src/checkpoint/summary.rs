//! A summary of a checkpoint.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

use super::{Checkpoint, SaeConfig};

/// A summary of a checkpoint; the JSON of `tracklens inspect`.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// `tracklens/checkpoint/1`.
    pub schema: &'static str,
    /// The name of the architecture, as [`SaeConfig::name`].
    pub name: String,
    /// The architecture and all sizes.
    pub config: SaeConfig,
    /// Counts of trainable parameters.
    pub parameters: Parameters,
    /// Count of values that are tracked but not trained: means and variances of batch norms.
    pub buffers: usize,
    /// The epoch after which it was saved, as counted in the file.
    pub epoch: Option<u64>,
    /// How it was trained, as far as the file says.
    pub training: Training,
    /// Tensors that are not part of the architecture.
    pub other_tensors: Vec<String>,
    /// The metadata of the file.
    pub metadata: BTreeMap<String, String>,
}

/// Counts of trainable parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Parameters {
    /// Parameters of the encoder.
    pub encoder: usize,
    /// Parameters of the decoder; 0 when the file holds only an encoder.
    pub decoder: usize,
}

/// How a checkpoint was trained; `None` where the file does not say.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Training {
    /// Planned epochs.
    pub epochs: Option<u64>,
    /// Snippets per step.
    pub batch: Option<u64>,
    /// Adam's learning rate.
    pub learning_rate: Option<f64>,
    /// The weight of the velocity loss in training, which need not be that of the architecture.
    pub velocity_weight: Option<f64>,
    /// Standard deviation of the noise on the encoder's input.
    pub noise: Option<f64>,
    /// The seed: of everything in a training by `tracklens`, of the split in one by the authors'
    /// code.
    pub seed: Option<u64>,
}

impl Checkpoint {
    /// A summary of the checkpoint.
    pub fn summary(&self) -> Summary {
        let shapes = self.config.tensor_shapes();
        let is_buffer = |name: &str| name.contains(".running_");
        let count = |of: &dyn Fn(&str) -> bool| -> usize {
            let there = shapes
                .iter()
                .filter_map(|(name, _)| Some((name, self.tensors.get(name)?)));
            there
                .filter(|(name, _)| of(name))
                .map(|(_, tensor)| tensor.data.len())
                .sum()
        };
        let json = |key: &str| {
            self.metadata
                .get(key)
                .and_then(|json| serde_json::from_str::<Value>(json).ok())
        };
        let epoch = ["tracklens.epoch", "epoch"]
            .iter()
            .find_map(|key| self.metadata.get(*key));
        Summary {
            schema: "tracklens/checkpoint/1",
            name: self.config.name(),
            config: self.config.clone(),
            parameters: Parameters {
                encoder: count(&|name| name.starts_with("encoder.") && !is_buffer(name)),
                decoder: count(&|name| name.starts_with("decoder.") && !is_buffer(name)),
            },
            buffers: count(&is_buffer),
            epoch: epoch.and_then(|epoch| epoch.parse().ok()),
            training: match (json("tracklens.training"), json("cfg")) {
                (Some(training), _) => Training::ours(&training),
                (None, Some(cfg)) => Training::authors(&cfg),
                (None, None) => Training::default(),
            },
            other_tensors: {
                let known = |name: &&String| !shapes.iter().any(|(known, _)| known == *name);
                self.tensors.keys().filter(known).cloned().collect()
            },
            metadata: self.metadata.clone(),
        }
    }
}

impl Training {
    fn ours(training: &Value) -> Self {
        Self {
            epochs: training["epochs"].as_u64(),
            batch: training["batch"].as_u64(),
            learning_rate: training["learning_rate"].as_f64(),
            velocity_weight: training["velocity_weight"].as_f64(),
            noise: training["noise"].as_f64(),
            seed: training["seed"].as_u64(),
        }
    }

    fn authors(cfg: &Value) -> Self {
        let training = &cfg["training"];
        Self {
            epochs: training["epochs"].as_u64(),
            batch: training["batch_size"].as_u64(),
            learning_rate: training["learning_rate"].as_f64(),
            velocity_weight: training["loss_weights"]["velocity"].as_f64(),
            noise: training["noise_std"].as_f64(),
            seed: cfg["dataset"]["seed"].as_u64(),
        }
    }
}
