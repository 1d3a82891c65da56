//! Extraction on the GPU.

use std::ops::Range;

use rayon::prelude::*;

use crate::data::FrameSource;
use crate::error::{Error, Result};
use crate::event::{Cancel, Event};
use crate::extract::{DeviceExtractor, Extraction, Prepared};
use crate::track::FrameKey;

/// Frames that go through the encoder together.
const BATCH: usize = 16;

/// Extracts every frame; the results are in order. The threads of the current pool read and resize
/// a batch while the GPU computes the one before.
pub(super) fn extract_all(
    extractor: &DeviceExtractor,
    frames: &dyn FrameSource,
    report: &(dyn Fn(Event) + Sync),
    cancel: &Cancel,
) -> Result<Vec<Result<Extraction>>> {
    let keys = frames.index().keys();
    report(Event::Started {
        what: "extracting keypoints".to_owned(),
        total: keys.len() as u64,
    });
    let prepare = |batch: Range<usize>| -> Vec<Result<Prepared>> {
        let one = |i| {
            let frame = frames.read(i)?;
            extractor.prepare(&frame).map_err(|e| e.at(&keys[i]))
        };
        batch.into_par_iter().map(one).collect()
    };
    let batch = |start: usize| start..(start + BATCH).min(keys.len());
    let mut found = Vec::with_capacity(keys.len());
    let mut prepared = prepare(batch(0));
    while found.len() < keys.len() {
        cancel.check()?;
        let now = batch(found.len());
        let next = batch(now.end);
        let (computed, following) =
            rayon::join(|| run(extractor, prepared, &keys[now]), || prepare(next));
        found.extend(computed?);
        prepared = following;
        report(Event::Progress {
            done: found.len() as u64,
            note: String::new(),
        });
    }
    report(Event::Done);
    Ok(found)
}

/// The keypoints of the frames that could be read, and the errors of the others in their places.
fn run(
    extractor: &DeviceExtractor,
    frames: Vec<Result<Prepared>>,
    keys: &[FrameKey],
) -> Result<Vec<Result<Extraction>>> {
    let mut good = Vec::with_capacity(frames.len());
    let unreadable: Vec<Option<Error>> = frames
        .into_iter()
        .map(|frame| frame.map(|frame| good.push(frame)).err())
        .collect();
    let mut extracted = extractor.run(&good)?.into_iter();
    let mut next = |key| Some(extracted.next()?.map_err(|e| e.at(key)));
    Ok(unreadable
        .into_iter()
        .zip(keys)
        .filter_map(|(error, key)| error.map(Err).or_else(|| next(key)))
        .collect())
}
