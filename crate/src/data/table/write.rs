//! Tables as CSV.

use std::fmt::Write as _;

use crate::track::{GroundTruth, KeypointTrack};

/// A keypoint table as CSV, with every digit needed to read the same numbers again.
pub fn keypoints_csv(track: &KeypointTrack) -> String {
    let mut out = String::from("sequence,frame,keypoint,x,y\n");
    for (key, points) in track.keys().iter().zip(track.points().outer_iter()) {
        let sequence = quote_csv(&key.sequence);
        for (n, point) in points.rows().into_iter().enumerate() {
            // Writing to a String cannot fail.
            let _ = writeln!(
                out,
                "{sequence},{},{n},{},{}",
                key.frame, point[0], point[1]
            );
        }
    }
    out
}

/// A ground-truth table as CSV, with every digit needed to read the same numbers again; x and y are
/// empty where an object is not visible.
pub fn ground_truth_csv(truth: &GroundTruth) -> String {
    let mut out = String::from("sequence,frame,object,x,y\n");
    for (key, points) in truth.keys().iter().zip(truth.points_ndc().outer_iter()) {
        let sequence = quote_csv(&key.sequence);
        for (name, point) in truth.names().iter().zip(points.rows()) {
            let name = quote_csv(name);
            // Writing to a String cannot fail.
            let _ = match point.iter().all(|v| v.is_finite()) {
                true => writeln!(
                    out,
                    "{sequence},{},{name},{},{}",
                    key.frame, point[0], point[1]
                ),
                false => writeln!(out, "{sequence},{},{name},,", key.frame),
            };
        }
    }
    out
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
