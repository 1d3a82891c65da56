//! Keypoints by ONNX models in JavaScript.

use std::collections::BTreeMap;

use js_sys::Float64Array;
use serde::Serialize;
use wasm_bindgen::prelude::*;

use super::{JsResult, js_error, to_js};
use crate::detector::{Graph, OnnxExtractor, Settings};
use crate::error::Error;
use crate::extract::{Extraction, Extractor as _};

/// Bytes of memory that this instance of the part holds: weights, and what its largest frame took.
/// It never shrinks.
#[wasm_bindgen(js_name = detectorMemory)]
pub fn detector_memory() -> f64 {
    super::memory()
}

/// A keypoint detector of any origin as an ONNX model, on the CPU.
#[wasm_bindgen(js_name = Detector)]
pub struct JsDetector {
    extractor: OnnxExtractor,
    metadata: BTreeMap<String, String>,
}

/// One frame's keypoints.
#[wasm_bindgen(js_name = Detection)]
pub struct JsDetection(Extraction);

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct DetectorInfo<'a> {
    /// How the model is run, in words.
    architecture: String,
    keypoints: usize,
    input_size: Option<[usize; 2]>,
    /// Of an exported encoder, whose points are latent.
    config: Option<String>,
    metadata: &'a BTreeMap<String, String>,
}

#[wasm_bindgen(js_class = Detector)]
impl JsDetector {
    /// Reads an ONNX model; `settings` is JSON that says what the model does not, or empty.
    ///
    /// # Errors
    /// As [`Settings::from_json`] and [`OnnxExtractor::new`].
    #[wasm_bindgen(constructor)]
    pub fn new(bytes: Vec<u8>, name: &str, settings: &str) -> JsResult<JsDetector> {
        let load = || {
            let settings = match settings {
                "" => Settings::default(),
                json => Settings::from_json(json.as_bytes())?,
            };
            let metadata = Graph::read(&bytes)?.metadata;
            Ok(Self {
                extractor: OnnxExtractor::new(bytes, &settings)?,
                metadata,
            })
        };
        load().map_err(|e: Error| js_error(&e.at(name)))
    }

    /// What the model is, and how it is run.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn info(&self) -> JsResult<JsValue> {
        let config = self.extractor.config().map(serde_json::to_string);
        let config = config.transpose().map_err(|e| {
            js_error(&Error::input(format!(
                "the configuration of the encoder: {e}"
            )))
        })?;
        to_js(&DetectorInfo {
            architecture: self.extractor.plan().to_string(),
            keypoints: self.extractor.keypoints(),
            input_size: self.extractor.input_size(),
            config,
            metadata: &self.metadata,
        })
    }

    /// Decodes an image and extracts its keypoints.
    ///
    /// # Errors
    /// When the image cannot be decoded, or the model fails on it.
    pub fn extract(&self, image: &[u8], name: &str) -> JsResult<JsDetection> {
        let found = self.extractor.extract(image);
        found.map(JsDetection).map_err(|e| js_error(&e.at(name)))
    }
}

#[wasm_bindgen(js_class = Detection)]
impl JsDetection {
    /// N x 2: ndc, or latent for an exported encoder.
    #[wasm_bindgen(getter)]
    pub fn points(&self) -> Float64Array {
        let points: Vec<f64> = self
            .0
            .points
            .iter()
            .flatten()
            .map(|v| f64::from(*v))
            .collect();
        Float64Array::from(&points[..])
    }

    /// N, in the detector's own unit; `undefined` where it has none.
    #[wasm_bindgen(getter)]
    pub fn confidences(&self) -> Option<Float64Array> {
        let all = self.0.confidences.as_ref()?;
        let all: Vec<f64> = all.iter().map(|v| f64::from(*v)).collect();
        Some(Float64Array::from(&all[..]))
    }

    /// Width of the image.
    #[wasm_bindgen(getter)]
    pub fn width(&self) -> u32 {
        self.0.image_size[0]
    }

    /// Height of the image.
    #[wasm_bindgen(getter)]
    pub fn height(&self) -> u32 {
        self.0.image_size[1]
    }
}
