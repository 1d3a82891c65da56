use burn::module::Module;
use burn::nn::PaddingConfig2d;
use burn::nn::conv::Conv2d;
use burn::nn::pool::{MaxPool2d, MaxPool2dConfig};
use burn::prelude::Tensor;
use burn::tensor::activation::relu;
use burn::tensor::module::interpolate;
use burn::tensor::ops::{InterpolateMode, InterpolateOptions};

use super::BatchNorm;
use super::weights::Loader;
use crate::checkpoint::ConvLayer;
use crate::error::Result;

/// A [`ConvLayer`] with its weights: upsampling, convolution, pool, batch norm, ReLU, each where the layer has it.
#[derive(Module, Debug)]
pub struct ConvBlock {
    /// With a bias where there is no batch norm.
    pub conv: Conv2d,
    /// After the pool.
    pub norm: Option<BatchNorm>,
    pool: Option<MaxPool2d>,
    upsample: bool,
    relu: bool,
}

impl ConvBlock {
    pub(super) fn load(weights: &Loader, layer: &ConvLayer) -> Result<Self> {
        Ok(Self {
            conv: weights.conv(layer)?,
            norm: layer
                .norm
                .as_ref()
                .map(|name| weights.batch_norm(name))
                .transpose()?,
            pool: layer.pool.then(|| {
                MaxPool2dConfig::new([2, 2])
                    .with_padding(PaddingConfig2d::Explicit(1, 1, 1, 1))
                    .init()
            }),
            upsample: layer.upsample,
            relu: layer.relu,
        })
    }

    /// One layer.
    ///
    /// # Shapes
    /// - `input`: `[B, C_in, H, W]`
    /// - output: `[B, C, H', W']`, where [`ConvLayer::output_side`] makes H' of H
    pub fn forward(&self, input: Tensor<4>) -> Tensor<4> {
        let mut x = input;
        if self.upsample {
            let twice = InterpolateOptions::new(InterpolateMode::Bilinear)
                .with_align_corners(false)
                .with_scale_factor([2.0, 2.0]);
            x = interpolate(x, twice);
        }
        x = self.conv.forward(x);
        if let Some(pool) = &self.pool {
            x = pool.forward(x);
        }
        if let Some(norm) = &self.norm {
            x = norm.forward(x);
        }
        if self.relu { relu(x) } else { x }
    }
}
