//! How statistics over runs and their intervals are computed.

use crate::error::Result;
use crate::metric::stats::stratified_interval;

/// Standard deviation of the smoothing of curves, in epochs of a training and in evaluations of an
/// agent (paper, appendix, "Evaluation").
pub(super) const SMOOTHING: f64 = 2.5;
/// The share of resamples between the ends of an interval.
const LEVEL: f64 = 0.95;

/// How intervals are drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Draws {
    pub resamples: usize,
    pub seed: u64,
}

impl Draws {
    /// The interval of a statistic of `values`; a single value has none.
    pub(super) fn interval(
        self,
        values: &[f64],
        statistic: impl Fn(&[f64]) -> Result<f64>,
    ) -> Result<Option<[f64; 2]>> {
        self.stratified(&[values.to_vec()], statistic)
    }

    /// The same of all values, where each stratum draws its own.
    pub(super) fn stratified(
        self,
        strata: &[Vec<f64>],
        statistic: impl Fn(&[f64]) -> Result<f64>,
    ) -> Result<Option<[f64; 2]>> {
        if strata.iter().map(Vec::len).sum::<usize>() < 2 {
            return Ok(None);
        }
        let statistic = |drawn: &[Vec<f64>]| statistic(&drawn.concat());
        stratified_interval(strata, self.resamples, LEVEL, self.seed, statistic).map(Some)
    }
}

pub(super) fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// The mean of values that are drawn, of which there is at least one.
pub(super) fn average(values: &[f64]) -> Result<f64> {
    Ok(mean(values).unwrap_or(f64::NAN))
}
