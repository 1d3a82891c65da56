//! Frames by path in JavaScript.

use wasm_bindgen::prelude::*;

use super::{JsResult, js_error, to_js};
use crate::data;

/// The frames among dropped files, in natural order.
#[wasm_bindgen]
pub struct FrameIndex {
    pub(super) index: data::FrameIndex,
    ignored: Vec<String>,
}

#[wasm_bindgen]
impl FrameIndex {
    /// Orders the frames among `paths`.
    ///
    /// # Errors
    /// When there is no image among them.
    #[wasm_bindgen(constructor)]
    pub fn new(paths: Vec<String>) -> JsResult<FrameIndex> {
        let index = data::FrameIndex::new(&paths).map_err(|e| js_error(&e))?;
        let ignored = index.ignored().iter().map(|i| paths[*i].clone()).collect();
        Ok(Self { index, ignored })
    }

    /// Orders frames of which all `paths` are some, whatever their endings.
    ///
    /// # Errors
    /// When there is none.
    #[wasm_bindgen(js_name = ofAll)]
    pub fn of_all(paths: Vec<String>) -> JsResult<FrameIndex> {
        let index = data::FrameIndex::of_all(&paths).map_err(|e| js_error(&e))?;
        Ok(Self {
            index,
            ignored: Vec::new(),
        })
    }

    /// The number of frames.
    #[wasm_bindgen(getter)]
    pub fn length(&self) -> usize {
        self.index.keys().len()
    }

    /// The sequences in order.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn sequences(&self) -> JsResult<JsValue> {
        to_js(&self.index.sequences())
    }

    /// For each frame its position among the paths.
    #[wasm_bindgen(getter)]
    pub fn order(&self) -> Vec<u32> {
        self.index.order().iter().map(|i| *i as u32).collect()
    }

    /// Only the frames at `positions`, with the same sequences and numbers.
    ///
    /// # Errors
    /// When a position is out of range or they are not ascending.
    pub fn select(&self, positions: Vec<u32>) -> JsResult<FrameIndex> {
        let positions: Vec<usize> = positions.into_iter().map(|i| i as usize).collect();
        let index = self.index.select(&positions).map_err(|e| js_error(&e))?;
        Ok(Self {
            index,
            ignored: self.ignored.clone(),
        })
    }

    /// The paths that are no images.
    #[wasm_bindgen(getter)]
    pub fn ignored(&self) -> Vec<String> {
        self.ignored.clone()
    }
}
