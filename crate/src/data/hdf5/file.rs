//! An open HDF5 file as a file of arrays, as the authors' `record.py` and h5py write them.

use hdf5_reader::storage::DynStorage;
use hdf5_reader::{Dataset, Datatype, H5Type, Hdf5File, OpenOptions, SliceInfo, SliceInfoElem};

use super::errors::{broken, unreadable};
use super::scalar::{Scalar, check_size, numbers};
use super::{pandas, sleap};
use crate::data::arrays::{ArrayFile, ArrayInfo, Kind, Members, Values};
use crate::data::export::Export;
use crate::data::reading::AxisOrder;
use crate::error::{Error, Result};

/// What is kept of unpacked chunks at most. h5py's own choice of chunks for the paper's recording
/// puts 63 sequences into a chunk, so that all frames of 63 sequences together (495 MB) have to be
/// unpacked to read one sequence.
const MAX_CHUNK_CACHE: u64 = if cfg!(target_arch = "wasm32") {
    // A browser gives a page less.
    1 << 27
} else {
    1 << 30
};

/// An image of [`MAX_SIDE`](crate::data::MAX_SIDE) squared in f64; a guard against damaged files.
const MAX_READ: usize = 8192 * 8192 * 3 * 8;

/// An open HDF5 file.
pub struct Hdf5 {
    pub file: Hdf5File,
}

impl Hdf5 {
    /// Opens a file; up to 1 GiB of unpacked chunks are kept.
    ///
    /// # Errors
    /// When it is no whole HDF5 file.
    pub fn open(storage: DynStorage) -> Result<Self> {
        let options = || OpenOptions::default().with_max_read_bytes(MAX_READ);
        let open = |options| {
            Hdf5File::from_storage_with_options(storage.clone(), options).map_err(|e| broken(&e))
        };
        let file = open(options())?;
        let (there, written) = (storage.len(), file.superblock().eof_address);
        if there < written {
            return Err(Error::input(format!(
                "the HDF5 file has {there} bytes and was written with {written}; it was cut short"
            )));
        }
        let bytes = ["images", "frames"]
            .iter()
            .filter_map(|name| chunks_of_a_sequence(&file, name))
            .max()
            .unwrap_or(0);
        let bytes = bytes.clamp(1 << 26, MAX_CHUNK_CACHE) as usize;
        let options = options()
            .with_chunk_cache_bytes(bytes)
            .with_chunk_cache_slots(1 << 20);
        Ok(Self {
            file: open(options)?,
        })
    }
}

/// The bytes of all chunks that hold something of one sequence.
fn chunks_of_a_sequence(file: &Hdf5File, name: &str) -> Option<u64> {
    let dataset = file.dataset(name).ok()?;
    let chunk = dataset.chunks()?;
    let item = match dataset.dtype() {
        Datatype::FixedPoint { size, .. } | Datatype::FloatingPoint { size, .. } => {
            u64::from(*size)
        }
        _ => return None,
    };
    let whole = |(n, chunk): (&u64, &u32)| n.checked_next_multiple_of(u64::from(*chunk));
    let first = u64::from(*chunk.first()?);
    let mut axes = dataset.shape().iter().zip(&chunk).skip(1).map(whole);
    axes.try_fold(item.checked_mul(first)?, |bytes, n| bytes.checked_mul(n?))
}

impl ArrayFile for Hdf5 {
    fn export(&self) -> Result<Option<Export>> {
        match pandas::export(&self.file)? {
            Some(table) => Ok(Some(table)),
            None => sleap::export(&self.file),
        }
    }

    fn names(&self) -> Result<Vec<String>> {
        Ok(self.members("")?.arrays)
    }

    fn members(&self, group: &str) -> Result<Members> {
        let mut found = self.file.root_group().map_err(|e| broken(&e))?;
        for part in group.split('/').filter(|part| !part.is_empty()) {
            // By name: listing a group of thousands of episodes for each of them takes long.
            found = match found.group(part) {
                Err(hdf5_reader::error::Error::GroupNotFound(_)) => return Ok(Members::default()),
                next => next.map_err(|e| unreadable(group, &e))?,
            };
        }
        let (groups, arrays) = found.member_names().map_err(|e| broken(&e))?;
        Ok(Members { groups, arrays })
    }

