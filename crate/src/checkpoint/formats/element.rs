//! The stored elements of a tensor.

use crate::error::Error;

/// What the elements of a stored tensor are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Element {
    F64,
    F32,
    F16,
    Bf16,
}

impl Element {
    pub fn size(self) -> usize {
        match self {
            Self::F64 => 8,
            Self::F32 => 4,
            Self::F16 | Self::Bf16 => 2,
        }
    }

    pub fn read(self, bytes: &[u8]) -> f32 {
        match (self, bytes) {
            (Self::F64, &[a, b, c, d, e, f, g, h]) => {
                f64::from_le_bytes([a, b, c, d, e, f, g, h]) as f32
            }
            (Self::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
            (Self::F16, &[a, b]) => half::f16::from_le_bytes([a, b]).to_f32(),
            (Self::Bf16, &[a, b]) => half::bf16::from_le_bytes([a, b]).to_f32(),
            _ => f32::NAN,
        }
    }

    /// The values of little-endian `bytes`, which are a whole number of elements.
    pub fn floats(self, bytes: &[u8]) -> Vec<f32> {
        bytes
            .chunks_exact(self.size())
            .map(|b| self.read(b))
            .collect()
    }
}

/// Whether a tensor only counts, e.g. the steps of a batch norm.
pub fn is_counter(name: &str) -> bool {
    name.ends_with("num_batches_tracked")
}

pub fn not_float(name: &str, found: &dyn std::fmt::Display) -> Error {
    Error::input(format!(
        "tensor `{name}` is {found}; expected floating-point weights (F64, F32, F16 or BF16)"
    ))
}

/// The number of elements of a shape.
pub fn count(shape: &[usize]) -> Option<usize> {
    shape
        .iter()
        .try_fold(1usize, |n, side| n.checked_mul(*side))
}
