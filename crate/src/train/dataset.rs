//! Decoded sequences.

use ndarray::{Array3, ArrayView2, Axis};
use rayon::prelude::*;

use super::SNIPPET;
use crate::checkpoint::SaeConfig;
use crate::data::{self, Filter, FrameIndex};
use crate::error::{Error, Result};
use crate::event::Cancel;
use crate::track::GroundTruth;

/// Sequences of decoded frames with their ground truth.
///
/// Everything is in memory: an input takes 1 byte a channel where frames have the encoder's input size, 4 bytes where
/// they are resized; a target takes 4.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset {
    /// The sequences, each of at least [`SNIPPET`] frames.
    pub sequences: Vec<Sequence>,
    /// The names of the objects.
    pub objects: Vec<String>,
    /// Width and height of the inputs.
    pub input_size: [usize; 2],
    /// What a person should know, e.g. sequences left out because they are too short.
    pub notices: Vec<String>,
}

/// One sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct Sequence {
    /// Its name.
    pub name: String,
    frames: Vec<Decoded>,
    /// T x K x 2, ndc; NaN where an object is not visible or has no row.
    truth_ndc: Array3<f64>,
}

#[derive(Debug, Clone, PartialEq)]
struct Decoded {
    input: Pixels,
    target: Vec<f32>,
}

/// Planes of red, green and blue.
#[derive(Debug, Clone, PartialEq)]
enum Pixels {
    Bytes(Vec<u8>),
    Floats(Vec<f32>),
}

impl Dataset {
    /// Decodes the frames of `index`, whose encoded bytes `read` gives, and joins them to `truth`.
    ///
    /// Inputs are resized with antialiasing to the configured input size (none: every frame must have the size of the
    /// first), targets without, as the authors' torchvision does.
    ///
    /// # Errors
    /// When a frame cannot be read, sizes differ, no frame has a row, or no sequence is long enough.
    pub fn load(
        index: &FrameIndex,
        read: impl Fn(usize) -> Result<(String, Vec<u8>)> + Sync,
        truth: &GroundTruth,
        config: &SaeConfig,
        cancel: &Cancel,
    ) -> Result<Self> {
        let join = data::join(index.keys(), truth.keys())?;
        let mut notices = join.rules.clone();
        if !join.unmatched_left.is_empty() {
            notices.push(format!(
                "{} frames have no row of ground truth",
                join.unmatched_left.len()
            ));
        }
        let mut row_of = vec![None; index.keys().len()];
        for (frame, row) in join.pairs {
            row_of[frame] = Some(row);
        }
        let decode = |i: usize| -> Result<([usize; 2], Decoded)> {
            cancel.check()?;
            let (name, bytes) = read(i)?;
            let frame = data::Frame::decode(&bytes).map_err(|e| e.at(name))?;
            let own = [frame.width() as usize, frame.height() as usize];
            let input = match config.input_size {
                Some(size) if size != own => {
                    Pixels::Floats(frame.to_planar(Some(size), Filter::BilinearAntialias))
                }
                _ => Pixels::Bytes(
                    (0..3)
                        .flat_map(|c| frame.rgb().iter().skip(c).step_by(3))
                        .copied()
                        .collect(),
                ),
            };
            let target = frame.to_planar(Some(config.target_size), Filter::Bilinear);
            Ok((config.input_size.unwrap_or(own), Decoded { input, target }))
        };
        let decoded: Vec<_> = (0..index.keys().len())
            .into_par_iter()
            .map(decode)
            .collect::<Result<_>>()?;
        let input_size = decoded[0].0;
        if let Some(i) = decoded.iter().position(|(size, _)| *size != input_size) {
            return Err(Error::mismatch(format!(
                "{}: the frame is {:?}, the first one {input_size:?}; expected one size, or give an input size",
                index.keys()[i],
                decoded[i].0
            )));
        }
        let mut frames = decoded.into_iter().map(|(_, frame)| frame);
        let mut sequences = Vec::new();
        let mut short = 0;
        for range in index.sequences() {
            let frames: Vec<Decoded> = frames.by_ref().take(range.length).collect();
            if range.length < SNIPPET {
                short += 1;
                continue;
            }
            let mut truth_ndc = Array3::from_elem((range.length, truth.names().len(), 2), f64::NAN);
            for (t, row) in row_of[range.start..range.start + range.length].iter().enumerate() {
                if let Some(row) = row {
                    truth_ndc.index_axis_mut(Axis(0), t).assign(&truth.frame(*row));
                }
            }
            sequences.push(Sequence {
                name: range.name,
                frames,
                truth_ndc,
            });
        }
        if short > 0 {
            notices.push(format!(
                "{short} sequences of fewer than {SNIPPET} frames are left out"
            ));
        }
        if sequences.is_empty() {
            return Err(Error::input(format!(
                "no sequence has {SNIPPET} frames, which training needs"
            )));
        }
        Ok(Self {
            sequences,
            objects: truth.names().to_vec(),
            input_size,
            notices,
        })
    }
}

impl Dataset {
    /// Inputs and targets of frames, given by sequence and index, one after the other.
    ///
    /// # Errors
    /// When a frame cannot be read any more.
    pub fn gather(&self, frames: &[(&Sequence, usize)]) -> Result<(Vec<f32>, Vec<f32>)> {
        let (mut inputs, mut targets) = (Vec::new(), Vec::new());
        for (sequence, t) in frames {
            sequence.push_input(*t, &mut inputs);
            targets.extend_from_slice(sequence.target(*t));
        }
        Ok((inputs, targets))
    }
}

impl Sequence {
    /// The number of frames T.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// The number of snippets: starts 0 to T - 3.
    pub fn snippets(&self) -> usize {
        (self.len() + 1).saturating_sub(SNIPPET)
    }

    /// Appends the input of frame `t`, 3 x height x width in [0, 1].
    pub fn push_input(&self, t: usize, out: &mut Vec<f32>) {
        match &self.frames[t].input {
            Pixels::Bytes(bytes) => out.extend(bytes.iter().map(|b| f32::from(*b) / 255.0)),
            Pixels::Floats(floats) => out.extend_from_slice(floats),
        }
    }

    /// The target of frame `t`, 3 x height x width in [0, 1].
    pub fn target(&self, t: usize) -> &[f32] {
        &self.frames[t].target
    }

    /// K x 2, ndc; NaN where an object is not visible.
    pub fn truth_ndc(&self, t: usize) -> ArrayView2<'_, f64> {
        self.truth_ndc.index_axis(Axis(0), t)
    }
}