    fn info(&self, name: &str) -> Result<Option<ArrayInfo>> {
        let (group, own) = name.rsplit_once('/').unwrap_or(("", name));
        if !self.members(group)?.arrays.iter().any(|n| n == own) {
            return Ok(None);
        }
        let dataset = self.file.dataset(name).map_err(|e| unreadable(name, &e))?;
        // Records, as SLEAP's `frames` and `points`.
        if let Datatype::Compound { .. } = dataset.dtype() {
            return Ok(None);
        }
        let (kind, dtype) = kind(dataset.dtype());
        Ok(Some(ArrayInfo {
            shape: dataset.shape().to_vec(),
            dtype,
            kind,
        }))
    }

    fn read(&self, name: &str, leading: &[u64]) -> Result<Values> {
        let failed = |e| unreadable(name, &e);
        let dataset = self.file.dataset(name).map_err(failed)?;
        let file = self.file.storage().len();
        if leading.is_empty() {
            check_size(&dataset, name, file)?;
        }
        let mut selection = SliceInfo::all(dataset.ndim());
        for (element, index) in selection.selections.iter_mut().zip(leading) {
            *element = SliceInfoElem::Index(*index);
        }
        match kind(dataset.dtype()).0 {
            Some(Kind::U8) => elements(&dataset, &selection).map(Values::U8),
            Some(Kind::F32) => elements(&dataset, &selection).map(Values::F32),
            Some(Kind::F64) => elements(&dataset, &selection).map(Values::F64),
            Some(Kind::Number) if leading.is_empty() => {
                return numbers(&dataset, name, file).map(Values::F64);
            }
            Some(Kind::Number) | None => {
                return Err(Error::input(format!(
                    "`{name}` is of a type that is not read"
                )));
            }
        }
        .map_err(failed)
    }

    fn size(&self) -> Option<u64> {
        Some(self.file.storage().len())
    }

    fn axes(&self) -> Option<AxisOrder> {
        // A boolean of h5py is an enumeration of one byte.
        let attribute = self
            .file
            .root_group()
            .ok()?
            .attribute("save/format/y_first")
            .ok()?;
        match attribute.raw_data.first()? {
            0 => Some(AxisOrder::Xy),
            _ => Some(AxisOrder::Yx),
        }
    }

    fn strings(&self, name: &str) -> Result<Vec<String>> {
        let dataset = self.file.dataset(name).map_err(|e| unreadable(name, &e))?;
        dataset.read_strings().map_err(|e| unreadable(name, &e))
    }

    fn point_names(&self) -> Result<Option<Vec<String>>> {
        if let Ok(names) = self.file.dataset("names") {
            let names = names.read_strings();
            return names
                .map(Some)
                .map_err(|e| Error::input(format!("`names` is no list of names ({e})")));
        }
        let root = self.file.root_group().map_err(|e| broken(&e))?;
        let objects = root.attribute("environment/keypoints/objects");
        let links = root.attribute("environment/keypoints/links");
        let (Ok(objects), Ok(links)) = (
            objects.and_then(|a| a.read_strings()),
            links.and_then(|a| a.read_1d::<i64>()),
        ) else {
            return Ok(None);
        };
        let id = root
            .attribute("environment/id")
            .and_then(|a| a.read_string());
        let push = id.is_ok_and(|id| id.starts_with("PandaPush"));
        let object = |name: String| {
            if push && name == "object" {
                "cube".to_owned()
            } else {
                name
            }
        };
        let link = |n: i64| {
            if push && n == 11 {
                "eef".to_owned()
            } else {
                format!("link_{n}")
            }
        };
        Ok(Some(
            objects
                .into_iter()
                .map(object)
                .chain(links.into_iter().map(link))
                .collect(),
        ))
    }
}

/// How elements of a type are read, and what it is called.
fn kind(datatype: &Datatype) -> (Option<Kind>, String) {
    let called = match datatype {
        Datatype::FixedPoint { size, signed, .. } => {
            let sign = if *signed { "" } else { "u" };
            format!("{sign}int{}", u16::from(*size) * 8)
        }
        Datatype::FloatingPoint { size, .. } => format!("float{}", u16::from(*size) * 8),
        Datatype::Enum { .. } => "an enumeration".to_owned(),
        _ => "no number".to_owned(),
    };
    let kind = match (datatype, called.as_str()) {
        (Datatype::FixedPoint { .. }, "uint8") => Some(Kind::U8),
        (_, "float32") => Some(Kind::F32),
        (_, "float64") => Some(Kind::F64),
        _ => Scalar::of(datatype).map(|_| Kind::Number),
    };
    (kind, called)
}

fn elements<T: H5Type + Clone>(
    dataset: &Dataset,
    selection: &SliceInfo,
) -> Result<Vec<T>, hdf5_reader::error::Error> {
    Ok(dataset.read_slice::<T>(selection)?.into_iter().collect())
}
