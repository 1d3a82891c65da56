//! Recordings: frames and points as arrays, in NPZ and HDF5 files.

use std::fmt;
use std::str::FromStr;

use ndarray::Array3;

use super::frames::FrameIndex;
use super::image::{Frame, MAX_SIDE, MIN_SIDE, Pixels};
use super::npz::npy_header;
use super::source::FrameSource;
use super::table::{
    Ground, Known, Layout as TableLayout, Reading, Space, Table, TableOptions, ndc_from_pixels,
    point_notices,
};
use crate::error::{Error, Result};
use crate::track::{FrameKey, GroundTruth, KeypointTrack};

/// The names of arrays of frames.
pub(super) const FRAMES: [&str; 2] = ["images", "frames"];
/// The names of arrays of points.
pub(super) const POINTS: [&str; 2] = ["keypoints", "sites"];

/// What the last axis of an array of points holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AxisOrder {
    /// (x, y)
    Xy,
    /// (y, x)
    Yx,
}

impl FromStr for AxisOrder {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "xy" => Ok(Self::Xy),
            "yx" => Ok(Self::Yx),
            _ => Err(Error::input(format!(
                "`{text}` is no axis order; expected xy or yx"
            ))),
        }
    }
}

impl AxisOrder {
    /// `xy` or `yx`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Xy => "xy",
            Self::Yx => "yx",
        }
    }
}

impl fmt::Display for AxisOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Xy => "(x, y)",
            Self::Yx => "(y, x)",
        })
    }
}

/// What an array holds, as far as this module reads it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    U8,
    F32,
    F64,
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

/// A file of named arrays.
pub(super) trait ArrayFile: Send + Sync {
    /// The names of all arrays.
    fn names(&self) -> Result<Vec<String>>;

    /// None where there is no such array.
    fn info(&self, name: &str) -> Result<Option<ArrayInfo>>;

    /// The part of a known array at the `leading` indices, row by row; the whole of it where there
    /// are none.
    fn read(&self, name: &str, leading: &[u64]) -> Result<Values>;

    /// Where the part of a known array at the `leading` indices lies in the array's file, header
    /// included, and its size, in bytes; None where it does not lie in one piece.
    fn place(&self, _name: &str, _leading: &[u64]) -> Option<(u64, u64)> {
        None
    }

    /// The axis order that the file itself states.
    fn axes(&self) -> Option<AxisOrder>;

    /// The names of the points that the file itself states.
    fn point_names(&self) -> Result<Option<Vec<String>>>;
}

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
    layout: Layout,
    index: FrameIndex,
    truth: Option<GroundTruth>,
    notices: Vec<String>,
}

impl Recording {
    pub(super) fn new(file: Box<dyn ArrayFile>, options: &TableOptions) -> Result<Self> {
        let Some((name, info)) = find(&*file, FRAMES)? else {
            return Err(Error::input(format!(
                "no array of frames; expected `images` or `frames`, found {}",
                listed(&file.names()?)
            )));
        };
        let layout = Layout::new(name, &info)?;
        let mut notices = Vec::new();
        let mut truth = None;
        let options = TableOptions {
            image_size: options.image_size.or(Some([layout.width, layout.height])),
            ..*options
        };
        if let Some(points) = Points::read(&*file, &options)? {
            if (points.sequences, points.frames) != (layout.sequences, layout.frames) {
                return Err(Error::mismatch(format!(
                    "`{}` has shape {:?}, `{name}` has {:?}; expected the same {} sequences of {} frames",
                    points.name, points.shape, info.shape, layout.sequences, layout.frames
                )));
            }
            let table = points.into_truth()?;
            notices = table.notices;
            truth = Some(table.content);
        }
        Ok(Self {
            index: FrameIndex::of_keys(keys(layout.sequences, layout.frames)),
            file,
            layout,
            truth,
            notices,
        })
    }

    /// Width and height of the frames.
    pub fn image_size(&self) -> [u32; 2] {
        [self.layout.width, self.layout.height]
    }

