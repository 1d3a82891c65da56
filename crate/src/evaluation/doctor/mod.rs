//! Looks at what was joined before it is scored: units, counting, a constant lag, axes, positions
//! that mean "not found", objects that do not move.
//!
//! Nothing is changed. A [`Finding`] says what looks wrong, how much that rests on, and what would
//! remedy it; whoever shows it offers that as an option or a button. What a person said themselves
//! ([`Ground::Said`](crate::data::Ground::Said)) is not questioned.

mod axes;
mod blocks;
mod counting;
mod finding;
mod lag;
mod still;
mod subject;
mod unit;
mod zeros;

pub use finding::{Evidence, Finding, Problem, Remedy, Side};
pub use subject::Subject;

use super::confidence::hide;
use crate::track::{GroundTruth, KeypointTrack};
use blocks::Blocks;

/// The keypoints without those that are not sure enough, where there are such.
fn sure_keypoints(subject: &Subject) -> Option<KeypointTrack> {
    let of = subject.keypoints;
    let (confidence, least) = of.confidence().zip(subject.least.keypoints)?;
    let mut points = of.points().clone();
    hide(&mut points, confidence, least);
    KeypointTrack::new(of.keys().to_vec(), points).ok()
}

/// The ground truth without positions that are not sure enough, where there are such.
fn sure_truth(subject: &Subject) -> Option<GroundTruth> {
    let of = subject.truth;
    let (confidence, least) = of.confidence().zip(subject.least.truth)?;
    let mut points = of.points_ndc().clone();
    hide(&mut points, confidence, least);
    GroundTruth::new(of.keys().to_vec(), of.names().to_vec(), points).ok()
}

/// What looks wrong, the worst first; nothing where all looks right, and nothing of points in
/// space: what is looked at is of images.
pub fn examine(subject: &Subject) -> Vec<Finding> {
    if (subject.keypoints.axes(), subject.truth.axes()) != (2, 2) {
        return Vec::new();
    }
    let keypoints = sure_keypoints(subject);
    let truth = sure_truth(subject);
    let subject = &Subject {
        keypoints: keypoints.as_ref().unwrap_or(subject.keypoints),
        truth: truth.as_ref().unwrap_or(subject.truth),
        ..*subject
    };
    let blocks = Blocks::of(subject);
    let mut findings = unit::examine(subject, &blocks);
    findings.extend(counting::examine(subject, &blocks));
    // A lag of one frame is how counting from 1 shows.
    let is_aligned = !findings.iter().any(|f| f.problem == Problem::Counting);
    if is_aligned {
        findings.extend(lag::examine(subject, &blocks));
    }
    findings.extend(axes::examine(subject, &blocks));
    findings.extend(zeros::examine(subject));
    findings.extend(still::examine(subject));
    findings
}
