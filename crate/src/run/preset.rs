//! Sets of options that are known to work.

use serde::{Deserialize, Serialize};

use super::{BackgroundStart, ColorError, EncoderStart, TrainConfig};
use crate::checkpoint::{Family, SaeConfig};
use crate::data::{Split, SplitBy};
use crate::error::{Error, Result};

/// A set of options that is known to work, where the paper's are too slow or too large. It is
/// nothing but the values it stands for: a run's configuration holds those.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// A KeyNet for frames of 64 x 64 that is trained on two cores, for recordings in which small
    /// coloured objects move before a still camera (docs/training-log.md).
    SmallCpu,
}

impl Preset {
    /// The architecture whose configuration the preset is for, unless another is asked for.
    pub fn architecture(self) -> &'static str {
        match self {
            Self::SmallCpu => "keynet-vel-std-bg",
        }
    }

    /// The preset's settings for an architecture.
    ///
    /// # Errors
    /// When the preset has none for its family.
    pub fn config(self, sae: &SaeConfig) -> Result<TrainConfig> {
        let Self::SmallCpu = self;
        let architecture = sae.architecture;
        if architecture.family != Family::KeyNet {
            return Err(Error::input(format!(
                "the preset small-cpu has no sizes for {architecture}; expected a KeyNet, e.g. {}",
                self.architecture()
            )));
        }
        let sae = SaeConfig {
            encoder_channels: vec![16, 16, 32, 32],
            encoder_kernels: vec![3, 3],
            encoder_strides: vec![1, 2, 1, 1],
            decoder_channels: vec![32, 16, 8],
            input_size: Some([64, 64]),
            ..sae.clone()
        };
        Ok(TrainConfig {
            velocity_weight: match architecture.velocity {
                true => 0.01,
                false => 0.0,
            },
            epochs: 10,
            batch: 8,
            split: Split::Shares {
                training: 0.9,
                validation: 0.1,
            },
            split_by: SplitBy::Episode,
            color_error: ColorError::Whitened,
            background: match architecture.background {
                true => BackgroundStart::Mean,
                false => BackgroundStart::Zero,
            },
            encoder_start: EncoderStart::Pointwise,
            ..TrainConfig::new(sae)
        })
    }
}
