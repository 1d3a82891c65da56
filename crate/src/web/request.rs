//! How to score, from JavaScript.

use std::collections::BTreeMap;

use serde::Deserialize;
use wasm_bindgen::prelude::*;

use super::options::from_js;
use super::thresholds::thresholds;
use super::{JsResult, js_error};
use crate::evaluation::Request;
use crate::metric::{Rank, Settings, Transform};

#[derive(Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct ScoreOptions {
    transform: Option<String>,
    rank: Option<String>,
    thresholds: BTreeMap<String, f64>,
    image_size: Option<[u32; 2]>,
    folds: Option<usize>,
    bootstrap: Option<usize>,
    seed: u64,
    sequences: bool,
    context: bool,
    temporal: bool,
    confidence_levels: Vec<f64>,
}

impl ScoreOptions {
    const KEYS: [&str; 11] = [
        "transform",
        "rank",
        "thresholds",
        "imageSize",
        "folds",
        "bootstrap",
        "seed",
        "sequences",
        "context",
        "temporal",
        "confidenceLevels",
    ];
}

/// The request that the options of `call` stand for, of keypoints with `axes` coordinates.
pub(super) fn request(options: JsValue, call: &str, axes: usize) -> JsResult<Request> {
    let what = format!("the options of {call}");
    let options: ScoreOptions = from_js(options, &what, &ScoreOptions::KEYS)?;
    let transform = options
        .transform
        .as_deref()
        .map(str::parse::<Transform>)
        .transpose();
    let thresholds = thresholds(options.thresholds);
    let rank = options.rank.as_deref().map(str::parse::<Rank>).transpose();
    Ok(Request {
        settings: Settings {
            transform: transform.map_err(|e| js_error(&e))?.unwrap_or_default(),
            rank: rank
                .map_err(|e| js_error(&e))?
                .unwrap_or(Rank::of_axes(axes)),
            ..Settings::default()
        },
        thresholds: thresholds.map_err(|e| js_error(&e))?,
        image_size: options.image_size,
        folds: options.folds,
        bootstrap: options.bootstrap,
        seed: options.seed,
        sequences: options.sequences,
        context: options.context,
        temporal: options.temporal,
        confidence_levels: options.confidence_levels,
    })
}
