//! Ground truth and keypoints as they were read, and all that is said of them together.

use super::doctor::{Subject, examine};
use super::document::{EvaluationReport, JoinReport};
use super::request::Request;
use super::scoring::{Matching, Scoring};
use crate::data::Reading;
use crate::error::Result;
use crate::metric::NonFinite;
use crate::track::{GroundTruth, KeypointTrack};

/// The two sides of a score, with how they were read where a file or an array says it.
#[derive(Debug, Clone, Copy)]
pub struct Sides<'a> {
    /// Where the objects are.
    pub truth: &'a GroundTruth,
    /// How the ground truth was read.
    pub truth_reading: Option<&'a Reading>,
    /// Where the keypoints are.
    pub keypoints: &'a KeypointTrack,
    /// How the keypoints were read.
    pub keypoints_reading: Option<&'a Reading>,
}

/// What two [`Sides`] give.
#[derive(Debug)]
pub struct Scored {
    /// Both, joined.
    pub scoring: Scoring,
    /// How frames were matched to rows.
    pub join: JoinReport,
    /// The evaluation, with measures over time where they were asked for, and with what looks wrong
    /// with the data.
    pub report: EvaluationReport,
}

impl Sides<'_> {
    /// Joins, scores, and looks at what was joined.
    ///
    /// # Errors
    /// As [`Scoring::matched`], [`Request::evaluate`] and [`Request::temporal`].
    pub fn score(
        &self,
        request: &Request,
        matching: Matching,
        policy: NonFinite,
    ) -> Result<Scored> {
        let (truth, keypoints) = (self.truth, self.keypoints);
        let scoring = Scoring::matched(truth, keypoints, policy, matching)?;
        let join = JoinReport::new(scoring.join(), keypoints.keys(), truth.keys());
        let mut report = request.evaluate(&scoring, &join)?;
        report.temporal = request.temporal(&scoring)?;
        report.findings = examine(&Subject {
            truth,
            truth_reading: self.truth_reading,
            keypoints,
            keypoints_reading: self.keypoints_reading,
            join: scoring.join(),
            alignment: matching.alignment,
            least: matching.least,
            image_size: request.image_size,
        });
        Ok(Scored {
            scoring,
            join,
            report,
        })
    }
}
