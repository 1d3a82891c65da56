//! Looks at what was joined before it is scored: units, counting, a constant lag, axes, positions
//! that mean "not found", objects that do not move.
//!
//! Nothing is changed. A [`Finding`] says what looks wrong, how much that rests on, and what would
//! remedy it; whoever shows it offers that as an option or a button. What a person said themselves
//! ([`Ground::Said`]) is not questioned.

mod axes;
mod blocks;
mod counting;
mod finding;
mod lag;
mod still;
mod unit;
mod zeros;

pub use finding::{Evidence, Finding, Problem, Remedy, Side};

use crate::data::{Alignment, Ground, Join, Known, Reading};
use crate::track::{GroundTruth, KeypointTrack};
use blocks::Blocks;

/// What is looked at.
#[derive(Debug, Clone, Copy)]
pub struct Subject<'a> {
    /// The ground truth.
    pub truth: &'a GroundTruth,
    /// What its numbers were taken for, where it was read from a file.
    pub truth_reading: Option<&'a Reading>,
    /// The keypoints.
    pub keypoints: &'a KeypointTrack,
    /// What their numbers were taken for, where they were read from a file.
    pub keypoints_reading: Option<&'a Reading>,
    /// How frames of the keypoints were matched to rows of the ground truth.
    pub join: &'a Join,
    /// What was added to the numbers of the rows for it.
    pub alignment: Alignment,
    /// Width and height of the images in pixels, where they are known.
    pub image_size: Option<[u32; 2]>,
}

impl Subject<'_> {
    fn reading(&self, side: Side) -> Option<&Reading> {
        match side {
            Side::Truth => self.truth_reading,
            Side::Keypoints => self.keypoints_reading,
        }
    }

    /// Whether a person said what `of` reads from a table.
    fn is_said<T>(&self, side: Side, of: impl Fn(&Reading) -> Known<T>) -> bool {
        self.reading(side)
            .is_some_and(|reading| of(reading).by == Ground::Said)
    }
}

/// What looks wrong, the worst first; nothing where all looks right.
pub fn examine(subject: &Subject) -> Vec<Finding> {
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
