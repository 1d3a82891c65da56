//! One step of training.

use std::collections::BTreeMap;

use burn::optim::{AdamConfig, GradientsParams, ModuleOptimizer};
use burn::prelude::{Device, Module, Tensor, TensorData};

use super::SNIPPET;
use crate::checkpoint::{Checkpoint, SaeConfig};
use crate::error::{Error, Result};
use crate::model::{Sae, SaeOutput};

/// PyTorch's default; burn's is 1e-5, which is far from negligible against the small gradients here.
const ADAM_EPSILON: f32 = 1e-8;

/// An SAE with its optimizer.
pub struct Trainer {
    config: SaeConfig,
    sae: Sae,
    optimizer: ModuleOptimizer,
    learning_rate: f64,
    device: Device,
}

/// The parts of the loss.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Losses {
    /// What is minimised: reconstruction + weight * velocity.
    pub total: f64,
    /// The mean squared error of the reconstructions.
    pub reconstruction: f64,
    /// The mean squared change of the keypoints' velocity, before it is weighted.
    pub velocity: f64,
}

impl Trainer {
    /// A trainer that starts from the weights of `checkpoint`, on burn's CPU device.
    ///
    /// # Errors
    /// As [`Sae::from_checkpoint`].
    pub fn new(checkpoint: &Checkpoint, learning_rate: f64) -> Result<Self> {
        let device = Device::flex().autodiff();
        Ok(Self {
            config: checkpoint.config.clone(),
            sae: Sae::from_checkpoint(checkpoint, &device)?,
            optimizer: AdamConfig::new().with_epsilon(ADAM_EPSILON).init(),
            learning_rate,
            device,
        })
    }

    /// One step of Adam on a batch of snippets.
    ///
    /// # Shapes
    /// - `inputs`: (B * 3) x 3 x height x width of `input_size`, the frames of a snippet one after the other
    /// - `targets`: (B * 3) x 3 x height x width of the configured target size
    ///
    /// # Errors
    /// When the number of values does not fit, or the loss is not finite (the weights are not changed then).
    pub fn step(&mut self, inputs: Vec<f32>, targets: Vec<f32>, input_size: [usize; 2]) -> Result<Losses> {
        let inputs = images(inputs, input_size, &self.device)?;
        let targets = images(targets, self.config.target_size, &self.device)?;
        let (loss, losses) = self.losses(&self.sae.forward(inputs), targets)?;
        if !losses.total.is_finite() {
            return Err(Error::numeric(format!("the loss is {}", losses.total)));
        }
        let gradients = GradientsParams::from_grads(loss.backward(), &self.sae);
        self.sae = self
            .optimizer
            .step(self.learning_rate, self.sae.clone(), gradients);
        Ok(losses)
    }

    /// The SAE for inference, with the running statistics of batch norm.
    pub fn valid(&self) -> Sae {
        self.sae.valid()
    }

    /// The weights as a checkpoint with `metadata`.
    ///
    /// # Errors
    /// When the device does not give the values back.
    pub fn checkpoint(&self, metadata: BTreeMap<String, String>) -> Result<Checkpoint> {
        self.sae.to_checkpoint(&self.config, metadata)
    }

    /// The losses of what `sae` makes of the frames of whole snippets, without training.
    ///
    /// # Errors
    /// When the number of values does not fit.
    pub fn evaluate(
        &self,
        sae: &Sae,
        inputs: Vec<f32>,
        targets: Vec<f32>,
        input_size: [usize; 2],
    ) -> Result<(SaeOutput, Losses)> {
        let device = Device::flex();
        let output = sae.forward(images(inputs, input_size, &device)?);
        let targets = images(targets, self.config.target_size, &device)?;
        let (_, losses) = self.losses(&output, targets)?;
        Ok((output, losses))
    }

    fn losses(&self, output: &SaeOutput, targets: Tensor<4>) -> Result<(Tensor<1>, Losses)> {
        let [frames, keypoints, _] = output.latent.dims();
        if targets.dims() != output.reconstruction.dims() || frames % SNIPPET != 0 {
            return Err(Error::input(format!(
                "targets of shape {:?} for reconstructions of shape {:?}; expected the same, and whole snippets of \
                 {SNIPPET} frames",
                targets.dims(),
                output.reconstruction.dims()
            )));
        }
        let reconstruction = (output.reconstruction.clone() - targets).square().mean();
        let points = output
            .latent
            .clone()
            .reshape([frames / SNIPPET, SNIPPET, keypoints * 2]);
        let at = |t: usize| points.clone().narrow(1, t, 1);
        let velocity = (at(2) - at(1) * 2.0 + at(0)).square().mean();
        let weight = self.config.architecture.velocity_weight();
        let total = if weight > 0.0 {
            reconstruction.clone() + velocity.clone() * weight
        } else {
            reconstruction.clone()
        };
        let value = |t: &Tensor<1>| f64::from(t.clone().into_scalar::<f32>());
        let losses = Losses {
            total: value(&total),
            reconstruction: value(&reconstruction),
            velocity: value(&velocity),
        };
        Ok((total, losses))
    }
}

fn images(values: Vec<f32>, [width, height]: [usize; 2], device: &Device) -> Result<Tensor<4>> {
    let count = values.len() / (3 * width * height);
    if count == 0 || values.len() != count * 3 * width * height {
        return Err(Error::input(format!(
            "{} values are no whole number of images of 3 x {height} x {width}",
            values.len()
        )));
    }
    Ok(Tensor::from_data(
        TensorData::new(values, [count, 3, height, width]),
        device,
    ))
}
