//! Batch normalization by the statistics of the batch with the ReLU that follows it, and its
//! gradients.
//!
//! Two passes over the maps each way. Sums run over one map at a time; those of the images are
//! added up in order, in f64.

use rayon::prelude::*;

use super::buffer::{Output, vectorised};

/// Sums that run side by side over a map, so that they fit the vectors of any CPU.
const LANES: usize = 64;

/// Images x channels x values of a map.
pub(super) type Maps = [usize; 3];

/// What the batch says about the channels.
pub(super) struct Statistics {
    pub mean: Vec<f32>,
    /// Biased.
    pub variance: Vec<f32>,
}

/// Gradients of the input, the scale and the offset.
pub(super) struct NormGradients {
    pub input: Vec<f32>,
    pub gamma: Vec<f32>,
    pub beta: Vec<f32>,
}

/// `x * scale + offset` a channel is the normalized x.
struct Line {
    scale: Vec<f32>,
    offset: Vec<f32>,
}

impl Line {
    fn new(statistics: &Statistics, gamma: &[f32], beta: &[f32], epsilon: f64) -> Self {
        let deviations = statistics
            .variance
            .iter()
            .map(|v| (f64::from(*v) + epsilon).sqrt());
        let scale: Vec<f64> = gamma
            .iter()
            .zip(deviations)
            .map(|(gamma, deviation)| f64::from(*gamma) / deviation)
            .collect();
        let offset = beta
            .iter()
            .zip(&statistics.mean)
            .zip(&scale)
            .map(|((beta, mean), scale)| (f64::from(*beta) - f64::from(*mean) * scale) as f32);
        Self {
            offset: offset.collect(),
            scale: scale.iter().map(|scale| *scale as f32).collect(),
        }
    }
}

/// Mean and biased variance of every channel.
pub(super) fn statistics(input: &[f32], [batch, channels, size]: Maps) -> Statistics {
    let moments: Vec<[f64; 2]> = input
        .par_chunks_exact(size)
        .map(|map| {
            let mean = sum([map], |[x]| [x])[0] / size as f64;
            let centre = mean as f32;
            let [first, second] = sum([map], |[x]| {
                let d = x - centre;
                [d, d * d]
            });
            // Deviations from the rounded mean.
            [
                f64::from(centre) + first / size as f64,
                second - first * first / size as f64,
            ]
        })
        .collect();
    let of_channel =
        |channel: usize| (0..batch).map(move |image| moments_at(image, channel, channels));
    let (mean, variance) = (0..channels)
        .map(|channel| {
            let mean = of_channel(channel).map(|i| moments[i][0]).sum::<f64>() / batch as f64;
            let spread = |i: usize| moments[i][1] + size as f64 * (moments[i][0] - mean).powi(2);
            let variance = of_channel(channel).map(spread).sum::<f64>() / (batch * size) as f64;
            (mean as f32, variance as f32)
        })
        .unzip();
    Statistics { mean, variance }
}

fn moments_at(image: usize, channel: usize, channels: usize) -> usize {
    image * channels + channel
}

/// Normalized, scaled, shifted, and negative values set to 0; a NaN stays one.
pub(super) fn normalize_relu(
    input: &[f32],
    [_, channels, size]: Maps,
    statistics: &Statistics,
    [gamma, beta]: [&[f32]; 2],
    epsilon: f64,
) -> Vec<f32> {
    let line = Line::new(statistics, gamma, beta, epsilon);
    let mut output = Output::new(input.len());
    let pieces = output.uninit();
    pieces
        .par_chunks_exact_mut(size)
        .zip(input.par_chunks_exact(size))
        .enumerate()
        .for_each(|(map, (output, input))| {
            let (scale, offset) = (line.scale[map % channels], line.offset[map % channels]);
            vectorised(
                #[inline(always)]
                || {
                    for (y, x) in output.iter_mut().zip(input) {
                        let value = x * scale + offset;
                        y.write(if value < 0.0 { 0.0 } else { value });
                    }
                },
            );
        });
    // SAFETY: the maps are all there is, and each was written.
    unsafe { output.into_vec(input.len()) }
}

