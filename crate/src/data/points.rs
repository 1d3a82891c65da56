//! Points in an array of a recording.

use ndarray::{Array2, Array3, Axis, s};

use super::arrays::{
    ArrayFile, ArrayInfo, CONFIDENCES, KEYPOINT, NODES, POINTS, TRACKS, Values, check_declared,
    check_frames, count, find, listed,
};
use super::names::cleaned;
use super::reading::{
    AxisOrder, Ground, Known, Layout, Notice, Parsed, Reading, Space, TableOptions,
    missing_image_size, point_notices,
};
use super::sequences::{Episode, Sequences, Within};
use crate::error::{Error, Reason, Result};
use crate::memory;
use crate::track::{FrameKey, GroundTruth, KeypointTrack, MOST_AXES};

/// The points of a recording as a ground truth; it need not have frames.
pub(super) fn ground_truth(
    file: &dyn ArrayFile,
    options: &TableOptions,
) -> Result<Parsed<GroundTruth>> {
    points(file, options)?.into_truth()
}

/// The points of a recording as keypoints of a detector; it need not have frames.
pub(super) fn keypoints(
    file: &dyn ArrayFile,
    options: &TableOptions,
) -> Result<Parsed<KeypointTrack>> {
    points(file, options)?.into_keypoints()
}

fn points(file: &dyn ArrayFile, options: &TableOptions) -> Result<Points> {
    match Points::read(file, &Sequences::of(file)?, options)? {
        Some(points) => Ok(points),
        None => Err(missing(file)?),
    }
}

/// The error of a file without points.
pub(super) fn missing(file: &dyn ArrayFile) -> Result<Error> {
    Ok(Error::input(format!(
        "no array of points; expected `keypoints` or `sites`, found {}",
        listed(&Sequences::of(file)?.names(file)?)
    ))
    .because(Reason::NoPoints))
}

/// The error of an array that holds something else than numbers.
pub(super) fn no_numbers(name: &str, dtype: &str) -> Error {
    Error::input(format!(
        "`{name}` is of type {dtype}; expected numbers, in ndc"
    ))
}

/// An array of points, (x, y) or (x, y, z).
pub(super) struct Points {
    pub name: &'static str,
    pub shape: Vec<u64>,
    /// The names of the sequences.
    pub sequences: Vec<String>,
    /// The number of frames of each.
    pub lengths: Vec<usize>,
    /// The frames of all sequences x points x 2, or 3 in space.
    pub values: Array3<f64>,
    /// Frames x points, where the file says how sure they are.
    pub confidence: Option<Array2<f64>>,
    pub names: Vec<String>,
    pub reading: Reading,
    /// How it was read.
    pub notices: Vec<Notice>,
}

/// How an array of points is arranged.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Arrangement {
    /// `[S, T, K, 2]` or `[T, K, 2]`, or 3 in the last axis.
    Frames,
    /// `[K, T, 2]`, as TAP-Vid has it.
    Points,
    /// `[I, 2, K, T]` of I individuals, as SLEAP's analyses have it.
    Sleap,
}

impl Arrangement {
    fn of(file: &dyn ArrayFile, name: &str) -> Result<Self> {
        let has = |name: &str| file.info(name).map(|info| info.is_some());
        Ok(match name {
            "tracks" if has(NODES)? => Self::Sleap,
            "tracks" | "points" if has("visibles")? || has("occluded")? => Self::Points,
            _ => Self::Frames,
        })
    }

    /// Sequences, frames, points and their coordinates of an array of this shape.
    fn sizes(self, shape: &[u64]) -> Option<([u64; 3], usize)> {
        let axes = match shape.last() {
            Some(3) if self == Self::Frames && MOST_AXES == 3 => 3,
            _ => 2,
        };
        let sizes = match (self, shape) {
            (Self::Frames, &[s, t, k, last]) if last == axes as u64 => [s, t, k],
            (Self::Frames, &[t, k, last]) if last == axes as u64 => [1, t, k],
            (Self::Points, &[k, t, 2]) => [1, t, k],
            (Self::Sleap, &[i, 2, k, t]) => [1, t, i.checked_mul(k)?],
            _ => return None,
        };
        Some((sizes, axes))
    }

