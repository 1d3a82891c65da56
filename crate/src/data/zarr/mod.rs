//! Zarr, versions 2 and 3: recordings, points as arrays, replay buffers of diffusion policy.

#[cfg(target_arch = "wasm32")]
mod codecs;
mod file;
mod guard;
mod store;

use super::as_npy::PointFile;
use super::named_arrays;
use super::points;
use super::reading::{Parsed, TableOptions};
use super::recording::Recording;
use super::table::Columns;
use crate::error::Result;
use crate::track::{GroundTruth, KeypointTrack};
use file::Zarr;
pub use store::{ZarrStore, ZipStore};

/// Whether a file of this name describes a Zarr array or group.
pub fn describes_zarr(name: &str) -> bool {
    store::DESCRIPTIONS.contains(&name)
}

impl Recording {
    /// Frames, and points if there are any, of a Zarr hierarchy; `array` names the array of frames,
    /// where it is another one than `images` or `frames`, or one of several cameras. Up to 256 MiB
    /// of unpacked chunks are kept.
    ///
    /// # Errors
    /// When a description or an array cannot be read, or its arrays do not hold frames and points;
    /// the message names the array.
    pub fn from_zarr(
        store: Box<dyn ZarrStore>,
        array: Option<&str>,
        options: &TableOptions,
    ) -> Result<Self> {
        Self::new(Box::new(Zarr::open(store)?), array, options)
    }
}

impl PointFile {
    /// A Zarr hierarchy.
    ///
    /// # Errors
    /// When a description cannot be read, and when there is no array.
    pub fn from_zarr(store: Box<dyn ZarrStore>) -> Result<Self> {
        Ok(Self::new(Box::new(Zarr::open(store)?)))
    }
}

/// Reads the points of a Zarr hierarchy as a ground truth; it need not have frames. `columns` says
/// which array has the positions of which object (`agent=state[0:2]`).
///
/// # Errors
/// As [`Recording::from_zarr`], and when the unit of positions is not said.
pub fn read_zarr_ground_truth(
    store: Box<dyn ZarrStore>,
    columns: Option<&Columns>,
    options: &TableOptions,
) -> Result<Parsed<GroundTruth>> {
    let file = Zarr::open(store)?;
    match columns {
        Some(columns) => named_arrays::ground_truth(&file, columns, options),
        None => points::ground_truth(&file, options),
    }
}

/// As [`read_zarr_ground_truth`], of keypoints of a detector.
///
/// # Errors
/// As [`read_zarr_ground_truth`].
pub fn read_zarr_keypoints(
    store: Box<dyn ZarrStore>,
    options: &TableOptions,
) -> Result<Parsed<KeypointTrack>> {
    points::keypoints(&Zarr::open(store)?, options)
}
