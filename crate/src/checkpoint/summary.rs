//! What a checkpoint is, in few words.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

use super::{Checkpoint, SaeConfig};

/// What a checkpoint is; the JSON of `tracklens inspect`.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// `tracklens/checkpoint/1`.
    pub schema: &'static str,
    /// The name of the architecture, as [`SaeConfig::name`].
    pub name: String,
    /// Every size.
    pub config: SaeConfig,
    /// Trained numbers.
    pub parameters: Parameters,
    /// Numbers that are tracked but not trained: the means and variances of batch norms.
    pub buffers: usize,
    /// The epoch after which it was saved, as the file counts.
    pub epoch: Option<u64>,
    /// How it was trained, as far as the file tells.
    pub training: Training,
    /// Tensors that the architecture does not have.
    pub other_tensors: Vec<String>,
    /// Everything the file says about itself.
    pub metadata: BTreeMap<String, String>,
}

/// Numbers of trained numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Parameters {
    /// Those of the encoder.
    pub encoder: usize,
    /// Those of the decoder; 0 when the file holds the encoder alone.
    pub decoder: usize,
}

/// How a checkpoint was trained; `None` is what the file does not tell.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Training {
    /// Epochs that were planned.
    pub epochs: Option<u64>,
    /// Snippets a step.
    pub batch: Option<u64>,
    /// Adam's learning rate.
    pub learning_rate: Option<f64>,
    /// The weight of the velocity loss.
    pub velocity_weight: Option<f64>,
    /// Standard deviation of the noise on the encoder's input.
    pub noise: Option<f64>,
    /// The seed: of everything for a training of `tracklens`, of the split for one of the authors'
    /// code.
    pub seed: Option<u64>,
}

impl Checkpoint {
    /// What the checkpoint is.
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
                (Some(training), _) => Training::ours(&training, &self.config),
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
    fn ours(training: &Value, config: &SaeConfig) -> Self {
        Self {
            epochs: training["epochs"].as_u64(),
            batch: training["batch"].as_u64(),
            learning_rate: training["learning_rate"].as_f64(),
            velocity_weight: Some(config.architecture.velocity_weight()),
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
