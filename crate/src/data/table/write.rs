//! Tables as CSV.

use std::fmt::Write as _;

use ndarray::{Array2, ArrayView1};

use crate::data::reading::px_from_ndc;
use crate::error::{Error, Result};
use crate::track::{GroundTruth, KeypointTrack};

/// A keypoint table as CSV, with every digit needed to read the same numbers again, and a column
/// `confidence` where there is one.
pub fn keypoints_csv(track: &KeypointTrack) -> String {
    let mut out = String::from("sequence,frame,keypoint,x,y");
    out += height_header(track.axes());
    out += confidence_header(track.confidence());
    for (t, (key, points)) in track
        .keys()
        .iter()
        .zip(track.points().outer_iter())
        .enumerate()
    {
        let sequence = quote_csv(&key.sequence);
        for (n, point) in points.rows().into_iter().enumerate() {
            // Writing to a String cannot fail.
            let _ = write!(out, "{sequence},{},{n}", key.frame);
            push_coordinates(&mut out, point);
            end_row(&mut out, track.confidence(), [t, n]);
        }
    }
    out
}

fn height_header(axes: usize) -> &'static str {
    if axes == 3 { ",z" } else { "" }
}

fn push_coordinates(out: &mut String, point: ArrayView1<f64>) {
    for value in point {
        // Writing to a String cannot fail.
        let _ = write!(out, ",{value}");
    }
}

fn confidence_header(confidence: Option<&Array2<f64>>) -> &'static str {
    match confidence {
        Some(_) => ",confidence\n",
        None => "\n",
    }
}

/// Ends the row of a point, with its confidence where there are any.
fn end_row(out: &mut String, confidence: Option<&Array2<f64>>, at: [usize; 2]) {
    // Writing to a String cannot fail.
    let _ = match confidence.map(|confidence| confidence[at]) {
        Some(confidence) if confidence.is_nan() => writeln!(out, ","),
        Some(confidence) => writeln!(out, ",{confidence}"),
        None => writeln!(out),
    };
}

/// A ground-truth table as CSV, with every digit needed to read the same numbers again; x, y and, in
/// space, z are empty where an object is not visible. With a column `confidence` where there is one.
pub fn ground_truth_csv(truth: &GroundTruth) -> String {
    let mut out = String::from("sequence,frame,object,x,y");
    out += height_header(truth.axes());
    out += confidence_header(truth.confidence());
    let frames = truth.keys().iter().zip(truth.points_ndc().outer_iter());
    for (t, (key, points)) in frames.enumerate() {
        let sequence = quote_csv(&key.sequence);
        for (k, (name, point)) in truth.names().iter().zip(points.rows()).enumerate() {
            let name = quote_csv(name);
            // Writing to a String cannot fail.
            let _ = write!(out, "{sequence},{},{name}", key.frame);
            match point.iter().all(|v| v.is_finite()) {
                true => push_coordinates(&mut out, point),
                false => out.extend(std::iter::repeat_n(',', point.len())),
            }
            end_row(&mut out, truth.confidence(), [t, k]);
        }
    }
    out
}

/// A position in pixels of images of `[width, height]`, where there is one.
pub fn seen_px(ndc: [f64; 2], image_size: [u32; 2]) -> Option<[f64; 2]> {
    ndc.iter()
        .all(|v| v.is_finite())
        .then(|| px_from_ndc(ndc, image_size))
}

/// The name of a sequence, which is to be one of a folder.
pub fn folder_name(sequence: &str) -> Result<&str> {
    match sequence.is_empty() || sequence.contains(['/', '\\']) {
        true => Err(Error::input(format!(
            "the sequence `{sequence}` is not the name of a folder; rename it"
        ))),
        false => Ok(sequence),
    }
}

/// A CSV field from a name, quoted where it must be. What a spreadsheet would run as a formula begins
/// with an apostrophe, which [`unescaped`] takes away again.
pub(crate) fn quote_csv(field: &str) -> String {
    let escaped = match is_formula(field) {
        true => format!("'{field}"),
        false => field.to_owned(),
    };
    if escaped.contains([',', '"', '\n', '\r']) || escaped.trim() != escaped {
        format!("\"{}\"", escaped.replace('"', "\"\""))
    } else {
        escaped
    }
}

/// A name as it was before [`quote_csv`].
pub fn unescaped(field: &str) -> &str {
    field
        .strip_prefix('\'')
        .filter(|name| is_formula(name))
        .unwrap_or(field)
}

/// Whether a spreadsheet takes a name for a formula, or it is one that was escaped; numbers are
/// harmless.
fn is_formula(name: &str) -> bool {
    name.trim_start_matches('\'')
        .starts_with(['=', '+', '-', '@'])
        && name.parse::<f64>().is_err()
}
