//! A Zarr hierarchy as a file of arrays.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Display;
use std::sync::{Arc, Mutex, PoisonError, RwLock};

use half::f16;
use serde_json::Value;
use zarrs::array::chunk_cache::{ChunkCache as _, ChunkCacheDecodedLruSizeLimit};
use zarrs::array::{Array, ArraySubset, CodecOptions, ElementOwned};
use zarrs::storage::byte_range::{ByteRangeIterator, extract_byte_ranges};
use zarrs::storage::{
    Bytes, MaybeBytes, MaybeBytesIterator, ReadableStorageTraits, StorageError, StoreKey,
};

use super::guard::Guard;
use super::store::{DESCRIPTIONS, ZarrStore, most_unpacked};
use crate::data::arrays::{ArrayFile, ArrayInfo, Kind, Members, Values};
use crate::data::reading::AxisOrder;
use crate::error::{Error, Result};
use crate::memory;

/// What is kept of unpacked chunks at most; diffusion policy's hold 161 frames (18 MB).
const MAX_CHUNK_CACHE: u64 = if cfg!(target_arch = "wasm32") {
    // A browser gives a page less.
    128 << 20
} else {
    256 << 20
};
/// More axes than frames or points have; a guard against damaged files.
const MAX_AXES: usize = 8;

/// An open hierarchy.
pub struct Zarr {
    store: Arc<Guarded>,
    /// By their paths the descriptions of arrays.
    arrays: BTreeMap<String, Value>,
    open: Mutex<HashMap<String, Arc<InThread<Opened>>>>,
}

/// zarrs has no threads in a browser, and neither have we: what is of it stays where it is.
#[cfg(target_arch = "wasm32")]
type InThread<T> = send_wrapper::SendWrapper<T>;
#[cfg(not(target_arch = "wasm32"))]
type InThread<T> = T;

fn in_thread<T>(value: T) -> InThread<T> {
    #[cfg(target_arch = "wasm32")]
    let value = send_wrapper::SendWrapper::new(value);
    value
}

/// An array whose chunks are kept for a while.
struct Opened {
    info: ArrayInfo,
    chunks: ChunkCacheDecodedLruSizeLimit,
}

impl Zarr {
    /// Reads the descriptions of all arrays.
    ///
    /// # Errors
    /// When a description cannot be read, and when there is no array.
    pub fn open(store: Box<dyn ZarrStore>) -> Result<Self> {
        #[cfg(target_arch = "wasm32")]
        super::codecs::register();
        let mut arrays = BTreeMap::new();
        for key in store.keys() {
            let (path, file) = key.rsplit_once('/').unwrap_or(("", &key));
            if !DESCRIPTIONS.contains(&file) || file == ".zgroup" {
                continue;
            }
            let description: Value = serde_json::from_slice(&store.read(&key)?).map_err(|e| {
                Error::input(format!("not a description of an array ({e})")).at(&key)
            })?;
            if file == ".zarray" || description["node_type"] == "array" {
                arrays.insert(path.to_owned(), description);
            }
        }
        if arrays.is_empty() {
            return Err(Error::input(
                "there is no Zarr array, of version 2 (.zarray) or 3 (zarr.json); is the folder \
                 complete?",
            ));
        }
        Ok(Self {
            store: Arc::new(Guarded {
                store,
                guards: RwLock::default(),
            }),
            arrays,
            open: Mutex::default(),
        })
    }

