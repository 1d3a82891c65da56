//! The library: the metric and its statistics, files, checkpoints, the engine.

#[cfg(feature = "data")]
#[path = "../shared/mod.rs"]
mod shared;

#[cfg(feature = "data")]
mod archive;
#[cfg(feature = "data")]
mod checkpoint;
mod context;
#[cfg(all(feature = "engine", feature = "jpeg-webp"))]
mod data;
#[cfg(feature = "onnx")]
mod detector;
#[cfg(feature = "data")]
mod doctor;
#[cfg(feature = "engine")]
mod engine;
#[cfg(all(feature = "engine", feature = "hdf5"))]
mod formats;
#[cfg(feature = "data")]
mod memory;
mod metric;
#[cfg(feature = "hdf5")]
mod recordings;
#[cfg(all(feature = "data", feature = "space"))]
mod space;
mod stats;
#[cfg(feature = "data")]
mod tables;
#[cfg(feature = "data")]
mod temporal;
