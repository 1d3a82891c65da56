//! Frames to keypoints, on any device.
//!
//! [`Extractor`] is the one interface: a [`CpuExtractor`] computes on the CPU, a `DeviceExtractor`
//! on a device of burn. The terminal gives it whole data sets with `extract_frames`; a worker of
//! the page gives it one image at a time.

mod cpu;
#[cfg(feature = "model")]
mod device;
mod extractor;
#[cfg(not(target_arch = "wasm32"))]
mod frames;

pub use cpu::CpuExtractor;
#[cfg(feature = "model")]
pub use device::{DeviceExtractor, Prepared};
pub use extractor::{Extraction, Extractor};
#[cfg(not(target_arch = "wasm32"))]
pub use frames::extract_frames;
