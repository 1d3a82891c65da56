//! Motion from frame to frame: shaking, and coming late.

use super::{Paths, mean, minus, point};

/// The lags that are looked at, in frames: up to so many before and behind.
pub const LAGS: i64 = 10;

/// The acceleration error: the mean length of the second difference of the distance vector between
/// the keypoint under its map and the object, in ndc a frame squared; `None` where no three frames
/// in a row have both.
pub fn acceleration_error(paths: Paths) -> Option<f64> {
    let off = |t: usize| Some(minus(point(paths.mapped, t)?, point(paths.truth, t)?));
    let (mut sum, mut count) = (0.0, 0);
    for run in paths.runs {
        for t in run.start + 1..run.end.saturating_sub(1) {
            let (Some(before), Some(at), Some(after)) = (off(t - 1), off(t), off(t + 1)) else {
                continue;
            };
            let bend = minus(minus(after, at), minus(at, before));
            sum += bend[0].hypot(bend[1]);
            count += 1;
        }
    }
    mean(sum, count)
}

/// The normalised cross-correlation of the velocities of the object and of the keypoint under its
/// map `lag` frames later: 1 for the same motion, 0 for an unrelated one. Velocities are differences
/// of frames in a row, and not centred. `None` where one of both never moves.
pub fn velocity_correlation(paths: Paths, lag: i64) -> Option<f64> {
    let (mut both, mut of_truth, mut of_mapped) = (0.0, 0.0, 0.0);
    for run in paths.runs {
        for t in run.start + 1..run.end {
            let Some(later) = t.checked_add_signed(lag as isize) else {
                continue;
            };
            if later <= run.start || later >= run.end {
                continue;
            }
            let step = |points, t: usize| Some(minus(point(points, t)?, point(points, t - 1)?));
            let (Some(v), Some(w)) = (step(paths.truth, t), step(paths.mapped, later)) else {
                continue;
            };
            both += v[0] * w[0] + v[1] * w[1];
            of_truth += v[0] * v[0] + v[1] * v[1];
            of_mapped += w[0] * w[0] + w[1] * w[1];
        }
    }
    let correlation = both / (of_truth.sqrt() * of_mapped.sqrt());
    correlation.is_finite().then_some(correlation)
}

/// By how many frames the keypoint comes later than the object: the lag of up to [`LAGS`] frames
/// whose velocities are correlated most, the smallest on ties. `None` where one of both never moves.
pub fn lag(paths: Paths) -> Option<i64> {
    let lags = std::iter::once(0).chain((1..=LAGS).flat_map(|lag| [lag, -lag]));
    let mut best: Option<(i64, f64)> = None;
    for lag in lags {
        let Some(found) = velocity_correlation(paths, lag) else {
            continue;
        };
        // What differs by rounding is a tie.
        if best.is_none_or(|(_, before)| found > before + 1e-9) {
            best = Some((lag, found));
        }
    }
    best.map(|(lag, _)| lag)
}
