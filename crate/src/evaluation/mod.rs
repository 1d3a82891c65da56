//! What an evaluation is, for the terminal and the page alike: ground truth and keypoints are joined
//! and scored ([`Scoring`]), a [`Request`] says how, and the result is an [`EvaluationReport`], which
//! is its JSON.
//!
//! ```
//! use tracklens::data::{TableOptions, parse_ground_truth, parse_keypoints};
//! use tracklens::evaluation::{JoinReport, Request, Scoring};
//! use tracklens::metric::NonFinite;
//!
//! let mut truth = String::from("sequence,frame,object,x,y\n");
//! let mut keypoints = String::from("sequence,frame,keypoint,x,y\n");
//! for t in 0..40 {
//!     let [x, y] = [f64::from(t) / 40.0, f64::from(t * t) / 1600.0];
//!     truth += &format!("0,{t},cube,{x},{y}\n");
//!     keypoints += &format!("0,{t},0,{},{}\n", 0.3 * y, -x);
//! }
//! let options = TableOptions::default();
//! let truth = parse_ground_truth(truth.as_bytes(), "truth.csv", &options)?.content;
//! let keypoints = parse_keypoints(keypoints.as_bytes(), "keypoints.csv", &options)?.content;
//!
//! let scoring = Scoring::new(&truth, &keypoints, NonFinite::Error)?;
//! let join = JoinReport::new(scoring.join(), keypoints.keys(), truth.keys());
//! let evaluation = Request::default().evaluate(&scoring, &join)?;
//! // One sequence of 40 frames in a single sweep: too little to tell tracking from chance.
//! assert_eq!((evaluation.tc, evaluation.frames), (None, 40));
//! assert!(evaluation.objects[0].tracked);
//! # Ok::<(), tracklens::Error>(())
//! ```

mod confidence;
pub mod doctor;
mod document;
mod request;
mod scoring;
mod sides;
mod temporal;
mod thresholds;
mod unmatched;

pub use confidence::MinConfidence;
pub use document::{
    AssignmentReport, CameraReport, ConfidenceLevel, ConfidenceReport, ContextReport, Dimensions,
    EvaluationReport, HeldOutReport, IntervalReport, IntervalsReport, JoinReport, KeypointError,
    MeasureReport, ObjectReport, RegressionReport, SequenceReport, SequencesReport, TemporalReport,
    Unmatched,
};
pub use request::Request;
pub use scoring::{Context, Matching, Scoring, SequenceError, Series};
pub use sides::{Scored, Sides};
pub use temporal::{Temporal, TemporalObject};
pub use thresholds::{Threshold, Thresholds};
pub use unmatched::{UnmatchedSequence, unmatched_sequences};
