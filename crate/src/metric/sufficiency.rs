//! Whether a recording can tell keypoints that track an object from keypoints that know nothing
//! of it.
//!
//! The best of N fitted maps comes close to an object by chance when there are few observations or
//! the object hardly moves. `docs/metrics.md` derives the bound that is computed here from the
//! object's positions alone.

use std::ops::Range;

use ndarray::ArrayView3;

use super::evaluation::Object;
use super::scale::larger;
use crate::error::{Error, Result};

/// The chance that random keypoints pass for tracking in a recording that is called sufficient: at
/// most this for all objects together.
pub const CHANCE: f64 = 0.05;

/// Lags up to this are summed one by one, longer ones at steps that grow by a tenth.
const EVERY_LAG: usize = 64;

/// What a recording can say about one object.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "data", derive(serde::Serialize, serde::Deserialize))]
pub struct Sufficiency {
    /// The name of the object.
    pub name: String,
    /// Its mean squared distance from its mean position (ndc): the error of a constant map.
    pub variance: f64,
    /// The number of independent observations that its frames amount to.
    pub observations: f64,
    /// A bound on the probability that the best of N random keypoints passes for tracking one of
    /// the objects, were all objects like this one.
    pub chance: f64,
    /// Whether that is at most [`CHANCE`].
    #[cfg_attr(feature = "data", serde(rename = "known"))]
    pub is_known: bool,
    /// What would be enough; `None` when this is, or when no number of frames is because the
    /// variance is not above the threshold.
    pub needed: Option<Needed>,
}

/// The size of a recording that would be enough, with objects that move like these.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "data", derive(serde::Serialize, serde::Deserialize))]
pub struct Needed {
    /// Frames that show the object.
    pub frames: u64,
    /// Sequences of the same length as these on average, where there are several.
    pub sequences: Option<u64>,
}

/// Whether the positions `truth` (T x K x 2, ndc; NaN: not visible) are enough to score `keypoints`
/// keypoints by any of the maps. `sequences` are ranges of frames, `seen` is the share of them that
/// show a keypoint at least (1: none is ever missing).
///
/// # Errors
/// When the number of `objects` is not K, or a variance is beyond the range of f64.
pub fn sufficiency(
    truth: ArrayView3<f64>,
    sequences: &[Range<usize>],
    keypoints: usize,
    seen: f64,
    objects: &[Object],
) -> Result<Vec<Sufficiency>> {
    if objects.len() != truth.dim().1 {
        return Err(Error::mismatch(format!(
            "{} objects are named; the ground truth has {}",
            objects.len(),
            truth.dim().1
        )));
    }
    let pairs = (keypoints * objects.len()) as f64;
    let of = |(k, object): (usize, &Object)| {
        let motion = Motion::of(truth, sequences, k);
        if !motion.variances[0].is_finite() {
            return Err(Error::numeric(format!(
                "the variance of object `{}` is too large for f64; expected coordinates near -1 \
                 to 1 (check for outliers and the unit)",
                object.name
            )));
        }
        Ok(motion.judge(object, pairs, seen))
    };
    objects.iter().enumerate().map(of).collect()
}

/// How an object moves.
struct Motion {
    frames: u64,
    sequences: u64,
    /// Along the principal axes, the larger one first.
    variances: [f64; 2],
    /// Frames that count as one observation.
    correlation_time: f64,
}

impl Motion {
    fn of(truth: ArrayView3<f64>, sequences: &[Range<usize>], k: usize) -> Self {
        let at = |t: usize| [truth[[t, k, 0]], truth[[t, k, 1]]];
        let is_seen = |p: &[f64; 2]| p.iter().all(|v| v.is_finite());
        let seen = || sequences.iter().cloned().flatten().map(at).filter(is_seen);
        let frames = seen().count() as u64;
        let count = frames as f64;
        let mean = [0, 1].map(|axis| seen().map(|p| p[axis] / count).sum::<f64>());
        let deviations: Vec<Vec<[f64; 2]>> = sequences
            .iter()
            .map(|range| {
                let deviation = |t| [0, 1].map(|axis| at(t)[axis] - mean[axis]);
                range.clone().map(deviation).collect()
            })
            .collect();
        let all = || deviations.iter().flatten().filter(|d| is_seen(d));
        let [xx, xy, yy] =
            [(0, 0), (0, 1), (1, 1)].map(|(i, j)| all().map(|d| d[i] * d[j] / count).sum::<f64>());
        let half = (0.5 * (xx - yy)).hypot(xy);
        let middle = 0.5 * (xx + yy);
        let shown = |sequence: &&Vec<[f64; 2]>| sequence.iter().any(is_seen);
        Self {
            frames,
            sequences: deviations.iter().filter(shown).count() as u64,
            variances: [middle + half, larger(middle - half, 0.0)],
            correlation_time: correlation_time(&deviations, count * (xx + yy)),
        }
    }

