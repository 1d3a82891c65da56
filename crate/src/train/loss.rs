use burn::prelude::Tensor;
use serde::{Deserialize, Serialize};

use super::SNIPPET;
use crate::model::SaeOutput;

/// The loss of a batch of snippets, on the device.
#[derive(Debug, Clone)]
pub struct SnippetLoss {
    /// What is minimised, reconstruction + weight * velocity: `[1]`.
    pub total: Tensor<1>,
    /// Squared error of the reconstruction, mean over frames, channels and pixels: `[1]`.
    pub reconstruction: Tensor<1>,
    /// Squared change of the points' velocity, mean over snippets, points and axes: `[1]`.
    pub velocity: Tensor<1>,
}

/// The loss as numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Losses {
    /// What is minimised, reconstruction + weight * velocity.
    pub total: f64,
    /// Squared error of the reconstruction, mean over frames, channels and pixels (values in [0, 1]).
    pub reconstruction: f64,
    /// Squared change of the points' velocity, mean over snippets, points and axes (latent units), without its weight.
    pub velocity: f64,
}

impl SnippetLoss {
    /// The loss of S snippets of three frames.
    ///
    /// The velocity loss is the mean squared difference between the two successive velocities of a snippet
    /// (paper, appendix, "Modifications": `g_slow`).
    ///
    /// # Shapes
    /// - `output`: of `3 S` frames, the frames of a snippet in a row
    /// - `targets`: `[3 S, 3, h, w]`
    pub fn new(output: SaeOutput, targets: Tensor<4>, velocity_weight: f64) -> Self {
        let reconstruction = (output.reconstruction - targets).square().mean();
        let [frames, points, _] = output.latent.dims();
        let latent = output.latent.reshape([frames / SNIPPET, SNIPPET, points * 2]);
        let frame = |i: usize| latent.clone().narrow(1, i, 1);
        let change = frame(2) - frame(1) * 2.0 + frame(0);
        let velocity = change.square().mean();
        let total = if velocity_weight == 0.0 {
            reconstruction.clone()
        } else {
            reconstruction.clone() + velocity.clone() * velocity_weight
        };
        Self { total, reconstruction, velocity }
    }

    /// Reads the numbers back from the device.
    pub fn losses(&self) -> Losses {
        let read = |value: &Tensor<1>| f64::from(value.clone().into_scalar::<f32>());
        Losses {
            total: read(&self.total),
            reconstruction: read(&self.reconstruction),
            velocity: read(&self.velocity),
        }
    }
}

impl Losses {
    /// Adds `weight` times `other`.
    pub(super) fn add(&mut self, other: &Self, weight: f64) {
        self.total += weight * other.total;
        self.reconstruction += weight * other.reconstruction;
        self.velocity += weight * other.velocity;
    }
}
