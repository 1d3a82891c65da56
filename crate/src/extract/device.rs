//! Keypoints on a device of burn, many frames at a time.

use burn::prelude::{Device, Tensor, TensorData};
use ndarray::Array3;

use super::{Extraction, Extractor};
use crate::checkpoint::Checkpoint;
use crate::data::{Filter, Frame};
use crate::engine::{self, LatentGrid, finite};
use crate::error::Result;
use crate::model::{Encoder, points_xy, points_xy_async};

/// An [`Extractor`] on a device of burn, a GPU for one, which is at its best with many frames at a
/// time: [`prepare`](Self::prepare) them on the CPU, then [`run`](Self::run) them together.
pub struct DeviceExtractor {
    /// Knows sizes; nothing runs on it.
    plan: engine::Encoder,
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
    /// When a tensor is missing or has another shape than its neighbours need.
    pub fn new(checkpoint: &Checkpoint, device: &Device) -> Result<Self> {
        Ok(Self {
            plan: engine::Encoder::new(checkpoint)?,
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
        let size = self.plan.config().input_size.unwrap_or(own);
        self.plan.check_size(size)?;
        Ok(Prepared {
            values: frame.to_planar(Some(size), Filter::BilinearAntialias),
            size,
            image_size: [frame.width(), frame.height()],
        })
    }

    /// How many frames of a size of the image, `[width, height]`, may go through the encoder
    /// together when no tensor may take more than `tensor_limit` bytes; 0 when a single one is too
    /// large.
    pub fn frames_within(&self, image_size: [u32; 2], tensor_limit: u64) -> usize {
        let config = self.plan.config();
        let size = config
            .input_size
            .unwrap_or(image_size.map(|side| side as usize));
        let bytes = config.largest_maps(size) as u64 * size_of::<f32>() as u64;
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
                image_size: frame.image_size,
            })
        })
}

impl Extractor for DeviceExtractor {
    fn keypoints(&self) -> usize {
        self.plan.keypoints()
    }

    fn grid(&self, image_size: [u32; 2]) -> LatentGrid {
        self.plan.grid(image_size)
    }

    fn extract_frame(&mut self, frame: &Frame) -> Result<Extraction> {
        self.run(&[self.prepare(frame)?])?.swap_remove(0)
    }
}
