//! Ground truth and keypoints in JavaScript.

use ndarray::{Array2, Array3};
use serde::Deserialize;
use wasm_bindgen::prelude::*;

use super::frames::FrameIndex;
use super::object;
use super::options::from_js;
use super::{JsResult, js_error, to_js};
use crate::data::{self, AxisOrder, Flip, Notice, Parsed, Reading, Space, TableOptions};
use crate::error::Error;
use crate::evaluation::CameraReport;
use crate::track::{GroundTruth, KeypointTrack};

#[derive(Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct JsTableOptions {
    space: Option<String>,
    axis_order: Option<String>,
    index_base: Option<u64>,
    first_keypoint: Option<u64>,
    image_size: Option<[u32; 2]>,
    flip: Option<String>,
    zero_is_missing: Option<bool>,
    xy_only: bool,
}

pub(super) fn table_options(value: JsValue, call: &str) -> JsResult<TableOptions> {
    let keys = [
        "space",
        "axisOrder",
        "indexBase",
        "firstKeypoint",
        "imageSize",
        "flip",
        "zeroIsMissing",
        "xyOnly",
    ];
    let options: JsTableOptions = from_js(value, &format!("the options of {call}"), &keys)?;
    let space = options
        .space
        .as_deref()
        .map(str::parse::<Space>)
        .transpose();
    let axes = options
        .axis_order
        .as_deref()
        .map(str::parse::<AxisOrder>)
        .transpose();
    let flip = options.flip.as_deref().map(str::parse::<Flip>).transpose();
    Ok(TableOptions {
        space: space.map_err(|e| js_error(&e))?,
        axes: axes.map_err(|e| js_error(&e))?,
        index_base: options.index_base,
        first_keypoint: options.first_keypoint,
        image_size: options.image_size,
        flip: flip.map_err(|e| js_error(&e))?,
        zero_is_missing: options.zero_is_missing,
        xy_only: options.xy_only,
    })
}

fn texts(notices: &[Notice]) -> Vec<String> {
    notices.iter().map(|notice| notice.text.clone()).collect()
}

fn reasons_to_js(notices: &[Notice]) -> JsResult<JsValue> {
    let reasons = notices.iter().filter_map(|notice| notice.reason.as_ref());
    to_js(&reasons.collect::<Vec<_>>())
}

/// Object positions over frames.
#[wasm_bindgen]
pub struct GroundTruthTable {
    pub(super) name: String,
    /// Of the images, where it was said.
    pub(super) image_size: Option<[u32; 2]>,
    pub(super) table: Parsed<GroundTruth>,
    /// What a camera did to it, where there is one.
    pub(super) camera: Option<CameraReport>,
}

/// Keypoints over frames.
#[wasm_bindgen]
pub struct KeypointTable {
    pub(super) name: String,
    pub(super) table: Parsed<KeypointTrack>,
}

#[wasm_bindgen]
impl GroundTruthTable {
    /// Parses a table of any layout; `options` may give what the file does not say.
    ///
    /// # Errors
    /// As [`data::parse_ground_truth`].
    pub fn parse(bytes: &[u8], name: String, options: JsValue) -> JsResult<GroundTruthTable> {
        let options = table_options(options, "GroundTruthTable.parse")?;
        let table = data::parse_ground_truth(bytes, &name, &options).map_err(|e| js_error(&e))?;
        Ok(Self::new(name, options.image_size, table))
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

    /// How many coordinates a position has: 2 in the image, 3 in space.
    #[wasm_bindgen(getter)]
    pub fn axes(&self) -> usize {
        self.table.content.axes()
    }

    /// The number of sequences.
    #[wasm_bindgen(getter)]
    pub fn sequences(&self) -> usize {
        data::ranges(self.table.content.keys()).len()
    }

    /// The table as a plain object, which other parts of the package read.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(js_name = toObject)]
    pub fn to_object(&self) -> JsResult<JsValue> {
        let truth = &self.table.content;
        // What a camera projects is no longer what the file says.
        let reading = Some(&self.table.reading).filter(|_| self.camera.is_none());
        let named = (truth.names(), self.image_size);
        let (points, confidence) = (truth.points_ndc(), truth.confidence());
        object::write::table(truth.keys(), points, confidence, reading, named)
    }

    /// Whether the positions say how sure they are.
    #[wasm_bindgen(getter, js_name = hasConfidence)]
    pub fn has_confidence(&self) -> bool {
        self.table.content.confidence().is_some()
    }

    /// What the numbers were taken for, and what said so.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn reading(&self) -> JsResult<JsValue> {
        to_js(&self.table.reading)
    }