    #[cfg_attr(
        target_arch = "wasm32",
        allow(
            clippy::arc_with_non_send_sync,
            reason = "zarrs takes an Arc of what it does not share"
        )
    )]
    fn array(&self, path: &str) -> Result<Arc<InThread<Opened>>> {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(array) = open.get(path) {
            return Ok(Arc::clone(array));
        }
        let description = self.arrays.get(path);
        let description = description.ok_or_else(|| Error::input("there is no such array"))?;
        let info = info(description)?;
        let most = most_unpacked(self.store.store.size());
        let guard = Guard::of(description, item(&info.dtype), most)?;
        self.store
            .guards
            .write()
            .unwrap_or_else(PoisonError::into_inner)
            .insert(format!("{path}/"), guard);
        let storage: Arc<dyn ReadableStorageTraits> = self.store.clone();
        let array = Array::open(storage, &format!("/{path}")).map_err(|e| unreadable(&e))?;
        let kept = MAX_CHUNK_CACHE.min(2 * most);
        let array = Arc::new(in_thread(Opened {
            info,
            chunks: ChunkCacheDecodedLruSizeLimit::new(Arc::new(array), kept),
        }));
        open.insert(path.to_owned(), Arc::clone(&array));
        Ok(array)
    }

    /// The elements at the `leading` indices.
    fn elements<T: ElementOwned>(&self, array: &Opened, leading: &[u64]) -> Result<Vec<T>> {
        let shape = &array.info.shape;
        let fixed = leading.iter().map(|i| *i..*i + 1);
        let ranges: Vec<_> = fixed
            .chain(shape[leading.len()..].iter().map(|n| 0..*n))
            .collect();
        let most = most_unpacked(self.store.store.size());
        let mut sides = ranges.iter().map(|range| range.end - range.start);
        // A text of its own takes 24.
        let item = match item(&array.info.dtype) {
            0 => 24,
            bytes => bytes,
        };
        let bytes = sides.try_fold(item, |bytes: u64, n| bytes.checked_mul(n));
        let bytes = bytes.filter(|bytes| *bytes <= most).ok_or_else(|| {
            Error::input(format!(
                "shape {shape:?} is more than {most} bytes, and its file has {}; is it damaged?",
                self.store.store.size()
            ))
        })?;
        memory::check(bytes.saturating_mul(4), "values", "split the file")?;
        // Frames are read by many threads already.
        let options = CodecOptions::default().with_concurrent_target(1);
        let subset = ArraySubset::new_with_ranges(&ranges);
        let read = array
            .chunks
            .retrieve_array_subset::<Vec<T>>(&subset, &options);
        read.map_err(|e| unreadable(&e))
    }

    fn numbers<T: ElementOwned>(
        &self,
        array: &Opened,
        leading: &[u64],
        number: impl Fn(T) -> f64,
    ) -> Result<Values> {
        let elements = self.elements(array, leading)?;
        Ok(Values::F64(elements.into_iter().map(number).collect()))
    }
}

impl ArrayFile for Zarr {
    fn names(&self) -> Result<Vec<String>> {
        Ok(self.members("")?.arrays)
    }

    fn members(&self, group: &str) -> Result<Members> {
        let mut members = Members::default();
        for path in self.arrays.keys() {
            let below = match group {
                "" => Some(path.as_str()),
                _ => path
                    .strip_prefix(group)
                    .and_then(|rest| rest.strip_prefix('/')),
            };
            match below.map(|below| below.split_once('/').ok_or(below)) {
                Some(Ok((name, _))) if members.groups.last().is_none_or(|last| last != name) => {
                    members.groups.push(name.to_owned());
                }
                Some(Err(name)) => members.arrays.push(name.to_owned()),
                Some(Ok(_)) | None => {}
            }
        }
        Ok(members)
    }

    fn info(&self, name: &str) -> Result<Option<ArrayInfo>> {
        let description = self.arrays.get(name);
        let placed = |e: Error| e.at(format!("`{name}`"));
        description.map(info).transpose().map_err(placed)
    }

    fn read(&self, name: &str, leading: &[u64]) -> Result<Values> {
        let read = || {
            let array = &*self.array(name)?;
            match array.info.dtype.as_str() {
                "uint8" => self.elements(array, leading).map(Values::U8),
                "float32" => self.elements(array, leading).map(Values::F32),
                "float64" => self.elements(array, leading).map(Values::F64),
                "bool" => self.numbers(array, leading, |v: bool| f64::from(u8::from(v))),
                "int8" => self.numbers(array, leading, |v: i8| f64::from(v)),
                "int16" => self.numbers(array, leading, |v: i16| f64::from(v)),
                "int32" => self.numbers(array, leading, |v: i32| f64::from(v)),
                "int64" => self.numbers(array, leading, |v: i64| v as f64),
                "uint16" => self.numbers(array, leading, |v: u16| f64::from(v)),
                "uint32" => self.numbers(array, leading, |v: u32| f64::from(v)),
                "uint64" => self.numbers(array, leading, |v: u64| v as f64),
                "float16" => self.numbers(array, leading, f16::to_f64),
                other => Err(Error::input(format!(
                    "it is of type {other}, which is not read"
                ))),
            }
        };
        read().map_err(|e: Error| e.at(format!("`{name}`")))
    }

    fn size(&self) -> Option<u64> {
        Some(self.store.store.size())
    }

    /// Zarr has no note of it.
    fn axes(&self) -> Option<AxisOrder> {
        None
    }

    fn strings(&self, name: &str) -> Result<Vec<String>> {
        let read = || {
            let array = &*self.array(name)?;
            match array.info.shape[..] {
                [_] => self.elements(array, &[]),
                _ => Err(Error::input("it is no list of texts")),
            }
        };
        read().map_err(|e: Error| e.at(format!("`{name}`")))
    }