    /// The name of the array of frames.
    pub fn frames_name(&self) -> &str {
        &self.layout.name
    }

    /// Where frame `i` lies in the file of its array, `images.npy` or `frames.npy`: start and
    /// length in bytes; None where it does not lie there in one piece.
    pub fn frame_place(&self, i: usize) -> Option<(u64, u64)> {
        self.file.place(&self.layout.name, &self.layout.leading(i))
    }

    /// The header that makes the bytes at [`Recording::frame_place`] a `.npy` array, which
    /// [`Frame::decode`] takes.
    pub fn frame_header(&self) -> Vec<u8> {
        let [w, h] = [self.layout.width as usize, self.layout.height as usize];
        let shape = match self.layout.channels_first {
            true => [3, h, w],
            false => [h, w, 3],
        };
        npy_header(&self.layout.dtype, &shape)
    }

    fn frame(&self, i: usize) -> Result<Frame> {
        let values = self.file.read(&self.layout.name, &self.layout.leading(i))?;
        self.layout.frame(values)
    }
}

/// The only frame of an array of one.
pub(super) fn frame(info: &ArrayInfo, values: Values) -> Result<Frame> {
    Layout::new("frame", info)?.frame(values)
}

impl FrameSource for Recording {
    fn index(&self) -> &FrameIndex {
        &self.index
    }

    fn read(&self, i: usize) -> Result<Frame> {
        self.frame(i)
            .map_err(|e| e.at(format!("`{}`, {}", self.layout.name, self.index.keys()[i])))
    }

    fn truth(&self) -> Option<&GroundTruth> {
        self.truth.as_ref()
    }

    fn notices(&self) -> &[String] {
        &self.notices
    }

    fn has_floats(&self) -> bool {
        self.layout.kind != Kind::U8
    }
}

/// The points of a recording as a ground truth; it need not have frames.
pub(super) fn ground_truth(
    file: &dyn ArrayFile,
    options: &TableOptions,
) -> Result<Table<GroundTruth>> {
    points(file, options)?.into_truth()
}

/// The points of a recording as keypoints of a detector; it need not have frames.
pub(super) fn keypoints(
    file: &dyn ArrayFile,
    options: &TableOptions,
) -> Result<Table<KeypointTrack>> {
    let points = points(file, options)?;
    let mut notices = vec![points.notice];
    notices.extend(point_notices(
        &points.values,
        "keypoints are missing or not finite",
    ));
    let keys = keys(points.sequences, points.frames);
    Ok(Table {
        content: KeypointTrack::new(keys, points.values)?,
        reading: points.reading,
        notices,
    })
}

fn points(file: &dyn ArrayFile, options: &TableOptions) -> Result<Points> {
    match Points::read(file, options)? {
        Some(points) => Ok(points),
        None => Err(Error::input(format!(
            "no array of points; expected `keypoints` or `sites`, found {}",
            listed(&file.names()?)
        ))),
    }
}

/// Where frames lie in their array.
struct Layout {
    name: String,
    dtype: String,
    kind: Kind,
    sequences: usize,
    frames: usize,
    width: u32,
    height: u32,
    channels_first: bool,
    /// Whether there is no axis of sequences.
    single: bool,
}

