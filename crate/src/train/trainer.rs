//! One step of training.

use std::collections::BTreeMap;

use burn::optim::{GradientsParams, ModuleOptimizer};
use burn::prelude::{Device, Module, Tensor, TensorData};
use burn::tensor::Bytes;

use super::SNIPPET;
use super::optimizer::adam;
use crate::checkpoint::{self, Checkpoint, SaeConfig};
use crate::error::{Error, Result};
use crate::model::{Sae, SaeOutput, host_values};
use crate::run::Losses;

/// An SAE with its optimizer.
pub struct Trainer {
    config: SaeConfig,
    sae: Sae,
    optimizer: ModuleOptimizer,
    learning_rate: f64,
    encoder_learning_rate: Option<f64>,
    velocity_weight: f64,
    color_transform: Option<[[f64; 3]; 3]>,
    /// Without autodiff.
    device: Device,
}

impl Trainer {
    /// A trainer that starts from the weights of `checkpoint`, on burn's CPU device, with the
    /// velocity weight of its architecture.
    ///
    /// # Errors
    /// As [`Sae::from_checkpoint`].
    pub fn new(checkpoint: &Checkpoint, learning_rate: f64) -> Result<Self> {
        Self::on(&Device::flex(), checkpoint, learning_rate)
    }

    /// The same on any device of burn.
    ///
    /// # Errors
    /// As [`Sae::from_checkpoint`].
    pub fn on(device: &Device, checkpoint: &Checkpoint, learning_rate: f64) -> Result<Self> {
        Ok(Self {
            velocity_weight: checkpoint.config.architecture.velocity_weight(),
            color_transform: None,
            config: checkpoint.config.clone(),
            sae: Sae::from_checkpoint(checkpoint, &device.clone().autodiff())?,
            optimizer: adam(),
            learning_rate,
            encoder_learning_rate: None,
            device: device.clone(),
        })
    }

    /// The same with another weight of the velocity loss.
    pub fn with_velocity_weight(self, velocity_weight: f64) -> Self {
        Self {
            velocity_weight,
            ..self
        }
    }

    /// The same with another learning rate for the encoder.
    pub fn with_encoder_learning_rate(self, encoder_learning_rate: Option<f64>) -> Self {
        Self {
            encoder_learning_rate,
            ..self
        }
    }

    /// The same with errors of colours that are multiplied by a lower triangular matrix before they
    /// are squared.
    pub(super) fn with_color_transform(self, matrix: [[f64; 3]; 3]) -> Self {
        Self {
            color_transform: Some(matrix),
            ..self
        }
    }

    /// The architecture and sizes.
    pub fn config(&self) -> &SaeConfig {
        &self.config
    }

    /// The state of the optimizer, for [`Trainer::load_optimizer`].
    ///
    /// # Errors
    /// When the device does not give the values back.
    pub(super) fn optimizer_bytes(&self) -> Result<Vec<u8>> {
        let bytes = self.optimizer.into_bytes();
        bytes.map(|bytes| bytes.to_vec()).map_err(|e| {
            Error::numeric(format!(
                "the state of the optimizer cannot be stored: {e:?}"
            ))
        })
    }

    /// Goes on with the moments of Adam that [`Trainer::optimizer_bytes`] gave for the same
    /// architecture. burn panics on others, so the caller has to know that nothing changed them.
    ///
    /// # Errors
    /// When burn does not read them.
    pub(super) fn load_optimizer(&mut self, bytes: Vec<u8>) -> Result<()> {
        self.optimizer = adam()
            .from_bytes(Bytes::from_bytes_vec(bytes))
            .map_err(|e| Error::input(format!("the state of the optimizer is damaged: {e:?}")))?;
        Ok(())
    }

    /// One step of Adam on a batch of snippets.
    ///
    /// # Shapes
    /// - `inputs`: (B * 3) x 3 x height x width of `input_size`, the frames of a snippet one after
    ///   the other
    /// - `targets`: (B * 3) x 3 x height x width of the configured target size
    ///
    /// # Errors
    /// When the number of values does not fit, or the loss is not finite (the weights are not
    /// changed then).
    pub fn step(
        &mut self,
        inputs: Vec<f32>,
        targets: Vec<f32>,
        input_size: [usize; 2],
    ) -> Result<Losses> {
        let device = self.device.clone().autodiff();
        let inputs = images(inputs, input_size, &device)?;
        let targets = images(targets, self.config.target_size, &device)?;
        let (loss, losses) = self.losses(&self.sae.forward(inputs), targets)?;
        if !losses.total.is_finite() {
            return Err(Error::numeric(self.diagnose(&losses)));
        }
        let mut gradients = loss.backward();
        if let Some(rate) = self.encoder_learning_rate {
            // What is taken here is not there below: one step moves every weight once.
            let encoder = GradientsParams::from_module(&mut gradients, &self.sae.encoder);
            self.sae = self.optimizer.step(rate, self.sae.clone(), encoder);
        }
        let gradients = GradientsParams::from_grads(gradients, &self.sae);
        self.sae = self
            .optimizer
            .step(self.learning_rate, self.sae.clone(), gradients);
        Ok(losses)
    }

