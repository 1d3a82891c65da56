//! Points in an array of a recording.

use ndarray::Array3;

use super::arrays::{ArrayFile, Kind, POINTS, Values, check_frames, count, find, listed};
use super::names::cleaned;
use super::reading::{
    AxisOrder, Ground, Known, Layout, Notice, Reading, Space, Table, TableOptions,
    missing_image_size, point_notices,
};
use crate::error::{Error, Reason, Result};
use crate::memory;
use crate::track::{FrameKey, GroundTruth, KeypointTrack};

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

/// An array of points, (x, y).
pub(super) struct Points {
    pub name: &'static str,
    pub shape: Vec<u64>,
    pub sequences: usize,
    pub frames: usize,
    values: Array3<f64>,
    names: Vec<String>,
    reading: Reading,
    /// How it was read.
    notice: Notice,
}

impl Points {
    pub fn read(file: &dyn ArrayFile, options: &TableOptions) -> Result<Option<Self>> {
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
        check_frames(sequences, frames, name, &info.shape)?;
        if !matches!(info.kind, Some(Kind::F32 | Kind::F64)) {
            return Err(Error::input(format!(
                "`{name}` is of type {}; expected float32 or float64, in ndc",
                info.dtype
            )));
        }
        memory::check(
            (sequences as u64)
                .saturating_mul(frames as u64)
                .saturating_mul(points as u64)
                .saturating_mul(2 * 8 * 2),
            "positions",
            "is the file damaged?",
        )
        .map_err(|e| e.at(format!("`{name}`")))?;
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
        let (source, reason) = match axes.by {
            Ground::Said => ("as asked for", None),
            Ground::File => ("as the file says", None),
            Ground::Guess => (
                "assumed, as the authors record",
                Some(Reason::AssumedAxisOrder),
            ),
        };
        let notice = Notice {
            text: format!("`{name}` is read as {}: {source}", axes.value),
            reason,
        };
        let reading = Reading {
            layout: Layout::Arrays,
            space: Known::of(options.space, Space::Ndc, Ground::Guess),
            axes,
            // Frames are the positions in the array.
            index_base: Known::of(None, 0, Ground::File),
            ..Reading::new(Layout::Arrays, options)
        };
        let lacks_size = reading.space.value == Space::Pixels && options.image_size.is_none();
        for point in values.chunks_exact_mut(2) {
            let at = [point[0], point[1]];
            if let Some(placed) = options.place(at, reading.space.value, options.image_size) {
                point.copy_from_slice(&placed);
            }
        }
        let names = match file.point_names()? {
            Some(names) if names.len() == points => names
                .iter()
                .map(|name| cleaned(name).into_owned())
                .collect(),
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
        if lacks_size {
            return Err(missing_image_size(
                &format!("the positions of `{name}`"),
                reading.space.by,
            ));
        }
        Ok(Some(Self {
            name,
            notice,
            reading,
            shape: info.shape,
            sequences,
            frames,
            values,
            names,
        }))
    }

    pub fn into_truth(self) -> Result<Table<GroundTruth>> {
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

pub(super) fn keys(sequences: usize, frames: usize) -> Vec<FrameKey> {
    let key = |s: usize, t: usize| FrameKey {
        sequence: format!("seq_{s:04}"),
        frame: t as u64,
    };
    (0..sequences)
        .flat_map(|s| (0..frames).map(move |t| key(s, t)))
        .collect()
}
