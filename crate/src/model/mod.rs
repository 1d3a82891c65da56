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
mod grid;
mod init;
#[cfg(not(target_arch = "wasm32"))]
mod kernels;
#[cfg(target_arch = "wasm32")]
#[path = "kernels/plain.rs"]
mod kernels;
mod points;
mod sae;
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
pub use init::{fresh_weights, load_first_layer, load_weights, pointwise_encoder};
#[cfg(not(target_arch = "wasm32"))]
pub(crate) use points::host_values;
pub use points::{points_xy, points_xy_async};
pub use sae::{Sae, SaeOutput};
pub use softargmax::spatial_softargmax;
#[cfg(all(feature = "web-gpu", target_arch = "wasm32"))]
pub use webgpu::WebGpu;

#[cfg(doc)]
use crate::checkpoint::{Checkpoint, ConvLayer};
