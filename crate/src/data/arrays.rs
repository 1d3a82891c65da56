//! Files of named arrays, whatever their format.

#[cfg(any(feature = "hdf5", feature = "zarr"))]
use super::export::Export;
use super::reading::AxisOrder;
use crate::error::{Error, Result};
use crate::memory;

/// The names of arrays of frames.
pub(super) const FRAMES: [&str; 2] = ["images", "frames"];

/// The names of arrays of points: those of recordings, of trackers of points, of TAP-Vid, and of
/// diffusion policy's replay buffers.
pub(super) const POINTS: [&str; 5] = ["keypoints", "sites", "tracks", "points", KEYPOINT];
/// Points of a replay buffer, whose unit is that of its simulator.
pub(super) const KEYPOINT: &str = "keypoint";

/// Where each episode ends in arrays that hold one after the other.
pub(super) const ENDS: &str = "episode_ends";

/// The names of arrays that say how sure points are.
pub(super) const CONFIDENCES: [&str; 5] = [
    "confidence",
    "point_scores",
    "visibility",
    "visibles",
    "occluded",
];

/// The names of arrays that say what points are called: all, the nodes of SLEAP's skeleton and its
/// tracks.
pub(super) const NAMES: [&str; 3] = ["names", NODES, TRACKS];
/// The names of a skeleton's nodes.
pub(super) const NODES: &str = "node_names";
/// The names of tracks.
pub(super) const TRACKS: &str = "track_names";

/// The name of an array that says whether points are (y, x), as `record.py` notes it.
pub(super) const Y_FIRST: &str = "y_first";

/// The most frames of a recording: 12 days at 16 frames a second.
const MAX_FRAMES: usize = 1 << 24;

/// What an array holds, as far as this module reads it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    U8,
    F32,
    F64,
    /// Another number, which is read as F64.
    Number,
}

impl Kind {
    /// Whether frames can be of this type.
    pub fn holds_frames(self) -> bool {
        self != Self::Number
    }
}

/// An array by its header.
#[derive(Debug, Clone)]
pub(super) struct ArrayInfo {
    pub shape: Vec<u64>,
    /// The type as the file names it.
    pub dtype: String,
    /// None where the type is not read here.
    pub kind: Option<Kind>,
}

/// Elements of an array.
pub(super) enum Values {
    U8(Vec<u8>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// The names of what is in a group.
#[derive(Debug, Default)]
pub(super) struct Members {
    pub groups: Vec<String>,
    pub arrays: Vec<String>,
}

/// A file of named arrays, which may lie in groups: `group/array`.
pub(super) trait ArrayFile: Send + Sync {
    /// The names of all arrays that are in no group.
    fn names(&self) -> Result<Vec<String>>;

    /// What is in a group; nothing where there is no such group.
    fn members(&self, _group: &str) -> Result<Members> {
        Ok(Members::default())
    }

    /// None where there is no such array.
    fn info(&self, name: &str) -> Result<Option<ArrayInfo>>;

    /// The part of a known array at the `leading` indices, row by row; the whole of it where there
    /// are none.
    fn read(&self, name: &str, leading: &[u64]) -> Result<Values>;

    /// Compares the checksum of an array that is read in parts, where there is one.
    fn verify(&self, _name: &str) -> Result<()> {
        Ok(())
    }

    /// Where the part of a known array at the `leading` indices lies in the array's file, header
    /// included, and its size, in bytes; None where it does not lie in one piece.
    fn place(&self, _name: &str, _leading: &[u64]) -> Option<(u64, u64)> {
        None
    }

    /// The bytes of the file, where what it holds is unpacked when it is read.
    fn size(&self) -> Option<u64> {
        None
    }

    /// The table of a program that keeps its points as records.
    #[cfg(any(feature = "hdf5", feature = "zarr"))]
    fn export(&self) -> Result<Option<Export>> {
        Ok(None)
    }

    /// The axis order that the file itself states.
    fn axes(&self) -> Option<AxisOrder>;

    /// The texts in an array.
    fn strings(&self, name: &str) -> Result<Vec<String>> {
        Err(Error::input(format!("`{name}` is no list of texts")))
    }

    /// Arrays that would be used if they could be read, and why they are not.
    fn left_out(&self) -> &[String] {
        &[]
    }

    /// The names of the points that the file itself states, or why they cannot be read.
    fn point_names(&self) -> Result<Option<Vec<String>>>;
}

/// The one array of several possible names.
pub(super) fn find(
    file: &dyn ArrayFile,
    names: &[&'static str],
) -> Result<Option<(&'static str, ArrayInfo)>> {
    let mut found = Vec::new();
    for name in names {
        found.extend(file.info(name)?.map(|info| (*name, info)));
    }
    match &found[..] {
        [(a, _), (b, _), ..] => Err(Error::input(format!(
            "both `{a}` and `{b}` are there; expected one of them"
        ))),
        _ => Ok(found.pop()),
    }
}

pub(super) fn count(n: u64, name: &str, shape: &[u64]) -> Result<usize> {
    usize::try_from(n)
        .ok()
        .filter(|n| (1..1 << 31).contains(n))
        .ok_or_else(|| {
            Error::input(format!(
                "`{name}` has shape {shape:?}; expected at least one sequence, frame and point"
            ))
        })
}

/// Checks that an array does not declare more frames than a recording can have: the names of frames
/// are kept in memory, and an HDF5 file of a kilobyte can declare any number.
pub(super) fn check_frames(
    sequences: usize,
    frames: usize,
    name: &str,
    shape: &[u64],
) -> Result<()> {
    match sequences.checked_mul(frames) {
        Some(all) if all <= MAX_FRAMES => Ok(()),
        _ => Err(Error::input(format!(
            "`{name}` has shape {shape:?}; expected at most {MAX_FRAMES} frames: split the recording"
        ))),
    }
}

/// Checks what arrays declare to hold, in bytes, that are read as a whole from a file of `file`
/// bytes: hardly any bytes can declare any number.
pub(super) fn check_declared(declared: u64, file: u64, what: &str) -> Result<()> {
    /// Bytes that may be declared however small the file is.
    const SMALL: u64 = 4 << 20;
    /// What more of them there may be for a byte of the file.
    const MOST_PACKED: u64 = 400;
    /// Bytes that become of one: numbers, their text, and the points read from it.
    const MADE: u64 = 12;
    if declared > SMALL && declared / MOST_PACKED > file {
        return Err(Error::input(format!(
            "{what} declares {declared} bytes, more than {MOST_PACKED} times the file; is it \
             damaged?"
        )));
    }
    memory::check(declared.saturating_mul(MADE), "values", "split the file").map_err(|e| e.at(what))
}

/// Names in a message, the first of many.
pub(super) fn listed(names: &[String]) -> String {
    const SHOWN: usize = 12;
    let mut shown: Vec<String> = names.iter().take(SHOWN).map(|n| format!("`{n}`")).collect();
    match names.len() {
        0 => return "nothing".to_owned(),
        all if all > SHOWN => shown.push(format!("… ({all})")),
        _ => {}
    }
    shown.join(", ")
}
