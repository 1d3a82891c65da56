//! What a file is, from its path and first bytes.

use serde::Serialize;

use crate::checkpoint::Format;
use crate::data::{Layout, is_hidden, is_image, look_at_table};

/// The endings of files that a browser may play.
const VIDEO_ENDINGS: [&str; 7] = ["mp4", "m4v", "mov", "webm", "mkv", "avi", "ogv"];

/// What a file is taken for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// A frame.
    Image,
    /// A table of object positions.
    GroundTruth,
    /// A table of keypoints.
    Keypoints,
    /// Weights of an encoder.
    Checkpoint,
    /// Frames and points as arrays, or in a file of another program: NPZ, HDF5, pickles.
    Recording,
    /// Other files, in a ZIP archive.
    Archive,
    /// Frames one after the other: MP4, WebM and their like.
    Video,
    /// A camera, which projects positions in space: JSON.
    Camera,
    /// What `score` and `eval` write, and the page: an evaluation.
    Result,
    /// Nothing that is known here.
    Unknown,
}

/// A role with the reason in words.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Classification {
    /// What the file is taken for.
    pub role: Role,
    /// Why.
    pub reason: String,
    /// Whether it is a guess: the content could as well be something else.
    pub guess: bool,
}

/// Guesses what a file is from its path and its first bytes (4 kB are enough).
pub fn classify(path: &str, head: &[u8]) -> Classification {
    let (role, reason, guess) = role_of(path, head);
    Classification {
        role,
        reason,
        guess,
    }
}

fn role_of(path: &str, head: &[u8]) -> (Role, String, bool) {
    let sure = |role, reason: String| (role, reason, false);
    if is_image(path) {
        return sure(Role::Image, "an image by its name".to_owned());
    }
    if is_hidden(path) {
        return sure(Role::Unknown, "a hidden file".to_owned());
    }
    let file = path.rsplit('/').next().unwrap_or_default();
    let ending = file
        .rsplit_once('.')
        .map(|(_, e)| e.to_ascii_lowercase())
        .unwrap_or_default();
    match ending.as_str() {
        // By its name even where the content is something else: reading it says what is wrong.
        _ if ending == "onnx" || Format::from_extension(&ending).is_some() => sure(
            Role::Checkpoint,
            format!("a checkpoint, by its ending `.{ending}`"),
        ),
        "csv" | "tsv" | "txt" => table(head),
        "npz" | "npy" => sure(
            Role::Recording,
            format!("numpy arrays, by its ending `.{ending}`"),
        ),
        "h5" | "hdf5" => sure(
            Role::Recording,
            format!("frames or points, by its ending `.{ending}`"),
        ),
        "slp" | "pkl" | "pickle" | "parquet" => sure(
            Role::Recording,
            format!("points, by its ending `.{ending}`"),
        ),
        "zip" if Format::of(head).is_none() => sure(
            Role::Archive,
            "a ZIP archive, by its ending `.zip`".to_owned(),
        ),
        ending if VIDEO_ENDINGS.contains(&ending) => {
            sure(Role::Video, format!("a video, by its ending `.{ending}`"))
        }
        "json" => json(head),
        ending => match (Format::of(head), ending) {
            (Some(format), _) => sure(
                Role::Checkpoint,
                format!("a {format} checkpoint, by its content"),
            ),
            (None, "") => sure(Role::Unknown, "a file without an ending".to_owned()),
            (None, _) => sure(
                Role::Unknown,
                format!(
                    "`.{ending}` is not known; expected images, a .csv table, a checkpoint (.safetensors, .pth, .bpk, \
                     .onnx), a recording (.npz, .h5), a video (.mp4, .webm) or a .zip archive of them"
                ),
            ),
        },
    }
}

fn table(head: &[u8]) -> (Role, String, bool) {
    let (layout, fields) = look_at_table(head);
    let has = |name: &str| fields.iter().any(|c| c.eq_ignore_ascii_case(name));
    match (has("object"), has("keypoint")) {
        (true, false) => (Role::GroundTruth, "a table with a column `object`".to_owned(), false),
        (false, true) => (Role::Keypoints, "a table with a column `keypoint`".to_owned(), false),
        (true, true) => (
            Role::Unknown,
            "a table with both a column `object` and a column `keypoint`; expected one of them".to_owned(),
            false,
        ),
        (false, false) if has("x") && has("y") => (
            Role::GroundTruth,
            "a table with columns `x` and `y`; a ground truth also needs `object`, keypoints need `keypoint`".to_owned(),
            true,
        ),
        (false, false) => match layout {
            Layout::Wide => (
                Role::GroundTruth,
                "a table with two columns a point, e.g. `cube_x,cube_y`; a guess: keypoints can look the same".to_owned(),
                true,
            ),
            Layout::DeepLabCut | Layout::Sleap | Layout::Mot => (
                Role::GroundTruth,
                format!("a table of {layout}; a guess: keypoints can look the same"),
                true,
            ),
            _ => (
                Role::Unknown,
                "a table without a column `object` (ground truth) or `keypoint`: expected `sequence,frame,object,x,y` or \
                 `sequence,frame,keypoint,x,y`"
                    .to_owned(),
                false,
            ),
        },
    }
}

/// JSON: an evaluation, a camera, or COCO keypoints, whose parts may come in any order.
fn json(head: &[u8]) -> (Role, String, bool) {
    let text = String::from_utf8_lossy(head);
    if text.contains("\"tracklens/evaluation/") {
        return (
            Role::Result,
            "an evaluation by tracklens, by its `schema`".to_owned(),
            false,
        );
    }
    if text.contains("\"tracklens/report/") {
        return (
            Role::Unknown,
            "numbers of a comparison of runs, which is not read again; expected the folders of the runs, or their evaluations"
                .to_owned(),
            false,
        );
    }
    if text.trim_start().starts_with('[') && text.contains("\"image_id\"") {
        return (
            Role::Keypoints,
            "results in COCO's format".to_owned(),
            false,
        );
    }
    if text.contains("\"intrinsics\"") {
        return (
            Role::Camera,
            "a camera, by its `intrinsics`".to_owned(),
            false,
        );
    }
    let is_coco = ["\"images\"", "\"annotations\"", "\"categories\""]
        .iter()
        .any(|key| text.contains(key));
    match is_coco {
        true => (
            Role::GroundTruth,
            "COCO keypoints; a guess: keypoints of a detector can look the same".to_owned(),
                true,
        ),
        false => (
            Role::Unknown,
            "JSON without `images`, `annotations` or `categories` at its beginning, the `intrinsics` of a camera or the \
             `schema` of an evaluation; expected COCO keypoints, a camera, or a result of tracklens"
                .to_owned(),
            false,
        ),
    }
}
