//! A constant number of frames between ground truth and keypoints.

use super::blocks::Blocks;
use super::finding::{Evidence, Finding, Problem, Remedy};
use super::subject::Subject;

/// The largest lag that is looked for, in frames.
const FARTHEST: i64 = 5;
/// The error with the lag taken out, relative to the error as things are, up to which a lag is
/// worth a word.
const LARGE: f64 = 0.75;

pub(super) fn examine(subject: &Subject, blocks: &Blocks) -> Option<Finding> {
    let lags = (-FARTHEST..=FARTHEST).filter(|by| *by != 0);
    let compared = lags.filter_map(|by| Some((by, blocks.compare(|row| blocks.later(row.z, by))?)));
    let (by, best) = compared.min_by(|a, b| a.1.ratio.total_cmp(&b.1.ratio))?;
    if best.ratio > LARGE || !best.is_significant() {
        return None;
    }
    let frames = match by.abs() {
        1 => "1 frame".to_owned(),
        n => format!("{n} frames"),
    };
    let what = match by > 0 {
        true => "the keypoints lag the ground truth",
        false => "the ground truth lags the keypoints",
    };
    Some(Finding {
        problem: Problem::Lag,
        text: format!(
            "{what} by {frames}: on held-out frames the error is {:.5} as it is and {:.5} without \
             the lag, smaller in {} of {} stretches",
            best.before, best.after, best.votes, best.of
        ),
        evidence: Evidence {
            before: Some(best.before),
            after: Some(best.after),
            count: best.votes,
            of: best.of,
        },
        remedies: vec![Remedy::ShiftFrames {
            by: subject.alignment.frames.saturating_add(by),
        }],
    })
}
