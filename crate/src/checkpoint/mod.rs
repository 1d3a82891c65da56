//! Checkpoints: the weights of an SAE with its configuration, independent of what runs them.
//!
//! A checkpoint is a file whose tensors carry the names of the authors' PyTorch state dict
//! (`encoder.block1.conv1.weight`), in one of three containers: `.safetensors`, PyTorch's `.pth`,
//! burn's `.bpk`. Files written here hold the [`SaeConfig`] as JSON under the metadata key
//! `tracklens.config`; for files without it the configuration is inferred from names and shapes,
//! and from the authors' `cfg` where it says more.

mod authors;
#[cfg(feature = "engine")]
mod batch_norm;
mod config;
mod formats;
mod grid;
mod infer;
mod layers;
#[cfg(feature = "cli")]
mod onnx;
mod summary;
mod tensor;
mod tensors;

#[cfg(feature = "engine")]
pub(crate) use batch_norm::BATCH_NORM_EPSILON;
pub use config::{Architecture, Family, SaeConfig};
pub use formats::{Format, read_tensors};
pub use grid::LatentGrid;
pub use layers::{BACKGROUND, ConvLayer, DENSE, SIGMA, TEMPERATURE};
pub use summary::{Parameters, Summary, Training};
pub use tensor::Tensor;
pub use tensors::Checkpoint;