    /// The gradients of the total loss, by the names of the state dict, without a step; the batch
    /// enters the running statistics of batch norm all the same.
    ///
    /// # Errors
    /// When the number of values does not fit.
    pub fn gradients(
        &self,
        inputs: Vec<f32>,
        targets: Vec<f32>,
        input_size: [usize; 2],
    ) -> Result<BTreeMap<String, checkpoint::Tensor>> {
        let device = self.device.clone().autodiff();
        let inputs = images(inputs, input_size, &device)?;
        let targets = images(targets, self.config.target_size, &device)?;
        let (loss, _) = self.losses(&self.sae.forward(inputs), targets)?;
        self.sae.gradients(&loss.backward(), &self.config)
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

    /// What `sae` makes of frames, without training, and the mean squared error of each
    /// reconstruction.
    ///
    /// # Errors
    /// When the number of values does not fit.
    pub fn evaluate(
        &self,
        sae: &Sae,
        inputs: Vec<f32>,
        targets: Vec<f32>,
        input_size: [usize; 2],
    ) -> Result<(SaeOutput, Vec<f64>)> {
        let output = sae.forward(images(inputs, input_size, &self.device)?);
        let targets = images(targets, self.config.target_size, &self.device)?;
        let [frames, ..] = targets.dims();
        let difference = self.squared_error(output.reconstruction.clone(), targets);
        let losses = host_values::<2>(difference.reshape([frames as i32, -1]).mean_dim(1))?;
        Ok((output, losses.into_iter().map(f64::from).collect()))
    }

    /// Why a loss is not finite, as far as one can tell.
    fn diagnose(&self, losses: &Losses) -> String {
        let weights = self.sae.to_checkpoint(&self.config, BTreeMap::new());
        let broken = weights.ok().and_then(|w| {
            w.tensors
                .into_iter()
                .find(|(_, tensor)| tensor.data.iter().any(|v| !v.is_finite()))
        });
        let cause = match broken {
            Some((name, _)) => format!("the weights are no longer finite, `{name}` for one"),
            None => "the weights are still finite: activations overflow on this batch".to_owned(),
        };
        format!(
            "the loss is {} (reconstruction {}, velocity {}); {cause}",
            losses.total, losses.reconstruction, losses.velocity
        )
    }

    /// The squared error of every pixel, a channel or the mean of all.
    fn squared_error(&self, reconstruction: Tensor<4>, targets: Tensor<4>) -> Tensor<4> {
        let difference = reconstruction - targets;
        let Some(matrix) = &self.color_transform else {
            return difference.square();
        };
        let channel = |i: usize| difference.clone().narrow(1, i, 1);
        let row = |i: usize| {
            (0..i)
                .map(|j| channel(j) * matrix[i][j])
                .fold(channel(i) * matrix[i][i], |sum, part| sum + part)
                .square()
        };
        (row(0) + row(1) + row(2)) / 3.0
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
        let reconstruction = self
            .squared_error(output.reconstruction.clone(), targets)
            .mean();
        let points = output
            .latent
            .clone()
            .reshape([frames / SNIPPET, SNIPPET, keypoints * 2]);
        let at = |t: usize| points.clone().narrow(1, t, 1);
        let velocity = (at(2) - at(1) * 2.0 + at(0)).square().mean();
        let total = if self.velocity_weight > 0.0 {
            reconstruction.clone() + velocity.clone() * self.velocity_weight
        } else {
            reconstruction.clone()
        };
        // One read for all: each of them waits for the device.
        let parts = [total.clone(), reconstruction, velocity].map(Tensor::inner);
        let values = host_values(Tensor::cat(parts.into(), 0))?;
        let [total_value, reconstruction, velocity] = [0, 1, 2].map(|i| f64::from(values[i]));
        let losses = Losses {
            total: total_value,
            reconstruction,
            velocity,
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
