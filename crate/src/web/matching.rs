//! How frames are matched to rows, from JavaScript.

use serde::Deserialize;
use wasm_bindgen::prelude::*;

use super::options::from_js;
use super::{JsResult, js_error};
use crate::data::Alignment;
use crate::evaluation::MinConfidence;

/// What is added to the numbers of the rows.
pub(super) fn alignment(value: JsValue) -> JsResult<Alignment> {
    #[derive(Default, Deserialize)]
    #[serde(default)]
    struct Shifts {
        frames: i64,
        sequences: i64,
    }
    let Shifts { frames, sequences } = from_js(value, "the alignment", &["frames", "sequences"])?;
    Ok(Alignment { frames, sequences })
}

/// How sure points have to be.
pub(super) fn min_confidence(value: JsValue) -> JsResult<MinConfidence> {
    #[derive(Default, Deserialize)]
    #[serde(default)]
    struct Least {
        keypoints: Option<f64>,
        truth: Option<f64>,
    }
    let keys = ["keypoints", "truth"];
    let Least { keypoints, truth } = from_js(value, "the smallest confidences", &keys)?;
    MinConfidence::new(keypoints, truth).map_err(|e| js_error(&e))
}
