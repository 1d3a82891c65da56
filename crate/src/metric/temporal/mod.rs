//! How good a keypoint is over time, beside the tracking error: does it shake, come late, lose its
//! object to another keypoint or in the eyes of other benchmarks, and would another map do better?
//!
//! All of it is measured on the object's best keypoint under its fitted map, in ndc, and none of it
//! changes the TC. `docs/metrics.md` has the definitions and their sources.

mod handover;
mod maps;
mod motion;
mod tracks;

use std::ops::Range;

use ndarray::ArrayView2;

pub use handover::handed_over;
pub use maps::{HeldOutMaps, held_out_maps};
pub use motion::{LAGS, acceleration_error, lag, velocity_correlation};
pub use tracks::{Oks, PIXELS, TapVid, Tracks, oks, pck};

/// An object and a keypoint under its map, T x 2 each in ndc; NaN where one is missing.
#[derive(Debug, Clone, Copy)]
pub struct Paths<'a> {
    /// The object.
    pub truth: ArrayView2<'a, f64>,
    /// The keypoint under its map.
    pub mapped: ArrayView2<'a, f64>,
    /// Ranges of frames that follow each other without a gap.
    pub runs: &'a [Range<usize>],
}

/// A point, where it is there.
fn point(points: ArrayView2<f64>, t: usize) -> Option<[f64; 2]> {
    let at = [points[[t, 0]], points[[t, 1]]];
    at.iter().all(|v| v.is_finite()).then_some(at)
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// A mean; none of nothing, or of what f64 cannot hold.
fn mean(sum: f64, count: u64) -> Option<f64> {
    let mean = sum / count as f64;
    (count > 0 && mean.is_finite()).then_some(mean)
}