/// The gradients, given the gradient of the output; the input's overwrites it.
pub(super) fn gradients(
    input: &[f32],
    [batch, channels, size]: Maps,
    statistics: &Statistics,
    [gamma, beta]: [&[f32]; 2],
    epsilon: f64,
    mut gradient: Vec<f32>,
) -> NormGradients {
    let line = Line::new(statistics, gamma, beta, epsilon);
    let sums: Vec<[f64; 2]> = input
        .par_chunks_exact(size)
        .zip(gradient.par_chunks_exact(size))
        .enumerate()
        .map(|(map, (input, gradient))| {
            let channel = map % channels;
            let (scale, offset, mean) = (
                line.scale[channel],
                line.offset[channel],
                statistics.mean[channel],
            );
            sum([input, gradient], |[x, g]| {
                let g = if x * scale + offset > 0.0 { g } else { 0.0 };
                [g, g * (x - mean)]
            })
        })
        .collect();
    // Per channel: the gradients of gamma and beta, and the line that is taken off the gradient of
    // the input: its slope, and its level at the mean.
    let mut result = NormGradients {
        input: Vec::new(),
        gamma: Vec::with_capacity(channels),
        beta: Vec::with_capacity(channels),
    };
    let samples = (batch * size) as f64;
    let mut slopes = Vec::with_capacity(channels);
    for channel in 0..channels {
        let maps = (0..batch).map(|image| sums[moments_at(image, channel, channels)]);
        let [sum, product] = maps.fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        let variance = f64::from(statistics.variance[channel]) + epsilon;
        result.gamma.push((product / variance.sqrt()) as f32);
        result.beta.push(sum as f32);
        let slope = product / (samples * variance);
        slopes.push([slope as f32, (sum / samples) as f32]);
    }
    gradient
        .par_chunks_exact_mut(size)
        .zip(input.par_chunks_exact(size))
        .enumerate()
        .for_each(|(map, (gradient, input))| {
            let channel = map % channels;
            let (scale, offset, mean) = (
                line.scale[channel],
                line.offset[channel],
                statistics.mean[channel],
            );
            let [slope, level] = slopes[channel];
            vectorised(
                #[inline(always)]
                || {
                    for (g, x) in gradient.iter_mut().zip(input) {
                        let own = if x * scale + offset > 0.0 { *g } else { 0.0 };
                        *g = scale * (own - level - slope * (x - mean));
                    }
                },
            );
        });
    result.input = gradient;
    result
}

/// Sums over a map of what `terms` makes of the values at a place.
#[inline(always)]
fn sum<const IN: usize, const OUT: usize>(
    maps: [&[f32]; IN],
    terms: impl Fn([f32; IN]) -> [f32; OUT] + Copy,
) -> [f64; OUT] {
    vectorised(
        #[inline(always)]
        || {
            let len = maps[0].len();
            let mut sums = [[0.0f32; LANES]; OUT];
            let whole = len - len % LANES;
            let mut start = 0;
            while start < whole {
                let parts = maps.map(|map| &map[start..start + LANES]);
                for lane in 0..LANES {
                    let values = terms(std::array::from_fn(|i| parts[i][lane]));
                    for (sums, value) in sums.iter_mut().zip(values) {
                        sums[lane] += value;
                    }
                }
                start += LANES;
            }
            let mut totals = sums.map(|sums| sums.iter().map(|sum| f64::from(*sum)).sum::<f64>());
            for at in whole..len {
                let values = terms(std::array::from_fn(|i| maps[i][at]));
                for (total, value) in totals.iter_mut().zip(values) {
                    *total += f64::from(value);
                }
            }
            totals
        },
    )
}
