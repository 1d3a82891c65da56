//! Frames by path in JavaScript.

use serde::Serialize;
use wasm_bindgen::prelude::*;

use super::tables::GroundTruthTable;
use super::{JsResult, js_error, to_js};
use crate::data;
use crate::evaluation::{self, JoinReport, UnmatchedSequence, unmatched_sequences};
use crate::track::FrameKey;

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
        sequences_to_js(self.index.sequences())
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

/// Joins frames to rows without scoring.
///
/// # Errors
/// When no frame matches.
#[wasm_bindgen(js_name = joinFrames)]
pub fn join_frames(frames: &FrameIndex, truth: &GroundTruthTable) -> JsResult<JsValue> {
    let (frames, rows) = (frames.index.keys(), truth.table.content.keys());
    let join = data::join(frames, rows).map_err(|e| js_error(&e))?;
    Joined::new(&join, frames, rows).to_js()
}

/// The report of a join with all that is unmatched.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct JsJoin<'a> {
    matched: usize,
    rules: &'a [String],
    unmatched_frames: &'a evaluation::Unmatched,
    unmatched_rows: &'a evaluation::Unmatched,
    unmatched: &'a Unmatched,
}

/// A join with its report.
pub(super) struct Joined {
    pub report: JoinReport,
    unmatched: Unmatched,
}

#[derive(Serialize)]
struct Unmatched {
    frames: Vec<UnmatchedSequence>,
    rows: Vec<UnmatchedSequence>,
}

impl Joined {
    pub fn new(join: &data::Join, frames: &[FrameKey], rows: &[FrameKey]) -> Self {
        Self {
            report: JoinReport::new(join, frames, rows),
            unmatched: Unmatched {
                frames: unmatched_sequences(frames, &join.unmatched_left),
                rows: unmatched_sequences(rows, &join.unmatched_right),
            },
        }
    }

    pub fn to_js(&self) -> JsResult<JsValue> {
        to_js(&JsJoin {
            matched: self.report.matched,
            rules: &self.report.rules,
            unmatched_frames: &self.report.unmatched_frames,
            unmatched_rows: &self.report.unmatched_rows,
            unmatched: &self.unmatched,
        })
    }
}

#[derive(Serialize)]
struct Sequence {
    name: String,
    start: usize,
    length: usize,
}

pub(super) fn sequences_to_js(ranges: Vec<data::SequenceRange>) -> JsResult<JsValue> {
    let plain = |r: data::SequenceRange| Sequence {
        name: r.name,
        start: r.start,
        length: r.length,
    };
    to_js(&ranges.into_iter().map(plain).collect::<Vec<_>>())
}
