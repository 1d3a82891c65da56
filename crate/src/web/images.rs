//! JPEG and WebP images in JavaScript, for the parts that read PNG images only.

use wasm_bindgen::prelude::*;

use super::{JsResult, js_error};
use crate::data::Frame;

/// Bytes of memory that this instance of the part holds: what its largest image took. It never
/// shrinks.
#[wasm_bindgen(js_name = decodingMemory)]
pub fn decoding_memory() -> f64 {
    super::memory()
}

/// Decodes a PNG, JPEG or WebP image to a numpy array (`.npy`), which all that takes an image takes
/// as well.
///
/// # Errors
/// When the image cannot be decoded.
#[wasm_bindgen(js_name = imageToArray)]
pub fn image_to_array(image: &[u8], name: &str) -> JsResult<Vec<u8>> {
    let frame = Frame::decode(image).map_err(|e| js_error(&e.at(name)))?;
    Ok(frame.to_npy())
}
