use burn::module::{Module, Param};
use burn::nn::conv::Conv2d;
use burn::prelude::{Tensor, TensorData};

use super::kernels::conv;
use super::weights::Loader;
use super::{BatchNorm, grid};
use crate::checkpoint::SaeConfig;
use crate::error::Result;

/// Keeps the products of profiles out of the subnormal numbers, on which a CPU's convolutions are several times
/// slower. It adds 1e-16 to maps of height 1, far below the resolution of an f32 (6e-8).
const PROFILE_FLOOR: f64 = 1e-16;

/// The decoder of a Basic SAE: Gaussian maps at the target size, three convolutions, a 1 x 1 convolution to
/// RGB, and with `-bg` a bias image.
#[derive(Module, Debug)]
pub struct Decoder {
    /// N points to N maps.
    pub gaussian_sampling: GaussianMaps,
    /// N maps to the first count.
    pub conv1: Conv2d,
    /// Over the first count.
    pub bn1: BatchNorm,
    /// First count to the second.
    pub conv2: Conv2d,
    /// Over the second count.
    pub bn2: BatchNorm,
    /// Second count to the third.
    pub conv3: Conv2d,
    /// Over the third count.
    pub bn3: BatchNorm,
    /// Third count to RGB, 1 x 1, with bias.
    pub aggregate_conv: Conv2d,
    /// The bias image of `-bg`.
    pub background_bias: Option<BackgroundBias>,
}

/// Paints every point as a blob `exp(-d² / σ²)`, where d is the distance in latent units.
#[derive(Module, Debug)]
pub struct GaussianMaps {
    /// The trained σ of `-std`: `[1]`. Its sign has no meaning.
    pub std: Option<Param<Tensor<1>>>,
    fixed: f64,
    size: [usize; 2],
}

/// An image that is added to the reconstruction: whatever never moves.
#[derive(Module, Debug)]
pub struct BackgroundBias {
    /// `[3, h, w]`
    pub bias: Param<Tensor<3>>,
}

impl Decoder {
    pub(super) fn load(weights: &Loader, config: &SaeConfig) -> Result<Self> {
        let architecture = config.architecture;
        Ok(Self {
            gaussian_sampling: GaussianMaps {
                std: architecture
                    .trained_sigma
                    .then(|| weights.parameter("decoder.gaussian_sampling.std"))
                    .transpose()?,
                fixed: config.sigma,
                size: config.target_size,
            },
            conv1: weights.conv("decoder.conv1")?,
            bn1: weights.batch_norm("decoder.bn1")?,
            conv2: weights.conv("decoder.conv2")?,
            bn2: weights.batch_norm("decoder.bn2")?,
            conv3: weights.conv("decoder.conv3")?,
            bn3: weights.batch_norm("decoder.bn3")?,
            aggregate_conv: weights.conv("decoder.aggregate_conv")?,
            background_bias: architecture
                .background
                .then(|| weights.parameter("decoder.background_bias.bias"))
                .transpose()?
                .map(|bias| BackgroundBias { bias }),
        })
    }

    /// The reconstruction, linear and not clipped.
    ///
    /// # Shapes
    /// - `latent`: `[B, N, 2]`, (y, x)
    /// - output: `[B, 3, h, w]`
    pub fn forward(&self, latent: Tensor<3>) -> Tensor<4> {
        let x = self.gaussian_sampling.forward(latent);
        let x = self.bn1.forward_relu(conv(&self.conv1, x));
        let x = self.bn2.forward_relu(conv(&self.conv2, x));
        let x = self.bn3.forward_relu(conv(&self.conv3, x));
        let x = conv(&self.aggregate_conv, x);
        match &self.background_bias {
            Some(background) => x + background.bias.val().unsqueeze::<4>(),
            None => x,
        }
    }
}

impl GaussianMaps {
    /// One map a point, 1 at the point; -1 and 1 are the centres of the border pixels.
    ///
    /// A blob is the outer product of its profile along y and its profile along x.
    ///
    /// # Shapes
    /// - `latent`: `[B, N, 2]`, (y, x)
    /// - output: `[B, N, h, w]`
    pub fn forward(&self, latent: Tensor<3>) -> Tensor<4> {
        let [batch, points, _] = latent.dims();
        let [width, height] = self.size;
        let device = latent.device();
        let axis = |index: usize, length: usize| {
            let grid = Tensor::<1>::from_data(TensorData::new(grid(length), [length]), &device);
            let centre = latent.clone().narrow(2, index, 1);
            let distance = grid.reshape([1, 1, length]) - centre;
            let squared = distance.square();
            let exponent = match &self.std {
                Some(std) => squared / std.val().square().reshape([1, 1, 1]),
                None => squared / (self.fixed * self.fixed),
            };
            exponent.neg().exp() + PROFILE_FLOOR
        };
        axis(0, height).reshape([batch, points, height, 1])
            * axis(1, width).reshape([batch, points, 1, width])
    }
}
