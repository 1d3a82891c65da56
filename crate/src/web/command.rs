//! The command of the terminal that gives the same evaluation as the page.

use serde::Deserialize;

use crate::command_line::{
    BOOTSTRAP, CAMERA, CONTEXT, FOLDS, IMAGE_SIZE, KEYPOINTS, MIN_CONFIDENCE, NON_FINITE, RANK,
    RESAMPLING_SEED, SEQUENCES, SHIFT_FRAMES, SHIFT_SEQUENCES, TEMPORAL, THRESHOLD, TRANSFORM,
    TRUTH, TRUTH_MIN_CONFIDENCE, shell_line,
};
use crate::error::Result;
use crate::evaluation::{Matching, Request};
use crate::metric::{NonFinite, Rank, Settings};

/// The files of an evaluation, as a command names them.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Inputs {
    truth: String,
    /// The table of keypoints, in place of a checkpoint and frames.
    keypoints: Option<String>,
    checkpoint: Option<String>,
    /// A folder of frames, or a recording.
    frames: Option<String>,
    /// The file of the camera that puts the ground truth into the image.
    camera: Option<String>,
    /// Options of reading, word by word, e.g. `--space`, `px`.
    options: Vec<String>,
}

impl Inputs {
    /// The fields in JavaScript.
    pub const KEYS: [&str; 6] = [
        "truth",
        "keypoints",
        "checkpoint",
        "frames",
        "camera",
        "options",
    ];
}

/// The command that repeats `request` on `inputs`, quoted for a shell. Options that have their
/// default are left out; `axes` is the number of coordinates of a keypoint.
///
/// # Errors
/// When a shell has no way to write a name.
pub(super) fn command(
    request: &Request,
    axes: usize,
    inputs: &Inputs,
    policy: NonFinite,
    Matching { least, alignment }: Matching,
) -> Result<String> {
    let mut words = vec!["tracklens".to_owned()];
    let option = |name: &str, value: &str| [format!("--{name}"), value.to_owned()];
    match (&inputs.keypoints, &inputs.checkpoint) {
        (None, Some(checkpoint)) => {
            words.push("eval".to_owned());
            words.extend(option("checkpoint", checkpoint));
            words.extend(option("frames", inputs.frames.as_deref().unwrap_or(".")));
            words.extend(option(TRUTH, &inputs.truth));
        }
        (keypoints, _) => {
            let keypoints = keypoints.as_deref().unwrap_or("keypoints.csv");
            words.push("score".to_owned());
            words.extend(option(TRUTH, &inputs.truth));
            words.extend(option(KEYPOINTS, keypoints));
            if let Some([width, height]) = request.image_size {
                words.extend(option(IMAGE_SIZE, &format!("{width}x{height}")));
            }
        }
    }
    words.extend(inputs.options.iter().cloned());
    if let Some(camera) = &inputs.camera {
        words.extend(option(CAMERA, camera));
    }
    let shifts = [
        (SHIFT_FRAMES, alignment.frames),
        (SHIFT_SEQUENCES, alignment.sequences),
    ];
    for (name, by) in shifts.into_iter().filter(|(_, by)| *by != 0) {
        words.extend(option(name, &by.to_string()));
    }
    let default = Settings {
        rank: Rank::of_axes(axes),
        ..Settings::default()
    };
    if request.settings.transform != default.transform {
        words.extend(option(TRANSFORM, request.settings.transform.name()));
    }
    if request.settings.rank != default.rank {
        words.extend(option(RANK, request.settings.rank.name()));
    }
    for threshold in request.thresholds.given() {
        words.extend(option(THRESHOLD, &threshold.to_string()));
    }
    if policy == NonFinite::ExcludeFrame {
        words.extend(option(NON_FINITE, "exclude-frame"));
    }
    for (least, name) in [
        (least.keypoints, MIN_CONFIDENCE),
        (least.truth, TRUTH_MIN_CONFIDENCE),
    ] {
        if let Some(least) = least {
            words.extend(option(name, &least.to_string()));
        }
    }
    let folds = request.folds.filter(|folds| *folds > 0);
    if let Some(folds) = folds {
        words.extend(option(FOLDS, &folds.to_string()));
    }
    if let Some(resamples) = request.bootstrap {
        words.extend(option(BOOTSTRAP, &resamples.to_string()));
    }
    if request.seed != 0 && (folds.is_some() || request.bootstrap.is_some()) {
        words.extend(option(RESAMPLING_SEED, &request.seed.to_string()));
    }
    let more = [
        (request.sequences, SEQUENCES),
        (request.context, CONTEXT),
        (request.temporal, TEMPORAL),
    ];
    for (asked, name) in more {
        if asked {
            words.push(format!("--{name}"));
        }
    }
    shell_line(words.iter().map(String::as_str))
}
