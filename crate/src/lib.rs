//! Do the keypoints track the objects?
//!
//! `tracklens` scores keypoint detectors with the metric of Cramer, Reiher and Trimpe, "Tracking
//! Object Positions in Reinforcement Learning: A Metric for Keypoint Detection" (L4DC 2024):
//! tracking errors and Tracking Capability (TC). It extracts keypoints from images with spatial
//! autoencoders (SAEs) and trains them.
//!
//! [`metric`] scores arrays; `evaluation` joins tables of keypoints and ground truth and scores
//! them; `extract` finds keypoints in frames, `detector` by models of any origin; `train` trains
//! autoencoders; `report` draws the results of one evaluation or of many runs.
//!
//! # Features
//!
//! With `default-features = false` there is only [`metric`]. The crates are counted with tracklens
//! itself and all crates that the feature needs (x86-64 Linux).
//!
//! | feature | brings | crates |
//! |---|---|---|
//! | none | [`metric`], [`track`] | 22 |
//! | `data` | tables, frames, sequences and checkpoints from bytes: `data`, `checkpoint`, `evaluation`, `run` | 69 |
//! | `jpeg-webp` | JPEG and WebP images besides PNG | 73 |
//! | `hdf5` | HDF5: recordings, data frames of pandas, projects of SLEAP | 78 |
//! | `parquet` | Parquet: tables of pandas and polars, data of LeRobot | 84 |
//! | `zarr` | Zarr: recordings, replay buffers of diffusion policy | 146 |
//! | `space` | points with three coordinates | 22 |
//! | `engine` | encoders on the CPU: `engine`, `extract` | 72 |
//! | `onnx` | any detector as an ONNX model: `detector`; checkpoints and models by path: `weights` | 93 |
//! | `report` | tables, figures and pages: `report` | 76 |
//! | `model` | the SAEs as burn modules: `model` | 195 |
//! | `train` | training: `train` | 208 |
//! | `gpu` | burn's wgpu backend (Vulkan, Metal, Direct3D 12, OpenGL) as a device | 301 |
//! | `cli` | the binary `tracklens`, without training | 252 |
//!
//! The default features are `cli` and `train` (336 crates). The features that begin with `web` make
//! the parts of the npm package and are of no use in Rust.

#[cfg(any(feature = "cli", feature = "train"))]
mod atomic;
#[cfg(any(feature = "cli", all(feature = "web-scoring", target_arch = "wasm32")))]
mod command_line;
#[cfg(feature = "data")]
pub mod device;
pub mod error;
pub mod event;
pub mod metric;
pub mod track;

#[cfg(feature = "data")]
pub mod checkpoint;
#[cfg(feature = "data")]
pub mod data;
#[cfg(feature = "onnx")]
pub mod detector;
#[cfg(feature = "engine")]
pub mod engine;
#[cfg(feature = "data")]
pub mod evaluation;
#[cfg(feature = "engine")]
pub mod extract;
#[cfg(feature = "data")]
pub mod intake;
#[cfg(feature = "data")]
mod memory;
#[cfg(feature = "model")]
pub mod model;
#[cfg(feature = "data")]
mod pickle;
#[cfg(feature = "report")]
pub mod report;
#[cfg(feature = "data")]
pub mod run;
#[cfg(all(feature = "cli", feature = "train"))]
#[doc(hidden)]
pub mod sweep;
#[cfg(feature = "train")]
pub mod train;
#[cfg(feature = "onnx")]
pub mod weights;

#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
#[cfg(all(feature = "web-part", target_arch = "wasm32"))]
#[doc(hidden)]
pub mod web;

pub use error::{Error, ErrorKind, Reason, Result};

/// Tests the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