    fn point_names(&self) -> Result<Option<Vec<String>>> {
        match self.arrays.contains_key("names") {
            true => self.strings("names").map(Some),
            false => Ok(None),
        }
    }
}

/// An array by its description.
fn info(description: &Value) -> Result<ArrayInfo> {
    let wrong = || Error::input("not a description of an array; expected its shape and its type");
    let shape = description["shape"].as_array().ok_or_else(wrong)?.iter();
    let shape: Vec<u64> = shape
        .map(Value::as_u64)
        .collect::<Option<_>>()
        .ok_or_else(wrong)?;
    if shape.len() > MAX_AXES {
        return Err(wrong());
    }
    // Version 2 has numpy's short names, behind the order of bytes.
    let dtype = match (description.get("dtype"), description.get("data_type")) {
        (Some(short), _) => long_name(short.as_str().unwrap_or_default()),
        (None, Some(long)) => long.as_str().unwrap_or("no number"),
        (None, None) => return Err(wrong()),
    };
    let kind = match dtype {
        "uint8" => Some(Kind::U8),
        "float32" => Some(Kind::F32),
        "float64" => Some(Kind::F64),
        _ if item(dtype) > 0 => Some(Kind::Number),
        _ => None,
    };
    Ok(ArrayInfo {
        shape,
        dtype: dtype.to_owned(),
        kind,
    })
}

/// Types of numbers: as numpy shortens them, and as they are called, with the bytes of each.
const TYPES: [(&str, &str, u64); 12] = [
    ("b1", "bool", 1),
    ("i1", "int8", 1),
    ("i2", "int16", 2),
    ("i4", "int32", 4),
    ("i8", "int64", 8),
    ("u1", "uint8", 1),
    ("u2", "uint16", 2),
    ("u4", "uint32", 4),
    ("u8", "uint64", 8),
    ("f2", "float16", 2),
    ("f4", "float32", 4),
    ("f8", "float64", 8),
];

fn long_name(short: &str) -> &'static str {
    let own = short.trim_start_matches(['<', '>', '|']);
    let found = TYPES.iter().find(|(short, ..)| *short == own);
    found.map_or("no number", |(_, long, _)| long)
}

/// The bytes of an element; 0 of what is no number.
fn item(dtype: &str) -> u64 {
    let found = TYPES.iter().find(|(_, long, _)| *long == dtype);
    found.map_or(0, |(.., bytes)| *bytes)
}

fn unreadable(error: &impl Display) -> Error {
    Error::input(format!(
        "it cannot be read ({error}); is the file complete, and packed with blosc, gzip, zlib, \
         zstd or not at all?"
    ))
}

/// The files of a hierarchy, whose chunks are looked at before they are unpacked.
struct Guarded {
    store: Box<dyn ZarrStore>,
    /// By the paths of arrays, with the `/` behind them.
    guards: RwLock<BTreeMap<String, Guard>>,
}

impl Guarded {
    fn bytes(&self, key: &str) -> Result<Option<Vec<u8>>> {
        if !self.store.has(key) {
            return Ok(None);
        }
        let bytes = self.store.read(key)?;
        let file = key.rsplit('/').next().unwrap_or_default();
        if DESCRIPTIONS.contains(&file) || file == ".zattrs" {
            return Ok(Some(bytes));
        }
        let guards = self.guards.read().unwrap_or_else(PoisonError::into_inner);
        let guard = guards
            .iter()
            .find(|(path, _)| key.starts_with(path.as_str()));
        if let Some((_, guard)) = guard {
            guard.check(&bytes).map_err(|e| e.at(format!("`{key}`")))?;
        }
        Ok(Some(bytes))
    }
}

impl ReadableStorageTraits for Guarded {
    fn get(&self, key: &StoreKey) -> Result<MaybeBytes, StorageError> {
        let bytes = self.bytes(key.as_str());
        let bytes = bytes.map_err(|e| StorageError::Other(e.to_string()))?;
        Ok(bytes.map(Bytes::from))
    }

    fn get_partial_many<'a>(
        &'a self,
        key: &StoreKey,
        byte_ranges: ByteRangeIterator<'a>,
    ) -> Result<MaybeBytesIterator<'a>, StorageError> {
        let Some(bytes) = self.get(key)? else {
            return Ok(None);
        };
        let parts = extract_byte_ranges(&bytes, byte_ranges)?;
        Ok(Some(Box::new(
            parts.into_iter().map(|part| Ok(Bytes::from(part))),
        )))
    }

    fn size_key(&self, key: &StoreKey) -> Result<Option<u64>, StorageError> {
        Ok(self.get(key)?.map(|bytes| bytes.len() as u64))
    }

    fn supports_get_partial(&self) -> bool {
        false
    }
}