    fn expected(self) -> &'static str {
        match self {
            Self::Frames if MOST_AXES == 3 => "[S, T, K, 2] or [T, K, 2], or 3 in the last axis",
            Self::Frames => "[S, T, K, 2] or [T, K, 2]",
            Self::Points => "[K, T, 2]",
            Self::Sleap => "[I, 2, K, T]",
        }
    }

    /// Where the values of one frame after the other lie in the array, `axes` for each point of
    /// `shape`.
    fn place(
        self,
        [frames, points]: [usize; 2],
        axes: usize,
        at: [usize; 3],
        individuals: usize,
    ) -> usize {
        let [t, k, axis] = at;
        match self {
            Self::Frames => (t * points + k) * axes + axis,
            Self::Points => (k * frames + t) * axes + axis,
            Self::Sleap => {
                let nodes = points / individuals.max(1);
                let (individual, node) = (k / nodes.max(1), k % nodes.max(1));
                ((individual * axes + axis) * nodes + node) * frames + t
            }
        }
    }
}

/// An array of points as it lies in its file.
struct Stored {
    name: &'static str,
    shape: Vec<u64>,
    arrangement: Arrangement,
    sequences: usize,
    /// Those of a sequence.
    frames: usize,
    /// Those of a frame, of all individuals.
    points: usize,
    /// The coordinates of a point, 2 or 3.
    axes: usize,
    individuals: usize,
}

impl Stored {
    /// # Errors
    /// When an array of this type and shape holds no points, or more than memory does.
    fn new(file: &dyn ArrayFile, name: &'static str, info: ArrayInfo) -> Result<Self> {
        let arrangement = Arrangement::of(file, name)?;
        let sizes = arrangement.sizes(&info.shape);
        let ([sequences, frames, points], axes) = sizes.ok_or_else(|| {
            let error = Error::input(format!(
                "`{name}` ({}) has shape {:?}; expected {}",
                info.dtype,
                info.shape,
                arrangement.expected()
            ));
            match info.shape.last() {
                Some(3) if MOST_AXES == 2 => error.because(Reason::InSpace),
                _ => error,
            }
        })?;
        let size = |n: u64| count(n, name, &info.shape);
        let (sequences, frames, points) = (size(sequences)?, size(frames)?, size(points)?);
        check_frames(sequences, frames, name, &info.shape)?;
        if info.kind.is_none() {
            return Err(no_numbers(name, &info.dtype));
        }
        memory::check(
            (sequences as u64)
                .saturating_mul(frames as u64)
                .saturating_mul(points as u64)
                .saturating_mul(axes as u64 * 8 * 3),
            "positions",
            "is the file damaged?",
        )
        .map_err(|e| e.at(format!("`{name}`")))?;
        let individuals = match (arrangement, info.shape.first()) {
            (Arrangement::Sleap, Some(individuals)) => *individuals as usize,
            _ => 1,
        };
        Ok(Self {
            name,
            shape: info.shape,
            arrangement,
            sequences,
            frames,
            points,
            axes,
            individuals,
        })
    }

    /// The frames of all sequences.
    fn rows(&self) -> usize {
        self.sequences * self.frames
    }

    /// The first `coordinates` of every point, one frame after the other.
    fn in_order(&self, given: Vec<f64>, coordinates: usize) -> Vec<f64> {
        let (rows, points) = (self.rows(), self.points);
        match self.arrangement {
            Arrangement::Frames if coordinates < self.axes => {
                let points = given.chunks_exact(self.axes);
                points
                    .flat_map(|point| &point[..coordinates])
                    .copied()
                    .collect()
            }
            Arrangement::Frames => given,
            Arrangement::Points | Arrangement::Sleap => {
                let all = (0..rows * points * 2).map(|i| [i / 2 / points, i / 2 % points, i % 2]);
                let value = |at| {
                    let place = self
                        .arrangement
                        .place([rows, points], 2, at, self.individuals);
                    given.get(place).copied().unwrap_or(f64::NAN)
                };
                all.map(value).collect()
            }
        }
    }

