//! Numpy arrays (`.npy`).

use std::io::Read;

use super::arrays::{ArrayInfo, CONFIDENCES, ENDS, FRAMES, Kind, NAMES, POINTS, Values, Y_FIRST};
use crate::error::{Error, Result};
use crate::memory;

/// The first bytes of a `.npy` array.
pub const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// Longer than the header of any array of numbers; a guard against damaged files.
pub(super) const MAX_HEADER: u32 = 1 << 16;

/// An array of an NPZ file, `.npy`: the whole of it, or of frames at least the header.
#[derive(Debug, Clone)]
pub struct NpyArray {
    /// Its name, without `.npy`.
    pub name: String,
    /// The bytes from its beginning.
    pub bytes: Vec<u8>,
    /// The size of all of it, unpacked.
    pub size: u64,
}

impl NpyArray {
    /// As many bytes hold the header of any array.
    pub const HEAD: u64 = MAX_HEADER as u64 + 12;

    /// An array that is a file by itself, taken for points.
    pub fn alone(bytes: Vec<u8>) -> Self {
        Self {
            name: "keypoints".to_owned(),
            size: bytes.len() as u64,
            bytes,
        }
    }

    /// Whether an array of this name holds frames.
    pub fn holds_frames(name: &str) -> bool {
        FRAMES.contains(&name)
    }

    /// Whether an array of this name says what frames there are: it holds them, or where their
    /// episodes end.
    pub fn tells_frames(name: &str) -> bool {
        Self::holds_frames(name) || name == ENDS
    }

    /// Whether an array of this name is needed as a whole, because it holds points, their names,
    /// their axis order, how sure they are or where episodes end.
    pub fn is_needed_whole(name: &str) -> bool {
        Self::holds_points(name)
            || CONFIDENCES.contains(&name)
            || NAMES.contains(&name)
            || name == Y_FIRST
            || name == ENDS
    }

    /// Whether an array of this name holds points.
    pub fn holds_points(name: &str) -> bool {
        POINTS.contains(&name)
    }
}

/// The header of a `.npy` array. Own code: it is a Python dictionary of three keys that numpy
/// always writes in the same form, and the libraries that read it bring a parser generator and a C
/// compiler.
pub(super) struct Header {
    pub dtype: String,
    pub fortran: bool,
    pub shape: Vec<u64>,
    /// Bytes of an element.
    pub item: u64,
    /// Bytes before the first element.
    pub length: u64,
}

impl Header {
    pub fn read(reader: &mut impl Read) -> Result<Self> {
        let mut start = [0; 8];
        reader.read_exact(&mut start).map_err(|e| damaged(&e))?;
        if start[..6] != *MAGIC {
            return Err(Error::input("not a numpy array"));
        }
        let mut size = [0; 4];
        let size_bytes = if start[6] == 1 { 2 } else { 4 };
        reader
            .read_exact(&mut size[..size_bytes])
            .map_err(|e| damaged(&e))?;
        let size = u32::from_le_bytes(size);
        let mut text = Vec::new();
        if (1..=3).contains(&start[6]) && size <= MAX_HEADER {
            reader
                .take(u64::from(size))
                .read_to_end(&mut text)
                .map_err(|e| damaged(&e))?;
        }
        let text = String::from_utf8_lossy(&text).into_owned();
        let length = 8 + size_bytes as u64 + u64::from(size);
        Self::parse(&text, length).ok_or_else(|| {
            Error::input(format!(
                "the header of the numpy array is not understood: `{}`; expected an array of numbers or strings",
                text.trim_end()
            ))
        })
    }

    fn parse(text: &str, length: u64) -> Option<Self> {
        let value = |key: &str| {
            Some(
                text.split_once(key)?
                    .1
                    .trim_start()
                    .strip_prefix(':')?
                    .trim_start(),
            )
        };
        let dtype = value("'descr'")?.strip_prefix('\'')?.split_once('\'')?.0;
        let fortran = value("'fortran_order'")?.starts_with("True");
        let shape = value("'shape'")?.strip_prefix('(')?.split_once(')')?.0;
        let shape: Option<Vec<u64>> = shape
            .split(',')
            .map(str::trim)
            .filter(|n| !n.is_empty())
            .map(|n| n.parse().ok())
            .collect();
        Self::of(dtype, fortran, shape?, length)
    }

    /// Of an array of numpy type `dtype` (`<f4`), `length` bytes before its first element; `None`
    /// where that is no type of numbers or texts.
    pub fn of(dtype: &str, fortran: bool, shape: Vec<u64>, length: u64) -> Option<Self> {
        let width: u64 = dtype.get(2..)?.parse().ok()?;
        let unit = if dtype.get(1..2)? == "U" { 4 } else { 1 };
        Some(Self {
            dtype: dtype.to_owned(),
            fortran,
            shape,
            item: width.checked_mul(unit)?,
            length,
        })
    }

    /// The size of all elements; an error when the array does not have `size` bytes.
    pub fn check(&self, name: &str, size: u64) -> Result<u64> {
        let bytes = self
            .bytes()
            .filter(|b| b.checked_add(self.length) == Some(size));
        bytes.ok_or_else(|| {
            Error::input(format!(
                "`{name}` has {} bytes, shape {:?} of {} needs {}; is the file complete?",
                size.saturating_sub(self.length),
                self.shape,
                self.dtype,
                self.bytes()
                    .map_or("more than there can be".to_owned(), |b| b.to_string())
            ))
        })
    }

    /// Where the elements at the `leading` indices begin, after the header, and their size in
    /// bytes.
    pub fn part(&self, leading: &[u64]) -> (u64, u64) {
        let count: u64 = self.shape[leading.len()..].iter().product();
        let strides = self.shape[..leading.len()].iter().zip(leading);
        let start = strides.fold(0, |start, (size, i)| start * size + i) * count;
        (start * self.item, count * self.item)
    }

