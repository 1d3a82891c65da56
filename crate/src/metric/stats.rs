//! Statistics over runs: how reliably an architecture tracks.
//!
//! One run says little (paper, section 5.1), so errors and capabilities are taken over many.
//! Aggregates, intervals, performance profiles and the probability of improvement follow Agarwal et
//! al., "Deep Reinforcement Learning at the Edge of the Statistical Precipice" (NeurIPS 2021),
//! whose library is rliable; the tests hold them against it and SciPy.

use fastrand::Rng;

use super::scale::times_power;
use crate::error::{Error, Result};

/// What box plots and tables show of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The number of values.
    pub count: usize,
    /// The mean.
    pub mean: f64,
    /// The variance with `count - 1` below; NaN of one value, and where a value is infinite.
    pub variance: f64,
    /// Minimum, quartiles and maximum; quartiles by linear interpolation, as numpy's.
    pub quartiles: [f64; 5],
}

impl Sample {
    /// The statistics of `values`.
    ///
    /// # Errors
    /// When there is no value, one is NaN, both infinities are among them, or the variance of
    /// finite values is beyond the range of f64.
    pub fn of(values: &[f64]) -> Result<Self> {
        let sorted = sorted(values)?;
        let count = sorted.len();
        let mean = mean(values)?;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        if mean.is_finite() && !squares.is_finite() {
            let largest = sorted[count - 1];
            return Err(Error::numeric(format!(
                "the variance of values from {:e} to {largest:e} is too large for f64; expected \
                 values below 1e150",
                sorted[0]
            )));
        }
        Ok(Self {
            count,
            mean,
            variance: if count > 1 {
                squares / (count - 1) as f64
            } else {
                f64::NAN
            },
            quartiles: [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| quantile_of_sorted(&sorted, share)),
        })
    }

    /// The median.
    pub fn median(&self) -> f64 {
        self.quartiles[2]
    }
}

/// The quantile at `share` (0 to 1), by linear interpolation between the two nearest values.
///
/// # Errors
/// When there is no value, one is NaN, or `share` is not within 0 and 1.
pub fn quantile(values: &[f64], share: f64) -> Result<f64> {
    if !(0.0..=1.0).contains(&share) {
        return Err(Error::input(format!(
            "the quantile at {share}; expected 0 to 1"
        )));
    }
    Ok(quantile_of_sorted(&sorted(values)?, share))
}

/// The interquartile mean as rliable has it: the mean without the lowest and the highest quarter of
/// the values, each rounded down (`scipy.stats.trim_mean(values, 0.25)`).
///
/// # Errors
/// When there is no value, one is NaN, or both infinities are left.
pub fn trimmed_mean(values: &[f64]) -> Result<f64> {
    let sorted = sorted(values)?;
    let cut = sorted.len() / 4;
    mean(&sorted[cut..sorted.len() - cut])
}

/// The interquartile mean by quantiles: the mean of the values from the lower to the upper
/// quartile, both included.
///
/// # Errors
/// When there is no value, one is NaN, or both infinities are left.
pub fn quantile_window_mean(values: &[f64]) -> Result<f64> {
    let sorted = sorted(values)?;
    let [low, high] = [0.25, 0.75].map(|share| quantile_of_sorted(&sorted, share));
    let inside: Vec<f64> = sorted
        .into_iter()
        .filter(|v| (low..=high).contains(v))
        .collect();
    // One or two values may have both quartiles between them.
    if inside.is_empty() {
        return Ok(f64::midpoint(low, high));
    }
    mean(&inside)
}

/// The percentile interval of `statistic` by a stratified bootstrap: in each of `resamples`, every
/// stratum (an object, a task) draws as many of its values as it has, with replacement. The strata
/// are handed to `statistic` in their order.
///
/// # Errors
/// When there is no stratum, or one without values or with NaN, no resample, `level` is not between
/// 0 and 1, or `statistic` fails.
pub fn stratified_interval(
    strata: &[Vec<f64>],
    resamples: usize,
    level: f64,
    seed: u64,
    statistic: impl Fn(&[Vec<f64>]) -> Result<f64>,
) -> Result<[f64; 2]> {
    let mut rng = Rng::with_seed(seed);
    // A `usize` would be drawn otherwise where it has 32 bits.
    let draw = |count: usize| rng.u64(0..count as u64) as usize;
    interval_of_draws(strata, resamples, level, draw, statistic)
}