    /// How the array is read, and what there is to say of it.
    fn reading(
        &self,
        file: &dyn ArrayFile,
        coordinates: usize,
        options: &TableOptions,
    ) -> Result<(Reading, Vec<Notice>)> {
        let name = self.name;
        let in_space = MOST_AXES == 3 && coordinates == 3;
        let axes = match file.axes() {
            Some(order) => Known::of(options.axes, order, Ground::File),
            None => Known::of(options.axes, AxisOrder::Xy, Ground::Guess),
        };
        let (source, reason) = match axes.by {
            Ground::Said => ("as asked for", None),
            Ground::File => ("as the file says", None),
            Ground::Guess => (
                "assumed, as the authors record",
                Some(Reason::AssumedAxisOrder),
            ),
        };
        let mut notices = vec![Notice {
            text: format!("`{name}` is read as {}: {source}", axes.value),
            reason,
        }];
        if coordinates < self.axes {
            notices.push(format!("`{name}`: z is left out of {} points", self.points).into());
        } else if in_space {
            notices.push(format!("`{name}`: the third number of a point is its z").into());
        }
        notices.extend(file.left_out().iter().cloned().map(Notice::from));
        // TAP-Vid's points go from 0 to 1 across the image.
        let is_share =
            name == "points" && self.arrangement == Arrangement::Points && options.space.is_none();
        if is_share {
            notices.push("`points` are read as shares of the image".to_owned().into());
        }
        let (space, by) = match name {
            "tracks" => (Space::Pixels, Ground::File),
            _ if is_share => (Space::Fraction, Ground::File),
            _ => (Space::Ndc, Ground::Guess),
        };
        let mut reading = Reading {
            layout: Layout::Arrays,
            space: Known::of(options.space, space, by),
            axes,
            // Frames are the positions in the array.
            index_base: Known::of(None, 0, Ground::File),
            ..Reading::new(Layout::Arrays, options)
        };
        if in_space {
            reading.in_space(options)?;
        }
        Ok((reading, notices))
    }

    /// The names of the points, numbers where the file has none.
    fn point_names(&self, file: &dyn ArrayFile, notices: &mut Vec<Notice>) -> Result<Vec<String>> {
        if self.arrangement == Arrangement::Sleap {
            return names_of_sleap(file, self.points, self.individuals);
        }
        match file.point_names() {
            Ok(Some(names)) if names.len() == self.points => {
                let cleaned = |name: &String| cleaned(name).into_owned();
                Ok(names.iter().map(cleaned).collect())
            }
            Ok(Some(names)) => Err(Error::mismatch(format!(
                "the file names {} points ({}), `{}` has {}; expected one name each",
                names.len(),
                names.join(", "),
                self.name,
                self.points
            ))),
            Ok(None) => Ok(numbered(self.points)),
            Err(problem) => {
                notices.push(format!("{problem}: points have numbers").into());
                Ok(numbered(self.points))
            }
        }
    }

