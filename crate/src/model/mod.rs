//! The spatial autoencoders (SAEs) as burn modules: written once, run on every burn device.
//!
//! An SAE squeezes an image through N points: the [`Encoder`] turns every feature map into the
//! position of its attention, the [`Decoder`] paints a Gaussian blob a point and reconstructs the
//! image from the blobs. What the modules compute, layer by layer and in the order of the axes, is
//! what the paper's authors' code computes. All families are one module tree, whose layers are the
//! [`ConvLayer`]s of a configuration; a [`Checkpoint`] names its tensors as their state dict does.
//!
//! Inside this module a latent point is (y, x), as in the authors' code. [`points_xy`] is the
//! border to the rest of the crate, which speaks (x, y).
//!
//! Training behaviour (batch statistics) is a matter of the device: inputs on an autodiff device
//! train, and [`Module::valid`](burn::prelude::Module) gives the module that infers.
//!
//! ```
//! use burn::prelude::{Device, Tensor};
//! use tracklens::checkpoint::{Architecture, SaeConfig};
//! use tracklens::model::Sae;
//!
//! # fn main() -> tracklens::error::Result<()> {
//! let device = Device::flex();
//! let config = SaeConfig::new(Architecture::BASIC);
//! let sae = Sae::init(&config, 0, &device)?;
//! let output = sae.forward(Tensor::zeros([1, 3, 32, 32], &device));
//! assert_eq!(output.latent.dims(), [1, 16, 2]);
//! assert_eq!(output.reconstruction.dims(), [1, 3, 64, 64]);
//! # Ok(())
//! # }
//! ```

mod batch_norm;
#[cfg(not(target_arch = "wasm32"))]
mod collect;
mod conv;
mod decoder;
#[cfg(not(target_arch = "wasm32"))]
mod device;
mod encoder;
mod init;
#[cfg(not(target_arch = "wasm32"))]
mod kernels;
#[cfg(target_arch = "wasm32")]
#[path = "kernels/plain.rs"]
mod kernels;
mod softargmax;
#[cfg(all(feature = "web-gpu", target_arch = "wasm32"))]
mod webgpu;
mod weights;

pub use crate::device::Adapter;
pub use batch_norm::BatchNorm;
pub use conv::ConvBlock;
pub use decoder::{BackgroundBias, Decoder, Dense, GaussianMaps};
#[cfg(not(target_arch = "wasm32"))]
pub use device::{OpenDevice, open};
pub use encoder::Encoder;
pub use init::{fresh_weights, load_first_layer, load_weights};
pub use softargmax::spatial_softargmax;
#[cfg(all(feature = "web-gpu", target_arch = "wasm32"))]
pub use webgpu::WebGpu;

use std::fmt;

use burn::prelude::{Device, Module, Tensor, TensorData};
use ndarray::Array3;

#[cfg(doc)]
use crate::checkpoint::ConvLayer;
use crate::checkpoint::{Checkpoint, SaeConfig};
use crate::error::{Error, ErrorKind, Result};
use weights::Loader;

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

/// Latent points `[B, N, 2]`, (y, x) on the device, as B x N x 2, (x, y) on the host.
///
/// # Errors
/// When the device does not give the values back.
pub fn points_xy(latent: Tensor<3>) -> Result<Array3<f64>> {
    let shape = latent.dims();
    host_points(&host_values(latent)?, shape)
}

/// As [`points_xy`]; the thread does not wait for the device, which a browser does not allow.
///
/// # Errors
/// When the device does not give the values back.
pub async fn points_xy_async(latent: Tensor<3>) -> Result<Array3<f64>> {
    let shape = latent.dims();
    let data = latent.into_data_async().await.map_err(device_failed)?;
    host_points(&floats(data)?, shape)
}

fn host_points(yx: &[f32], [batch, points, _]: [usize; 3]) -> Result<Array3<f64>> {
    let values = yx
        .chunks_exact(2)
        .flat_map(|p| [f64::from(p[1]), f64::from(p[0])])
        .collect();
    Array3::from_shape_vec((batch, points, 2), values)
        .map_err(|e| Error::numeric(format!("the device returned points of another shape: {e}")))
}

/// The f32 values of a tensor, read back from its device.
pub(crate) fn host_values<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>> {
    floats(tensor.try_into_data().map_err(device_failed)?)
}

fn floats(data: TensorData) -> Result<Vec<f32>> {
    data.try_into_vec::<f32>()
        .map_err(|e| Error::numeric(format!("the device returned no f32 values: {e:?}")))
}

fn device_failed(error: impl fmt::Display) -> Error {
    Error::new(ErrorKind::Io, format!("the device failed: {error}"))
}

/// n coordinates from -1 to 1, the ends included: the authors' grid over a feature map or an image,
/// on which -1 and 1 are the *centres* of the border cells.
fn grid(n: usize) -> Vec<f32> {
    let step = 2.0 / (n.max(2) - 1) as f64;
    (0..n).map(|i| (step * i as f64 - 1.0) as f32).collect()
}
