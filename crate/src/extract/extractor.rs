//! The interface of every device.

#[cfg(not(target_arch = "wasm32"))]
use std::ops::Range;

use crate::checkpoint::LatentGrid;
use crate::data::Frame;
#[cfg(not(target_arch = "wasm32"))]
use crate::data::FrameSource;
use crate::error::Result;
#[cfg(not(target_arch = "wasm32"))]
use crate::event::Cancel;

/// The keypoints of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Extraction {
    /// N points (x, y) in the latent space of the encoder, or in ndc for other detectors.
    pub points: Vec<[f32; 2]>,
    /// How sure the detector is of each of them, in its own unit, if it says so.
    pub confidences: Option<Vec<f32>>,
    /// Width and height of the image.
    pub image_size: [u32; 2],
}

/// Extracts keypoints from images.
pub trait Extractor {
    /// The number of keypoints N.
    fn keypoints(&self) -> usize;

    /// Width and height that images are resized to; `None` where each is taken as it is.
    fn input_size(&self) -> Option<[usize; 2]>;

    /// Where the points lie in an image of `[width, height]`.
    fn grid(&self, image_size: [u32; 2]) -> LatentGrid;

    /// Extracts the keypoints of a decoded frame.
    ///
    /// # Errors
    /// When the frame is too small for the encoder, the keypoints are not finite, or the device
    /// fails.
    fn extract_frame(&self, frame: &Frame) -> Result<Extraction>;

    /// Reads the frames of `range` and extracts their keypoints, on the threads of rayon's current
    /// pool; the results are in order. `progress` gets the number of frames that are finished.
    /// Prefer [`extract_frames`](super::extract_frames), which calls this.
    ///
    /// # Errors
    /// When the work is cancelled or the device fails. An error of a single frame is in its place
    /// and names it.
    #[cfg(not(target_arch = "wasm32"))]
    fn extract_range(
        &self,
        source: &dyn FrameSource,
        range: Range<usize>,
        progress: &(dyn Fn(u64) + Sync),
        cancel: &Cancel,
    ) -> Result<Vec<Result<Extraction>>>;

    /// Decodes an image ([`Frame::decode`]) and extracts its keypoints.
    ///
    /// # Errors
    /// When the image cannot be decoded; as [`Extractor::extract_frame`].
    fn extract(&self, image: &[u8]) -> Result<Extraction> {
        self.extract_frame(&Frame::decode(image)?)
    }
}
