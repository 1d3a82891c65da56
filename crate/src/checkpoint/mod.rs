//! Checkpoints: the weights of an SAE with its configuration, independent of what runs them.
//!
//! A checkpoint is a `.safetensors` file whose tensors carry the names of the authors' PyTorch state dict
//! (`encoder.block1.conv1.weight`). Files written here hold the [`SaeConfig`] as JSON under the metadata key
//! `tracklens.config`; for files without it the configuration is inferred from names and shapes.

mod config;
mod infer;
mod layers;
mod tensors;

pub use config::{Architecture, Family, SaeConfig};
pub use layers::{BACKGROUND, ConvLayer, DENSE, SIGMA, TEMPERATURE};
pub use tensors::{Checkpoint, Tensor};
