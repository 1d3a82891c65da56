//! Files of other programs that are neither text nor NPZ, in JavaScript: their points as what the
//! part that scores reads.

use wasm_bindgen::prelude::*;

use super::table::stored_to_js;
use super::{JsResult, js_error};
use crate::data::{Columns, HDF5_MAGIC, PointFile, StoredPoints, export_pickle};
use crate::error::{Error, Result};
use crate::pickle::is_pickle;

/// The points of an HDF5 file or a pickle: a table and the unit of its positions, or arrays.
///
/// # Errors
/// When the bytes are neither, or hold no points.
#[wasm_bindgen(js_name = readPoints)]
pub fn read_points(bytes: Vec<u8>, name: &str) -> JsResult<JsValue> {
    stored_to_js(&read(bytes).map_err(|e| js_error(&e.at(name)))?)
}

/// A table whose columns have other names, with those that are expected: `expected` are these,
/// `columns` those in their place, nothing where all rows have the same.
///
/// # Errors
/// As [`Columns::apply`].
#[wasm_bindgen(js_name = mapColumns)]
pub fn map_columns(
    table: &[u8],
    name: &str,
    expected: Vec<String>,
    columns: Vec<String>,
    is_keypoints: bool,
) -> JsResult<Vec<u8>> {
    let columns = columns
        .into_iter()
        .map(|name| Some(name).filter(|name| !name.is_empty()));
    let columns = Columns::new(expected.into_iter().zip(columns));
    columns
        .apply(table, is_keypoints)
        .map_err(|e| js_error(&e.at(name)))
}

fn read(bytes: Vec<u8>) -> Result<StoredPoints> {
    match &bytes {
        _ if bytes.starts_with(HDF5_MAGIC) => PointFile::from_hdf5_bytes(bytes)?.stored(),
        _ if is_pickle(&bytes) => export_pickle(&bytes).map(StoredPoints::Table),
        _ => Err(Error::input(
            "neither an HDF5 file nor a pickle by its first bytes; is it complete, and does its ending say what it is?",
        )),
    }
}
