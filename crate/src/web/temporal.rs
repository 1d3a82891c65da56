//! Measures of keypoints over time, in JavaScript.

use wasm_bindgen::prelude::*;

use super::matching;
use super::object::read::Table;
use super::request::request;
use super::{JsResult, js_error, to_js};
use crate::evaluation::{Matching, Request, Scoring};
use crate::metric::NonFinite;

/// How good the best keypoints of two tables are over time; see [`Request::temporal`].
///
/// # Errors
/// When an argument is not understood, or no frame has a row.
#[wasm_bindgen(js_name = temporalQuality)]
pub fn temporal_quality(
    truth: &JsValue,
    keypoints: &JsValue,
    min_confidence: JsValue,
    alignment: JsValue,
    options: JsValue,
) -> JsResult<JsValue> {
    let matching = Matching {
        least: matching::min_confidence(min_confidence)?,
        alignment: matching::alignment(alignment)?,
    };
    let truth = Table::from_js(truth)?.truth()?;
    let keypoints = Table::from_js(keypoints)?.keypoints()?;
    let request = Request {
        temporal: true,
        ..request(options, "temporalQuality", keypoints.axes())?
    };
    let scoring = Scoring::matched(&truth, &keypoints, NonFinite::default(), matching);
    let measured = scoring.and_then(|scoring| request.temporal(&scoring));
    to_js(&measured.map_err(|e| js_error(&e))?)
}
