//! CPU inference of an encoder, without burn: batch norm folded into the convolutions, weights
//! packed once, and every convolution computed together with what follows it.
//!
//! Maps lie as rows x columns x channels. 3 x 3 filters and 5 x 5 filters with stride 1 go by
//! Winograd's algorithm (`winograd`), all others as products of shifted rows (`direct`); both are
//! built on the one product in `gemm`, which is written once over `rten-simd`'s instruction sets:
//! AVX-512, AVX2 with FMA, NEON, wasm simd128, and plain code. Which one a layer takes is a rule on
//! its shape, so that results are the same in every run; [`CpuEncoder::plan`] shows it.
//!
//! In wasm the steps of a kernel are functions of their own: a browser's compiler gives up on
//! keeping values in registers in a function as large as a whole kernel. Elsewhere they have to be
//! inlined, into the code of an instruction set.
//!
//! What is computed is defined by the burn modules in `model`; tests hold the two together. An
//! [`CpuEncoder`] is immutable and shared by threads; every thread brings a [`Workspace`], which is
//! sized by the first frame and reused by the following ones.

mod buffer;
mod decoder;
mod direct;
mod encoder;
pub(crate) mod epilogue;
pub(crate) mod gemm;
mod layer;
pub(crate) mod map;
pub(crate) mod pool;
mod rows;
mod simd;
mod softargmax;
pub(crate) mod tile;
pub(crate) mod winograd;

pub use decoder::CpuDecoder;
pub use encoder::{CpuEncoder, HeatMap, Workspace};
#[cfg(feature = "model")]
pub(crate) use encoder::{check_size, finite};
pub use layer::PlannedLayer;