    /// The confidences of all points, where the file has them in the same arrangement. Those that say
    /// what is visible hide what is not.
    fn confidence(
        &self,
        file: &dyn ArrayFile,
        points: &mut Array3<f64>,
        notices: &mut Vec<Notice>,
    ) -> Result<Option<Array2<f64>>> {
        let Some((name, info)) = find(file, &CONFIDENCES)? else {
            return Ok(None);
        };
        let (rows, count, _) = points.dim();
        let number = info
            .shape
            .iter()
            .try_fold(1, |n: u64, side| n.checked_mul(*side));
        if info.kind.is_none() || number != Some((rows * count) as u64) {
            notices.push(
                format!(
                    "`{name}` ({}, shape {:?}) does not say how sure each point is, and is left out",
                    info.dtype, info.shape
                )
                .into(),
            );
            return Ok(None);
        }
        let given = floats(file.read(name, &[])?);
        let mut confidence = Array2::from_elem((rows, count), f64::NAN);
        for ((t, k), confidence) in confidence.indexed_iter_mut() {
            let place = self
                .arrangement
                .place([rows, count], 1, [t, k, 0], self.individuals);
            let value = given.get(place).copied().unwrap_or(f64::NAN);
            *confidence = if name == "occluded" {
                1.0 - value
            } else {
                value
            };
            let says_visible = ["visibility", "visibles", "occluded"].contains(&name);
            if says_visible && *confidence == 0.0 {
                points.slice_mut(s![t, k, ..]).fill(f64::NAN);
            }
        }
        Ok(Some(confidence))
    }
}

pub(super) fn floats(values: Values) -> Vec<f64> {
    match values {
        Values::U8(values) => values.into_iter().map(f64::from).collect(),
        Values::F32(values) => values.into_iter().map(f64::from).collect(),
        Values::F64(values) => values,
    }
}

impl Points {
    /// The points of all sequences; none where there is no array of them.
    pub fn read(
        file: &dyn ArrayFile,
        sequences: &Sequences,
        options: &TableOptions,
    ) -> Result<Option<Self>> {
        match sequences {
            Sequences::Axis => Self::of_array(file, options),
            Sequences::Groups(episodes) => Self::of_groups(file, episodes, options),
            Sequences::Ends { group, lengths } => {
                let group = (*group).to_owned();
                let points = Self::of_array(&Within { file, group }, options)?;
                points.map(|points| points.divided(lengths)).transpose()
            }
        }
    }

    /// Points of episodes that have a group each.
    fn of_groups(
        file: &dyn ArrayFile,
        episodes: &[Episode],
        options: &TableOptions,
    ) -> Result<Option<Self>> {
        let places = episodes
            .iter()
            .map(|episode| episode.points(file))
            .collect::<Result<Vec<_>>>()?;
        if places.iter().all(Option::is_none) {
            return Ok(None);
        }
        let mut declared = 0_u64;
        for place in places.iter().flatten() {
            let shape = find(place, &POINTS)?.map(|(_, info)| info.shape);
            let sides = shape.iter().flatten();
            let bytes = sides.fold(8, |bytes: u64, side| bytes.saturating_mul(*side));
            declared = declared.saturating_add(bytes);
        }
        if let Some(size) = file.size() {
            check_declared(declared, size, "the points of all episodes")?;
        }
        let mut all: Option<Self> = None;
        for (episode, place) in episodes.iter().zip(places) {
            let mut next = || -> Result<()> {
                let place = place.as_ref().ok_or_else(|| {
                    Error::input("there are no points, unlike in other episodes of the file")
                })?;
                let Some(mut points) = Self::of_array(place, options)? else {
                    return Ok(());
                };
                points.sequences = vec![episode.name.clone(); points.lengths.len()];
                match &mut all {
                    Some(all) => all.append(points),
                    None => {
                        all = Some(points);
                        Ok(())
                    }
                }
            };
            next().map_err(|e| e.at(format!("`{}`", episode.path)))?;
        }
        Ok(all)
    }

