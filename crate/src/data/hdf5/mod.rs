//! HDF5 files: recordings and arrays of points, data frames of pandas (DeepLabCut), and projects of
//! SLEAP.

mod errors;
mod file;
mod pandas;
mod records;
mod scalar;
mod sleap;

use std::fs::File;
use std::sync::Arc;

use hdf5_reader::storage::{BytesStorage, DynStorage, FileStorage, Storage, StorageBuffer};

use super::arrays::ArrayFile as _;
use super::as_npy::{PointFile, has_points};
use super::export::Export;
use super::named_arrays;
use super::points;
use super::reading::{Parsed, TableOptions};
use super::recording::Recording;
use super::table::Columns;
use crate::error::{Error, Result};
use crate::track::{GroundTruth, KeypointTrack};
use errors::broken;
use file::Hdf5;

/// The first bytes of an HDF5 file.
pub const HDF5_MAGIC: &[u8; 8] = b"\x89HDF\r\n\x1a\n";

impl Recording {
    /// Frames, and points if there are any, of an HDF5 file in memory; `array` names the array of
    /// frames, where it is another one than `images` or `frames`, or one of several cameras. Without
    /// `options.axes` the file's attribute `save/format/y_first` decides the order of the points'
    /// coordinates, else it is (x, y).
    ///
    /// Points are named by an array of strings `names`, or by the attributes that the authors'
    /// `record.py` leaves: the objects, then the links as `link_4`. Of PandaPush, `object` is
    /// called `cube` and link 11 `eef`, as in the paper.
    ///
    /// # Errors
    /// When the file is no whole HDF5 file, or its arrays do not hold frames and points; the
    /// message names the array.
    pub fn from_hdf5_bytes(
        bytes: Vec<u8>,
        array: Option<&str>,
        options: &TableOptions,
    ) -> Result<Self> {
        Self::from_storage(Arc::new(BytesStorage::new(bytes)), array, options)
    }

    /// As [`Recording::from_hdf5_bytes`], of an open file; frames are read from it when they are
    /// asked for. Up to 1 GiB of unpacked chunks are kept.
    ///
    /// # Errors
    /// As [`Recording::from_hdf5_bytes`].
    pub fn from_hdf5_file(file: File, array: Option<&str>, options: &TableOptions) -> Result<Self> {
        let storage = FileStorage::from_file(file).map_err(|e| broken(&e))?;
        Self::from_storage(Arc::new(storage), array, options)
    }

    /// As [`Recording::from_hdf5_file`], of a file that is read by other means.
    ///
    /// # Errors
    /// As [`Recording::from_hdf5_bytes`].
    pub fn from_hdf5_ranges(
        file: Arc<dyn Ranges>,
        array: Option<&str>,
        options: &TableOptions,
    ) -> Result<Self> {
        Self::from_storage(Arc::new(Ranged(file)), array, options)
    }

    fn from_storage(
        storage: DynStorage,
        array: Option<&str>,
        options: &TableOptions,
    ) -> Result<Self> {
        Self::new(Box::new(Hdf5::open(storage)?), array, options)
    }
}

/// A file of which ranges of bytes can be read.
pub trait Ranges: Send + Sync {
    /// Its size in bytes.
    fn size(&self) -> u64;

    /// The `length` bytes from `start` on.
    ///
    /// # Errors
    /// When they cannot be read.
    fn range(&self, start: u64, length: usize) -> Result<Vec<u8>>;
}

/// A file for the reader of HDF5.
struct Ranged(Arc<dyn Ranges>);

impl Storage for Ranged {
    fn len(&self) -> u64 {
        self.0.size()
    }

    fn read_range(
        &self,
        start: u64,
        length: usize,
    ) -> Result<StorageBuffer, hdf5_reader::error::Error> {
        let end = start.checked_add(length as u64);
        if end.is_none_or(|end| end > self.len()) {
            return Err(hdf5_reader::error::Error::OffsetOutOfBounds(start));
        }
        let bytes = self.0.range(start, length);
        let bytes = bytes.map_err(|e| std::io::Error::other(e.to_string()))?;
        Ok(StorageBuffer::from_vec(bytes))
    }
}

impl PointFile {
    /// An HDF5 file in memory.
    ///
    /// # Errors
    /// When the bytes are no whole HDF5 file.
    pub fn from_hdf5_bytes(bytes: Vec<u8>) -> Result<Self> {
        Self::from_storage(Arc::new(BytesStorage::new(bytes)))
    }

    /// An HDF5 file that is read by other means.
    ///
    /// # Errors
    /// As [`PointFile::from_hdf5_bytes`].
    pub fn from_hdf5_ranges(file: Arc<dyn Ranges>) -> Result<Self> {
        Self::from_storage(Arc::new(Ranged(file)))
    }

    fn from_storage(storage: DynStorage) -> Result<Self> {
        Ok(Self::new(Box::new(Hdf5::open(storage)?)))
    }
}

/// Reads the points of an open HDF5 file as a ground truth; it need not have frames. `name` is the
/// file's, for messages, and of the sequence where the file has none. `columns` says which column of
/// a table is what, or which array has the positions of which object (`eef=obs/robot0_eef_pos`).
///
/// # Errors
/// As [`Recording::from_hdf5_bytes`], and for a table as
/// [`parse_ground_truth`](super::parse_ground_truth).
pub fn read_hdf5_ground_truth(
    file: File,
    name: &str,
    columns: Option<&Columns>,
    options: &TableOptions,
) -> Result<Parsed<GroundTruth>> {
    let read = || {
        let file = of_file(file)?;
        match (export(&file)?, columns) {
            (Some(table), _) => table.renamed(columns, false).map(Points::Table),
            (None, Some(columns)) => {
                named_arrays::ground_truth(&file, columns, options).map(Points::Read)
            }
            (None, None) => points::ground_truth(&file, options).map(Points::Read),
        }
    };
    match read().map_err(|e: Error| e.at(name))? {
        Points::Table(table) => table.ground_truth(name, options),
        Points::Read(points) => Ok(points),
    }
}

/// Points as the table that its program would export, or read already.
enum Points<T> {
    Table(Export),
    Read(Parsed<T>),
}

/// As [`read_hdf5_ground_truth`], of keypoints of a detector.
///
/// # Errors
/// As [`read_hdf5_ground_truth`].
pub fn read_hdf5_keypoints(
    file: File,
    name: &str,
    columns: Option<&Columns>,
    options: &TableOptions,
) -> Result<Parsed<KeypointTrack>> {
    let read = || {
        let file = of_file(file)?;
        match export(&file)? {
            Some(table) => table.renamed(columns, true).map(Points::Table),
            None => points::keypoints(&file, options).map(Points::Read),
        }
    };
    match read().map_err(|e: Error| e.at(name))? {
        Points::Table(table) => table.keypoints(name, options),
        Points::Read(points) => Ok(points),
    }
}

fn of_file(file: File) -> Result<Hdf5> {
    let storage = FileStorage::from_file(file).map_err(|e| broken(&e))?;
    Hdf5::open(Arc::new(storage))
}

/// The table of a program that keeps one in HDF5; `None` where points are arrays.
fn export(file: &Hdf5) -> Result<Option<Export>> {
    match has_points(file)? {
        true => Ok(None),
        false => file.export(),
    }
}
