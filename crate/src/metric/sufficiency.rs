//! Whether a recording can tell keypoints that track an object from keypoints that know nothing
//! of it.
//!
//! The best of N fitted maps comes close to an object by chance when there are few observations or
//! the object hardly moves. `docs/metrics.md` derives the bound that is computed here from the
//! object's positions alone.

use std::ops::Range;

use ndarray::ArrayView3;

use super::axes::Axes;
use super::evaluation::Object;
use super::scale::larger;
#[cfg(feature = "space")]
use super::scale::non_negative;
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
    /// Its mean squared distance from its mean position (ndc, or the unit of a ground truth in
    /// space): the error of a constant map.
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
/// show a keypoint at least (1: none is ever missing). The truth may be in space (T x K x 3), and so
/// may keypoints, of which `coordinates` is how many coordinates each has.
///
/// # Errors
/// When the number of `objects` is not K, or a variance is beyond the range of f64.
pub fn sufficiency(
    truth: ArrayView3<f64>,
    sequences: &[Range<usize>],
    keypoints: usize,
    coordinates: usize,
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
        #[cfg(feature = "space")]
        let motion = match truth.dim().2 {
            3 => Motion::of::<3>(truth, sequences, k),
            _ => Motion::of::<2>(truth, sequences, k),
        };
        #[cfg(not(feature = "space"))]
        let motion = Motion::of::<2>(truth, sequences, k);
        if !motion.variances[0].is_finite() {
            return Err(Error::numeric(format!(
                "the variance of object `{}` is too large for f64; expected coordinates near -1 \
                 to 1 (check for outliers and the unit)",
                object.name
            )));
        }
        Ok(motion.judge(object, pairs, coordinates, seen))
    };
    objects.iter().enumerate().map(of).collect()
}

/// How an object moves.
struct Motion {
    frames: u64,
    sequences: u64,
    /// Along the principal axes, the largest one first.
    variances: Axes<f64>,
    /// Frames that count as one observation.
    correlation_time: f64,
}

impl Motion {
    fn of<const D: usize>(truth: ArrayView3<f64>, sequences: &[Range<usize>], k: usize) -> Self {
        let at = |t: usize| -> [f64; D] { std::array::from_fn(|axis| truth[[t, k, axis]]) };
        let is_seen = |p: &[f64; D]| p.iter().all(|v| v.is_finite());
        let seen = || sequences.iter().cloned().flatten().map(at).filter(is_seen);
        let frames = seen().count() as u64;
        let count = frames as f64;
        let mean: [f64; D] =
            std::array::from_fn(|axis| seen().map(|p| p[axis] / count).sum::<f64>());
        let deviations: Vec<Vec<[f64; D]>> = sequences
            .iter()
            .map(|range| {
                let deviation = |t| std::array::from_fn(|axis| at(t)[axis] - mean[axis]);
                range.clone().map(deviation).collect()
            })
            .collect();
        let all = || deviations.iter().flatten().filter(|d| is_seen(d));
        let product = |i: usize, j: usize| all().map(|d| d[i] * d[j] / count).sum::<f64>();
        let total = (1..D).fold(product(0, 0), |sum, i| sum + product(i, i));
        let shown = |sequence: &&Vec<[f64; D]>| sequence.iter().any(is_seen);
        Self {
            frames,
            sequences: deviations.iter().filter(shown).count() as u64,
            variances: principal::<D>(product),
            correlation_time: correlation_time(&deviations, count * total),
        }
    }

