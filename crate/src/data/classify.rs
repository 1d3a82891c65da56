//! What a file is, from its path and first bytes.

use super::frames::{is_hidden, is_image};
use super::table::{Layout, header_layout};
use crate::checkpoint::Format;

/// What a file is taken for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// A frame.
    Image,
    /// A table of object positions.
    GroundTruth,
    /// A table of keypoints.
    Keypoints,
    /// Weights of an encoder.
    Checkpoint,
    /// Nothing that is known here.
    Unknown,
}

/// A role with the reason in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Classification {
    /// What the file is taken for.
    pub role: Role,
    /// Why.
    pub reason: String,
}

/// Guesses what a file is from its path and its first bytes (4 kB are enough).
pub fn classify(path: &str, head: &[u8]) -> Classification {
    let (role, reason) = guess(path, head);
    Classification { role, reason }
}

fn guess(path: &str, head: &[u8]) -> (Role, String) {
    if is_image(path) {
        return (Role::Image, "an image by its name".to_owned());
    }
    if is_hidden(path) {
        return (Role::Unknown, "a hidden file".to_owned());
    }
    let file = path.rsplit('/').next().unwrap_or_default();
    let ending = file
        .rsplit_once('.')
        .map(|(_, e)| e.to_ascii_lowercase())
        .unwrap_or_default();
    match ending.as_str() {
        // By its name even where the content is something else: reading it says what is wrong.
        _ if Format::from_extension(&ending).is_some() => (
            Role::Checkpoint,
            format!("a checkpoint, by its ending `.{ending}`"),
        ),
        "csv" | "tsv" | "txt" => table(head),
        "json" => json(head),
        ending => match (Format::of(head), ending) {
            (Some(format), _) => (Role::Checkpoint, format!("a {format} checkpoint, by its content")),
            (None, "") => (Role::Unknown, "a file without an ending".to_owned()),
            (None, _) => (
                Role::Unknown,
                format!(
                    "`.{ending}` is not known; expected images, a .csv table or a checkpoint (.safetensors, .pth, .bpk)"
                ),
            ),
        },
    }
}

fn table(head: &[u8]) -> (Role, String) {
    let text = String::from_utf8_lossy(head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head));
    let header = text.lines().next().unwrap_or_default().to_ascii_lowercase();
    let fields: csv::StringRecord = header
        .split([',', ';', '\t'])
        .map(|c| c.trim().trim_matches('"'))
        .collect();
    let has = |name: &str| fields.iter().any(|c| c == name);
    match (has("object"), has("keypoint")) {
        (true, false) => (Role::GroundTruth, "a table with a column `object`".to_owned()),
        (false, true) => (Role::Keypoints, "a table with a column `keypoint`".to_owned()),
        (true, true) => (
            Role::Unknown,
            "a table with both a column `object` and a column `keypoint`; expected one of them".to_owned(),
        ),
        (false, false) if has("x") && has("y") => (
            Role::GroundTruth,
            "a table with columns `x` and `y`; a ground truth also needs `object`, keypoints need `keypoint`".to_owned(),
        ),
        (false, false) => match header_layout(&fields) {
            Layout::Wide => (
                Role::GroundTruth,
                "a table with two columns a point, e.g. `cube_x,cube_y`; a guess: keypoints can look the same".to_owned(),
            ),
            Layout::DeepLabCut => (
                Role::GroundTruth,
                "a table of DeepLabCut; a guess: keypoints can look the same".to_owned(),
            ),
            Layout::Tidy | Layout::Coco => (
                Role::Unknown,
                "a table without a column `object` (ground truth) or `keypoint`: expected `sequence,frame,object,x,y` or \
                 `sequence,frame,keypoint,x,y`"
                    .to_owned(),
            ),
        },
    }
}

/// JSON: COCO keypoints, whose parts may come in any order.
fn json(head: &[u8]) -> (Role, String) {
    let text = String::from_utf8_lossy(head);
    let is_coco = ["\"images\"", "\"annotations\"", "\"categories\""]
        .iter()
        .any(|key| text.contains(key));
    match is_coco {
        true => (
            Role::GroundTruth,
            "COCO keypoints; a guess: keypoints of a detector can look the same".to_owned(),
        ),
        false => (
            Role::Unknown,
            "JSON without `images`, `annotations` or `categories` at its beginning; expected COCO keypoints"
                .to_owned(),
        ),
    }
}
