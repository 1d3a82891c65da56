//! Keypoints on a device of burn, many frames at a time.

#[cfg(not(target_arch = "wasm32"))]
use std::ops::Range;

use burn::prelude::{Device, Tensor, TensorData};
use ndarray::Array3;
#[cfg(not(target_arch = "wasm32"))]
use rayon::prelude::*;

use super::{Extraction, Extractor};
use crate::checkpoint::{Checkpoint, LatentGrid, SaeConfig};
#[cfg(not(target_arch = "wasm32"))]
use crate::data::FrameSource;
use crate::data::{Filter, Frame};
use crate::engine::{check_size, finite};
#[cfg(not(target_arch = "wasm32"))]
use crate::error::Error;
use crate::error::Result;
#[cfg(not(target_arch = "wasm32"))]
use crate::event::Cancel;
use crate::model::{Encoder, points_xy, points_xy_async};
#[cfg(not(target_arch = "wasm32"))]
use crate::track::FrameKey;

/// Frames of a source that go through the encoder together.
#[cfg(not(target_arch = "wasm32"))]
const BATCH: usize = 16;

/// An [`Extractor`] on a device of burn, such as a GPU, which is fastest with many frames at a
/// time: [`prepare`](Self::prepare) them on the CPU, then [`run`](Self::run) them together.
pub struct DeviceExtractor {
    config: SaeConfig,
    encoder: Encoder,
    device: Device,
}

/// A frame as the encoder takes it.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// 3 x height x width in [0, 1].
    values: Vec<f32>,
    /// Width and height.
    size: [usize; 2],
    image_size: [u32; 2],
}

impl DeviceExtractor {
    /// Moves the encoder of `checkpoint` to `device`.
    ///
    /// # Errors
    /// When a tensor is missing or has the wrong rank.
    pub fn new(checkpoint: &Checkpoint, device: &Device) -> Result<Self> {
        Ok(Self {
            config: checkpoint.config.clone(),
            encoder: Encoder::from_checkpoint(checkpoint, device)?,
            device: device.clone(),
        })
    }

    /// Resizes a frame to the encoder's input size, if it has one.
    ///
    /// # Errors
    /// When the frame is too small for the encoder.
    pub fn prepare(&self, frame: &Frame) -> Result<Prepared> {
        let own = [frame.width() as usize, frame.height() as usize];
        let size = self.config.input_size.unwrap_or(own);
        check_size(&self.config, size)?;
        Ok(Prepared {
            values: frame.to_planar(Some(size), Filter::BilinearAntialias),
            size,
            image_size: [frame.width(), frame.height()],
        })
    }

    /// How many images of `[width, height]` may go through the encoder together when no tensor may
    /// take more than `tensor_limit` bytes; 0 when a single one is too large.
    pub fn frames_within(&self, image_size: [u32; 2], tensor_limit: u64) -> usize {
        let size = self
            .config
            .input_size
            .unwrap_or(image_size.map(|side| side as usize));
        let bytes = self.config.largest_maps(size) as u64 * size_of::<f32>() as u64;
        usize::try_from(tensor_limit / bytes.max(1)).unwrap_or(usize::MAX)
    }

    /// The keypoints of frames, in their order. Neighbours of one size go through the encoder
    /// together.
    ///
    /// # Errors
    /// When the device fails. An error of a single frame is in its place.
    pub fn run(&self, frames: &[Prepared]) -> Result<Vec<Result<Extraction>>> {
        let mut found = Vec::with_capacity(frames.len());
        for batch in batches(frames) {
            found.extend(extractions(batch, &points_xy(self.forward(batch))?));
        }
        Ok(found)
    }

    /// As [`run`](Self::run); the thread does not wait for the device, which a browser does not
    /// allow.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub async fn run_async(&self, frames: &[Prepared]) -> Result<Vec<Result<Extraction>>> {
        let mut found = Vec::with_capacity(frames.len());
        for batch in batches(frames) {
            found.extend(extractions(
                batch,
                &points_xy_async(self.forward(batch)).await?,
            ));
        }
        Ok(found)
    }

    /// The keypoints of the frames that could be read, and the errors of the others in their
    /// places.
    #[cfg(not(target_arch = "wasm32"))]
    fn run_readable(
        &self,
        frames: Vec<Result<Prepared>>,
        keys: &[FrameKey],
    ) -> Result<Vec<Result<Extraction>>> {
        let mut good = Vec::with_capacity(frames.len());
        let unreadable: Vec<Option<Error>> = frames
            .into_iter()
            .map(|frame| frame.map(|frame| good.push(frame)).err())
            .collect();
        let mut extracted = self.run(&good)?.into_iter();
        let mut next = |key| Some(extracted.next()?.map_err(|e| e.at(key)));
        Ok(unreadable
            .into_iter()
            .zip(keys)
            .filter_map(|(error, key)| error.map(Err).or_else(|| next(key)))
            .collect())
    }

    fn forward(&self, batch: &[Prepared]) -> Tensor<3> {
        let [width, height] = batch[0].size;
        let values: Vec<f32> = batch
            .iter()
            .flat_map(|frame| &frame.values)
            .copied()
            .collect();
        let data = TensorData::new(values, [batch.len(), 3, height, width]);
        self.encoder.forward(Tensor::from_data(data, &self.device))
    }
}

/// Neighbours of one size.
fn batches(frames: &[Prepared]) -> impl Iterator<Item = &[Prepared]> {
    frames.chunk_by(|a, b| a.size == b.size)
}

fn extractions(
    batch: &[Prepared],
    points: &Array3<f64>,
) -> impl Iterator<Item = Result<Extraction>> {
    batch
        .iter()
        .zip(points.outer_iter())
        .map(|(frame, points)| {
            let points = points
                .outer_iter()
                .map(|p| [p[0] as f32, p[1] as f32])
                .collect();
            finite(points).map(|points| Extraction {
                points,
                confidences: None,
                image_size: frame.image_size,
            })
        })
}

impl Extractor for DeviceExtractor {
    fn keypoints(&self) -> usize {
        self.config.keypoints
    }

    fn input_size(&self) -> Option<[usize; 2]> {
        self.config.input_size
    }

    fn grid(&self, image_size: [u32; 2]) -> LatentGrid {
        self.config.latent_grid(image_size)
    }

    fn extract_frame(&self, frame: &Frame) -> Result<Extraction> {
        self.run(&[self.prepare(frame)?])?.swap_remove(0)
    }

    /// Reads and prepares a batch while the device computes the one before.
    #[cfg(not(target_arch = "wasm32"))]
    fn extract_range(
        &self,
        source: &dyn FrameSource,
        range: Range<usize>,
        progress: &(dyn Fn(u64) + Sync),
        cancel: &Cancel,
    ) -> Result<Vec<Result<Extraction>>> {
        let keys = source.index().keys();
        let prepare = |batch: Range<usize>| -> Vec<Result<Prepared>> {
            let one = |i| {
                let frame = source.read(i)?;
                self.prepare(&frame).map_err(|e| e.at(&keys[i]))
            };
            batch.into_par_iter().map(one).collect()
        };
        let batch = |start: usize| start..(start + BATCH).min(range.end);
        let mut found = Vec::with_capacity(range.len());
        let mut prepared = prepare(batch(range.start));
        while found.len() < range.len() {
            cancel.check()?;
            let now = batch(range.start + found.len());
            let next = batch(now.end);
            let (computed, following) =
                rayon::join(|| self.run_readable(prepared, &keys[now]), || prepare(next));
            found.extend(computed?);
            prepared = following;
            progress(found.len() as u64);
        }
        Ok(found)
    }
}
