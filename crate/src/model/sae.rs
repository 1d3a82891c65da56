use burn::prelude::{Device, Module, Tensor};

use super::weights::Loader;
use super::{Decoder, Encoder, fresh_weights};
use crate::checkpoint::{Checkpoint, SaeConfig};
use crate::error::{Error, Result};

/// A spatial autoencoder: image to N points to image.
#[derive(Module, Debug)]
pub struct Sae {
    /// Image to points.
    pub encoder: Encoder,
    /// Points to image.
    pub decoder: Decoder,
}

/// What an [`Sae`] gives for a batch of B images.
#[derive(Debug, Clone)]
pub struct SaeOutput {
    /// The points (y, x) in the latent space [-1, 1]: `[B, N, 2]`.
    pub latent: Tensor<3>,
    /// The reconstruction at the target size, not clipped: `[B, 3, h, w]`.
    pub reconstruction: Tensor<4>,
}

impl Sae {
    /// An untrained SAE with the weights of [`fresh_weights`].
    ///
    /// # Errors
    /// When a size in the configuration makes no sense.
    pub fn init(config: &SaeConfig, seed: u64, device: &Device) -> Result<Self> {
        config.validate()?;
        Self::from_checkpoint(&fresh_weights(config, seed), device)
    }

    /// The SAE of a checkpoint.
    ///
    /// # Errors
    /// When a tensor is missing, e.g. because the checkpoint holds an encoder only, or has the
    /// wrong rank.
    pub fn from_checkpoint(checkpoint: &Checkpoint, device: &Device) -> Result<Self> {
        if !checkpoint.has_decoder() {
            return Err(Error::input(
                "the checkpoint holds an encoder only; expected the decoder's tensors too (`decoder.…`)",
            ));
        }
        Ok(Self {
            encoder: Encoder::from_checkpoint(checkpoint, device)?,
            decoder: Decoder::load(&Loader::new(checkpoint, device), &checkpoint.config)?,
        })
    }

    /// Encodes and decodes.
    ///
    /// # Shapes
    /// - `images`: `[B, 3, H, W]`, RGB in [0, 1]
    /// - output: see [`SaeOutput`]
    pub fn forward(&self, images: Tensor<4>) -> SaeOutput {
        let latent = self.encoder.forward(images);
        SaeOutput {
            reconstruction: self.decoder.forward(latent.clone()),
            latent,
        }
    }
}
