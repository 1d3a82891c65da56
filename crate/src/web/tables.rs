//! Ground truth and keypoints in JavaScript.

use ndarray::Array3;
use wasm_bindgen::prelude::*;

use super::frames::FrameIndex;
use super::{JsResult, js_error};
use crate::data::{self, Table};
use crate::error::Error;
use crate::track::{GroundTruth, KeypointTrack};

/// Object positions over frames.
#[wasm_bindgen]
pub struct GroundTruthTable {
    name: String,
    pub(super) table: Table<GroundTruth>,
}

/// Keypoints over frames.
#[wasm_bindgen]
pub struct KeypointTable {
    name: String,
    pub(super) table: Table<KeypointTrack>,
}

#[wasm_bindgen]
impl GroundTruthTable {
    /// Parses `sequence,frame,object,x,y`.
    ///
    /// # Errors
    /// As [`data::parse_ground_truth`].
    pub fn parse(bytes: &[u8], name: String) -> JsResult<GroundTruthTable> {
        let table = data::parse_ground_truth(bytes, &name).map_err(|e| js_error(&e))?;
        Ok(Self { name, table })
    }

    /// The name of the file.
    #[wasm_bindgen(getter)]
    pub fn name(&self) -> String {
        self.name.clone()
    }

    /// The names of the objects.
    #[wasm_bindgen(getter)]
    pub fn objects(&self) -> Vec<String> {
        self.table.content.names().to_vec()
    }

    /// The number of frames.
    #[wasm_bindgen(getter)]
    pub fn frames(&self) -> usize {
        self.table.content.keys().len()
    }

    /// The number of sequences.
    #[wasm_bindgen(getter)]
    pub fn sequences(&self) -> usize {
        data::ranges(self.table.content.keys()).len()
    }

    /// How the table was read.
    #[wasm_bindgen(getter)]
    pub fn notices(&self) -> Vec<String> {
        self.table.notices.clone()
    }
}

#[wasm_bindgen]
impl KeypointTable {
    /// Parses `sequence,frame,keypoint,x,y`.
    ///
    /// # Errors
    /// As [`data::parse_keypoints`].
    pub fn parse(bytes: &[u8], name: String) -> JsResult<KeypointTable> {
        let table = data::parse_keypoints(bytes, &name).map_err(|e| js_error(&e))?;
        Ok(Self { name, table })
    }

    /// The keypoints of all `frames`: frames x keypoints x 2 numbers in their order.
    ///
    /// # Errors
    /// When the number of points is another one.
    #[wasm_bindgen(js_name = fromExtraction)]
    pub fn from_extraction(
        frames: &FrameIndex,
        points: Vec<f64>,
        keypoints: usize,
    ) -> JsResult<KeypointTable> {
        let keys = frames.index.keys().to_vec();
        let (count, shape) = (points.len(), (keys.len(), keypoints, 2));
        let content = Array3::from_shape_vec(shape, points)
            .map_err(|_| {
                Error::input(format!(
                    "{count} numbers for {} frames of {keypoints} keypoints",
                    shape.0
                ))
            })
            .and_then(|points| KeypointTrack::new(keys, points))
            .map_err(|e| js_error(&e))?;
        Ok(Self {
            name: "extraction".to_owned(),
            table: Table {
                content,
                notices: Vec::new(),
            },
        })
    }

    /// The name of the file, or `extraction`.
    #[wasm_bindgen(getter)]
    pub fn name(&self) -> String {
        self.name.clone()
    }

    /// The number of keypoints N.
    #[wasm_bindgen(getter)]
    pub fn keypoints(&self) -> usize {
        self.table.content.keypoints()
    }

    /// The number of frames.
    #[wasm_bindgen(getter)]
    pub fn frames(&self) -> usize {
        self.table.content.keys().len()
    }

    /// How the table was read.
    #[wasm_bindgen(getter)]
    pub fn notices(&self) -> Vec<String> {
        self.table.notices.clone()
    }

    /// The table as CSV.
    #[wasm_bindgen(js_name = toCsv)]
    pub fn to_csv(&self) -> String {
        data::keypoints_csv(&self.table.content)
    }
}
