//! Sequences of frames, decoded as often as needed.

use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use ndarray::{Array3, ArrayView2, Axis};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::SNIPPET;
use super::digest::hex;
use crate::data::{self, Filter, Frame, FrameSource, for_blocks, planes};
use crate::error::{Error, Result};
use crate::event::Cancel;
use crate::run::{SplitBy, TargetFilter, TrainConfig};
use crate::track::{FrameKey, GroundTruth};

/// What decoded frames may take in memory unless told otherwise, in bytes: 4 GiB.
pub const DEFAULT_CACHE: u64 = 4 << 30;

/// Sequences of frames with their ground truth.
///
/// Decoded frames are kept in memory up to a budget: an input takes 1 byte a channel where frames
/// are images of the encoder's input size, 4 bytes where they are floats or resized; a target takes
/// 4. The others are read and decoded again whenever they are needed; the numbers are the same.
#[derive(Debug, Clone)]
pub struct Dataset {
    /// The sequences, each of at least [`SNIPPET`] frames.
    pub sequences: Vec<Sequence>,
    /// The names of the objects.
    pub objects: Vec<String>,
    /// Width and height of the inputs.
    pub input_size: [usize; 2],
    /// What a person should know, e.g. sequences left out because they are too short.
    pub notices: Vec<String>,
    pub(super) fingerprint: Fingerprint,
}

/// What tells two data sets apart, as SHA-256. A run goes on with the data that it was started with
/// and no other.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Fingerprint {
    /// Of all frames: their sequences and numbers, their sizes, and the CRC-32 of their decoded
    /// pixels. Another file format without loss is the same.
    pub frames: String,
    /// Of the ground truth: the objects, and the points of every frame.
    pub truth: String,
}

/// One sequence.
#[derive(Debug, Clone)]
pub struct Sequence {
    /// Its name.
    pub name: String,
    frames: Arc<Frames>,
    /// The position of its first frame among all.
    start: usize,
    episode: Option<String>,
    /// T x K x 2, ndc; NaN where an object is not visible or has no row.
    truth_ndc: Array3<f64>,
}

/// The frames of all sequences.
struct Frames {
    decoder: Decoder,
    kept: Vec<Option<Decoded>>,
    /// CRC-32 of every frame.
    checksums: Vec<u32>,
}

/// How frames become inputs and targets.
struct Decoder {
    source: Arc<dyn FrameSource>,
    input_size: Option<[usize; 2]>,
    target_size: [usize; 2],
    target_filter: Filter,
}

struct Decoded {
    input: Input,
    target: Vec<f32>,
    about: About,
}

/// What is known of a frame once it was decoded.
#[derive(Clone, Copy)]
struct About {
    input_size: [usize; 2],
    /// Before it was resized.
    own_size: [usize; 2],
    checksum: u32,
}

/// Planes of red, green and blue.
enum Input {
    Bytes(Vec<u8>),
    Floats(Vec<f32>),
}

impl Decoder {
    /// Frame `i`.
    fn decode(&self, i: usize) -> Result<Decoded> {
        let frame = self.source.read(i)?;
        let own = [frame.width() as usize, frame.height() as usize];
        let size = self.input_size.unwrap_or(own);
        let input = match frame.pixels() {
            data::Pixels::Bytes(bytes) if size == own => Input::Bytes(planes(bytes, |v| v)),
            _ => Input::Floats(frame.to_planar(Some(size), Filter::BilinearAntialias)),
        };
        let target = frame.to_planar(Some(self.target_size), self.target_filter);
        Ok(Decoded {
            input,
            target,
            about: About {
                input_size: size,
                own_size: own,
                checksum: checksum(&frame),
            },
        })
    }
}

/// CRC-32 of the pixels.
fn checksum(frame: &Frame) -> u32 {
    match frame.pixels() {
        data::Pixels::Bytes(bytes) => crc32fast::hash(bytes),
        data::Pixels::Floats(floats) => {
            let mut hash = crc32fast::Hasher::new();
            for block in floats.chunks(1024) {
                let bytes: Vec<u8> = block.iter().flat_map(|v| v.to_le_bytes()).collect();
                hash.update(&bytes);
            }
            hash.finalize()
        }
    }
}

impl Decoded {
    fn bytes(&self) -> u64 {
        let input = match &self.input {
            Input::Bytes(bytes) => bytes.len(),
            Input::Floats(floats) => 4 * floats.len(),
        };
        (input + 4 * self.target.len()) as u64
    }
}

