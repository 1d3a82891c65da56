//! Frames and points that are in memory already, as the caller of a library has them.

use ndarray::{Array2, Array3, ArrayView2, ArrayView3, s};

use super::frames::FrameIndex;
use super::image::Frame;
use super::points::{Points, keys, numbered, place, sequence_names};
use super::reading::{
    AxisOrder, Ground, Known, Layout, Parsed, Reading, Space, TableOptions, missing_image_size,
};
use super::source::FrameSource;
use crate::error::{Error, Result};
use crate::track::{GroundTruth, KeypointTrack, MOST_AXES};

/// Frames of one sequence.
pub struct FramesInMemory {
    index: FrameIndex,
    frames: Vec<Frame>,
}

impl FramesInMemory {
    /// These frames, in their order, with numbers from `first` on.
    pub fn new(first: u64, frames: Vec<Frame>) -> Self {
        let mut keys = keys(&sequence_names(1), &[frames.len()]);
        keys.iter_mut().for_each(|key| key.frame += first);
        let index = FrameIndex::of_keys(keys);
        Self { index, frames }
    }
}

impl FrameSource for FramesInMemory {
    fn index(&self) -> &FrameIndex {
        &self.index
    }

    fn read(&self, i: usize) -> Result<Frame> {
        Ok(self.frames[i].clone())
    }
}

/// Points of sequences that may differ in length: what a recording holds as one array, read in the
/// same way. The sequences are called `seq_0000`, `seq_0001`, …, their frames are counted from 0.
pub struct PointSequences(Points);

impl PointSequences {
    /// `sequences` holds T x N x 2 numbers of each, or T x N x 3 in space, `confidence` T x N where the points have one.
    /// `name` says in messages what they are.
    ///
    /// # Errors
    /// When an axis has not the length it should; the message names it. When the points are in
    /// pixels and the size of the images is not known.
    pub fn new(
        name: &'static str,
        sequences: &[ArrayView3<f64>],
        confidence: Option<&[ArrayView2<f64>]>,
        options: &TableOptions,
    ) -> Result<Self> {
        let (points, axes) = match sequences.first().map(ArrayView3::dim) {
            Some((_, points, axes)) => (points, axes),
            None => (0, 2),
        };
        if sequences.is_empty() {
            return Err(Error::input(format!(
                "`{name}` has no sequence; expected at least one"
            )));
        }
        for (s, sequence) in sequences.iter().enumerate() {
            check(sequence.dim(), points, axes)
                .map_err(|e| e.at(format!("`{name}`, sequence {s}")))?;
        }
        let lengths: Vec<usize> = sequences.iter().map(|one| one.dim().0).collect();
        let rows = lengths.iter().sum();
        let confidence = confidence
            .map(|all| joined(name, all, &lengths, points))
            .transpose()?;
        let mut reading = Reading {
            axes: Known::of(options.axes, AxisOrder::Xy, Ground::Guess),
            space: Known::of(options.space, Space::Ndc, Ground::Guess),
            // Frames are the positions in the array.
            index_base: Known::of(None, 0, Ground::File),
            ..Reading::new(Layout::Arrays, options)
        };
        let coordinates = if options.xy_only { 2 } else { axes };
        if MOST_AXES == 3 && coordinates == 3 {
            reading.in_space(options)?;
        }
        if reading.space.value == Space::Pixels && options.image_size.is_none() {
            let positions = format!("the positions of `{name}`");
            return Err(missing_image_size(&positions, reading.space.by));
        }
        let kept = |sequence: &ArrayView3<f64>| {
            let kept = sequence.slice(s![.., .., ..coordinates]);
            kept.iter().copied().collect::<Vec<f64>>()
        };
        let mut values: Vec<f64> = sequences.iter().flat_map(kept).collect();
        place(&mut values, coordinates, &reading, options);
        let values = Array3::from_shape_vec((rows, points, coordinates), values)
            .map_err(|e| Error::input(format!("`{name}`: {e}")))?;
        Ok(Self(Points {
            name,
            shape: vec![rows as u64, points as u64, coordinates as u64],
            sequences: sequence_names(lengths.len()),
            lengths,
            names: numbered(points),
            values,
            confidence,
            reading,
            notices: Vec::new(),
        }))
    }

    /// Gives the sequences names.
    #[cfg(any(feature = "hdf5", feature = "zarr"))]
    pub(super) fn name_sequences(&mut self, names: Vec<String>) {
        self.0.sequences = names;
    }

    /// The points as keypoints of a detector.
    ///
    /// # Errors
    /// When there is not one confidence for each of them.
    pub fn into_keypoints(self) -> Result<Parsed<KeypointTrack>> {
        self.0.into_keypoints()
    }

    /// The points as a ground truth of the objects `names`; without names they are called
    /// `point_0`, `point_1`, …
    ///
    /// # Errors
    /// When a position is infinite, when there is not one name for each point, or not one
    /// confidence for each position.
    pub fn into_truth(mut self, names: Option<Vec<String>>) -> Result<Parsed<GroundTruth>> {
        if let Some(names) = names {
            self.0.names = names;
        }
        self.0.into_truth()
    }
}

/// Checks the shape of a sequence whose neighbours have so many `points` of so many coordinates.
fn check((frames, own, numbers): (usize, usize, usize), points: usize, axes: usize) -> Result<()> {
    let wrong = match (frames, own, numbers) {
        (_, _, numbers) if !(2..=MOST_AXES).contains(&numbers) => {
            let in_space = if MOST_AXES == 3 {
                ", or 3, (x, y, z)"
            } else {
                ""
            };
            format!("the last axis has {numbers} numbers; expected 2, (x, y){in_space}")
        }
        (_, _, numbers) if numbers != axes => {
            format!(
                "the last axis has {numbers} numbers; expected {axes}, as in the first sequence"
            )
        }
        (0, _, _) => "the axis of frames is empty; expected at least one".to_owned(),
        (_, 0, _) => "the axis of points is empty; expected at least one".to_owned(),
        (_, own, _) if own != points => {
            format!("the axis of points has {own}; expected {points}, as in the first sequence")
        }
        _ => return Ok(()),
    };
    Err(Error::input(wrong))
}

/// The confidences of all sequences one after the other.
fn joined(
    name: &str,
    all: &[ArrayView2<f64>],
    lengths: &[usize],
    points: usize,
) -> Result<Array2<f64>> {
    if all.len() != lengths.len() {
        return Err(Error::input(format!(
            "`{name}` has {} sequences and the confidences of {}; expected those of each",
            lengths.len(),
            all.len()
        )));
    }
    for (s, (one, frames)) in all.iter().zip(lengths).enumerate() {
        if one.dim() != (*frames, points) {
            return Err(Error::input(format!(
                "the confidences of `{name}`, sequence {s}, have shape {:?}; expected [{frames}, \
                 {points}], one number for each point",
                one.shape()
            )));
        }
    }
    let rows = lengths.iter().sum();
    Array2::from_shape_vec((rows, points), all.iter().flatten().copied().collect())
        .map_err(|e| Error::input(format!("the confidences of `{name}`: {e}")))
}