    /// Adds the points of the next sequence.
    fn append(&mut self, next: Self) -> Result<()> {
        if next.lengths.len() != 1 || next.values.dim().1 != self.values.dim().1 {
            return Err(Error::mismatch(format!(
                "`{}` has shape {:?}, and {:?} in the first episode; expected the same points of \
                 one sequence",
                next.name, next.shape, self.shape
            )));
        }
        if next.names != self.names || next.values.dim().2 != self.values.dim().2 {
            return Err(Error::mismatch(format!(
                "`{}` has the points {}, and {} in the first episode; expected the same",
                next.name,
                next.names.join(", "),
                self.names.join(", ")
            )));
        }
        if self.confidence.is_some() || next.confidence.is_some() {
            let (mut own, of_next) = (self.confidences(), next.confidences());
            own.append(Axis(0), of_next.view())
                .map_err(|e| Error::input(e.to_string()))?;
            self.confidence = Some(own);
        }
        let values = self.values.append(Axis(0), next.values.view());
        values.map_err(|e| Error::input(e.to_string()))?;
        self.sequences.extend(next.sequences);
        self.lengths.extend(next.lengths);
        for notice in next.notices {
            if !self.notices.contains(&notice) {
                self.notices.push(notice);
            }
        }
        Ok(())
    }

    /// The confidences; NaN where there is none.
    fn confidences(&self) -> Array2<f64> {
        let (frames, points, _) = self.values.dim();
        let none = || Array2::from_elem((frames, points), f64::NAN);
        self.confidence.clone().unwrap_or_else(none)
    }

    /// The frames of one array as sequences of these lengths.
    fn divided(mut self, lengths: &[usize]) -> Result<Self> {
        let frames: usize = lengths.iter().sum();
        if self.lengths != [frames] {
            return Err(Error::input(format!(
                "`{}` has shape {:?}, and the last episode ends at {frames}; expected so many \
                 frames one after the other",
                self.name, self.shape
            )));
        }
        self.sequences = episode_names(lengths.len());
        self.lengths = lengths.to_vec();
        Ok(self)
    }

    /// The points of one array, whose sequences are an axis of it.
    fn of_array(file: &dyn ArrayFile, options: &TableOptions) -> Result<Option<Self>> {
        let Some((name, info)) = find(file, &POINTS)? else {
            return Ok(None);
        };
        let array = Stored::new(file, name, info)?;
        let coordinates = if options.xy_only { 2 } else { array.axes };
        if name == KEYPOINT && coordinates == 2 && options.space.is_none() {
            return Err(Error::input(format!(
                "the unit of `{name}` is that of its simulator, and the file does not say which; \
                 expected the unit"
            ))
            .because(Reason::UnknownUnit));
        }
        let mut values = array.in_order(floats(file.read(name, &[])?), coordinates);
        let (reading, mut notices) = array.reading(file, coordinates, options)?;
        place(&mut values, coordinates, &reading, options);
        let names = array.point_names(file, &mut notices)?;
        let length = values.len();
        let shape = (array.rows(), array.points, coordinates);
        let mut values = Array3::from_shape_vec(shape, values).map_err(|_| {
            Error::input(format!(
                "`{name}` holds {length} values for shape {:?}",
                array.shape
            ))
        })?;
        let confidence = array.confidence(file, &mut values, &mut notices)?;
        if reading.space.value == Space::Pixels && options.image_size.is_none() {
            return Err(missing_image_size(
                &format!("the positions of `{name}`"),
                reading.space.by,
            ));
        }
        Ok(Some(Self {
            name,
            notices,
            confidence,
            reading,
            sequences: sequence_names(array.sequences),
            lengths: vec![array.frames; array.sequences],
            shape: array.shape,
            values,
            names,
        }))
    }

    pub fn into_keypoints(self) -> Result<Parsed<KeypointTrack>> {
        let mut notices = self.notices;
        notices.extend(point_notices(
            &self.values,
            "keypoints are missing or not finite",
        ));
        Ok(Parsed {
            content: KeypointTrack::new(keys(&self.sequences, &self.lengths), self.values)?
                .with_confidence(self.confidence)?,
            reading: self.reading,
            notices,
        })
    }

