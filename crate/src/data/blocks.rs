//! Many frames at a time.

use std::ops::Range;

use rayon::prelude::*;

use crate::error::Result;
use crate::event::Cancel;

/// Frames that are read at a time: neighbours, since a recording unpacks them together.
const BLOCK: usize = 256;

/// Calls `one` for every frame of `frames` on the threads of the current pool, and gives `done` the
/// results in order, block by block.
///
/// # Errors
/// When `done` fails or the work is cancelled, which is looked at before every frame. Errors of
/// `one` go to `done`.
pub(crate) fn for_blocks<T: Send>(
    frames: Range<usize>,
    cancel: &Cancel,
    one: impl Fn(usize) -> Result<T> + Sync,
    mut done: impl FnMut(Vec<Result<T>>) -> Result<()>,
) -> Result<()> {
    for start in frames.clone().step_by(BLOCK) {
        let block = (start..(start + BLOCK).min(frames.end)).into_par_iter();
        let results = block
            .map(|i| cancel.check().and_then(|()| one(i)))
            .collect();
        cancel.check()?;
        done(results)?;
    }
    Ok(())
}
