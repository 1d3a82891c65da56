//! All frames of a source.

use std::ops::Range;

use super::{Extraction, Extractor};
use crate::data::FrameSource;
use crate::error::Result;
use crate::event::{Cancel, Event};

/// Reads the frames of `range` and extracts their keypoints, on the threads of rayon's current
/// pool; the results are in order. `observer` follows the work.
///
/// # Errors
/// When the work is cancelled or the device fails. An error of a single frame is in its place and
/// names it.
pub fn extract_frames(
    extractor: &dyn Extractor,
    source: &dyn FrameSource,
    range: Range<usize>,
    observer: &(dyn Fn(Event) + Sync),
    cancel: &Cancel,
) -> Result<Vec<Result<Extraction>>> {
    observer(Event::Started {
        what: "extracting keypoints".to_owned(),
        total: range.len() as u64,
    });
    let progress = |done| {
        observer(Event::Progress {
            done,
            note: String::new(),
        });
    };
    let found = extractor.extract_range(source, range, &progress, cancel);
    observer(Event::Done);
    found
}
