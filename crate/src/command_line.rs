//! The terminal's options for scoring by name, and command lines as text. Both faces take the names
//! from here: the terminal parses them, and the page writes the command that gives its result.

use crate::error::{Error, Result};

pub(crate) const TRUTH: &str = "truth";
pub(crate) const KEYPOINTS: &str = "keypoints";
pub(crate) const IMAGE_SIZE: &str = "image-size";
pub(crate) const TRANSFORM: &str = "transform";
pub(crate) const RANK: &str = "rank";
pub(crate) const THRESHOLD: &str = "threshold";
pub(crate) const SHIFT_FRAMES: &str = "shift-frames";
pub(crate) const SHIFT_SEQUENCES: &str = "shift-sequences";
pub(crate) const CAMERA: &str = "camera";
pub(crate) const NON_FINITE: &str = "non-finite";
pub(crate) const MIN_CONFIDENCE: &str = "min-confidence";
pub(crate) const TRUTH_MIN_CONFIDENCE: &str = "truth-min-confidence";
pub(crate) const FOLDS: &str = "folds";
pub(crate) const BOOTSTRAP: &str = "bootstrap";
pub(crate) const RESAMPLING_SEED: &str = "resampling-seed";
pub(crate) const SEQUENCES: &str = "sequences";
pub(crate) const CONTEXT: &str = "context";
pub(crate) const TEMPORAL: &str = "temporal";

/// Words as one line of a shell, quoted where needed.
///
/// # Errors
/// When a shell has no way to write a word.
pub(crate) fn shell_line<'a>(words: impl IntoIterator<Item = &'a str>) -> Result<String> {
    shlex::try_join(words)
        .map_err(|e| Error::input(format!("these names cannot be written as a command: {e}")))
}