impl Frames {
    /// Decodes every frame once, so that one that cannot be read is found before the training, and
    /// keeps as many as `cache` bytes hold. Also returns the size of the inputs and the fingerprint
    /// of all frames.
    fn load(decoder: Decoder, cache: u64, cancel: &Cancel) -> Result<(Self, [usize; 2], String)> {
        let keys = decoder.source.index().keys();
        let taken = AtomicU64::new(0);
        let decode = |i: usize| -> Result<(About, Option<Decoded>)> {
            let decoded = decoder.decode(i)?;
            let about = decoded.about;
            let bytes = decoded.bytes();
            let before = taken.fetch_add(bytes, Ordering::Relaxed);
            Ok((about, (before + bytes <= cache).then_some(decoded)))
        };
        let (mut kept, mut checksums) = (Vec::with_capacity(keys.len()), Vec::new());
        let mut input_size = None;
        let mut hash = Sha256::new();
        for_blocks(0..keys.len(), cancel, decode, |block| {
            for frame in block {
                let (about, decoded) = frame?;
                let key = &keys[kept.len()];
                let size = about.input_size;
                let first = *input_size.get_or_insert(size);
                if size != first {
                    return Err(Error::mismatch(format!(
                        "{key}: the frame is {size:?}, the first one {first:?}; expected one size, or \
                         give an input size",
                    )));
                }
                let About {
                    own_size, checksum, ..
                } = about;
                hash.update(format!("{key}\0{own_size:?}\0{checksum:08x}\n"));
                checksums.push(checksum);
                kept.push(decoded);
            }
            Ok(())
        })?;
        let input_size = input_size.ok_or_else(|| Error::input("there are no frames"))?;
        let frames = Self {
            decoder,
            kept,
            checksums,
        };
        Ok((frames, input_size, hex(hash)))
    }

    /// Writes the input and the target of frame `i`.
    fn write(&self, i: usize, input: &mut [f32], target: &mut [f32]) -> Result<()> {
        let again;
        let decoded = match &self.kept[i] {
            Some(kept) => kept,
            None => {
                again = self.decoder.decode(i)?;
                if again.about.checksum != self.checksums[i] {
                    return Err(Error::input(
                        "the frame has changed since the training was started; leave the data as \
                         they are until it ends",
                    )
                    .at(&self.decoder.source.index().keys()[i]));
                }
                &again
            }
        };
        match &decoded.input {
            Input::Bytes(bytes) => {
                for (value, byte) in input.iter_mut().zip(bytes) {
                    *value = f32::from(*byte) / 255.0;
                }
            }
            Input::Floats(floats) => input.copy_from_slice(floats),
        }
        target.copy_from_slice(&decoded.target);
        Ok(())
    }
}

/// The fingerprint of the points that belong to frames.
fn truth_fingerprint(truth: &GroundTruth, row_of: &[Option<usize>]) -> String {
    let mut hash = Sha256::new();
    for name in truth.names() {
        hash.update((name.len() as u64).to_le_bytes());
        hash.update(name);
    }
    for row in row_of {
        hash.update([u8::from(row.is_some())]);
        for value in row.iter().flat_map(|row| truth.frame(*row)) {
            // One NaN is as good as another.
            let bits = if value.is_nan() { f64::NAN } else { *value };
            hash.update(bits.to_le_bytes());
        }
    }
    hex(hash)
}

impl fmt::Debug for Frames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kept = self.kept.iter().flatten().count();
        write!(f, "Frames({kept} of {} kept)", self.kept.len())
    }
}

