//! Scoring in JavaScript.

use std::collections::{BTreeMap, HashMap};

use js_sys::{Float64Array, Object, Reflect};
use serde::{Deserialize, Serialize};
use wasm_bindgen::prelude::*;

use super::frames::{FrameIndex, JsJoin, sequences_to_js};
use super::options::from_js;
use super::tables::{GroundTruthTable, KeypointTable};
use super::{JsResult, js_error, to_js};
use crate::data;
use crate::error::Error;
use crate::metric::{NonFinite, Rank, Settings, Transform};
use crate::report::EvaluationReport;
use crate::scoring;
use crate::track::FrameKey;

/// Ground truth and keypoints, joined.
#[wasm_bindgen]
pub struct Scoring {
    scoring: scoring::Scoring,
    join: JsJoin,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct ScoreOptions {
    transform: Option<String>,
    rank: Option<String>,
    thresholds: BTreeMap<String, f64>,
    image_size: Option<[u32; 2]>,
}

impl ScoreOptions {
    fn from_js(value: JsValue, call: &str) -> JsResult<Self> {
        let keys = ["transform", "rank", "thresholds", "imageSize"];
        from_js(value, &format!("the options of {call}"), &keys)
    }

    fn settings(&self) -> JsResult<Settings> {
        let transform = self.transform.as_deref().map(str::parse::<Transform>).transpose();
        let rank = self.rank.as_deref().map(str::parse::<Rank>).transpose();
        Ok(Settings {
            transform: transform.map_err(|e| js_error(&e))?.unwrap_or_default(),
            rank: rank.map_err(|e| js_error(&e))?.unwrap_or_default(),
        })
    }
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct SequenceError {
    sequence: String,
    start: usize,
    length: usize,
    frames: u64,
    error: f64,
    worst: usize,
    worst_frame: u64,
    worst_error: f64,
}

#[wasm_bindgen]
impl Scoring {
    /// Joins a ground truth and keypoints.
    ///
    /// # Errors
    /// When no frame matches or a keypoint is not finite.
    #[wasm_bindgen(constructor)]
    pub fn new(
        truth: &GroundTruthTable,
        keypoints: &KeypointTable,
        on_non_finite: Option<String>,
    ) -> JsResult<Scoring> {
        let policy = on_non_finite.as_deref().map(str::parse::<NonFinite>).transpose();
        let policy = policy.map_err(|e| js_error(&e))?.unwrap_or_default();
        let (truth, keypoints) = (&truth.table.content, &keypoints.table.content);
        let scoring = scoring::Scoring::new(truth, keypoints, policy).map_err(|e| js_error(&e))?;
        let join = JsJoin::new(scoring.join(), keypoints.keys(), truth.keys());
        Ok(Self { scoring, join })
    }

    /// How frames found their rows.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn join(&self) -> JsResult<JsValue> {
        to_js(&self.join)
    }

    /// The number of joined frames.
    #[wasm_bindgen(getter)]
    pub fn frames(&self) -> usize {
        self.scoring.keys().len()
    }

    /// The names of the objects.
    #[wasm_bindgen(getter)]
    pub fn objects(&self) -> Vec<String> {
        self.scoring.objects().to_vec()
    }

    /// The joined frames by sequence.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn sequences(&self) -> JsResult<JsValue> {
        sequences_to_js(data::ranges(self.scoring.keys()))
    }

    /// The frame number of every joined frame.
    #[wasm_bindgen(getter, js_name = frameNumbers)]
    pub fn frame_numbers(&self) -> Vec<f64> {
        self.scoring.keys().iter().map(|key| key.frame as f64).collect()
    }

