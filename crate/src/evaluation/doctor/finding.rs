//! What looks wrong, as data and in words.

use serde::{Deserialize, Serialize};

use crate::data::{AxisOrder, Flip, Space};

/// Which of the two tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// The ground truth.
    Truth,
    /// The keypoints.
    Keypoints,
}

impl Side {
    /// The table in words.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Truth => "the ground truth",
            Self::Keypoints => "the keypoints",
        }
    }
}

/// What looks wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Problem {
    /// Positions look like another unit than the one they were read in.
    Unit,
    /// One side counts from another number than the other.
    Counting,
    /// Every sequence of the ground truth begins later than its frames.
    FirstRows,
    /// The ground truth runs a constant number of frames before or behind the keypoints.
    Lag,
    /// The axes of the keypoints are swapped, or run the other way than those of the ground truth.
    Axes,
    /// Positions of exactly (0, 0) that stand out.
    Zeros,
    /// An object that does not move.
    Still,
}

/// What would put it right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Remedy {
    /// Read the positions in this unit.
    Unit {
        /// The table.
        side: Side,
        /// `ndc`, `px` or `fraction`.
        space: Space,
    },
    /// Count the frames of a table from this number.
    CountFrom {
        /// The table.
        side: Side,
        /// The number of the first frame.
        first: u64,
        /// The number of the first keypoint, which stays what it is; of keypoints only.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        first_keypoint: Option<u64>,
    },
    /// Add this to the frame numbers of the ground truth.
    ShiftFrames {
        /// What is added.
        by: i64,
    },
    /// Add this to the sequence numbers of the ground truth.
    ShiftSequences {
        /// What is added.
        by: i64,
    },
    /// Read the axes of a table like this.
    Axes {
        /// The table.
        side: Side,
        /// The order of the coordinates.
        order: AxisOrder,
        /// The axes that run the other way.
        flip: Flip,
    },
    /// Take positions of exactly (0, 0) in a table for missing.
    ZeroIsMissing {
        /// The table.
        side: Side,
    },
}

/// What a finding rests on.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Evidence {
    /// The mean error of the objects that are followed, on held-out frames, as things are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before: Option<f64>,
    /// The same with the first remedy.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub after: Option<f64>,
    /// How many speak for it: stretches of frames whose error becomes smaller, coordinates,
    /// positions or sequences.
    pub count: usize,
    /// Of how many.
    pub of: usize,
}

/// Something that looks wrong.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Finding {
    /// What looks wrong.
    pub problem: Problem,
    /// In words.
    pub text: String,
    /// What it rests on.
    pub evidence: Evidence,
    /// What would put it right, the likeliest first; none where nothing can be done about it here.
    pub remedies: Vec<Remedy>,
}
