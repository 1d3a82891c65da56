//! What files are, and what belongs to all parts.

use wasm_bindgen::prelude::*;

use super::{JsResult, js_error, to_js};
use crate::checkpoint::SaeConfig;
use crate::error::Error;
use crate::intake;

/// The version of the package.
#[wasm_bindgen]
pub fn version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}

/// Guesses what a file is from its path and first bytes.
///
/// # Errors
/// When the translation to JavaScript fails.
#[wasm_bindgen]
pub fn classify(path: &str, head: &[u8]) -> JsResult<JsValue> {
    to_js(&intake::classify(path, head))
}

/// Places latent points of an encoder in an image of `width` x `height`; `config` as in
/// `EncoderInfo`.
///
/// # Errors
/// When `config` is not the configuration of an encoder.
#[wasm_bindgen(js_name = latentToImage)]
pub fn latent_to_image(
    config: &str,
    points: &[f64],
    width: u32,
    height: u32,
) -> JsResult<Vec<f64>> {
    let config: SaeConfig = serde_json::from_str(config).map_err(|e| {
        js_error(&Error::input(format!(
            "the configuration of the encoder: {e}"
        )))
    })?;
    let grid = config.latent_grid([width, height]);
    let placed = points
        .chunks_exact(2)
        .flat_map(|p| grid.to_image([p[0], p[1]]));
    Ok(placed.collect())
}