    fn judge(&self, object: &Object, pairs: f64, coordinates: usize, seen: f64) -> Sufficiency {
        let variance = total(&self.variances);
        let observations = seen * self.frames as f64 / self.correlation_time;
        let chance = |observations: f64| {
            let one = chance_of_one(observations, &self.variances, coordinates, object.threshold);
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
fn correlation_time<const D: usize>(sequences: &[Vec<[f64; D]>], squares: f64) -> f64 {
    if squares == 0.0 {
        return 1.0;
    }
    let correlation = |lag: usize| {
        let pairs = sequences
            .iter()
            .flat_map(|s| s.iter().zip(s.iter().skip(lag)));
        let products =
            pairs.map(|(a, b)| (1..D).fold(a[0] * b[0], |sum, axis| sum + a[axis] * b[axis]));
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

fn total(variances: &[f64]) -> f64 {
    let variances = variances.iter().copied();
    variances.reduce(|sum, v| sum + v).unwrap_or(0.0)
}

/// The variances along the principal axes, of the mean `product`s of deviations.
fn principal<const D: usize>(product: impl Fn(usize, usize) -> f64) -> Axes<f64> {
    #[cfg(feature = "space")]
    if D == 3 {
        let matrix = nalgebra::Matrix3::from_fn(|i, j| product(i.min(j), i.max(j)));
        if matrix.iter().any(|v| !v.is_finite()) {
            return [f64::NAN; 3].into();
        }
        let mut found: [f64; 3] = matrix.symmetric_eigenvalues().into();
        found.sort_unstable_by(|a, b| b.total_cmp(a));
        return found.map(|v| larger(v, 0.0)).into();
    }
    let [xx, xy, yy] = [(0, 0), (0, 1), (1, 1)].map(|(i, j)| product(i, j));
    let half = (0.5 * (xx - yy)).hypot(xy);
    let middle = 0.5 * (xx + yy);
    [middle + half, larger(middle - half, 0.0)].into()
}

/// A bound on the probability that a map fitted to one random keypoint of so many `coordinates`
/// leaves at most `threshold` of an object with these `variances` along its principal axes.
fn chance_of_one(observations: f64, variances: &[f64], coordinates: usize, threshold: f64) -> f64 {
    match (coordinates, variances) {
        (2, [major, minor]) => chance_in_plane(observations, [*major, *minor], threshold),
        #[cfg(feature = "space")]
        _ => chance_in_space(observations, variances, coordinates, threshold),
        #[cfg(not(feature = "space"))]
        _ => 1.0,
    }
}

/// [`chance_of_one`] with a keypoint and an object in the plane.
///
/// With weights w of the axes in the variance, the share that is left is at least `B1^w1 B2^w2`
/// with independent `B1 ~ Beta((m-3)/2, 1)` and `B2 ~ Beta((m-4)/2, 1)`, whose logarithms are
/// exponential.
fn chance_in_plane(observations: f64, variances: [f64; 2], threshold: f64) -> f64 {
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

/// [`chance_of_one`] with a keypoint or an object in space.
///
/// The share that is left is at least the product of `B_i^w_i` with independent `B_i ~ Beta((m - p -
/// i) / 2, p / 2)` for p coordinates and the axes i from 1. A keypoint of three coordinates is taken
/// for one of four, which leaves no more: then p / 2 is whole, and `B_i` is a product of p / 2
/// variables `Beta(a, 1)`, `Beta(a + 1, 1)`, whose logarithms are exponential.
#[cfg(feature = "space")]
fn chance_in_space(
    observations: f64,
    variances: &[f64],
    coordinates: usize,
    threshold: f64,
) -> f64 {
    let variance = total(variances);
    let factors = coordinates.div_ceil(2);
    let predictors = 2.0 * factors as f64;
    let moving: Vec<f64> = variances.iter().copied().filter(|v| *v > 0.0).collect();
    if variance <= threshold || observations <= predictors + moving.len() as f64 {
        return 1.0;
    }
    let mut rates: Vec<f64> = Vec::new();
    for (i, own) in moving.iter().enumerate() {
        let a = (observations - predictors - (i + 1) as f64) / 2.0;
        rates.extend((0..factors).map(|factor| (a + factor as f64) * variance / own));
    }
    beyond(&rates, (variance / threshold).ln())
}

/// The probability that the sum of independent exponential variables of these rates is beyond
/// `distance`.
///
/// They are the times that a chain of states takes: the first row of `exp(distance Q)`, where each
/// state has its rate of going on to the next one.
#[cfg(feature = "space")]
fn beyond(rates: &[f64], distance: f64) -> f64 {
    let smaller = |a: f64, b: f64| if b < a { b } else { a };
    let slowest = rates.iter().copied().fold(f64::INFINITY, smaller);
    // The slowest alone takes that long with a chance of e^-700; the others add little to it.
    if slowest * distance > 700.0 {
        return 0.0;
    }
    // A rate that is cut to a smaller one makes the sum larger: it stays a bound.
    let rate = |i: usize| smaller(rates[i], 1e6 * slowest);
    let states = rates.len();
    let step = nalgebra::DMatrix::from_fn(states, states, |i, j| match j.checked_sub(i) {
        Some(0) => -rate(i) * distance,
        Some(1) => rate(i) * distance,
        _ => 0.0,
    });
    let found: f64 = step.exp().row(0).iter().sum();
    smaller(non_negative(found), 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_is_exact_on_a_line() {
        // 1 - R^2 of a regression on two variables and a constant is Beta((m - 3) / 2, 1).
        let found = chance_in_plane(13.0, [1.0, 0.0], 0.5);
        assert!((found - 0.5f64.powi(5)).abs() < 1e-15, "{found}");
    }

    #[test]
    fn two_axes_are_harder_to_hit_than_one_and_equal_rates_are_no_gap() {
        let line = chance_in_plane(13.0, [1.0, 0.0], 0.2);
        let plane = chance_in_plane(13.0, [0.5, 0.5], 0.2);
        assert!(plane < line);
        // The rates are equal where w1 = (m - 3) / (2 m - 7).
        let equal = 10.0 / 19.0;
        let chances =
            [equal - 1e-5, equal, equal + 1e-5].map(|w| chance_in_plane(13.0, [w, 1.0 - w], 0.2));
        let gap = (f64::midpoint(chances[0], chances[2]) - chances[1]).abs();
        assert!(gap < 1e-6 * chances[1], "{chances:?}");
    }

    #[cfg(feature = "space")]
    #[test]
    fn the_bound_in_space_is_that_of_the_plane_where_all_is_in_the_plane() {
        for (variances, threshold) in [([0.7, 0.3], 0.2), ([0.5, 0.5], 0.1), ([0.9, 1e-5], 0.3)] {
            let plane = chance_in_plane(13.0, variances, threshold);
            let space = chance_in_space(13.0, &variances, 2, threshold);
            assert!((plane - space).abs() < 1e-9 * plane, "{plane} {space}");
        }
    }

    #[cfg(feature = "space")]
    #[test]
    fn a_rate_that_is_cut_leaves_a_bound() {
        // The second rate is 1e9 times the first one. Cut to 1e6 times, it adds a millionth of the
        // first one's mean to the sum, and so a millionth to the chance.
        let plane = chance_in_plane(13.0, [0.9, 1e-9], 0.3);
        let space = chance_in_space(13.0, &[0.9, 1e-9], 2, 0.3);
        let more = space / plane - 1.0;
        assert!((0.0..2e-6).contains(&more), "{plane} {space}");
    }

    #[cfg(feature = "space")]
    #[test]
    fn a_third_coordinate_of_the_object_makes_chance_smaller_and_of_the_keypoint_larger() {
        let plane = chance_in_space(20.0, &[0.5, 0.5], 2, 0.2);
        let of_object = chance_in_space(20.0, &[0.4, 0.3, 0.3], 2, 0.2);
        let of_keypoint = chance_in_space(20.0, &[0.5, 0.5], 3, 0.2);
        assert!(of_object < plane && plane < of_keypoint);
    }

    #[cfg(feature = "space")]
    #[test]
    fn a_sum_of_equal_exponentials_is_erlangs() {
        // e^-d (1 + d + d^2 / 2) of three with rate 1.
        for d in [0.1f64, 2.0, 20.0] {
            let expected = (-d).exp() * (1.0 + d + d * d / 2.0);
            let found = beyond(&[1.0, 1.0, 1.0], d);
            assert!(
                (found - expected).abs() < 1e-12 * larger(expected, 1e-3),
                "{d}: {found}"
            );
        }
    }
}
