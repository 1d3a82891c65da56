//! Tables, images, sequences and recordings, parsed from bytes: the same code serves a dropped file
//! and a folder on disk.

mod archive;
mod archive_name;
mod arrays;
#[cfg(any(feature = "hdf5", feature = "zarr"))]
mod as_npy;
#[cfg(all(feature = "engine", not(target_arch = "wasm32")))]
mod blocks;
#[cfg(feature = "space")]
mod camera;
mod decode;
mod export;
mod frame_array;
mod frames;
#[cfg(feature = "hdf5")]
mod hdf5;
mod image;
mod join;
mod memory;
#[cfg(any(feature = "hdf5", feature = "zarr"))]
mod named_arrays;
mod names;
mod npy;
mod npz;
#[cfg(feature = "parquet")]
mod parquet;
mod points;
mod reading;
mod recording;
mod resize;
mod sequences;
mod source;
mod split;
mod table;
mod tap_vid;
#[cfg(feature = "zarr")]
mod zarr;

#[cfg(feature = "parquet")]
pub use self::parquet::{PARQUET_MAGIC, VideoEpisode, export_parquet, read_video_episodes};
#[cfg(feature = "zarr")]
pub use self::zarr::{
    ZarrStore, ZipStore, describes_zarr, read_zarr_ground_truth, read_zarr_keypoints,
};
pub use archive::{
    ArchiveEntry, ArchiveIndex, MAX_ENTRIES, MAX_ENTRY, MAX_RATIO, RATIO_FROM,
    TAIL as ARCHIVE_TAIL, ZIP_MAGIC,
};
#[cfg(any(feature = "hdf5", feature = "zarr"))]
pub use as_npy::{PointFile, StoredPoints};
#[cfg(all(feature = "engine", not(target_arch = "wasm32")))]
pub(crate) use blocks::for_blocks;
#[cfg(feature = "space")]
pub use camera::{Camera, Projected};
pub use export::Export;
pub use frames::{FrameIndex, SequenceRange, ranges};
#[cfg(feature = "hdf5")]
pub use hdf5::{HDF5_MAGIC, Ranges, read_hdf5_ground_truth, read_hdf5_keypoints};
#[cfg(feature = "train")]
pub(crate) use image::planes;
pub use image::{Frame, MAX_SIDE, MIN_SIDE, OVERSHOOT, Pixels};
pub use join::{Alignment, Join, join, join_aligned};
pub use memory::{FramesInMemory, PointSequences};
pub(crate) use names::{is_hidden, is_image, last_number};
pub use npy::{MAGIC as NPY_MAGIC, NpyArray};
pub use npz::{
    NpzWriter, ground_truth_of_arrays, keypoints_of_arrays, parse_npz_ground_truth,
    parse_npz_keypoints,
};
pub use reading::{
    AxisOrder, Flip, Ground, Known, Layout, Notice, Parsed, Reading, Space, TableOptions,
};
pub use recording::Recording;
pub use resize::{Filter, resize_planar};
pub use source::{EncodedFrames, FrameSource};
pub use split::{Parts, Split, SplitBy, numpy_permutation, parse_episodes};
pub use table::Columns;
pub(crate) use table::look_at_table;
#[cfg(feature = "report")]
pub(crate) use table::quote_csv;
pub use table::{coco_json, deeplabcut_csv};
pub use table::{ground_truth_csv, keypoints_csv, parse_ground_truth, parse_keypoints};
pub use tap_vid::export as export_pickle;