impl Layout {
    fn new(name: &str, info: &ArrayInfo) -> Result<Self> {
        let place = || format!("`{name}` ({}, shape {:?})", info.dtype, info.shape);
        let Some(kind) = info.kind else {
            return Err(Error::input(format!(
                "{} is of a type that holds no frames; expected uint8, or float32 or float64 in [0, 1]",
                place()
            )));
        };
        let (single, (sequences, frames, image)) = match info.shape[..] {
            [s, t, a, b, c] => (false, (s, t, [a, b, c])),
            [t, a, b, c] => (true, (1, t, [a, b, c])),
            _ => (true, (0, 0, [0; 3])),
        };
        let (channels_first, [height, width]) = match image {
            [h, w, 3] => (false, [h, w]),
            [3, h, w] => (true, [h, w]),
            _ => {
                return Err(Error::input(format!(
                    "{} is no array of RGB frames; expected [S, T, H, W, 3] or [T, H, W, 3], or with the 3 channels \
                     before H and W",
                    place()
                )));
            }
        };
        let side = |side: u64| {
            u32::try_from(side)
                .ok()
                .filter(|s| (MIN_SIDE..=MAX_SIDE).contains(s))
        };
        let (Some(width), Some(height)) = (side(width), side(height)) else {
            return Err(Error::input(format!(
                "{} has frames of {width} x {height} pixels; expected {MIN_SIDE} to {MAX_SIDE} a side",
                place()
            )));
        };
        Ok(Self {
            name: name.to_owned(),
            dtype: info.dtype.clone(),
            kind,
            sequences: count(sequences, name, &info.shape)?,
            frames: count(frames, name, &info.shape)?,
            width,
            height,
            channels_first,
            single,
        })
    }

    fn leading(&self, i: usize) -> Vec<u64> {
        let (sequence, frame) = ((i / self.frames) as u64, (i % self.frames) as u64);
        match self.single {
            true => vec![frame],
            false => vec![sequence, frame],
        }
    }

    fn frame(&self, values: Values) -> Result<Frame> {
        let pixels = match values {
            Values::U8(values) => Pixels::Bytes(self.interleave(values)),
            Values::F32(values) => Pixels::Floats(self.interleave(values)),
            Values::F64(values) => {
                Pixels::Floats(self.interleave(values.into_iter().map(|v| v as f32).collect()))
            }
        };
        Frame::from_pixels(self.width, self.height, pixels)
    }

    fn interleave<T: Copy>(&self, values: Vec<T>) -> Vec<T> {
        if !self.channels_first {
            return values;
        }
        let plane = self.width as usize * self.height as usize;
        let at = |i: usize| values[i % 3 * plane + i / 3];
        (0..3 * plane).map(at).collect()
    }
}

/// An array of points, (x, y).
struct Points {
    name: &'static str,
    shape: Vec<u64>,
    sequences: usize,
    frames: usize,
    values: Array3<f64>,
    names: Vec<String>,
    reading: Reading,
    /// How it was read.
    notice: String,
}