    fn judge(&self, object: &Object, pairs: f64, seen: f64) -> Sufficiency {
        let variance = self.variances[0] + self.variances[1];
        let observations = seen * self.frames as f64 / self.correlation_time;
        let chance = |observations: f64| {
            let one = chance_of_one(observations, self.variances, object.threshold);
            let all = pairs * one;
            if all < 1.0 { all } else { 1.0 }
        };
        let found = chance(observations);
        let is_known = found <= CHANCE;
        let needed = (!is_known && variance > object.threshold && observations > 0.0).then(|| {
            let (mut low, mut high) = (observations, 2.0 * larger(observations, 4.0));
            while chance(high) > CHANCE && high < 1e15 {
                high *= 2.0;
            }
            for _ in 0..60 {
                let middle = f64::midpoint(low, high);
                if chance(middle) > CHANCE {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            let times = high / observations;
            Needed {
                frames: (times * self.frames as f64).ceil() as u64,
                sequences: (self.sequences > 1)
                    .then(|| (times * self.sequences as f64).ceil() as u64),
            }
        });
        Sufficiency {
            name: object.name.clone(),
            variance,
            observations,
            chance: found,
            is_known,
            needed,
        }
    }
}

/// One more than twice the sum of the autocorrelations within the sequences up to the first that is
/// not positive; the number of frames in a sequence for an object that rests in each.
fn correlation_time(sequences: &[Vec<[f64; 2]>], squares: f64) -> f64 {
    if squares == 0.0 {
        return 1.0;
    }
    let correlation = |lag: usize| {
        let pairs = sequences
            .iter()
            .flat_map(|s| s.iter().zip(s.iter().skip(lag)));
        let products = pairs.map(|(a, b)| a[0] * b[0] + a[1] * b[1]);
        products.filter(|p| !p.is_nan()).sum::<f64>() / squares
    };
    let longest = sequences.iter().map(Vec::len).max().unwrap_or(0);
    let mut sum = 0.0;
    let (mut lag, mut found) = (1, correlation(1));
    while lag < longest && found > 0.0 {
        let next = lag + (lag / 10).clamp(1, if lag < EVERY_LAG { 1 } else { lag });
        let after = correlation(next);
        // The trapezoid over the lags that are not looked at.
        let between = f64::midpoint(found, larger(after, 0.0));
        sum += found + (next.min(longest) - lag - 1) as f64 * between;
        (lag, found) = (next, after);
    }
    1.0 + 2.0 * sum
}

/// A bound on the probability that a map fitted to one random keypoint leaves at most `threshold`
/// of an object with these `variances` along its principal axes.
///
/// With weights w of the axes in the variance, the share that is left is at least `B1^w1 B2^w2`
/// with independent `B1 ~ Beta((m-3)/2, 1)` and `B2 ~ Beta((m-4)/2, 1)`, whose logarithms are
/// exponential.
fn chance_of_one(observations: f64, variances: [f64; 2], threshold: f64) -> f64 {
    let variance = variances[0] + variances[1];
    if variance <= threshold || observations <= 4.0 {
        return 1.0;
    }
    let distance = (variance / threshold).ln();
    let [w1, w2] = variances.map(|v| v / variance);
    let first = (observations - 3.0) / (2.0 * w1);
    let second = (observations - 4.0) / (2.0 * w2);
    if !second.is_finite() {
        return (-first * distance).exp();
    }
    let [a, b] = [first, second].map(|rate| (-rate * distance).exp());
    if (second - first).abs() < 1e-6 * first {
        return (1.0 + first * distance) * a;
    }
    (second * a - first * b) / (second - first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_is_exact_on_a_line() {
        // 1 - R^2 of a regression on two variables and a constant is Beta((m - 3) / 2, 1).
        let found = chance_of_one(13.0, [1.0, 0.0], 0.5);
        assert!((found - 0.5f64.powi(5)).abs() < 1e-15, "{found}");
    }

    #[test]
    fn two_axes_are_harder_to_hit_than_one_and_equal_rates_are_no_gap() {
        let line = chance_of_one(13.0, [1.0, 0.0], 0.2);
        let plane = chance_of_one(13.0, [0.5, 0.5], 0.2);
        assert!(plane < line);
        // The rates are equal where w1 = (m - 3) / (2 m - 7).
        let equal = 10.0 / 19.0;
        let chances =
            [equal - 1e-5, equal, equal + 1e-5].map(|w| chance_of_one(13.0, [w, 1.0 - w], 0.2));
        let gap = (f64::midpoint(chances[0], chances[2]) - chances[1]).abs();
        assert!(gap < 1e-6 * chances[1], "{chances:?}");
    }
}
