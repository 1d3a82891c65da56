use burn::module::{Module, Param};
use burn::prelude::{Tensor, TensorData};
use burn::tensor::activation::relu;

use super::ConvBlock;
use super::grid::grid;
use super::weights::Loader;
use crate::checkpoint::{BACKGROUND, DENSE, Family, SIGMA, SaeConfig};
use crate::error::Result;

/// Keeps the products of profiles out of the subnormal numbers, on which a CPU's convolutions are
/// several times slower. It adds 1e-16 to maps of height 1, far below the resolution of an f32
/// (6e-8).
const PROFILE_FLOOR: f64 = 1e-16;

/// The decoder of an SAE: Gaussian maps and convolutions to RGB, for a DSAE one dense layer; with
/// `-bg` a bias image.
#[derive(Module, Debug)]
pub struct Decoder {
    /// N points to N maps; a DSAE does not use it.
    pub gaussian_sampling: GaussianMaps,
    /// From N maps to RGB; none in a DSAE.
    pub layers: Vec<ConvBlock>,
    /// The dense layer of a DSAE.
    pub dense: Option<Dense>,
    /// The bias image of `-bg`.
    pub background_bias: Option<BackgroundBias>,
    size: [usize; 2],
}

/// Paints every point as a blob `exp(-d² / σ²)`, where d is the distance in latent units.
#[derive(Module, Debug)]
pub struct GaussianMaps {
    /// The trained σ of `-std`: `[1]`, or `[N]` with one a keypoint. Its sign has no meaning.
    pub std: Option<Param<Tensor<1>>>,
    fixed: f64,
    limit: Option<f64>,
    size: [usize; 2],
}

/// From 2N coordinates (y, x, y, x, …) to all values of an image.
#[derive(Module, Debug)]
pub struct Dense {
    /// `[3 h w, 2 N]`
    pub weight: Param<Tensor<2>>,
    /// `[3 h w]`
    pub bias: Param<Tensor<1>>,
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
        let is_dsae = architecture.family == Family::Dsae;
        Ok(Self {
            gaussian_sampling: GaussianMaps::load(weights, config)?,
            layers: config
                .decoder_layers()
                .iter()
                .map(|layer| ConvBlock::load(weights, layer))
                .collect::<Result<_>>()?,
            dense: is_dsae.then(|| Dense::load(weights)).transpose()?,
            background_bias: architecture
                .background
                .then(|| weights.parameter(BACKGROUND))
                .transpose()?
                .map(|bias| BackgroundBias { bias }),
            size: config.target_size,
        })
    }

    /// The reconstruction, linear and not clipped.
    ///
    /// # Shapes
    /// - `latent`: `[B, N, 2]`, (y, x)
    /// - output: `[B, 3, h, w]`
    pub fn forward(&self, latent: Tensor<3>) -> Tensor<4> {
        let [batch, points, _] = latent.dims();
        let [width, height] = self.size;
        let mut x = match &self.dense {
            Some(dense) => dense
                .forward(latent.reshape([batch, 2 * points]))
                .reshape([batch, 3, height, width]),
            None => self.gaussian_sampling.forward(latent),
        };
        for layer in &self.layers {
            x = layer.forward(x);
        }
        match &self.background_bias {
            Some(background) => x + background.bias.val().unsqueeze::<4>(),
            None => x,
        }
    }
}

impl Dense {
    fn load(weights: &Loader) -> Result<Self> {
        Ok(Self {
            weight: weights.parameter(&format!("{DENSE}.weight"))?,
            bias: weights.parameter(&format!("{DENSE}.bias"))?,
        })
    }

    fn forward(&self, input: Tensor<2>) -> Tensor<2> {
        input.matmul(self.weight.val().transpose()) + self.bias.val().unsqueeze::<2>()
    }
}

impl GaussianMaps {
    fn load(weights: &Loader, config: &SaeConfig) -> Result<Self> {
        Ok(Self {
            std: config
                .architecture
                .trained_sigma
                .then(|| weights.vector(SIGMA))
                .transpose()?,
            fixed: config.sigma,
            limit: config.sigma_limit,
            size: config.map_size(),
        })
    }

    /// One map a point, 1 at the point (1 minus the height at the limit, where there is one); -1
    /// and 1 are the centres of the border pixels.
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
                Some(std) => {
                    let std = std.val();
                    let [count] = std.dims();
                    squared / std.square().reshape([1, count, 1])
                }
                None => squared / (self.fixed * self.fixed),
            };
            exponent.neg().exp() + PROFILE_FLOOR
        };
        let maps = axis(0, height).reshape([batch, points, height, 1])
            * axis(1, width).reshape([batch, points, 1, width]);
        match self.limit {
            Some(limit) => relu(maps - (-limit * limit).exp()),
            None => maps,
        }
    }
}
