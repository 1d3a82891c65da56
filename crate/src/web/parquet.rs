//! Parquet files in JavaScript.

use wasm_bindgen::prelude::*;

use super::table::table_to_js;
use super::{JsResult, js_error, to_js};
use crate::data::{export_parquet, read_video_episodes};

/// The table in a Parquet file, as `readPoints` gives one.
///
/// # Errors
/// As [`export_parquet`].
#[wasm_bindgen(js_name = readParquet)]
pub fn read_parquet(bytes: Vec<u8>, name: &str) -> JsResult<JsValue> {
    let table = export_parquet(bytes).map_err(|e| js_error(&e.at(name)))?;
    table_to_js(&table)
}

/// The episodes in the videos of LeRobot's data, as a table below `meta/episodes/` lists them.
///
/// # Errors
/// As [`read_video_episodes`].
#[wasm_bindgen(js_name = readVideoEpisodes)]
pub fn video_episodes(bytes: Vec<u8>, name: &str) -> JsResult<JsValue> {
    let episodes = read_video_episodes(bytes).map_err(|e| js_error(&e.at(name)))?;
    to_js(&episodes)
}
