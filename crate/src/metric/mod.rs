//! The paper's metric (section 3): do keypoints track ground-truth objects?
//!
//! For every keypoint `z_n` and object `x_k` a time-invariant map is fitted by ordinary least
//! squares, and the tracking error is the mean over time of the squared distance that is left,
//! `e_{n,k} = 1/T sum_t |A z_n^t + b - x_k^t|^2` (equation 1, which writes the sum; the thresholds
//! belong to the mean, and the sum is reported beside it). The best keypoint of an object is `n*_k
//! = argmin_n e_{n,k}`; the object is tracked when `e_{n*_k,k} <= mu_k`; the tracking capability TC
//! is the share of tracked objects (equation 2).
//!
//! Everything here is pure: arrays in, numbers out, f64, no I/O. Frames are pushed one by one into
//! an [`Accumulator`], which keeps centred second moments only, so that a recording of any length
//! takes O(N K) memory and can be split over threads and merged.
//!
//! ```
//! use ndarray::array;
//! use tracklens::metric::{Accumulator, NonFinite, Object, Settings};
//!
//! let mut accumulator = Accumulator::new(1, 1, NonFinite::Error);
//! for t in 0..10 {
//!     let s = f64::from(t) / 10.0;
//!     let keypoints = array![[s, s * s]];
//!     let truth = array![[2.0 * s * s + 0.1, -s]];
//!     accumulator.push(keypoints.view(), truth.view())?;
//! }
//! let evaluation = accumulator.finish().evaluate(&[Object::new("cube", 0.015)], &Settings::default())?;
//! assert_eq!(evaluation.tracking_capability, 1.0);
//! # Ok::<(), tracklens::Error>(())
//! ```

mod accumulator;
pub mod context;
mod evaluation;
mod map;
mod moments;
mod sequences;
pub mod stats;

pub use accumulator::{Accumulator, NonFinite};
pub use evaluation::{Best, Evaluation, Object, ObjectEvaluation, Settings, default_threshold};
pub use map::{AffineMap, Fit, Rank, Transform};
pub use moments::Moments;
pub use sequences::{Bootstrap, HeldOut, HeldOutObject, Intervals, bootstrap, deal, held_out};

use ndarray::ArrayView3;

use crate::error::Result;

/// Scores keypoints (T x N x 2) against ground truth (T x K x 2, ndc; NaN = not visible) in one
/// call.
///
/// # Errors
/// As [`Accumulator::push`] and [`Moments::evaluate`].
pub fn evaluate(
    keypoints: ArrayView3<f64>,
    truth: ArrayView3<f64>,
    objects: &[Object],
    policy: NonFinite,
    settings: &Settings,
) -> Result<Evaluation> {
    let mut accumulator = Accumulator::new(keypoints.dim().1, truth.dim().1, policy);
    for (z, x) in keypoints.outer_iter().zip(truth.outer_iter()) {
        accumulator.push(z, x)?;
    }
    accumulator.finish().evaluate(objects, settings)
}