    /// For each joined frame the position of its image in `frames`, or -1.
    #[wasm_bindgen(js_name = imagesFrom)]
    pub fn images_from(&self, frames: &FrameIndex) -> Vec<i32> {
        let keys = self.scoring.keys();
        let mut images = vec![-1; keys.len()];
        let exact: HashMap<&FrameKey, usize> = frames
            .index
            .keys()
            .iter()
            .enumerate()
            .map(|(i, key)| (key, i))
            .collect();
        if keys.iter().any(|key| exact.contains_key(key)) {
            for (image, key) in images.iter_mut().zip(keys) {
                if let Some(i) = exact.get(key) {
                    *image = *i as i32;
                }
            }
        } else if let Ok(join) = data::join(frames.index.keys(), keys) {
            for (i, row) in join.pairs {
                images[row] = i as i32;
            }
        }
        images
    }

    /// Tracking errors and TC.
    ///
    /// # Errors
    /// When an option is not understood.
    pub fn evaluate(&self, options: JsValue) -> JsResult<JsValue> {
        let options = ScoreOptions::from_js(options, "evaluate")?;
        let settings = options.settings()?;
        let thresholds: Vec<(String, f64)> = options.thresholds.into_iter().collect();
        let evaluation = self
            .scoring
            .evaluate(&thresholds, &settings)
            .map_err(|e| js_error(&e))?;
        to_js(&EvaluationReport::new(
            &evaluation,
            options.image_size,
            Some(&self.join.report),
        ))
    }

    /// The keypoints of a joined frame, N x 2.
    ///
    /// # Errors
    /// When there is no such frame.
    #[wasm_bindgen(js_name = keypointsAt)]
    pub fn keypoints_at(&self, frame: usize) -> JsResult<Vec<f64>> {
        let points = self.scoring.keypoints(frame).ok_or_else(|| {
            let frames = self.frames();
            js_error(&Error::input(format!(
                "there is no frame {frame}; expected one below {frames}"
            )))
        })?;
        Ok(points.iter().copied().collect())
    }

    /// The error of an object with a keypoint by the sequence, the worst one first.
    ///
    /// # Errors
    /// When there is no such object or keypoint.
    #[wasm_bindgen(js_name = sequenceErrors)]
    pub fn sequence_errors(&self, object: usize, keypoint: usize, options: JsValue) -> JsResult<JsValue> {
        let settings = ScoreOptions::from_js(options, "sequenceErrors")?.settings()?;
        let errors = self.scoring.sequence_errors(object, keypoint, &settings);
        let errors: Vec<SequenceError> = errors
            .map_err(|e| js_error(&e))?
            .into_iter()
            .map(|error| SequenceError {
                sequence: error.range.name,
                start: error.range.start,
                length: error.range.length,
                frames: error.frames,
                error: error.error,
                worst: error.worst,
                worst_frame: self.scoring.keys()[error.worst].frame,
                worst_error: error.worst_error,
            })
            .collect();
        to_js(&errors)
    }

    /// The squared distance between an object and a keypoint under its map in every joined frame.
    ///
    /// # Errors
    /// When there is no such object or keypoint.
    pub fn distances(&self, object: usize, keypoint: usize, options: JsValue) -> JsResult<Vec<f64>> {
        let settings = ScoreOptions::from_js(options, "distances")?.settings()?;
        let distances = self.scoring.distances(object, keypoint, &settings);
        distances.map_err(|e| js_error(&e))
    }

    /// An object, a keypoint, and the keypoint under its map, over the joined frames.
    ///
    /// # Errors
    /// When there is no such object or keypoint.
    pub fn series(&self, object: usize, keypoint: usize, options: JsValue) -> JsResult<JsValue> {
        let options = ScoreOptions::from_js(options, "series")?;
        let settings = options.settings()?;
        let series = self
            .scoring
            .series(object, keypoint, &settings)
            .map_err(|e| js_error(&e))?;
        let out = Object::new();
        for (name, points) in [
            ("truth", series.truth_ndc),
            ("keypoint", series.keypoint),
            ("transformed", series.transformed_ndc),
        ] {
            let flat: Vec<f64> = points.iter().copied().collect();
            Reflect::set(&out, &name.into(), &Float64Array::from(&flat[..]))?;
        }
        Ok(out.into())
    }
}
