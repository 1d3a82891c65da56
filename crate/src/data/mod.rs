//! Tables, images and sequences, parsed from bytes: the same code serves a dropped file and a folder on disk.

mod classify;
mod frames;
mod image;
mod join;
mod resize;
mod split;
mod table;

pub use classify::{Classification, Role, classify};
pub use frames::{FrameIndex, SequenceRange, ranges};
pub use image::{Frame, MAX_SIDE, MIN_SIDE};
pub use join::{Join, join};
pub use resize::{Filter, resize_planar};
pub use split::{Parts, Split, numpy_permutation};
#[cfg(feature = "report")]
pub(crate) use table::quote_csv;
pub use table::{Table, keypoints_csv, parse_ground_truth, parse_keypoints};
