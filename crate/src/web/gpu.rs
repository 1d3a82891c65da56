//! Keypoints from images on WebGPU in JavaScript.

use js_sys::{Array, Float64Array, Object, Reflect};
use wasm_bindgen::prelude::*;

use super::{JsResult, js_error};
use crate::checkpoint::Checkpoint;
use crate::data::Frame;
use crate::error::{Error, Result};
use crate::extract::{DeviceExtractor, Extraction, Prepared};
use crate::model::WebGpu;

/// What a tensor of a batch may take, in bytes, where the GPU allows more: several of them are
/// alive, and its memory may be the computer's.
const TENSOR: u64 = 256 << 20;

/// The GPU of the browser, open.
#[wasm_bindgen]
pub struct Gpu(WebGpu);

/// The encoder of a checkpoint, on the GPU.
#[wasm_bindgen]
pub struct GpuEncoder {
    gpu: WebGpu,
    extractor: DeviceExtractor,
}

/// A frame, decoded and resized.
#[wasm_bindgen]
pub struct GpuFrame {
    name: String,
    prepared: Prepared,
    /// Frames like this one that the GPU takes together at most.
    #[wasm_bindgen(readonly, js_name = batchLimit)]
    pub batch_limit: usize,
}

#[wasm_bindgen]
impl Gpu {
    /// Opens the GPU. That works once in an instance of the module.
    ///
    /// # Errors
    /// When the browser gives none.
    pub async fn open() -> JsResult<Gpu> {
        WebGpu::open().await.map(Self).map_err(|e| js_error(&e))
    }

    /// Reads a checkpoint: `.safetensors`, `.pth` or `.bpk`.
    ///
    /// # Errors
    /// As [`Checkpoint::from_bytes`].
    pub fn encoder(&self, bytes: &[u8], name: &str) -> JsResult<GpuEncoder> {
        let load = || {
            let checkpoint = Checkpoint::from_bytes(bytes)?;
            Ok(GpuEncoder {
                extractor: DeviceExtractor::new(&checkpoint, &self.0.device)?,
                gpu: self.0.clone(),
            })
        };
        load().map_err(|e: Error| js_error(&e.at(name)))
    }
}

#[wasm_bindgen]
impl GpuEncoder {
    /// Decodes an image and resizes it to the encoder's input.
    ///
    /// # Errors
    /// When the image cannot be decoded, or is too small for the encoder or too large for the GPU.
    pub fn prepare(&self, image: &[u8], name: &str) -> JsResult<GpuFrame> {
        let prepare = || {
            let frame = Frame::decode(image)?;
            let prepared = self.extractor.prepare(&frame)?;
            let size = [frame.width(), frame.height()];
            let limit = self.gpu.tensor_limit;
            if self.extractor.frames_within(size, limit) == 0 {
                return Err(Error::input(format!(
                    "its feature maps are larger than the {limit} bytes that the GPU allows a buffer; extract it on the CPU"
                )));
            }
            Ok(GpuFrame {
                name: name.to_owned(),
                prepared,
                batch_limit: self.extractor.frames_within(size, limit.min(TENSOR)).max(1),
            })
        };
        prepare().map_err(|e: Error| js_error(&e.at(name)))
    }

    /// The keypoints of frames that are given away, in their order: objects with `points` (N x 2,
    /// latent space), `width` and `height`, and an `Error` in the place of a frame that has none.
    ///
    /// # Errors
    /// When the GPU fails, now or before: what it computed may be stale.
    pub async fn extract(&self, frames: Vec<GpuFrame>) -> JsResult<Array> {
        let (names, prepared): (Vec<_>, Vec<_>) =
            frames.into_iter().map(|f| (f.name, f.prepared)).unzip();
        let found = self.extractor.run_async(&prepared).await;
        self.gpu.check().map_err(|e| js_error(&e))?;
        let found = found.map_err(|e| js_error(&e))?;
        found
            .into_iter()
            .zip(names)
            .map(|(found, name)| extracted(found, &name))
            .collect()
    }
}

fn extracted(found: Result<Extraction>, name: &str) -> JsResult<JsValue> {
    let Extraction {
        points, image_size, ..
    } = match found {
        Ok(extraction) => extraction,
        Err(error) => return Ok(js_error(&error.at(name))),
    };
    let points: Vec<f64> = points.iter().flatten().map(|v| f64::from(*v)).collect();
    let object = Object::new();
    for (key, value) in [
        ("points", Float64Array::from(&points[..]).into()),
        ("width", image_size[0].into()),
        ("height", image_size[1].into()),
    ] {
        Reflect::set(&object, &key.into(), &value)?;
    }
    Ok(object.into())
}
