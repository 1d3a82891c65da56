//! How to train.

use serde::{Deserialize, Serialize};

use crate::checkpoint::SaeConfig;
use crate::data::{Split, SplitBy};
use crate::device::DeviceKind;
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
    /// Adam's learning rate for the encoder; null: the same. A slow encoder keeps what it sees from
    /// the start while the decoder, which is random at first, learns what to make of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub encoder_learning_rate: Option<f64>,
    /// Standard deviation of the noise on the encoder's input.
    pub noise: f32,
    /// Which sequences are for training and which for validation.
    pub split: Split,
    /// What the split keeps together.
    #[serde(default, skip_serializing_if = "SplitBy::is_sequence")]
    pub split_by: SplitBy,
    /// Weight of the velocity loss; the paper's is [`Architecture::velocity_weight`].
    ///
    /// [`Architecture::velocity_weight`]: crate::checkpoint::Architecture::velocity_weight
    pub velocity_weight: f64,
    /// Leaves out the snippets that do not fill a batch, in training and in validation, as the
    /// authors' code does. The paper does not mention it.
    pub drop_last: bool,
    /// The frames that the metric of an epoch is computed on.
    pub validation_frames: ValidationFrames,
    /// How targets are resized.
    pub target_filter: TargetFilter,
    /// How the colours of a reconstruction are compared with those of its target.
    #[serde(default, skip_serializing_if = "ColorError::is_plain")]
    pub color_error: ColorError,
    /// What the background bias of `-bg` starts from.
    #[serde(default, skip_serializing_if = "BackgroundStart::is_zero")]
    pub background: BackgroundStart,
    /// How an encoder is drawn that does not start from other weights.
    #[serde(default, skip_serializing_if = "EncoderStart::is_drawn")]
    pub encoder_start: EncoderStart,
    /// What the encoder's first convolution starts from; null: drawn as the others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_layer: Option<FirstLayer>,
    /// The checkpoint that all weights start from; null: drawn from the seed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weights: Option<StartWeights>,
    /// What computes; left out when it is the CPU. Devices round differently and so come to
    /// different weights.
    #[serde(default, skip_serializing_if = "DeviceKind::is_cpu")]
    pub device: DeviceKind,
}

/// The first convolution of another network, which training starts from. The weights themselves are
/// given to `train`; this is what tells two of them apart.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FirstLayer {
    /// Name of the tensor in the file.
    pub tensor: String,
    /// CRC-32 of the file.
    pub crc32: u32,
}

/// The checkpoint that a training starts from. The weights themselves are given to `train`; this is
/// what tells two of them apart.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartWeights {
    /// CRC-32 of the file.
    pub crc32: u32,
}

/// The frames of the validation sequences that the metric is computed on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ValidationFrames {
    /// The first frame of every snippet, as in the authors' code: the last two frames of a sequence
    /// do not count.
    #[default]
    First,
    /// Every frame, as in the paper's text.
    All,
}

/// How targets are resized to the target size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TargetFilter {
    /// Bilinear without antialiasing, as the authors' pinned torchvision does.
    #[default]
    Bilinear,
    /// Bilinear with antialiasing, as later torchvisions do.
    BilinearAntialias,
}

/// What the background bias of `-bg` starts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BackgroundStart {
    /// Zero (paper, appendix, "Modifications").
    #[default]
    Zero,
    /// The mean of the training targets, less the bias of the decoder's last convolution. Learning
    /// the background takes the first hundreds of steps, in which every weight moves along; an
    /// encoder that need not do that keeps what it sees of small objects.
    Mean,
}

/// How an untrained encoder is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EncoderStart {
    /// PyTorch's default for convolutions, as the authors' code.
    #[default]
    Drawn,
    /// Every convolution is a random orthogonal 1 x 1 one in the middle of its kernel, which sees
    /// the colour of one pixel, whitened as for [`ColorError::Whitened`], and nothing around it
    /// (`model::pointwise_encoder`).
    Pointwise,
}

