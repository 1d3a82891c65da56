//! Do the keypoints track the objects?
//!
//! `tracklens` scores keypoint detectors with the metric of Cramer, Reiher and Trimpe, "Tracking
//! Object Positions in Reinforcement Learning: A Metric for Keypoint Detection" (L4DC 2024):
//! tracking errors and Tracking Capability (TC). It extracts keypoints from images with spatial
//! autoencoders (SAEs) and trains them.
//!
//! With `default-features = false` there is only [`metric`], with few and small dependencies. The
//! other parts are features: `data` (tables, images, sequences, checkpoints), `engine` (CPU
//! inference), `report` (results and figures), `model` and `train` (SAEs in burn), `gpu` (SAEs on
//! the GPU), `cli`, `web`.

#[cfg(any(feature = "cli", feature = "train"))]
mod atomic;
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
#[cfg(feature = "engine")]
pub mod engine;
#[cfg(feature = "engine")]
pub mod extract;
#[cfg(feature = "data")]
pub mod intake;
#[cfg(feature = "data")]
mod memory;
#[cfg(feature = "model")]
pub mod model;
#[cfg(feature = "report")]
pub mod report;
#[cfg(feature = "data")]
pub mod scoring;
#[cfg(all(feature = "cli", feature = "train"))]
pub mod sweep;
#[cfg(feature = "report")]
pub mod train;

#[cfg(feature = "cli")]
pub mod cli;
#[cfg(all(feature = "web-part", target_arch = "wasm32"))]
pub mod web;

pub use error::{Error, ErrorKind, Reason, Result};
