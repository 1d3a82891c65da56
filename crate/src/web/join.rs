//! Which frame belongs to which row, in JavaScript.

use serde::Serialize;
use wasm_bindgen::prelude::*;

use super::frames::FrameIndex;
use super::matching;
use super::tables::GroundTruthTable;
use super::{JsResult, js_error, to_js};
use crate::data;
use crate::evaluation::{self, JoinReport, UnmatchedSequence, unmatched_sequences};
use crate::track::FrameKey;

/// Joins frames to rows without scoring.
///
/// # Errors
/// When no frame matches.
#[wasm_bindgen(js_name = joinFrames)]
pub fn join_frames(
    frames: &FrameIndex,
    truth: &GroundTruthTable,
    alignment: JsValue,
) -> JsResult<JsValue> {
    let (frames, rows) = (frames.index.keys(), truth.table.content.keys());
    let join = data::join_aligned(frames, rows, matching::alignment(alignment)?);
    let join = join.map_err(|e| js_error(&e))?;
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
