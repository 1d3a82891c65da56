//! Parquet files in JavaScript.

use wasm_bindgen::prelude::*;

use super::table::table_to_js;
use super::{JsResult, js_error};
use crate::data::export_parquet;

/// The table in a Parquet file, as `readPoints` gives one.
///
/// # Errors
/// As [`export_parquet`].
#[wasm_bindgen(js_name = readParquet)]
pub fn read_parquet(bytes: Vec<u8>, name: &str) -> JsResult<JsValue> {
    let table = export_parquet(bytes).map_err(|e| js_error(&e.at(name)))?;
    table_to_js(&table)
}
