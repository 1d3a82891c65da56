//! Where frames come from.

use super::frames::FrameIndex;
use super::image::Frame;
use super::reading::Notice;
use crate::error::Result;
use crate::track::GroundTruth;

/// Frames in order, read one by one: a folder of images, or a recording. What reads frames takes
/// any of them.
pub trait FrameSource: Send + Sync {
    /// Which frames there are.
    fn index(&self) -> &FrameIndex;

    /// Reads and decodes frame `i`, in the order of the index.
    ///
    /// # Errors
    /// When it cannot be read or decoded; the message names it.
    fn read(&self, i: usize) -> Result<Frame>;

    /// The ground truth that lies with the frames, if any.
    fn truth(&self) -> Option<&GroundTruth> {
        None
    }

    /// What a person should know of how the source was read.
    fn notices(&self) -> &[Notice] {
        &[]
    }

    /// Compares the checksum of all frames together, where the source has one: reading frame by
    /// frame does not.
    ///
    /// # Errors
    /// When it differs.
    fn verify(&self) -> Result<()> {
        Ok(())
    }

    /// The first frame of another size than frame 0, with both sizes (width and height, that of
    /// frame 0 first); None where all have one size, as in every recording. Frames that cannot be
    /// read are passed over.
    fn other_size(&self) -> Option<(usize, [[u32; 2]; 2])> {
        None
    }

    /// Whether some frames are floats, which 8 bits would quantise.
    fn has_floats(&self) -> bool {
        false
    }
}

/// Encoded images, whose names and bytes a function gives.
pub struct EncodedFrames<F> {
    index: FrameIndex,
    read: F,
}

impl<F: Fn(usize) -> Result<(String, Vec<u8>)> + Send + Sync> EncodedFrames<F> {
    /// The frames of `index`; `read` gives the name, for messages, and the bytes of the i-th in
    /// order.
    pub fn new(index: FrameIndex, read: F) -> Self {
        Self { index, read }
    }
}

impl<F: Fn(usize) -> Result<(String, Vec<u8>)> + Send + Sync> FrameSource for EncodedFrames<F> {
    fn index(&self) -> &FrameIndex {
        &self.index
    }

    fn read(&self, i: usize) -> Result<Frame> {
        let (name, bytes) = (self.read)(i)?;
        Frame::decode(&bytes).map_err(|e| e.at(name))
    }
}
