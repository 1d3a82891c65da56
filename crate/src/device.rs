//! The devices that the spatial autoencoders run on.

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

/// The error of a build that has no GPU support.
#[cfg(all(not(feature = "gpu"), any(feature = "cli", feature = "model")))]
pub(crate) fn built_without_gpu() -> crate::Error {
    crate::Error::input(
        "this tracklens is built without GPU support; build it with the feature `gpu` (cargo build --release \
         --features gpu), or use the device cpu",
    )
}
