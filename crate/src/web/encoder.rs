//! Keypoints from images in JavaScript.

use std::collections::BTreeMap;

use js_sys::{Float32Array, Float64Array};
use serde::Serialize;
use wasm_bindgen::prelude::*;

use super::{JsResult, js_error, to_js};
use crate::checkpoint::Checkpoint;
use crate::data::Frame;
use crate::engine::HeatMap;
use crate::error::Error;
use crate::extract::{CpuExtractor, Extractor as _};

/// The encoder of a checkpoint, on the CPU.
#[wasm_bindgen(js_name = Encoder)]
pub struct JsEncoder {
    extractor: CpuExtractor,
    has_decoder: bool,
    metadata: BTreeMap<String, String>,
}

/// Bytes of memory that this instance of the extraction holds: weights, and what its largest frame
/// took. It never shrinks.
#[wasm_bindgen(js_name = extractionMemory)]
pub fn extraction_memory() -> f64 {
    super::memory()
}

/// One frame's keypoints.
#[wasm_bindgen(js_name = Extraction)]
pub struct JsExtraction {
    points: Vec<f64>,
    image_size: [u32; 2],
}

/// The weights behind one keypoint of a frame.
#[wasm_bindgen(js_name = HeatMap)]
pub struct JsHeatMap(HeatMap);

#[wasm_bindgen(js_class = HeatMap)]
impl JsHeatMap {
    /// The number of columns.
    #[wasm_bindgen(getter)]
    pub fn width(&self) -> usize {
        self.0.width
    }

    /// The number of rows.
    #[wasm_bindgen(getter)]
    pub fn height(&self) -> usize {
        self.0.weights.len() / self.0.width
    }

    /// Row by row from the top.
    #[wasm_bindgen(getter)]
    pub fn weights(&self) -> Float32Array {
        Float32Array::from(&self.0.weights[..])
    }
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct EncoderInfo<'a> {
    architecture: String,
    keypoints: usize,
    input_size: Option<[usize; 2]>,
    encoder_channels: &'a [usize],
    decoder: bool,
    config: String,
    metadata: &'a BTreeMap<String, String>,
}

#[wasm_bindgen(js_class = Encoder)]
impl JsEncoder {
    /// Reads a checkpoint: `.safetensors`, `.pth` or `.bpk`.
    ///
    /// # Errors
    /// As [`Checkpoint::from_bytes`].
    #[wasm_bindgen(constructor)]
    pub fn new(bytes: &[u8], name: &str) -> JsResult<JsEncoder> {
        let load = || {
            let checkpoint = Checkpoint::from_bytes(bytes)?;
            let extractor = CpuExtractor::new(&checkpoint)?;
            Ok(Self {
                extractor,
                has_decoder: checkpoint.has_decoder(),
                metadata: checkpoint.metadata,
            })
        };
        load().map_err(|e: Error| js_error(&e.at(name)))
    }

    /// What the checkpoint holds.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn info(&self) -> JsResult<JsValue> {
        let config = self.extractor.config();
        let json = serde_json::to_string(config).map_err(|e| {
            js_error(&Error::input(format!(
                "the configuration of the encoder: {e}"
            )))
        })?;
        to_js(&EncoderInfo {
            architecture: config.name(),
            keypoints: config.keypoints,
            input_size: config.input_size,
            encoder_channels: &config.encoder_channels,
            decoder: self.has_decoder,
            config: json,
            metadata: &self.metadata,
        })
    }

    /// Decodes an image and extracts its keypoints.
    ///
    /// # Errors
    /// When the image cannot be decoded.
    pub fn extract(&self, image: &[u8], name: &str) -> JsResult<JsExtraction> {
        let found = self
            .extractor
            .extract(image)
            .map_err(|e| js_error(&e.at(name)))?;
        let points = found
            .points
            .iter()
            .flatten()
            .map(|v| f64::from(*v))
            .collect();
        Ok(JsExtraction {
            points,
            image_size: found.image_size,
        })
    }

    /// Decodes an image and gives the weights behind one of its keypoints.
    ///
    /// # Errors
    /// When the image cannot be decoded or there is no such keypoint.
    #[wasm_bindgen(js_name = heatMap)]
    pub fn heat_map(&self, image: &[u8], name: &str, keypoint: usize) -> JsResult<JsHeatMap> {
        let map = Frame::decode(image).and_then(|frame| self.extractor.heat_map(&frame, keypoint));
        Ok(JsHeatMap(map.map_err(|e| js_error(&e.at(name)))?))
    }
}

#[wasm_bindgen(js_class = Extraction)]
impl JsExtraction {
    /// N x 2, latent space.
    #[wasm_bindgen(getter)]
    pub fn points(&self) -> Float64Array {
        Float64Array::from(&self.points[..])
    }

    /// Width of the image.
    #[wasm_bindgen(getter)]
    pub fn width(&self) -> u32 {
        self.image_size[0]
    }

    /// Height of the image.
    #[wasm_bindgen(getter)]
    pub fn height(&self) -> u32 {
        self.image_size[1]
    }
}