impl Points {
    fn read(file: &dyn ArrayFile, options: &TableOptions) -> Result<Option<Self>> {
        let Some((name, info)) = find(file, POINTS)? else {
            return Ok(None);
        };
        let (sequences, frames, points) = match info.shape[..] {
            [s, t, k, 2] => (s, t, k),
            [t, k, 2] => (1, t, k),
            _ => {
                return Err(Error::input(format!(
                    "`{name}` ({}) has shape {:?}; expected [S, T, K, 2] or [T, K, 2]",
                    info.dtype, info.shape
                )));
            }
        };
        let size = |n: u64| count(n, name, &info.shape);
        let (sequences, frames, points) = (size(sequences)?, size(frames)?, size(points)?);
        if !matches!(info.kind, Some(Kind::F32 | Kind::F64)) {
            return Err(Error::input(format!(
                "`{name}` is of type {}; expected float32 or float64, in ndc",
                info.dtype
            )));
        }
        let mut values = match file.read(name, &[])? {
            Values::U8(values) => values.into_iter().map(f64::from).collect(),
            Values::F32(values) => values.into_iter().map(f64::from).collect(),
            Values::F64(values) => values,
        };
        let axes = match file.axes() {
            Some(order) => Known::of(options.axes, order, Ground::File),
            None => Known::of(options.axes, AxisOrder::Xy, Ground::Guess),
        };
        if axes.value == AxisOrder::Yx {
            values
                .chunks_exact_mut(2)
                .for_each(|point| point.swap(0, 1));
        }
        let source = match axes.by {
            Ground::Said => "as asked for",
            Ground::File => "as the file says",
            Ground::Guess => "a guess, as the authors record; --axis-order yx reads (y, x)",
        };
        let reading = Reading {
            layout: TableLayout::Arrays,
            space: Known::of(options.space, Space::Ndc, Ground::Guess),
            axes,
            // Frames are the positions in the array.
            index_base: Known::of(None, 0, Ground::File),
        };
        if reading.space.value == Space::Pixels {
            let size = options.image_size.ok_or_else(|| {
                Error::input(format!(
                    "the positions of `{name}` are in pixels, as was said, and the size of the images is not known; give \
                     the frames along, or the size (--image-size 256x256)"
                ))
            })?;
            for point in values.chunks_exact_mut(2) {
                point.copy_from_slice(&ndc_from_pixels([point[0], point[1]], size));
            }
        }
        let names = match file.point_names()? {
            Some(names) if names.len() == points => names,
            Some(names) => {
                return Err(Error::mismatch(format!(
                    "the file names {} points ({}), `{name}` has {points}; expected one name each",
                    names.len(),
                    names.join(", ")
                )));
            }
            None => (0..points).map(|k| format!("point_{k}")).collect(),
        };
        let length = values.len();
        let values =
            Array3::from_shape_vec((sequences * frames, points, 2), values).map_err(|_| {
                Error::input(format!(
                    "`{name}` holds {length} values for shape {:?}",
                    info.shape
                ))
            })?;
        Ok(Some(Self {
            name,
            notice: format!("`{name}` is read as {}: {source}", axes.value),
            reading,
            shape: info.shape,
            sequences,
            frames,
            values,
            names,
        }))
    }

    fn into_truth(self) -> Result<Table<GroundTruth>> {
        if let Some(((t, k, _), value)) = self.values.indexed_iter().find(|(_, v)| v.is_infinite())
        {
            return Err(Error::input(format!(
                "`{}`: point {k} is {value} in sequence {}, frame {}; expected finite numbers, or NaN where the object \
                 is not visible",
                self.name,
                t / self.frames,
                t % self.frames
            )));
        }
        let mut notices = vec![self.notice];
        notices.extend(point_notices(
            &self.values,
            "positions are missing: the object counts as not visible in that frame",
        ));
        let keys = keys(self.sequences, self.frames);
        Ok(Table {
            content: GroundTruth::new(keys, self.names, self.values)?,
            reading: self.reading,
            notices,
        })
    }
}

/// The one array of two possible names.
fn find(
    file: &dyn ArrayFile,
    names: [&'static str; 2],
) -> Result<Option<(&'static str, ArrayInfo)>> {
    match [file.info(names[0])?, file.info(names[1])?] {
        [Some(_), Some(_)] => Err(Error::input(format!(
            "both `{}` and `{}` are there; expected one of them",
            names[0], names[1]
        ))),
        [Some(info), None] => Ok(Some((names[0], info))),
        [None, Some(info)] => Ok(Some((names[1], info))),
        [None, None] => Ok(None),
    }
}

fn count(n: u64, name: &str, shape: &[u64]) -> Result<usize> {
    usize::try_from(n)
        .ok()
        .filter(|n| (1..1 << 31).contains(n))
        .ok_or_else(|| {
            Error::input(format!(
                "`{name}` has shape {shape:?}; expected at least one sequence, frame and point"
            ))
        })
}

fn keys(sequences: usize, frames: usize) -> Vec<FrameKey> {
    let key = |s: usize, t: usize| FrameKey {
        sequence: format!("seq_{s:04}"),
        frame: t as u64,
    };
    (0..sequences)
        .flat_map(|s| (0..frames).map(move |t| key(s, t)))
        .collect()
}

fn listed(names: &[String]) -> String {
    match names {
        [] => "nothing".to_owned(),
        _ => names
            .iter()
            .map(|n| format!("`{n}`"))
            .collect::<Vec<_>>()
            .join(", "),
    }
}
