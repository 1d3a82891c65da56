//! Recordings: frames and points as arrays, in NPZ, HDF5 and Zarr files.

use super::arrays::{ArrayFile, Kind, check_frames};
use super::frame_array::FrameArray;
use super::frames::FrameIndex;
use super::image::Frame;
use super::npy;
use super::points::{Points, episode_names, keys, sequence_names};
use super::reading::{Notice, TableOptions};
use super::sequences::Sequences;
use super::source::FrameSource;
use crate::error::{Error, Reason, Result};
use crate::track::GroundTruth;

/// Frames, and points if there are any, as arrays in an NPZ, HDF5 or Zarr file. Frames are read when
/// they are asked for.
///
/// Frames are the array `images` or `frames`, of shape `[S, T, H, W, 3]` (S sequences of T frames)
/// or `[T, H, W, 3]` (one sequence), or with the channels before height and width; `uint8`, or
/// `float32` or `float64` in [0, 1]. Points are the array `keypoints` or `sites`, `[S, T, K, 2]` or
/// `[T, K, 2]`, floats in ndc, NaN where an object is not visible. Sequences are called `seq_0000`,
/// `seq_0001`, …, frames are counted from 0.
///
/// Sequences of unequal length lie
///
/// - in groups of their own, as robomimic keeps them: `data/demo_0/obs/NAME_image` `[T, H, W, 3]`,
///   and the points beside it; a sequence is called as its group;
/// - or one after the other in one array `[N, H, W, 3]`, where an array `episode_ends` has for each
///   of them the number of the frame behind its last one: beside it, or as `meta/episode_ends` of
///   `data/img` in a replay buffer of diffusion policy (floats in [0, 255], points `keypoint` in the
///   unit of a simulator). They are called `episode_0`, `episode_1`, …
///
/// The authors' `record.py` writes `images` and `keypoints`, (x, y); its option `y_first` gives (y,
/// x) and leaves an attribute that says so. (Their `loading.py` flips (x, y) to (y, x) when it
/// reads.)
pub struct Recording {
    file: Box<dyn ArrayFile>,
    /// One, or one of each sequence; all of one size.
    arrays: Vec<FrameArray>,
    /// For each of them the number of its first frame.
    starts: Vec<usize>,
    index: FrameIndex,
    truth: Option<GroundTruth>,
    notices: Vec<Notice>,
}

impl Recording {
    /// `array` names the array of frames, where a person said which.
    pub(super) fn new(
        file: Box<dyn ArrayFile>,
        array: Option<&str>,
        options: &TableOptions,
    ) -> Result<Self> {
        let sequences = Sequences::of(&*file)?;
        let arrays = frame_arrays(&*file, &sequences, array)?;
        let mut starts = Vec::with_capacity(arrays.len());
        let mut frames = 0_usize;
        for array in &arrays {
            starts.push(frames);
            frames = frames.saturating_add(array.sequences * array.frames);
            check_frames(1, frames, &array.name, &array.shape)?;
        }
        let first = &arrays[0];
        let (names, lengths) = match &sequences {
            Sequences::Axis => (
                sequence_names(first.sequences),
                vec![first.frames; first.sequences],
            ),
            Sequences::Groups(episodes) => (
                episodes
                    .iter()
                    .map(|episode| episode.name.clone())
                    .collect(),
                arrays.iter().map(|array| array.frames).collect(),
            ),
            Sequences::Ends { lengths, .. } => (episode_names(lengths.len()), lengths.clone()),
        };
        let whole: usize = lengths.iter().sum();
        if whole != frames {
            return Err(Error::input(format!(
                "`{}` has shape {:?}, and the last episode ends at {whole}; expected so many \
                 frames one after the other",
                first.name, first.shape
            )));
        }
        let mut recording = Self {
            index: FrameIndex::of_keys(keys(&names, &lengths)),
            file,
            arrays,
            starts,
            truth: None,
            notices: Vec::new(),
        };
        recording.read_points(&sequences, &lengths, options)?;
        Ok(recording)
    }

