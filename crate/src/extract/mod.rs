//! Frames to keypoints, on whichever device.
//!
//! [`Extractor`] is the one interface: encoded bytes of a frame in, keypoints out. The terminal
//! deals frames to threads with one extractor each or gives a GPU many at a time, the page deals
//! them to a worker.

#[cfg(feature = "model")]
mod device;

#[cfg(feature = "model")]
pub use device::{DeviceExtractor, Prepared};

use crate::checkpoint::Checkpoint;
use crate::data::Frame;
use crate::engine::{Encoder, HeatMap, LatentGrid, Workspace};
use crate::error::Result;

/// The keypoints of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Extraction {
    /// N points (x, y) in the latent space of the encoder.
    pub points: Vec<[f32; 2]>,
    /// Width and height of the image.
    pub image_size: [u32; 2],
}

/// Extracts keypoints from images.
pub trait Extractor {
    /// The number of keypoints N.
    fn keypoints(&self) -> usize;

    /// Where the latent points lie in an image of `[width, height]`.
    fn grid(&self, image_size: [u32; 2]) -> LatentGrid;

    /// Decodes an image ([`Frame::decode`]) and extracts its keypoints.
    ///
    /// # Errors
    /// When the image cannot be decoded or the keypoints are not finite.
    fn extract(&mut self, image: &[u8]) -> Result<Extraction> {
        self.extract_frame(&Frame::decode(image)?)
    }

    /// Extracts the keypoints of a decoded frame.
    ///
    /// # Errors
    /// When the keypoints are not finite.
    fn extract_frame(&mut self, frame: &Frame) -> Result<Extraction>;
}

/// An [`Extractor`] on the CPU engine: a shared encoder and a workspace of its own.
pub struct CpuExtractor<E> {
    encoder: E,
    workspace: Workspace,
}

impl CpuExtractor<Encoder> {
    /// An extractor that owns the encoder of `checkpoint`.
    ///
    /// # Errors
    /// As [`Encoder::new`].
    pub fn from_checkpoint(checkpoint: &Checkpoint) -> Result<Self> {
        Ok(Self::new(Encoder::new(checkpoint)?))
    }
}

impl<E: std::borrow::Borrow<Encoder>> CpuExtractor<E> {
    /// An extractor for `encoder`, owned or borrowed.
    pub fn new(encoder: E) -> Self {
        Self {
            encoder,
            workspace: Workspace::default(),
        }
    }

    /// The encoder.
    pub fn encoder(&self) -> &Encoder {
        self.encoder.borrow()
    }

    /// The weights behind keypoint `n` of a frame.
    ///
    /// # Errors
    /// As [`Encoder::heat_map`].
    pub fn heat_map(&mut self, frame: &Frame, n: usize) -> Result<HeatMap> {
        self.encoder
            .borrow()
            .heat_map(&mut self.workspace, frame, n)
    }
}

impl<E: std::borrow::Borrow<Encoder>> Extractor for CpuExtractor<E> {
    fn keypoints(&self) -> usize {
        self.encoder().keypoints()
    }

    fn grid(&self, image_size: [u32; 2]) -> LatentGrid {
        self.encoder().grid(image_size)
    }

    fn extract_frame(&mut self, frame: &Frame) -> Result<Extraction> {
        let points = self.encoder.borrow().extract(&mut self.workspace, frame)?;
        Ok(Extraction {
            points,
            image_size: [frame.width(), frame.height()],
        })
    }
}
