//! Which paths are frames, of which sequence, in which order.

use std::collections::{BTreeMap, HashMap, HashSet};

use serde::Serialize;

use super::names::{cleaned, is_image, natural_order, numbers, original, stem};
use crate::error::{Error, Result};
use crate::track::FrameKey;

/// A run of consecutive frames of one sequence.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SequenceRange {
    /// The name of the sequence.
    pub name: String,
    /// The position of its first frame.
    pub start: usize,
    /// The number of its frames.
    pub length: usize,
}

/// The frames among a list of paths: images, one folder a sequence, in natural order (`frame_2`
/// before `frame_10`).
///
/// A sequence is named by its folder (images without one: `images`), or by its path from the top
/// where folder names repeat. A frame is numbered by the last number in its file name that is
/// different for all frames of the sequence; where no file name has a number, by its position.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameIndex {
    keys: Vec<FrameKey>,
    order: Vec<usize>,
    ignored: Vec<usize>,
}

impl FrameIndex {
    /// Orders the frames among `paths` (separated by `/`).
    ///
    /// # Errors
    /// When there is no image among them, and when some file names of a sequence have numbers that
    /// do not tell its frames apart, e.g. because of a copy.
    pub fn new<S: AsRef<str>>(paths: &[S]) -> Result<Self> {
        Self::among(paths, is_image)
    }

    /// Orders frames that need not be files with the ending of an image, e.g. those of a video.
    ///
    /// # Errors
    /// As [`FrameIndex::new`].
    pub fn of_all<S: AsRef<str>>(paths: &[S]) -> Result<Self> {
        Self::among(paths, |_| true)
    }

    fn among<S: AsRef<str>>(paths: &[S], is_frame: fn(&str) -> bool) -> Result<Self> {
        let mut folders: BTreeMap<&str, Vec<(usize, &str)>> = BTreeMap::new();
        let mut ignored = Vec::new();
        for (i, path) in paths.iter().enumerate() {
            let path = path.as_ref();
            if is_frame(path) {
                let (folder, file) = path.rsplit_once('/').unwrap_or(("", path));
                folders.entry(folder).or_default().push((i, file));
            } else {
                ignored.push(i);
            }
        }
        if folders.is_empty() {
            return Err(Error::input(format!(
                "no images among {} file{}; expected .png, .jpg, .jpeg or .webp files, one folder a sequence",
                paths.len(),
                if paths.len() == 1 { "" } else { "s" }
            )));
        }
        let last = |folder: &'_ str| folder.rsplit('/').next().unwrap_or_default().to_owned();
        let names: HashSet<String> = folders.keys().map(|f| last(f)).collect();
        let short = names.len() == folders.len();
        let folders: Vec<(&str, Vec<(usize, &str)>)> = folders.into_iter().collect();
        let names: Vec<&str> = folders.iter().map(|(folder, _)| *folder).collect();

        let mut keys = Vec::new();
        let mut order = Vec::new();
        for place in natural_order(&names) {
            let (folder, files) = &folders[place];
            let sequence = match *folder {
                "" => "images".to_owned(),
                _ if short => cleaned(&last(folder)).into_owned(),
                _ => cleaned(folder).into_owned(),
            };
            let names: Vec<&str> = files.iter().map(|(_, file)| *file).collect();
            let places = natural_order(&names);
            let names: Vec<&str> = places.iter().map(|i| names[*i]).collect();
            let numbers = frame_numbers(&names).map_err(|e| match *folder {
                "" => e,
                _ => e.at(folder),
            })?;
            for (i, frame) in places.into_iter().zip(numbers) {
                keys.push(FrameKey {
                    sequence: sequence.clone(),
                    frame,
                });
                order.push(files[i].0);
            }
        }
        Ok(Self {
            keys,
            order,
            ignored,
        })
    }

    /// An index of frames that are in order already and are no files.
    pub(super) fn of_keys(keys: Vec<FrameKey>) -> Self {
        Self {
            order: (0..keys.len()).collect(),
            keys,
            ignored: Vec::new(),
        }
    }

    /// The frames in order.
    pub fn keys(&self) -> &[FrameKey] {
        &self.keys
    }

    /// For each frame in order, the position of its path in the list given.
    pub fn order(&self) -> &[usize] {
        &self.order
    }

    /// The positions of the paths that are no images.
    pub fn ignored(&self) -> &[usize] {
        &self.ignored
    }

    /// Only the frames at `positions` (in order, of this index), with the same keys.
    ///
    /// # Errors
    /// When a position is out of range or they are not ascending.
    pub fn select(&self, positions: &[usize]) -> Result<Self> {
        let ascending = positions.windows(2).all(|w| w[0] < w[1]);
        if !ascending
            || positions
                .last()
                .is_some_and(|last| *last >= self.keys.len())
        {
            return Err(Error::input(format!(
                "positions of frames must be ascending and below {}",
                self.keys.len()
            )));
        }
        Ok(Self {
            keys: positions.iter().map(|i| self.keys[*i].clone()).collect(),
            order: positions.iter().map(|i| self.order[*i]).collect(),
            ignored: self.ignored.clone(),
        })
    }

    /// The sequences in order.
    pub fn sequences(&self) -> Vec<SequenceRange> {
        ranges(&self.keys)
    }
}

/// The runs of equal sequence in a list of frames.
pub fn ranges(keys: &[FrameKey]) -> Vec<SequenceRange> {
    let mut start = 0;
    keys.chunk_by(|a, b| a.sequence == b.sequence)
        .map(|run| {
            let range = SequenceRange {
                name: run[0].sequence.clone(),
                start,
                length: run.len(),
            };
            start += run.len();
            range
        })
        .collect()
}

/// The frame numbers that the names of a sequence's files give.
fn frame_numbers(files: &[&str]) -> Result<Vec<u64>> {
    // `frame_5 (1).png` among others is what file managers and browsers call a second
    // `frame_5.png`; where all files are named like that, it is how they were numbered.
    let all_alike = files.iter().all(|file| original(stem(file)) != stem(file));
    let name = |file| {
        if all_alike {
            stem(file)
        } else {
            original(stem(file))
        }
    };
    let runs: Vec<Vec<u64>> = files.iter().map(|file| numbers(name(file))).collect();
    let longest = runs.iter().map(Vec::len).max().unwrap_or(0);
    if longest == 0 {
        return Ok((0..files.len() as u64).collect());
    }
    for from_end in 1..=longest {
        let at = |run: &Vec<u64>| run.len().checked_sub(from_end).map(|i| run[i]);
        let found: Vec<u64> = runs.iter().filter_map(at).collect();
        if found.len() == files.len() && found.iter().collect::<HashSet<_>>().len() == files.len() {
            return Ok(found);
        }
    }
    let mut seen: HashMap<u64, &str> = HashMap::new();
    for (file, run) in files.iter().zip(&runs) {
        let Some(last) = run.last() else {
            return Err(Error::input(format!(
                "`{file}` has no number, other images of its folder have; remove it, or number all"
            )));
        };
        if let Some(other) = seen.insert(*last, file) {
            return Err(Error::input(format!(
                "`{other}` and `{file}` are both frame {last}; expected one image a frame, and a folder for each sequence: put sequences into \
                 folders of their own, or remove one of the two"
            )));
        }
    }
    Err(Error::input(
        "the numbers in the file names do not tell the frames apart; rename them to 0, 1, 2, …",
    ))
}
