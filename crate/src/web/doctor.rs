//! What looks wrong with tables, in JavaScript.

use wasm_bindgen::prelude::*;

use super::matching;
use super::object::read::Table;
use super::{JsResult, js_error, to_js};
use crate::data::join_aligned;
use crate::evaluation::doctor::{self, Subject};

/// What looks wrong with two tables that are joined like this; see [`doctor::examine`].
///
/// # Errors
/// When an argument is not understood, or no frame has a row.
#[wasm_bindgen]
pub fn examine(
    truth: &JsValue,
    keypoints: &JsValue,
    min_confidence: JsValue,
    alignment: JsValue,
) -> JsResult<JsValue> {
    let least = matching::min_confidence(min_confidence)?;
    let alignment = matching::alignment(alignment)?;
    let (truth, keypoints) = (Table::from_js(truth)?, Table::from_js(keypoints)?);
    let (truth_reading, keypoints_reading) = (truth.head.reading, keypoints.head.reading);
    let image_size = truth.head.image_size;
    let (truth, keypoints) = (truth.truth()?, keypoints.keypoints()?);
    let join = join_aligned(keypoints.keys(), truth.keys(), alignment).map_err(|e| js_error(&e))?;
    to_js(&doctor::examine(&Subject {
        truth: &truth,
        truth_reading: truth_reading.as_ref(),
        keypoints: &keypoints,
        keypoints_reading: keypoints_reading.as_ref(),
        join: &join,
        alignment,
        least,
        image_size,
    }))
}
