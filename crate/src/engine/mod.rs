//! CPU inference of an encoder, without burn: batch norm folded into the convolutions, weights packed once,
//! convolutions as matrix products over a virtual im2col matrix.
//!
//! What is computed is defined by the burn modules in `model`; tests hold the two together. An [`Encoder`] is
//! immutable and shared by threads; every thread brings a [`Workspace`], which is sized by the first frame and
//! reused by the following ones.

mod conv;
mod decoder;
mod encoder;
mod pool;
mod softargmax;

pub use crate::checkpoint::LatentGrid;
pub use decoder::Decoder;
#[cfg(feature = "model")]
pub(crate) use encoder::finite;
pub use encoder::{Encoder, HeatMap, Workspace};
