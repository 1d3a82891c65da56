//! The devices that the spatial autoencoders run on.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A device by what a person asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum DeviceKind {
    /// All cores of the processor.
    #[default]
    Cpu,
    /// A graphics card; needs the feature `gpu`.
    Gpu,
}

impl DeviceKind {
    /// Whether this is the processor.
    pub fn is_cpu(&self) -> bool {
        *self == Self::Cpu
    }
}

/// A GPU, or a program that acts as one, as its driver describes it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Adapter {
    /// The name of the card.
    pub name: String,
    /// The graphics API.
    pub api: String,
    /// The driver with its version.
    pub driver: String,
    /// Whether it computes on the CPU, as Mesa's lavapipe does: right, and slower than the device
    /// cpu.
    pub software: bool,
}

impl fmt::Display for Adapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({}, {})", self.name, self.api, self.driver)
    }
}

/// The error of a build that has no GPU support.
#[cfg(all(not(feature = "gpu"), any(feature = "cli", feature = "model")))]
pub(crate) fn built_without_gpu() -> crate::Error {
    crate::Error::input(
        "this tracklens is built without GPU support; build it with the feature `gpu` (cargo build --release \
         --features gpu), or use the device cpu",
    )
}