    pub fn into_truth(self) -> Result<Parsed<GroundTruth>> {
        if let Some(((t, k, _), value)) = self.values.indexed_iter().find(|(_, v)| v.is_infinite())
        {
            let [sequence, frame] = numbers(&self.lengths, t);
            let sequence = match self.sequences.get(sequence) {
                Some(name) if *name != seq_name(sequence) => name.clone(),
                _ => sequence.to_string(),
            };
            return Err(Error::input(format!(
                "`{}`: point {k} is {value} in sequence {sequence}, frame {frame}; expected finite numbers, or NaN where \
                 the object is not visible",
                self.name
            )));
        }
        let mut notices = self.notices;
        notices.extend(point_notices(
            &self.values,
            "positions are missing: the object counts as not visible in that frame",
        ));
        Ok(Parsed {
            content: GroundTruth::new(
                keys(&self.sequences, &self.lengths),
                self.names,
                self.values,
            )?
            .with_confidence(self.confidence)?,
            reading: self.reading,
            notices,
        })
    }
}

/// Swaps and places `values`, (x, y) or (y, x) of one point after the other, so that they are (x, y)
/// in ndc. Those in pixels of images of unknown size stay as they are, and so do those of three
/// `coordinates`, but for the order of the first two.
pub(super) fn place(
    values: &mut [f64],
    coordinates: usize,
    reading: &Reading,
    options: &TableOptions,
) {
    for point in values.chunks_exact_mut(coordinates) {
        if reading.axes.value == AxisOrder::Yx {
            point.swap(0, 1);
        }
        if MOST_AXES == 3
            && let [x, y, z] = *point
        {
            point.copy_from_slice(&options.place_in_space([x, y, z]));
            continue;
        }
        let at = [point[0], point[1]];
        if let Some(placed) = options.place(at, reading.space.value, options.image_size) {
            point.copy_from_slice(&placed);
        }
    }
}

/// The names of points that have none.
pub(super) fn numbered(points: usize) -> Vec<String> {
    (0..points).map(|k| format!("point_{k}")).collect()
}

/// The numbers of the sequence and of the frame in it that is the `t`-th of all.
fn numbers(lengths: &[usize], t: usize) -> [usize; 2] {
    let mut frame = t;
    for (sequence, length) in lengths.iter().enumerate() {
        if frame < *length {
            return [sequence, frame];
        }
        frame -= length;
    }
    [lengths.len(), frame]
}

/// `track/node`, or the node alone where there is one track.
fn names_of_sleap(file: &dyn ArrayFile, points: usize, individuals: usize) -> Result<Vec<String>> {
    let nodes = file.strings(NODES)?;
    let tracks = file.strings(TRACKS).unwrap_or_default();
    let name = |k: usize| {
        let per = points / individuals.max(1);
        let (individual, node) = (k / per.max(1), k % per.max(1));
        let node = nodes.get(node).cloned().unwrap_or_else(|| node.to_string());
        let name = match (individuals, tracks.get(individual)) {
            (1, _) => node,
            (_, Some(track)) => format!("{track}/{node}"),
            (_, None) => format!("{individual}/{node}"),
        };
        cleaned(&name).into_owned()
    };
    Ok((0..points).map(name).collect())
}

/// What the sequences of an array are called, which have no names: `seq_0000`, `seq_0001`, …
pub(super) fn sequence_names(count: usize) -> Vec<String> {
    (0..count).map(seq_name).collect()
}

fn seq_name(number: usize) -> String {
    format!("seq_{number:04}")
}

/// What episodes are called that have no names: `episode_0`, `episode_1`, …
pub(super) fn episode_names(count: usize) -> Vec<String> {
    (0..count).map(|n| format!("episode_{n}")).collect()
}

/// The frames of sequences of these names and lengths, counted from 0.
pub(super) fn keys(names: &[String], lengths: &[usize]) -> Vec<FrameKey> {
    let key = |name: &String, t: usize| FrameKey {
        sequence: name.clone(),
        frame: t as u64,
    };
    let sequences = names.iter().zip(lengths);
    sequences
        .flat_map(|(name, frames)| (0..*frames).map(move |t| key(name, t)))
        .collect()
}
