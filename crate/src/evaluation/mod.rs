//! What an evaluation is, for the terminal and the page alike: ground truth and keypoints are joined
//! and scored ([`Scoring`]), a [`Request`] says how, and the result is an [`EvaluationReport`], which
//! is its JSON.

mod document;
mod request;
mod scoring;
mod thresholds;
mod unmatched;

pub use document::{
    AssignmentReport, ContextReport, EvaluationReport, HeldOutReport, IntervalReport,
    IntervalsReport, JoinReport, KeypointError, ObjectReport, RegressionReport, SequenceReport,
    SequencesReport, Unmatched,
};
pub use request::Request;
pub use scoring::{Context, Scoring, SequenceError, Series};
pub use thresholds::{Threshold, Thresholds};
pub use unmatched::{UnmatchedSequence, unmatched_sequences};
