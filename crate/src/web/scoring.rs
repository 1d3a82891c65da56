//! Scoring in JavaScript.

use std::collections::HashMap;
use std::sync::Arc;

use js_sys::{Float64Array, Object, Reflect};
use serde::Serialize;
use wasm_bindgen::prelude::*;

use super::command::{Inputs, command};
use super::frames::FrameIndex;
use super::join::Joined;
use super::matching;
use super::options::from_js;
use super::request::request;
use super::tables::{GroundTruthTable, KeypointTable};
use super::{JsResult, js_error, to_js};
use crate::data;
use crate::error::Error;
use crate::evaluation::{self, CameraReport, IntervalsReport, Matching, MinConfidence, Request};
use crate::metric::{self, Moments, NonFinite};
use crate::track::FrameKey;

/// Ground truth and keypoints, joined.
#[wasm_bindgen]
pub struct Scoring {
    scoring: evaluation::Scoring,
    join: Joined,
    /// What a camera did to the ground truth, where there is one.
    camera: Option<CameraReport>,
    policy: NonFinite,
    least: MinConfidence,
    alignment: data::Alignment,
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

/// 95 % intervals over the sequences, drawn in steps.
#[wasm_bindgen]
pub struct Bootstrap {
    bootstrap: metric::Bootstrap,
    sequences: Arc<[Moments]>,
    objects: Vec<String>,
    seed: u64,
}

#[wasm_bindgen]
impl Bootstrap {
    /// Draws the sequences `resamples` times more.
    ///
    /// # Errors
    /// When there are fewer than two sequences.
    pub fn draw(&mut self, resamples: usize) -> JsResult<()> {
        let drawn = self.bootstrap.draw(&self.sequences, resamples);
        drawn.map_err(|e| js_error(&e))
    }

    /// The intervals of what was drawn.
    ///
    /// # Errors
    /// When nothing was drawn.
    pub fn intervals(&self) -> JsResult<JsValue> {
        let intervals = self.bootstrap.clone().finish().map_err(|e| js_error(&e))?;
        to_js(&IntervalsReport::new(&intervals, self.seed, &self.objects))
    }
}

#[wasm_bindgen]
impl Scoring {
    /// Joins a ground truth and keypoints; `min_confidence` says how sure they have to be to count.
    ///
    /// # Errors
    /// When no frame matches or an argument is not understood.
    #[wasm_bindgen(constructor)]
    pub fn new(
        truth: &GroundTruthTable,
        keypoints: &KeypointTable,
        on_non_finite: Option<String>,
        min_confidence: JsValue,
        alignment: JsValue,
    ) -> JsResult<Scoring> {
        let least = matching::min_confidence(min_confidence)?;
        let policy = on_non_finite
            .as_deref()
            .map(str::parse::<NonFinite>)
            .transpose();
        let policy = policy.map_err(|e| js_error(&e))?.unwrap_or_default();
        let alignment = matching::alignment(alignment)?;
        let camera = truth.camera;
        let (truth, keypoints) = (&truth.table.content, &keypoints.table.content);
        let matching = Matching { least, alignment };
        let scoring = evaluation::Scoring::matched(truth, keypoints, policy, matching)
            .map_err(|e| js_error(&e))?;
        let join = Joined::new(scoring.join(), keypoints.keys(), truth.keys());
        Ok(Self {
            scoring,
            join,
            camera,
            policy,
            least,
            alignment,
        })
    }

    /// How frames found their rows.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn join(&self) -> JsResult<JsValue> {
        self.join.to_js()
    }

    /// The number of joined frames.
    #[wasm_bindgen(getter)]
    pub fn frames(&self) -> usize {
        self.scoring.keys().len()
    }

    /// The numbers of coordinates of a keypoint and of an object: 2 in the image, 3 in space.
    #[wasm_bindgen(getter)]
    pub fn axes(&self) -> Vec<usize> {
        self.scoring.axes().to_vec()
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
        to_js(&data::ranges(self.scoring.keys()))
    }

    /// The frame number of every joined frame.
    #[wasm_bindgen(getter, js_name = frameNumbers)]
    pub fn frame_numbers(&self) -> Vec<f64> {
        self.scoring
            .keys()
            .iter()
            .map(|key| key.frame as f64)
            .collect()
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
        let request = self.request(options, "evaluate")?;
        let report = request.evaluate(&self.scoring, &self.join.report);
        let mut report = report.map_err(|e| js_error(&e))?;
        if let Some(camera) = self.camera {
            report.take_camera(camera);
        }
        to_js(&report)
    }

    /// The start of a bootstrap over the sequences.
    ///
    /// # Errors
    /// When an option is not understood.
    pub fn bootstrap(&self, options: JsValue) -> JsResult<Bootstrap> {
        let request = self.request(options, "bootstrap")?;
        let started =
            self.scoring
                .start_bootstrap(request.seed, &request.thresholds, &request.settings);
        let (bootstrap, sequences) = started.map_err(|e| js_error(&e))?;
        Ok(Bootstrap {
            bootstrap,
            sequences,
            objects: self.scoring.objects().to_vec(),
            seed: request.seed,
        })
    }

    /// The error of an object with a keypoint by the sequence, the worst one first.
    ///
    /// # Errors
    /// When there is no such object or keypoint.
    #[wasm_bindgen(js_name = sequenceErrors)]
    pub fn sequence_errors(
        &self,
        object: usize,
        keypoint: usize,
        options: JsValue,
    ) -> JsResult<JsValue> {
        let settings = self.request(options, "sequenceErrors")?.settings;
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
    pub fn distances(
        &self,
        object: usize,
        keypoint: usize,
        options: JsValue,
    ) -> JsResult<Vec<f64>> {
        let settings = self.request(options, "distances")?.settings;
        let distances = self.scoring.distances(object, keypoint, &settings);
        distances.map_err(|e| js_error(&e))
    }

    /// The command of the terminal that gives the same evaluation.
    ///
    /// # Errors
    /// When an option is not understood, or a name cannot be written in a shell.
    pub fn command(&self, inputs: JsValue, options: JsValue) -> JsResult<String> {
        let request = self.request(options, "command")?;
        let inputs: Inputs = from_js(inputs, "the inputs of command", &Inputs::KEYS)?;
        let matching = Matching {
            least: self.least,
            alignment: self.alignment,
        };
        let axes = self.scoring.axes()[0];
        command(&request, axes, &inputs, self.policy, matching).map_err(|e| js_error(&e))
    }

    /// The keypoints of a joined frame, N x 2, or N x 3 in space.
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

    /// An object, a keypoint, and the keypoint under its map, over the joined frames.
    ///
    /// # Errors
    /// When there is no such object or keypoint.
    pub fn series(&self, object: usize, keypoint: usize, options: JsValue) -> JsResult<JsValue> {
        let settings = self.request(options, "series")?.settings;
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

    fn request(&self, options: JsValue, call: &str) -> JsResult<Request> {
        request(options, call, self.scoring.axes()[0])
    }
}