    /// Reads the points, if there are any, of the sequences of these lengths.
    fn read_points(
        &mut self,
        sequences: &Sequences,
        lengths: &[usize],
        options: &TableOptions,
    ) -> Result<()> {
        let options = TableOptions {
            // Points of a replay buffer are on the board of a simulator, whatever frames show it.
            image_size: match sequences.is_replay() {
                true => options.image_size,
                false => options.image_size.or(Some(self.image_size())),
            },
            ..*options
        };
        let points = match Points::read(&*self.file, sequences, &options) {
            // Frames are of use without it.
            Err(error) if error.reason() == Some(&Reason::UnknownUnit) => {
                self.notices = vec![Notice::because(
                    format!("the points are left out: {error}"),
                    Reason::UnknownUnit,
                )];
                return Ok(());
            }
            points => points?,
        };
        let Some(points) = points else { return Ok(()) };
        if points.lengths != lengths {
            let first = &self.arrays[0];
            return Err(Error::mismatch(match sequences {
                Sequences::Axis => format!(
                    "`{}` has shape {:?}, `{}` has {:?}; expected the same {} sequences of {} \
                     frames",
                    points.name,
                    points.shape,
                    first.name,
                    first.shape,
                    first.sequences,
                    first.frames
                ),
                _ => {
                    let pairs = points.lengths.iter().zip(lengths);
                    let at = pairs
                        .take_while(|(points, frames)| points == frames)
                        .count();
                    format!(
                        "`{}` has {} rows in {}, which has {} frames; expected one row a frame",
                        points.name,
                        points.lengths.get(at).copied().unwrap_or_default(),
                        points
                            .sequences
                            .get(at)
                            .map_or("no sequence", String::as_str),
                        lengths.get(at).copied().unwrap_or_default()
                    )
                }
            }));
        }
        let table = points.into_truth()?;
        self.notices = table.notices;
        self.truth = Some(table.content);
        Ok(())
    }

    /// Width and height of the frames.
    pub fn image_size(&self) -> [u32; 2] {
        [self.arrays[0].width, self.arrays[0].height]
    }

    /// The frames as paths, each in the folder of its sequence.
    pub fn frame_paths(&self) -> Vec<String> {
        let keys = self.index.keys().iter();
        keys.map(|key| format!("{}/frame_{:06}", key.sequence, key.frame))
            .collect()
    }

    /// The name of the array of frames; of several, of the first one.
    pub fn frames_name(&self) -> &str {
        &self.arrays[0].name
    }

    /// The array of frame `i`, and the indices of the frame in it.
    fn place(&self, i: usize) -> (&FrameArray, Vec<u64>) {
        let at = self.starts.partition_point(|start| *start <= i) - 1;
        (
            &self.arrays[at],
            self.arrays[at].leading(i - self.starts[at]),
        )
    }

    /// Where frame `i` lies in the file of its array, `images.npy` or `frames.npy`: start and
    /// length in bytes; None where it does not lie there in one piece.
    pub fn frame_place(&self, i: usize) -> Option<(u64, u64)> {
        let (array, leading) = self.place(i);
        self.file.place(&array.name, &leading)
    }

    /// The header that makes the bytes at [`Recording::frame_place`] a `.npy` array, which
    /// [`Frame::decode`] takes.
    pub fn frame_header(&self) -> Vec<u8> {
        let [w, h] = self.image_size().map(|side| side as usize);
        let frames = &self.arrays[0];
        let shape = match frames.channels_first {
            true => [3, h, w],
            false => [h, w, 3],
        };
        npy::header(&frames.dtype, &shape)
    }

    fn frame(&self, i: usize) -> Result<Frame> {
        let (array, leading) = self.place(i);
        array.frame(self.file.read(&array.name, &leading)?)
    }
}

impl FrameSource for Recording {
    fn index(&self) -> &FrameIndex {
        &self.index
    }

    fn read(&self, i: usize) -> Result<Frame> {
        self.frame(i).map_err(|e| {
            e.at(format!(
                "`{}`, {}",
                self.place(i).0.name,
                self.index.keys()[i]
            ))
        })
    }

    fn truth(&self) -> Option<&GroundTruth> {
        self.truth.as_ref()
    }

    fn notices(&self) -> &[Notice] {
        &self.notices
    }

    fn verify(&self) -> Result<()> {
        for FrameArray { name, .. } in &self.arrays {
            let verified = self.file.verify(name);
            verified.map_err(|e| e.at(format!("`{name}`")))?;
        }
        Ok(())
    }

    fn has_floats(&self) -> bool {
        self.arrays.iter().any(|array| array.kind != Kind::U8)
    }
}

/// The arrays of frames, which have to be of one size: one, or one of each group.
fn frame_arrays(
    file: &dyn ArrayFile,
    sequences: &Sequences,
    array: Option<&str>,
) -> Result<Vec<FrameArray>> {
    let mut arrays: Vec<FrameArray> = Vec::new();
    for (name, info) in sequences.frames(file, array)? {
        let mut next = FrameArray::new(&name, &info)?;
        if sequences.have_one_each() && next.sequences != 1 {
            return Err(Error::input(format!(
                "`{name}` has shape {:?}; expected the frames of one sequence, [T, H, W, 3]",
                next.shape
            )));
        }
        if sequences.is_replay() {
            next = next.in_bytes();
        }
        if let Some(first) = arrays.first()
            && [next.width, next.height] != [first.width, first.height]
        {
            return Err(Error::mismatch(format!(
                "`{name}` has frames of {} x {} pixels, and `{}` of {} x {}; expected one size",
                next.width, next.height, first.name, first.width, first.height
            )));
        }
        arrays.push(next);
    }
    Ok(arrays)
}
