use burn::module::{Module, Param};
use burn::prelude::{Device, Tensor};

use super::weights::Loader;
use super::{ConvBlock, spatial_softargmax};
use crate::checkpoint::{Checkpoint, TEMPERATURE};
use crate::error::Result;

/// The encoder of an SAE: convolutions to N feature maps, a spatial soft-argmax.
#[derive(Module, Debug)]
pub struct Encoder {
    /// From RGB to N maps.
    pub layers: Vec<ConvBlock>,
    /// The trained temperature of the softmax: `[1]`.
    pub temperature: Option<Param<Tensor<1>>>,
    fixed_temperature: f64,
}

impl Encoder {
    /// The encoder of a checkpoint; the decoder's tensors need not be there.
    ///
    /// # Errors
    /// When a tensor is missing or has the wrong rank.
    pub fn from_checkpoint(checkpoint: &Checkpoint, device: &Device) -> Result<Self> {
        let weights = Loader::new(checkpoint, device);
        let config = &checkpoint.config;
        Ok(Self {
            layers: config
                .encoder_layers()
                .iter()
                .map(|layer| ConvBlock::load(&weights, layer))
                .collect::<Result<_>>()?,
            temperature: config
                .trained_temperature
                .then(|| weights.parameter(TEMPERATURE))
                .transpose()?,
            fixed_temperature: config.temperature,
        })
    }

    /// The N maps whose attention the points are.
    ///
    /// # Shapes
    /// - `images`: `[B, 3, H, W]`, RGB in [0, 1]
    /// - output: `[B, N, H', W']`; 256 px make 33 cells (Basic), 117 (DSAE), 32 (KeyNet)
    pub fn maps(&self, images: Tensor<4>) -> Tensor<4> {
        self.layers.iter().fold(images, |x, layer| layer.forward(x))
    }

    /// The points.
    ///
    /// # Shapes
    /// - `images`: `[B, 3, H, W]`, RGB in [0, 1]
    /// - output: `[B, N, 2]`, (y, x); -1 and 1 are the centres of the border cells of the last maps
    pub fn forward(&self, images: Tensor<4>) -> Tensor<3> {
        let maps = self.maps(images);
        spatial_softargmax(match &self.temperature {
            Some(temperature) => maps / temperature.val().reshape([1, 1, 1, 1]),
            None if self.fixed_temperature == 1.0 => maps,
            None => maps / self.fixed_temperature,
        })
    }
}
