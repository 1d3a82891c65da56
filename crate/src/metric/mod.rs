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

// `f64::max` and `f64::min` drop NaN, so that an overflow could pass for an error of 0.
#![deny(clippy::disallowed_methods)]

mod accumulator;
mod axes;
pub mod context;
mod evaluation;
mod map;
mod moments;
mod planes;
mod scale;
mod sequences;
#[cfg(feature = "space")]
mod space;
pub mod stats;
mod sufficiency;
pub mod temporal;

pub use accumulator::{Accumulator, NonFinite};
pub use axes::Axes;
pub use evaluation::{Best, Evaluation, Object, ObjectEvaluation, Settings, default_threshold};
pub use map::{AffineMap, Fit, Rank, Transform};
pub use moments::Moments;
pub use sequences::{Bootstrap, HeldOut, HeldOutObject, Intervals, bootstrap, deal, held_out};
pub use sufficiency::{CHANCE, Needed, Sufficiency, sufficiency};

use ndarray::{ArrayView3, Axis};

use crate::error::Result;

/// Scores keypoints (T x N x 2) against ground truth (T x K x 2, ndc; NaN = not visible) in one
/// call. Either may be in space, x, y and z in the last axis; the errors are then in the unit of
/// the ground truth.
///
/// # Errors
/// As [`Accumulator::push`] and [`Moments::evaluate`]; the message names the frame.
pub fn evaluate(
    keypoints: ArrayView3<f64>,
    truth: ArrayView3<f64>,
    objects: &[Object],
    policy: NonFinite,
    settings: &Settings,
) -> Result<Evaluation> {
    let axes = [keypoints.dim().2, truth.dim().2];
    let (count, objects_count) = (keypoints.dim().1, truth.dim().1);
    let mut accumulator = Accumulator::of_axes(count, objects_count, axes, policy)?;
    for (t, (z, x)) in keypoints.outer_iter().zip(truth.outer_iter()).enumerate() {
        accumulator
            .push(z, x)
            .map_err(|e| e.at(format!("frame {t}")))?;
    }
    let evaluated = accumulator.finish().evaluate(objects, settings);
    evaluated.map_err(|e| match farthest_frame(keypoints, truth) {
        Some((t, value)) => e.at(format!("frame {t} (coordinate {value:e})")),
        None => e,
    })
}

/// The frame with the coordinate that is farthest from 0, and that coordinate, if it is beyond 1e9:
/// where to look when scoring fails with
/// [`ErrorKind::Numeric`](crate::error::ErrorKind::Numeric).
pub fn farthest_frame(keypoints: ArrayView3<f64>, truth: ArrayView3<f64>) -> Option<(usize, f64)> {
    let mut farthest: Option<(usize, f64)> = None;
    for points in [keypoints, truth] {
        for (t, frame) in points.axis_iter(Axis(0)).enumerate() {
            for value in frame.iter().filter(|v| v.is_finite()) {
                if farthest.is_none_or(|(_, found)| value.abs() > found.abs()) {
                    farthest = Some((t, *value));
                }
            }
        }
    }
    farthest.filter(|(_, value)| value.abs() > context::FARTHEST)
}
