//! Keypoints on the CPU, one frame a thread.

#[cfg(not(target_arch = "wasm32"))]
use std::ops::Range;
#[cfg(not(target_arch = "wasm32"))]
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::{Extraction, Extractor};
use crate::checkpoint::{Checkpoint, LatentGrid, SaeConfig};
use crate::data::Frame;
#[cfg(not(target_arch = "wasm32"))]
use crate::data::{FrameSource, for_blocks};
use crate::engine::{CpuEncoder, HeatMap, Workspace};
use crate::error::Result;
#[cfg(not(target_arch = "wasm32"))]
use crate::event::Cancel;

/// An [`Extractor`] on the CPU: an encoder that threads share.
pub struct CpuExtractor {
    encoder: CpuEncoder,
    /// As many as threads used the encoder at a time; the next frame uses their memory again.
    idle: Mutex<Vec<Workspace>>,
}

impl CpuExtractor {
    /// An extractor with the encoder of `checkpoint`.
    ///
    /// # Errors
    /// As [`CpuEncoder::new`].
    pub fn new(checkpoint: &Checkpoint) -> Result<Self> {
        Ok(Self {
            encoder: CpuEncoder::new(checkpoint)?,
            idle: Mutex::default(),
        })
    }

    /// The architecture and sizes of the encoder.
    pub fn config(&self) -> &SaeConfig {
        self.encoder.config()
    }

    /// The weights behind keypoint `n` of a frame.
    ///
    /// # Errors
    /// As [`CpuEncoder::heat_map`].
    pub fn heat_map(&self, frame: &Frame, n: usize) -> Result<HeatMap> {
        self.with_workspace(|workspace| self.encoder.heat_map(workspace, frame, n))
    }

    fn with_workspace<T>(&self, run: impl FnOnce(&mut Workspace) -> T) -> T {
        let taken = self.idle().pop();
        let mut workspace = taken.unwrap_or_default();
        let result = run(&mut workspace);
        self.idle().push(workspace);
        result
    }

    fn idle(&self) -> MutexGuard<'_, Vec<Workspace>> {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Extractor for CpuExtractor {
    fn keypoints(&self) -> usize {
        self.config().keypoints
    }

    fn input_size(&self) -> Option<[usize; 2]> {
        self.config().input_size
    }

    fn grid(&self, image_size: [u32; 2]) -> LatentGrid {
        self.config().latent_grid(image_size)
    }

    fn extract_frame(&self, frame: &Frame) -> Result<Extraction> {
        let points = self.with_workspace(|workspace| self.encoder.extract(workspace, frame))?;
        Ok(Extraction {
            points,
            confidences: None,
            image_size: [frame.width(), frame.height()],
        })
    }

    #[cfg(not(target_arch = "wasm32"))]
    fn extract_range(
        &self,
        source: &dyn FrameSource,
        range: Range<usize>,
        progress: &(dyn Fn(u64) + Sync),
        cancel: &Cancel,
    ) -> Result<Vec<Result<Extraction>>> {
        let finished = AtomicU64::new(0);
        let one = |i: usize| {
            let found = source.read(i).and_then(|frame| {
                let found = self.extract_frame(&frame);
                found.map_err(|e| e.at(&source.index().keys()[i]))
            });
            progress(finished.fetch_add(1, Ordering::Relaxed) + 1);
            found
        };
        let mut all = Vec::with_capacity(range.len());
        for_blocks(range, cancel, one, |block| {
            all.extend(block);
            Ok(())
        })?;
        Ok(all)
    }
}
