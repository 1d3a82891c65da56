use burn::module::Module;
use burn::nn::conv::Conv2d;
use burn::prelude::Tensor;

use super::weights::Loader;
use super::{BatchNorm, kernels};
use crate::checkpoint::ConvLayer;
use crate::error::Result;

/// A [`ConvLayer`] with its weights: upsampling, convolution, pool, batch norm, ReLU, each where
/// the layer has it.
#[derive(Module, Debug)]
pub struct ConvBlock {
    /// With a bias where there is no batch norm.
    pub conv: Conv2d,
    /// After the pool; a ReLU follows every batch norm.
    pub norm: Option<BatchNorm>,
    pool: bool,
    upsample: bool,
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
            pool: layer.pool,
            upsample: layer.upsample,
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
            x = kernels::upsample(x);
        }
        x = kernels::conv(&self.conv, x);
        if self.pool {
            x = kernels::max_pool(x);
        }
        match &self.norm {
            Some(norm) => norm.forward_relu(x),
            None => x,
        }
    }
}
