//! Losses and metric on sequences that are not trained on.

use burn::prelude::Device;
use ndarray::{ArrayView3, Axis, concatenate, s};

use super::{Dataset, Losses, SNIPPET};
use crate::error::{Error, Result};
use crate::event::Cancel;
use crate::metric::{Evaluation, NonFinite, Settings};
use crate::model::{Sae, points_xy};
use crate::scoring::Scoring;
use crate::track::{GroundTruth, KeypointTrack};

/// What the validation sequences say about an SAE.
pub(super) struct Validation {
    pub losses: Losses,
    /// The first frame of every snippet, which is what the authors' code scores.
    pub track: KeypointTrack,
}

/// Runs an SAE over `sequences` of `dataset`, without noise; `batch` frames at once.
///
/// The losses are the means over all snippets. Without batch statistics a frame gives the same whatever snippet it is
/// in, so every frame is run once.
pub(super) fn validate(
    sae: &Sae,
    device: &Device,
    dataset: &Dataset,
    sequences: &[usize],
    velocity_weight: f64,
    batch: usize,
    cancel: &Cancel,
) -> Result<Validation> {
    let positions: Vec<usize> = sequences
        .iter()
        .map(|s| &dataset.sequences()[*s])
        .flat_map(|s| s.start..s.start + s.length)
        .collect();
    let mut squared_errors = Vec::with_capacity(positions.len());
    let mut points = Vec::new();
    for chunk in positions.chunks(batch) {
        cancel.check()?;
        let (inputs, targets) = dataset.batch(chunk.iter().copied()).into_tensors(device);
        let output = sae.forward(inputs);
        let errors = (output.reconstruction - targets).square().mean_dims(&[1, 2, 3]);
        let errors = errors
            .into_data()
            .try_into_vec::<f32>()
            .map_err(|e| Error::numeric(format!("the device returned no f32 values: {e:?}")))?;
        squared_errors.extend(errors.into_iter().map(f64::from));
        points.push(points_xy(output.latent)?);
    }
    let views: Vec<ArrayView3<f64>> = points.iter().map(|batch| batch.view()).collect();
    let points = concatenate(Axis(0), &views)
        .map_err(|e| Error::numeric(format!("batches of different numbers of keypoints: {e}")))?;

    let mut losses = Losses::default();
    let mut firsts = Vec::new();
    let mut start = 0;
    for sequence in sequences.iter().map(|s| &dataset.sequences()[*s]) {
        for t in start..(start + sequence.length).saturating_sub(SNIPPET - 1).max(start) {
            let frame = |i: usize| points.slice(s![t + i, .., ..]);
            let change = &frame(2) - &(&frame(1) * 2.0) + frame(0);
            losses.velocity += change.mapv(|v| v * v).mean().unwrap_or_default();
            losses.reconstruction += squared_errors[t..t + SNIPPET].iter().sum::<f64>() / SNIPPET as f64;
            firsts.push(t);
        }
        start += sequence.length;
    }
    let snippets = firsts.len().max(1) as f64;
    losses.velocity /= snippets;
    losses.reconstruction /= snippets;
    losses.total = losses.reconstruction + velocity_weight * losses.velocity;
    let keys = firsts.iter().map(|t| dataset.keys()[positions[*t]].clone()).collect();
    Ok(Validation { losses, track: KeypointTrack::new(keys, points.select(Axis(0), &firsts))? })
}

impl Validation {
    /// The metric with the affine map, the reference's rank rule and default thresholds.
    pub(super) fn evaluate(&self, truth: &GroundTruth) -> Result<Evaluation> {
        Scoring::new(truth, &self.track, NonFinite::Error)?.evaluate(&[], &Settings::default())
    }
}
