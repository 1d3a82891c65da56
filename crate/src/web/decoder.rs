//! Images from keypoints in JavaScript.

use wasm_bindgen::prelude::*;

use super::{JsResult, js_error};
use crate::checkpoint::Checkpoint;
use crate::engine::CpuDecoder;

/// The decoder of a checkpoint.
#[wasm_bindgen(js_name = Decoder)]
pub struct JsDecoder(CpuDecoder);

#[wasm_bindgen(js_class = Decoder)]
impl JsDecoder {
    /// Reads the decoder of a checkpoint; undefined when it holds only an encoder.
    ///
    /// # Errors
    /// As [`Checkpoint::from_bytes`], and when a tensor of the decoder is missing.
    pub fn open(bytes: &[u8], name: &str) -> JsResult<Option<JsDecoder>> {
        let decoder =
            Checkpoint::from_bytes(bytes).and_then(|checkpoint| CpuDecoder::new(&checkpoint));
        Ok(decoder.map_err(|e| js_error(&e.at(name)))?.map(JsDecoder))
    }

    /// Width of the reconstruction.
    #[wasm_bindgen(getter)]
    pub fn width(&self) -> usize {
        self.0.size()[0]
    }

    /// Height of the reconstruction.
    #[wasm_bindgen(getter)]
    pub fn height(&self) -> usize {
        self.0.size()[1]
    }

    /// The image that the decoder makes of N x 2 keypoints, as bytes of red, green, blue and alpha.
    ///
    /// # Errors
    /// When there are not N keypoints.
    pub fn reconstruct(&self, points: &[f64]) -> JsResult<Vec<u8>> {
        let points: Vec<[f32; 2]> = points
            .chunks_exact(2)
            .map(|p| [p[0] as f32, p[1] as f32])
            .collect();
        let image = self.0.reconstruct(&points).map_err(|e| js_error(&e))?;
        let plane = image.len() / 3;
        let byte = |value: f32| (255.0 * value.clamp(0.0, 1.0)).round() as u8;
        let pixel = |i: usize| {
            [
                byte(image[i]),
                byte(image[plane + i]),
                byte(image[2 * plane + i]),
                255,
            ]
        };
        Ok((0..plane).flat_map(pixel).collect())
    }
}
