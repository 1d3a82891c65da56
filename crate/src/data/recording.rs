//! Recordings: frames and points as arrays, in NPZ and HDF5 files.

use super::arrays::{ArrayFile, FRAMES, Kind, find, listed};
use super::frame_array::FrameArray;
use super::frames::FrameIndex;
use super::image::Frame;
use super::npy;
use super::points::{Points, keys};
use super::reading::{Notice, TableOptions};
use super::source::FrameSource;
use crate::error::{Error, Reason, Result};
use crate::track::GroundTruth;

/// Frames, and points if there are any, as arrays in an NPZ or HDF5 file. Frames are read when they
/// are asked for.
///
/// Frames are the array `images` or `frames`, of shape `[S, T, H, W, 3]` (S sequences of T frames)
/// or `[T, H, W, 3]` (one sequence), or with the channels before height and width; `uint8`, or
/// `float32` or `float64` in [0, 1]. Points are the array `keypoints` or `sites`, `[S, T, K, 2]` or
/// `[T, K, 2]`, floats in ndc, NaN where an object is not visible. Sequences are called `seq_0000`,
/// `seq_0001`, …, frames are counted from 0.
///
/// The authors' `record.py` writes `images` and `keypoints`, (x, y); its option `y_first` gives (y,
/// x) and leaves an attribute that says so. (Their `loading.py` flips (x, y) to (y, x) when it
/// reads.)
pub struct Recording {
    file: Box<dyn ArrayFile>,
    frames: FrameArray,
    index: FrameIndex,
    truth: Option<GroundTruth>,
    notices: Vec<Notice>,
}

impl Recording {
    pub(super) fn new(file: Box<dyn ArrayFile>, options: &TableOptions) -> Result<Self> {
        let Some((name, info)) = find(&*file, &FRAMES)? else {
            return Err(Error::input(format!(
                "no array of frames; expected `images` or `frames`, found {}",
                listed(&file.names()?)
            ))
            .because(Reason::NoFrames));
        };
        let frames = FrameArray::new(name, &info)?;
        let mut notices = Vec::new();
        let mut truth = None;
        let options = TableOptions {
            image_size: options.image_size.or(Some([frames.width, frames.height])),
            ..*options
        };
        if let Some(points) = Points::read(&*file, &options)? {
            if points.lengths != vec![frames.frames; frames.sequences] {
                return Err(Error::mismatch(format!(
                    "`{}` has shape {:?}, `{name}` has {:?}; expected the same {} sequences of {} frames",
                    points.name, points.shape, info.shape, frames.sequences, frames.frames
                )));
            }
            let table = points.into_truth()?;
            notices = table.notices;
            truth = Some(table.content);
        }
        Ok(Self {
            index: FrameIndex::of_keys(keys(&vec![frames.frames; frames.sequences])),
            file,
            frames,
            truth,
            notices,
        })
    }

    /// Width and height of the frames.
    pub fn image_size(&self) -> [u32; 2] {
        [self.frames.width, self.frames.height]
    }

    /// The name of the array of frames.
    pub fn frames_name(&self) -> &str {
        &self.frames.name
    }

    /// Where frame `i` lies in the file of its array, `images.npy` or `frames.npy`: start and
    /// length in bytes; None where it does not lie there in one piece.
    pub fn frame_place(&self, i: usize) -> Option<(u64, u64)> {
        self.file.place(&self.frames.name, &self.frames.leading(i))
    }

    /// The header that makes the bytes at [`Recording::frame_place`] a `.npy` array, which
    /// [`Frame::decode`] takes.
    pub fn frame_header(&self) -> Vec<u8> {
        let [w, h] = [self.frames.width as usize, self.frames.height as usize];
        let shape = match self.frames.channels_first {
            true => [3, h, w],
            false => [h, w, 3],
        };
        npy::header(&self.frames.dtype, &shape)
    }

    fn frame(&self, i: usize) -> Result<Frame> {
        let values = self.file.read(&self.frames.name, &self.frames.leading(i))?;
        self.frames.frame(values)
    }
}

impl FrameSource for Recording {
    fn index(&self) -> &FrameIndex {
        &self.index
    }

    fn read(&self, i: usize) -> Result<Frame> {
        self.frame(i)
            .map_err(|e| e.at(format!("`{}`, {}", self.frames.name, self.index.keys()[i])))
    }

    fn truth(&self) -> Option<&GroundTruth> {
        self.truth.as_ref()
    }

    fn notices(&self) -> &[Notice] {
        &self.notices
    }

    fn verify(&self) -> Result<()> {
        let name = &self.frames.name;
        self.file
            .verify(name)
            .map_err(|e| e.at(format!("`{name}`")))
    }

    fn has_floats(&self) -> bool {
        self.frames.kind != Kind::U8
    }
}
