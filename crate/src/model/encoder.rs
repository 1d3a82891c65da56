use burn::module::Module;
use burn::nn::conv::Conv2d;
use burn::prelude::{Device, Tensor};

use super::kernels::{conv, max_pool};
use super::weights::Loader;
use super::{BatchNorm, spatial_softargmax};
use crate::checkpoint::Checkpoint;
use crate::error::Result;

/// The encoder of a Basic SAE: three blocks, a 1 x 1 convolution to N maps, a spatial soft-argmax.
#[derive(Module, Debug)]
pub struct Encoder {
    /// 3 channels to the first count.
    pub block1: ConvBlock,
    /// First count to the second.
    pub block2: ConvBlock,
    /// Second count to the third.
    pub block3: ConvBlock,
    /// Third count to N maps, 1 x 1, with bias.
    pub aggregate_conv: Conv2d,
}

/// Convolution, batch norm, ReLU, convolution, max-pool, batch norm, ReLU.
///
/// Convolutions are 3 x 3 with padding 1 and no bias. The pool is 2 x 2 with stride 2 and a border of -inf one
/// cell wide: it makes H / 2 + 1 rows out of H, and the *second* batch norm sees the pooled maps.
#[derive(Module, Debug)]
pub struct ConvBlock {
    /// Input channels to C.
    pub conv1: Conv2d,
    /// Over C channels.
    pub bn1: BatchNorm,
    /// C to C channels.
    pub conv2: Conv2d,
    /// Over C channels, after the pool.
    pub bn2: BatchNorm,
}

impl Encoder {
    /// The encoder of a checkpoint; the decoder's tensors need not be there.
    ///
    /// # Errors
    /// When a tensor is missing or has the wrong rank.
    pub fn from_checkpoint(checkpoint: &Checkpoint, device: &Device) -> Result<Self> {
        let weights = Loader::new(checkpoint, device);
        Ok(Self {
            block1: ConvBlock::load(&weights, "encoder.block1")?,
            block2: ConvBlock::load(&weights, "encoder.block2")?,
            block3: ConvBlock::load(&weights, "encoder.block3")?,
            aggregate_conv: weights.conv("encoder.aggregate_conv")?,
        })
    }

    /// The N maps whose attention the points are.
    ///
    /// # Shapes
    /// - `images`: `[B, 3, H, W]`, RGB in [0, 1]
    /// - output: `[B, N, H', W']`, where every block makes `H / 2 + 1` out of H (256 gives 33)
    pub fn maps(&self, images: Tensor<4>) -> Tensor<4> {
        let x = self.block1.forward(images);
        let x = self.block2.forward(x);
        let x = self.block3.forward(x);
        conv(&self.aggregate_conv, x)
    }

    /// The points.
    ///
    /// # Shapes
    /// - `images`: `[B, 3, H, W]`, RGB in [0, 1]
    /// - output: `[B, N, 2]`, (y, x); -1 and 1 are the centres of the border cells of the last maps
    pub fn forward(&self, images: Tensor<4>) -> Tensor<3> {
        spatial_softargmax(self.maps(images))
    }
}

impl ConvBlock {
    fn load(weights: &Loader, name: &str) -> Result<Self> {
        Ok(Self {
            conv1: weights.conv(&format!("{name}.conv1"))?,
            bn1: weights.batch_norm(&format!("{name}.bn1"))?,
            conv2: weights.conv(&format!("{name}.conv2"))?,
            bn2: weights.batch_norm(&format!("{name}.bn2"))?,
        })
    }

    /// One block.
    ///
    /// # Shapes
    /// - `input`: `[B, C_in, H, W]`
    /// - output: `[B, C, H / 2 + 1, W / 2 + 1]`
    pub fn forward(&self, input: Tensor<4>) -> Tensor<4> {
        let x = self.bn1.forward_relu(conv(&self.conv1, input));
        let x = max_pool(conv(&self.conv2, x));
        self.bn2.forward_relu(x)
    }
}