/// [`stratified_interval`] with the positions that are drawn given: `draw(n)` is one below n.
fn interval_of_draws(
    strata: &[Vec<f64>],
    resamples: usize,
    level: f64,
    mut draw: impl FnMut(usize) -> usize,
    statistic: impl Fn(&[Vec<f64>]) -> Result<f64>,
) -> Result<[f64; 2]> {
    if strata.is_empty() || resamples == 0 {
        return Err(Error::input(format!(
            "{resamples} resamples of {} strata; expected at least one of each",
            strata.len()
        )));
    }
    for stratum in strata {
        sorted(stratum)?;
    }
    let mut drawn = strata.to_vec();
    let mut replicates = Vec::with_capacity(resamples);
    for _ in 0..resamples {
        for (drawn, stratum) in drawn.iter_mut().zip(strata) {
            for value in drawn {
                *value = stratum[draw(stratum.len())];
            }
        }
        replicates.push(statistic(&drawn)?);
    }
    percentile_interval(&replicates, level)
}

/// The two percentiles of `replicates` with `level` between them.
///
/// # Errors
/// When there is no replicate, one is NaN, or `level` is not between 0 and 1.
pub fn percentile_interval(replicates: &[f64], level: f64) -> Result<[f64; 2]> {
    if !(level > 0.0 && level < 1.0) {
        return Err(Error::input(format!(
            "the level {level}; expected one between 0 and 1, e.g. 0.95"
        )));
    }
    let sorted = sorted(replicates)?;
    Ok([(1.0 - level) / 2.0, f64::midpoint(1.0, level)]
        .map(|share| quantile_of_sorted(&sorted, share)))
}

/// The probability that a run of `a` has a lower error than one of `b`, by all pairs; equal errors
/// count half (Mann and Whitney's U over the number of pairs).
///
/// # Errors
/// When one has no value, or a value is NaN.
pub fn probability_of_improvement(a: &[f64], b: &[f64]) -> Result<f64> {
    let (a, b) = (sorted(a)?, sorted(b)?);
    let wins: f64 = a
        .iter()
        .map(|v| {
            let not_above = b.partition_point(|w| w <= v);
            let below = b.partition_point(|w| w < v);
            (b.len() - not_above) as f64 + (not_above - below) as f64 / 2.0
        })
        .sum();
    Ok(wins / (a.len() * b.len()) as f64)
}

/// Spearman's rank correlation of `a` and `b`, one value each for every individual: Pearson's of
/// their ranks, where equal values share the mean of their ranks. `None` where one of them has a
/// single value throughout and so no order.
///
/// # Errors
/// When they differ in length, have no value, or a value is NaN.
pub fn rank_correlation(a: &[f64], b: &[f64]) -> Result<Option<f64>> {
    if a.len() != b.len() {
        return Err(Error::input(format!(
            "a rank correlation of {} and {} values; expected as many of both",
            a.len(),
            b.len()
        )));
    }
    let (a, b) = (ranks(a)?, ranks(b)?);
    let middle = (a.len() as f64 + 1.0) / 2.0;
    let product = |x: &[f64], y: &[f64]| -> f64 {
        let pairs = x.iter().zip(y);
        pairs.map(|(x, y)| (x - middle) * (y - middle)).sum()
    };
    let spread = product(&a, &a) * product(&b, &b);
    Ok((spread > 0.0).then(|| product(&a, &b) / spread.sqrt()))
}

/// The ranks of `values`, counted from 1; equal ones share their mean.
fn ranks(values: &[f64]) -> Result<Vec<f64>> {
    let sorted = sorted(values)?;
    let rank = |value: &f64| {
        let below = sorted.partition_point(|other| other < value);
        let not_above = sorted.partition_point(|other| other <= value);
        (below + 1 + not_above) as f64 / 2.0
    };
    Ok(values.iter().map(rank).collect())
}

/// The share of `errors` that are at most tau, for each of `taus`.
///
/// # Errors
/// When there is no error, or one is NaN.
pub fn performance_profile(errors: &[f64], taus: &[f64]) -> Result<Vec<f64>> {
    let sorted = sorted(errors)?;
    let share = |tau: &f64| sorted.partition_point(|e| e <= tau) as f64 / sorted.len() as f64;
    Ok(taus.iter().map(share).collect())
}