/// How the colours of a reconstruction are compared with those of its target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ColorError {
    /// The mean squared error over red, green and blue, as in the paper.
    #[default]
    Plain,
    /// The squared Mahalanobis distance of colours, under the covariance of what the training
    /// targets have beyond their mean image, scaled so that the mean image has the same error as
    /// with `Plain`. Large grey objects and their shading no longer outweigh small coloured ones.
    Whitened,
    /// Half of that: the inverse square root of the covariance in place of its inverse, in which an
    /// arm counts more than small objects, and small objects more than with `Plain`.
    HalfWhitened,
}

impl ColorError {
    fn is_plain(&self) -> bool {
        *self == Self::Plain
    }
}

impl EncoderStart {
    fn is_drawn(&self) -> bool {
        *self == Self::Drawn
    }
}

impl BackgroundStart {
    fn is_zero(&self) -> bool {
        *self == Self::Zero
    }
}

impl TrainConfig {
    /// The paper's settings (appendix, table "Hyperparameters for SAE training"): 500 epochs,
    /// batches of 32, Adam with learning rate 0.001, noise 0.001; half of the sequences for
    /// training, a quarter for validation.
    pub fn new(sae: SaeConfig) -> Self {
        Self {
            velocity_weight: sae.architecture.velocity_weight(),
            sae,
            epochs: 500,
            seed: 0,
            batch: 32,
            learning_rate: 1e-3,
            encoder_learning_rate: None,
            noise: 1e-3,
            split: Split::Shares {
                training: 0.5,
                validation: 0.25,
            },
            split_by: SplitBy::Sequence,
            drop_last: true,
            validation_frames: ValidationFrames::First,
            target_filter: TargetFilter::Bilinear,
            color_error: ColorError::Plain,
            background: BackgroundStart::Zero,
            encoder_start: EncoderStart::Drawn,
            first_layer: None,
            weights: None,
            device: DeviceKind::Cpu,
        }
    }

    /// Checks every value.
    ///
    /// # Errors
    /// Names the value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        self.sae.validate()?;
        let wrong = |what: &str, value: &dyn std::fmt::Display, expected: &str| {
            Err(Error::input(format!(
                "{what} is {value}; expected {expected}"
            )))
        };
        if self.epochs == 0 {
            return wrong("the number of epochs", &0, "at least 1");
        }
        if self.batch == 0 {
            return wrong("the batch", &0, "at least 1 snippet");
        }
        if !(self.learning_rate.is_finite() && self.learning_rate > 0.0) {
            return wrong(
                "the learning rate",
                &self.learning_rate,
                "a positive number",
            );
        }
        if let Some(rate) = self.encoder_learning_rate
            && !(rate.is_finite() && rate > 0.0)
        {
            return wrong("the encoder's learning rate", &rate, "a positive number");
        }
        if !(self.noise.is_finite() && self.noise >= 0.0) {
            return wrong("the noise", &self.noise, "0 or a positive number");
        }
        if !(self.velocity_weight.is_finite() && self.velocity_weight >= 0.0) {
            return wrong(
                "the weight of the velocity loss",
                &self.velocity_weight,
                "0 or a positive number",
            );
        }
        if self.background == BackgroundStart::Mean && !self.sae.architecture.background {
            return wrong(
                "the background's start",
                &"mean",
                "zero, or an architecture with -bg, which has a background",
            );
        }
        if self.background == BackgroundStart::Mean && self.weights.is_some() {
            return wrong(
                "the background's start",
                &"mean",
                "zero with weights of a checkpoint, which have a background",
            );
        }
        let starts = self.weights.is_some() || self.first_layer.is_some();
        if self.encoder_start == EncoderStart::Pointwise && starts {
            return wrong(
                "the encoder's start",
                &"pointwise",
                "drawn with weights of another network",
            );
        }
        self.split.validate()
    }
}