    /// The numbers that `bytes` hold.
    pub fn values(&self, name: &str, bytes: &[u8]) -> Result<Values> {
        let by_rows;
        let bytes = match self.fortran {
            true if self.bytes() == Some(bytes.len() as u64) => {
                by_rows = self.by_rows(bytes);
                &by_rows[..]
            }
            true => {
                return Err(Error::input(format!(
                    "`{name}` is stored column by column; save np.ascontiguousarray of it"
                )));
            }
            false => bytes,
        };
        let big = self.dtype.starts_with('>');
        Ok(match self.kind() {
            Some(Kind::U8) => Values::U8(bytes.to_vec()),
            Some(Kind::F32) if big => Values::F32(numbers(bytes, f32::from_be_bytes)),
            Some(Kind::F32) => Values::F32(numbers(bytes, f32::from_le_bytes)),
            Some(Kind::F64) if big => Values::F64(numbers(bytes, f64::from_be_bytes)),
            Some(Kind::F64) => Values::F64(numbers(bytes, f64::from_le_bytes)),
            Some(Kind::Number) => {
                let number = |bytes: &[u8]| self.number(bytes);
                let item = self.item.max(1) as usize;
                Values::F64(bytes.chunks_exact(item).map(number).collect())
            }
            None => {
                return Err(Error::input(format!(
                    "`{name}` is of type {}, which is not read",
                    self.dtype
                )));
            }
        })
    }

    /// The elements of an array that is stored column by column, row by row.
    fn by_rows(&self, bytes: &[u8]) -> Vec<u8> {
        let item = self.item as usize;
        let mut out = Vec::with_capacity(bytes.len());
        let mut index = vec![0_u64; self.shape.len()];
        for _ in 0..bytes.len() / item.max(1) {
            let axes = index.iter().zip(&self.shape).rev();
            let place = axes.fold(0, |place, (i, n)| place * n + i) as usize * item;
            out.extend(&bytes[place..place + item]);
            for (i, n) in index.iter_mut().zip(&self.shape).rev() {
                *i += 1;
                if *i < *n {
                    break;
                }
                *i = 0;
            }
        }
        out
    }

    /// A number of one of the types of [`Kind::Number`].
    fn number(&self, bytes: &[u8]) -> f64 {
        let mut little = [0; 8];
        let used = &mut little[..bytes.len().min(8)];
        used.copy_from_slice(&bytes[..used.len()]);
        if self.dtype.starts_with('>') {
            used.reverse();
        }
        let is_negative = used.last().is_some_and(|byte| *byte >= 0x80);
        if self.dtype.get(1..2) == Some("f") {
            return half::f16::from_le_bytes([little[0], little[1]]).to_f64();
        }
        if self.dtype.get(1..2) == Some("i") && is_negative {
            little[bytes.len().min(8)..].fill(0xff);
        }
        match self.dtype.get(1..2) {
            Some("i") => i64::from_le_bytes(little) as f64,
            _ => u64::from_le_bytes(little) as f64,
        }
    }

    /// The array by its header.
    pub fn info(&self) -> ArrayInfo {
        ArrayInfo {
            shape: self.shape.clone(),
            dtype: self.dtype.clone(),
            kind: self.kind(),
        }
    }

    fn kind(&self) -> Option<Kind> {
        match &self.dtype[1..] {
            "u1" => Some(Kind::U8),
            "f4" => Some(Kind::F32),
            "f8" => Some(Kind::F64),
            "i1" | "i2" | "i4" | "i8" | "u2" | "u4" | "u8" | "f2" | "b1" => Some(Kind::Number),
            _ => None,
        }
    }

    /// The size of all elements.
    fn bytes(&self) -> Option<u64> {
        self.shape
            .iter()
            .try_fold(self.item, |bytes, n| bytes.checked_mul(*n))
    }
}

fn numbers<T, const N: usize>(bytes: &[u8], number: impl Fn([u8; N]) -> T) -> Vec<T> {
    bytes
        .as_chunks()
        .0
        .iter()
        .map(|bytes| number(*bytes))
        .collect()
}

/// The type and the elements of an array of texts.
///
/// # Errors
/// When there is no memory for them: each takes as much as the longest.
pub(super) fn texts(values: &[String]) -> Result<(String, Vec<u8>)> {
    let lengths = values.iter().map(|text| text.chars().count());
    let width = lengths.max().unwrap_or(0).max(1);
    let bytes = values.len().saturating_mul(width).saturating_mul(4);
    memory::check(bytes as u64, "names", "is the file damaged?")?;
    let mut elements = Vec::with_capacity(bytes);
    for text in values {
        let padded = text.chars().map(u32::from).chain(std::iter::repeat(0));
        elements.extend(padded.take(width).flat_map(u32::to_le_bytes));
    }
    Ok((format!("<U{width}"), elements))
}

/// The header of a `.npy` array of numpy type `dtype`.
pub(super) fn header(dtype: &str, shape: &[usize]) -> Vec<u8> {
    let sizes: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let mut text = format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({sizes}), }}");
    // numpy aligns the first element to 64 bytes.
    let padding = 63 - (10 + text.len()) % 64;
    text.push_str(&" ".repeat(padding));
    text.push('\n');
    let mut header = MAGIC.to_vec();
    header.extend([1, 0]);
    header.extend((text.len() as u16).to_le_bytes());
    header.extend(text.as_bytes());
    header
}

pub(super) fn damaged(error: &std::io::Error) -> Error {
    Error::input(format!(
        "the array cannot be read ({error}); is the file complete?"
    ))
}
