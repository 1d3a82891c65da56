//! How to train.

use serde::{Deserialize, Serialize};

use crate::checkpoint::SaeConfig;
use crate::data::Split;
use crate::error::{Error, Result};

/// Everything that decides what a training computes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainConfig {
    /// The autoencoder.
    pub sae: SaeConfig,
    /// Passes over the training sequences.
    pub epochs: u32,
    /// Seeds weights, split, order and noise: the same seed gives the same weights on one machine.
    pub seed: u64,
    /// Snippets a step.
    pub batch: usize,
    /// Adam's learning rate.
    pub learning_rate: f64,
    /// Standard deviation of the noise on the encoder's input.
    pub noise: f32,
    /// Which sequences are for training and which for validation.
    pub split: Split,
}

impl TrainConfig {
    /// The paper's settings (appendix, table "Hyperparameters for SAE training"): 500 epochs, batches of 32, Adam with
    /// learning rate 0.001, noise 0.001; half of the sequences for training, a quarter for validation.
    pub fn new(sae: SaeConfig) -> Self {
        Self {
            sae,
            epochs: 500,
            seed: 0,
            batch: 32,
            learning_rate: 1e-3,
            noise: 1e-3,
            split: Split::Shares {
                training: 0.5,
                validation: 0.25,
            },
        }
    }

    /// Checks that every value makes sense.
    ///
    /// # Errors
    /// Names the value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        self.sae.validate()?;
        let wrong = |what: &str, value: &dyn std::fmt::Display, expected: &str| {
            Err(Error::input(format!("{what} is {value}; expected {expected}")))
        };
        if self.epochs == 0 {
            return wrong("the number of epochs", &0, "at least 1");
        }
        if self.batch == 0 {
            return wrong("the batch", &0, "at least 1 snippet");
        }
        if !(self.learning_rate.is_finite() && self.learning_rate > 0.0) {
            return wrong("the learning rate", &self.learning_rate, "a positive number");
        }
        if !(self.noise.is_finite() && self.noise >= 0.0) {
            return wrong("the noise", &self.noise, "0 or a positive number");
        }
        self.split.validate()
    }
}
