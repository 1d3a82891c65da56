//! Run folders among dropped files, in JavaScript.

use wasm_bindgen::prelude::*;

use super::{JsResult, to_js};
use crate::run::find_runs;

/// The run folders among `paths`; see [`find_runs`].
///
/// # Errors
/// When the translation to JavaScript fails.
#[wasm_bindgen(js_name = findRuns)]
pub fn find_runs_of(paths: Vec<String>) -> JsResult<JsValue> {
    to_js(&find_runs(paths.iter().map(String::as_str)))
}