impl Dataset {
    /// Decodes the frames of `source`, joins them to `truth`, and keeps decoded frames up to
    /// `cache` bytes ([`DEFAULT_CACHE`]).
    ///
    /// Inputs are resized with antialiasing to the configured input size (none: every frame must
    /// have the size of the first), targets as configured.
    ///
    /// # Errors
    /// When a frame cannot be read, sizes differ, no frame has a row, or no sequence is long
    /// enough.
    pub fn load(
        source: Arc<dyn FrameSource>,
        truth: &GroundTruth,
        config: &TrainConfig,
        cache: u64,
        cancel: &Cancel,
    ) -> Result<Self> {
        let index = source.index().clone();
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
        let decoder = Decoder {
            source,
            input_size: config.sae.input_size,
            target_size: config.sae.target_size,
            target_filter: match config.target_filter {
                TargetFilter::Bilinear => Filter::Bilinear,
                TargetFilter::BilinearAntialias => Filter::BilinearAntialias,
            },
        };
        let (frames, input_size, fingerprint) = Frames::load(decoder, cache, cancel)?;
        let again = frames.kept.iter().filter(|kept| kept.is_none()).count();
        if again > 0 {
            notices.push(format!(
                "{again} of {} decoded frames do not fit the cache of {} MiB: they are read and decoded again \
                 whenever they are needed",
                frames.kept.len(),
                cache >> 20
            ));
        }
        let frames = Arc::new(frames);

        let mut sequences = Vec::new();
        let mut short = 0;
        for range in index.sequences() {
            if range.length < SNIPPET {
                short += 1;
                continue;
            }
            let mut truth_ndc = Array3::from_elem((range.length, truth.names().len(), 2), f64::NAN);
            for (t, row) in row_of[range.start..range.start + range.length]
                .iter()
                .enumerate()
            {
                if let Some(row) = row {
                    truth_ndc
                        .index_axis_mut(Axis(0), t)
                        .assign(&truth.frame(*row));
                }
            }
            sequences.push(Sequence {
                name: range.name,
                frames: Arc::clone(&frames),
                start: range.start,
                episode: None,
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
            fingerprint: Fingerprint {
                frames: fingerprint,
                truth: truth_fingerprint(truth, &row_of),
            },
        })
    }

    /// The same with the episodes of sequences, given by the names of both. Sequences match as those
    /// of frames and ground truth do.
    ///
    /// # Errors
    /// When a sequence has no episode.
    pub fn with_episodes(mut self, episodes: &[(String, String)]) -> Result<Self> {
        let key = |sequence: &str| FrameKey {
            sequence: sequence.to_owned(),
            frame: 0,
        };
        let own: Vec<FrameKey> = self.sequences.iter().map(|s| key(&s.name)).collect();
        let rows: Vec<FrameKey> = episodes.iter().map(|(name, _)| key(name)).collect();
        let pairs = data::join(&own, &rows)?.pairs;
        for (sequence, row) in pairs {
            self.sequences[sequence].episode = Some(episodes[row].1.clone());
        }
        match self.sequences.iter().find(|s| s.episode.is_none()) {
            Some(sequence) => Err(Error::mismatch(format!(
                "sequence `{}` has no episode; expected a row for every sequence",
                sequence.name
            ))),
            None => Ok(self),
        }
    }

    /// The positions of sequences that a split keeps together, in order of their first ones.
    pub(super) fn groups(&self, by: SplitBy) -> Result<Vec<Vec<usize>>> {
        if by == SplitBy::Sequence {
            return Ok((0..self.sequences.len()).map(|i| vec![i]).collect());
        }
        let mut groups: Vec<Vec<usize>> = Vec::new();
        let mut group_of: HashMap<&str, usize> = HashMap::new();
        for (i, sequence) in self.sequences.iter().enumerate() {
            let episode = sequence.episode.as_deref().ok_or_else(|| {
                Error::input("the data set has no episodes, by which it is to be split")
            })?;
            let group = *group_of.entry(episode).or_insert(groups.len());
            match groups.get_mut(group) {
                Some(members) => members.push(i),
                None => groups.push(vec![i]),
            }
        }
        Ok(groups)
    }

    /// Inputs (3 x height x width in [0, 1] each) and targets of frames, given by sequence and
    /// index, one after the other; frames that are not in memory are decoded side by side.
    ///
    /// # Errors
    /// When a frame cannot be read any more.
    pub fn gather(&self, frames: &[(&Sequence, usize)]) -> Result<(Vec<f32>, Vec<f32>)> {
        let size = |[width, height]: [usize; 2]| 3 * width * height;
        let Some((first, _)) = frames.first() else {
            return Ok(Default::default());
        };
        let input = size(self.input_size);
        let target = size(first.frames.decoder.target_size);
        let mut inputs = vec![0.0; frames.len() * input];
        let mut targets = vec![0.0; frames.len() * target];
        inputs
            .par_chunks_exact_mut(input)
            .zip(targets.par_chunks_exact_mut(target))
            .zip(frames)
            .try_for_each(|((input, target), (sequence, t))| {
                sequence.frames.write(sequence.start + t, input, target)
            })?;
        Ok((inputs, targets))
    }
}

impl Sequence {
    /// The number of frames T.
    pub fn len(&self) -> usize {
        self.truth_ndc.dim().0
    }

    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The number of snippets: starts 0 to T - 3.
    pub fn snippets(&self) -> usize {
        (self.len() + 1).saturating_sub(SNIPPET)
    }

    /// K x 2, ndc; NaN where an object is not visible.
    pub fn truth_ndc(&self, t: usize) -> ArrayView2<'_, f64> {
        self.truth_ndc.index_axis(Axis(0), t)
    }
}