    /// How the table was read.
    #[wasm_bindgen(getter)]
    pub fn notices(&self) -> Vec<String> {
        texts(&self.table.notices)
    }

    /// What programs need to know of the notices to offer remedies.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn reasons(&self) -> JsResult<JsValue> {
        reasons_to_js(&self.table.notices)
    }
}

impl GroundTruthTable {
    pub(super) fn new(
        name: String,
        image_size: Option<[u32; 2]>,
        table: Parsed<GroundTruth>,
    ) -> Self {
        Self {
            name,
            image_size,
            table,
            camera: None,
        }
    }
}

#[wasm_bindgen]
impl KeypointTable {
    /// Parses a table of any layout; `options` may give what the file does not say.
    ///
    /// # Errors
    /// As [`data::parse_keypoints`].
    pub fn parse(bytes: &[u8], name: String, options: JsValue) -> JsResult<KeypointTable> {
        let options = table_options(options, "KeypointTable.parse")?;
        let table = data::parse_keypoints(bytes, &name, &options).map_err(|e| js_error(&e))?;
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
        confidences: Option<Vec<f64>>,
    ) -> JsResult<KeypointTable> {
        let keys = frames.index.keys().to_vec();
        let (count, length) = (points.len(), keys.len());
        let track = || {
            let wrong = |_| {
                Error::input(format!(
                    "{count} numbers for {length} frames of {keypoints} keypoints"
                ))
            };
            let points = Array3::from_shape_vec((length, keypoints, 2), points).map_err(wrong)?;
            let confidence =
                confidences.map(|all| Array2::from_shape_vec((length, keypoints), all));
            KeypointTrack::new(keys, points)?
                .with_confidence(confidence.transpose().map_err(wrong)?)
        };
        let content = track().map_err(|e| js_error(&e))?;
        Ok(Self {
            name: "extraction".to_owned(),
            table: Parsed {
                content,
                reading: Reading::of_extraction(),
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

    /// How many coordinates a keypoint has: 2 in the image, 3 in space.
    #[wasm_bindgen(getter)]
    pub fn axes(&self) -> usize {
        self.table.content.axes()
    }

    /// The table as a plain object, which other parts of the package read.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(js_name = toObject)]
    pub fn to_object(&self) -> JsResult<JsValue> {
        let (track, reading) = (&self.table.content, &self.table.reading);
        let (points, confidence) = (track.points(), track.confidence());
        object::write::table(track.keys(), points, confidence, Some(reading), (&[], None))
    }

    /// Whether the keypoints say how sure they are.
    #[wasm_bindgen(getter, js_name = hasConfidence)]
    pub fn has_confidence(&self) -> bool {
        self.table.content.confidence().is_some()
    }

    /// What the numbers were taken for, and what said so.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn reading(&self) -> JsResult<JsValue> {
        to_js(&self.table.reading)
    }

    /// How the table was read.
    #[wasm_bindgen(getter)]
    pub fn notices(&self) -> Vec<String> {
        texts(&self.table.notices)
    }

    /// What programs need to know of the notices to offer remedies.
    ///
    /// # Errors
    /// When the translation to JavaScript fails.
    #[wasm_bindgen(getter)]
    pub fn reasons(&self) -> JsResult<JsValue> {
        reasons_to_js(&self.table.notices)
    }

    /// The table as CSV.
    #[wasm_bindgen(js_name = toCsv)]
    pub fn to_csv(&self) -> String {
        data::keypoints_csv(&self.table.content)
    }
}
