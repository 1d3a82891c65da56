//! What the doctor looks at.

use super::finding::Side;
use crate::data::{Alignment, Ground, Join, Known, Reading};
use crate::evaluation::confidence::MinConfidence;
use crate::track::{GroundTruth, KeypointTrack};

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
    /// How sure points have to be; others are taken for missing.
    pub least: MinConfidence,
    /// Width and height of the images in pixels, where they are known.
    pub image_size: Option<[u32; 2]>,
}

impl Subject<'_> {
    pub(super) fn reading(&self, side: Side) -> Option<&Reading> {
        match side {
            Side::Truth => self.truth_reading,
            Side::Keypoints => self.keypoints_reading,
        }
    }

    /// Whether a person said what `of` reads from a table.
    pub(super) fn is_said<T>(&self, side: Side, of: impl Fn(&Reading) -> Known<T>) -> bool {
        self.reading(side)
            .is_some_and(|reading| of(reading).by == Ground::Said)
    }
}
