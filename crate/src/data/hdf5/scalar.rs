//! Numbers of HDF5's types, beyond those that are read as they are.

use half::f16;
use hdf5_reader::error::ByteOrder;
use hdf5_reader::{Dataset, Datatype};

use super::errors::unreadable;
use crate::data::arrays::check_declared;
use crate::error::{Error, Result};

/// How a number is stored.
#[derive(Debug, Clone, Copy)]
pub struct Scalar {
    pub size: usize,
    kind: Kind,
    is_big: bool,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Signed,
    Unsigned,
    Float,
}

impl Scalar {
    /// None for what is no number. Booleans are numbers: h5py writes them as an enumeration,
    /// PyTables as a field of bits.
    pub fn of(datatype: &Datatype) -> Option<Self> {
        let (size, kind, order) = match datatype {
            Datatype::FixedPoint {
                size,
                signed,
                byte_order,
            } => match signed {
                true => (*size, Kind::Signed, *byte_order),
                false => (*size, Kind::Unsigned, *byte_order),
            },
            Datatype::Bitfield { size, byte_order } => (*size, Kind::Unsigned, *byte_order),
            Datatype::FloatingPoint { size, byte_order } => (*size, Kind::Float, *byte_order),
            Datatype::Enum { base, .. } => return Self::of(base),
            _ => return None,
        };
        let is_known = match kind {
            Kind::Float => matches!(size, 2 | 4 | 8),
            Kind::Signed | Kind::Unsigned => (1..=8).contains(&size),
        };
        is_known.then_some(Self {
            size: size.into(),
            kind,
            is_big: order == ByteOrder::BigEndian,
        })
    }

    /// The number in as many bytes as it has; 0 where there are others.
    pub fn number(self, bytes: &[u8]) -> f64 {
        let mut little = [0; 8];
        if bytes.len() != self.size {
            return 0.0;
        }
        little[..self.size].copy_from_slice(bytes);
        if self.is_big {
            little[..self.size].reverse();
        }
        match self.kind {
            Kind::Float => match self.size {
                2 => f16::from_le_bytes([little[0], little[1]]).to_f64(),
                4 => f32::from_le_bytes([little[0], little[1], little[2], little[3]]).into(),
                _ => f64::from_le_bytes(little),
            },
            Kind::Unsigned => u64::from_le_bytes(little) as f64,
            Kind::Signed => {
                // The sign is moved to the top, and comes back down with the number.
                let unused = 64 - 8 * self.size as u32;
                (i64::from_le_bytes(little) << unused >> unused) as f64
            }
        }
    }
}

/// The bytes of a whole data set; its file has `file` bytes.
///
/// # Errors
/// When it cannot be read, or declares more than can be in the file or in memory.
pub fn bytes(dataset: &Dataset, name: &str, file: u64) -> Result<Vec<u8>> {
    check_size(dataset, name, file)?;
    dataset.read_raw_bytes().map_err(|e| unreadable(name, &e))
}

/// Checks what a whole data set declares to hold; its file has `file` bytes.
///
/// # Errors
/// When that is more than can be in the file or in memory.
pub fn check_size(dataset: &Dataset, name: &str, file: u64) -> Result<()> {
    let size = dataset.raw_byte_len();
    let size = size.map_err(|e| unreadable(name, &e))? as u64;
    check_declared(size, file, &format!("`{name}`"))
}

/// All numbers of a data set, row by row; its file has `file` bytes.
///
/// # Errors
/// When it holds no numbers or cannot be read.
pub fn numbers(dataset: &Dataset, name: &str, file: u64) -> Result<Vec<f64>> {
    let scalar = Scalar::of(dataset.dtype())
        .ok_or_else(|| Error::input(format!("`{name}` holds no numbers")))?;
    let bytes = bytes(dataset, name, file)?;
    let numbers = bytes.chunks_exact(scalar.size);
    Ok(numbers.map(|bytes| scalar.number(bytes)).collect())
}