/// `values` smoothed by a Gaussian of the standard deviation `sigma` (in values), cut off at four
/// of them; at the ends the values are mirrored, the last one included
/// (`scipy.ndimage.gaussian_filter1d`'s default).
///
/// # Errors
/// When `sigma` is not a positive number of at most a million, or a value is NaN.
pub fn smooth(values: &[f64], sigma: f64) -> Result<Vec<f64>> {
    if !(sigma > 0.0 && sigma <= 1e6) {
        return Err(Error::input(format!(
            "cannot smooth with the sigma {sigma}; expected a positive number of at most 1e6"
        )));
    }
    if let Some(i) = values.iter().position(|v| v.is_nan()) {
        return Err(Error::numeric(format!("value {i} is not a number")));
    }
    let radius = (4.0 * sigma + 0.5) as isize;
    let weight = |offset: isize| (-0.5 * (offset as f64 / sigma).powi(2)).exp();
    let total: f64 = (-radius..=radius).map(weight).sum();
    let period = 2 * values.len().max(1) as isize;
    let at = |place: isize| {
        let place = place.rem_euclid(period);
        values[place.min(period - 1 - place) as usize]
    };
    let smoothed = |i: isize| {
        let sum = |scale: i32| {
            (-radius..=radius)
                .map(|offset| weight(offset) * times_power(at(i + offset), -scale))
                .sum::<f64>()
        };
        let ordinary = sum(0);
        if ordinary.is_finite() {
            return ordinary / total;
        }
        // The weights add up to less than 2^23.
        const ROOM: i32 = 23;
        times_power(sum(ROOM) / total, ROOM)
    };
    Ok((0..values.len() as isize).map(smoothed).collect())
}

/// The mean; the infinity among the values, if there is one.
fn mean(values: &[f64]) -> Result<f64> {
    let count = values.len() as f64;
    let sum: f64 = values.iter().sum();
    if sum.is_finite() {
        return Ok(sum / count);
    }
    // The sum of fewer than 2^60 values divided by 2^60 is in range. Infinities stay.
    const ROOM: i32 = 60;
    let sum: f64 = values.iter().map(|v| times_power(*v, -ROOM)).sum();
    if sum.is_nan() {
        return Err(Error::numeric(
            "positive and negative infinities have no mean; expected finite values",
        ));
    }
    Ok(times_power(sum / count, ROOM))
}

fn sorted(values: &[f64]) -> Result<Vec<f64>> {
    if values.is_empty() || values.iter().any(|v| v.is_nan()) {
        return Err(Error::numeric(match values.is_empty() {
            true => "there is no value to take a statistic of",
            false => "a value is not a number",
        }));
    }
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    Ok(sorted)
}

/// `sorted` is not empty.
fn quantile_of_sorted(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let (below, above) = (place.floor(), place.ceil());
    let (low, high) = (sorted[below as usize], sorted[above as usize]);
    if low == high {
        return low;
    }
    if !(high - low).is_finite() {
        // An infinity outweighs everything; the distance of finite values is out of range.
        return low * (1.0 - (place - below)) + high * (place - below);
    }
    // numpy's way of interpolating, which is exact at both ends.
    let part = place - below;
    if part < 0.5 {
        low + (high - low) * part
    } else {
        high - (high - low) * (1.0 - part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values, the positions that were drawn of them, and what numpy makes of the draws.
    #[test]
    fn the_same_draws_give_the_same_interval() {
        let fixture: serde_json::Value =
            serde_json::from_str(include_str!("../../../tests/golden/stats.json")).expect("JSON");
        let numbers = |value: &serde_json::Value| -> Vec<f64> {
            let values = value.as_array().expect("numbers").iter();
            values.map(|v| v.as_f64().expect("a number")).collect()
        };
        let case = &fixture["bootstrap"];
        let strata: Vec<Vec<f64>> = case["strata"]
            .as_array()
            .expect("strata")
            .iter()
            .map(numbers)
            .collect();
        let draws = numbers(&case["draws"]);
        let mut next = draws.iter();
        let draw = |_: usize| *next.next().expect("enough draws") as usize;
        let resamples = case["resamples"].as_u64().expect("a number") as usize;
        let statistic = |strata: &[Vec<f64>]| trimmed_mean(&strata.concat());
        let interval =
            interval_of_draws(&strata, resamples, 0.95, draw, statistic).expect("an interval");
        for (found, expected) in interval.iter().zip(numbers(&case["interval"])) {
            // Sums of 12 values of about 1 in another order.
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
    }
}
