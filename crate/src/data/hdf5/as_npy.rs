//! Points of an HDF5 file as arrays of numpy, which are read as those of an NPZ file.

use crate::data::arrays::{
    ArrayFile, CONFIDENCES, ENDS, NODES, POINTS, TRACKS, Values, Y_FIRST, find,
};
use crate::data::npy::{self, NpyArray};
use crate::data::points::{missing, no_numbers};
use crate::data::reading::AxisOrder;
use crate::error::Result;

/// Whether a file has an array of points.
pub fn has_points(file: &dyn ArrayFile) -> Result<bool> {
    for name in POINTS {
        if file.info(name)?.is_some() {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The arrays that points are read from, as numpy's; those of an NPZ file that holds the same.
///
/// # Errors
/// When there are no points, or an array cannot be read.
pub fn points(file: &dyn ArrayFile) -> Result<Vec<NpyArray>> {
    let Some((name, info)) = find(file, &POINTS)? else {
        return Err(missing(file)?);
    };
    if info.kind.is_none() {
        return Err(no_numbers(name, &info.dtype));
    }
    let mut arrays = Vec::new();
    for name in POINTS.iter().chain(&CONFIDENCES).chain(&[ENDS]) {
        let Some(info) = file.info(name)? else {
            continue;
        };
        if info.kind.is_none() {
            continue;
        }
        let shape: Vec<usize> = info.shape.iter().map(|n| *n as usize).collect();
        let (dtype, bytes) = elements(&file.read(name, &[])?);
        arrays.push(array(name, &dtype, &shape, &bytes));
    }
    let names = file.point_names().ok().flatten();
    let texts = [NODES, TRACKS].map(|name| (name, file.strings(name).ok()));
    for (name, texts) in std::iter::once(("names", names)).chain(texts) {
        if let Some(texts) = texts {
            let (dtype, bytes) = npy::texts(&texts)?;
            arrays.push(array(name, &dtype, &[texts.len()], &bytes));
        }
    }
    if let Some(axes) = file.axes() {
        let is = u8::from(axes == AxisOrder::Yx);
        arrays.push(array(Y_FIRST, "|u1", &[], &[is]));
    }
    Ok(arrays)
}

/// A whole array of numpy type `dtype`, its elements row by row.
fn array(name: &str, dtype: &str, shape: &[usize], elements: &[u8]) -> NpyArray {
    let mut bytes = npy::header(dtype, shape);
    bytes.extend(elements);
    NpyArray {
        name: name.to_owned(),
        size: bytes.len() as u64,
        bytes,
    }
}

/// The type and the elements of an array of numbers.
fn elements(values: &Values) -> (String, Vec<u8>) {
    let (dtype, bytes) = match values {
        Values::U8(values) => ("|u1", values.clone()),
        Values::F32(values) => ("<f4", values.iter().flat_map(|v| v.to_le_bytes()).collect()),
        Values::F64(values) => ("<f8", values.iter().flat_map(|v| v.to_le_bytes()).collect()),
    };
    (dtype.to_owned(), bytes)
}
