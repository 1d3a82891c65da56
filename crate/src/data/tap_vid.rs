//! Tracks of points in a pickle, as TAP-Vid and RoboTAP are published, and as trackers' results are
//! pickled: a dictionary `{video: {"points": …, "occluded": …, "video": …}}`, a list of such, or one
//! of them. Arrays are numpy's; nothing of a pickle is run.

use ndarray::{Array2, Array3, ArrayD, Axis, Ix2, Ix3};

use super::arrays::Values;
use super::export::Export;
use super::npy::Header;
use super::reading::Space;
use crate::error::{Error, Result};
use crate::memory;
use crate::pickle::{Id, Node, Pickle};

/// Tables of so many fields may be as sparse as they like; larger ones have one field in
/// [`MAX_SPARSENESS`] with a position.
const SPARSE_FROM: usize = 1 << 20;
const MAX_SPARSENESS: usize = 64;

/// The tracks of a pickle as a table with one row a frame. Points are numbered in each video.
///
/// # Errors
/// When the bytes are no whole pickle, or hold no tracks.
pub fn export(bytes: &[u8]) -> Result<Export> {
    let pickle = Pickle::read(bytes)
        .map_err(|fault| Error::input(format!("{fault}; is the file complete, and a pickle?")))?;
    let file = File { pickle, bytes };
    let videos = file.videos()?;
    let mut space = None;
    let mut videos_read = Vec::new();
    let mut left = bytes.len();
    for (name, id) in videos {
        let video = file.video(id).map_err(|e| e.at(format!("`{name}`")))?;
        // A value has a byte at least; many videos could share the same array.
        left = left.checked_sub(video.xy.len()).ok_or_else(|| {
            Error::input("the videos hold more than the file; expected every array once")
        })?;
        if space
            .replace(video.space)
            .is_some_and(|before| before != video.space)
        {
            return Err(Error::input(
                "some videos have `points`, others `tracks`; expected one of them throughout",
            ));
        }
        videos_read.push((name, video));
    }
    let points = videos_read.iter().map(|(_, video)| video.points()).max();
    let points = points.unwrap_or_default();
    check_density(&videos_read, points)?;
    let header = ["sequence", "frame"].map(str::to_owned).into_iter();
    let of_points =
        (0..points).flat_map(|k| ["x", "y", "visible"].map(|column| format!("point_{k}_{column}")));
    let header = Ok(header.chain(of_points).collect());
    let rows = videos_read.iter().flat_map(|(name, video)| {
        (0..video.frames()).map(move |frame| Ok(video.row(name, frame, points)))
    });
    Export::of(std::iter::once(header).chain(rows), space)
}

/// Fails where videos have so different numbers of points that the table would be nearly empty.
fn check_density(videos: &[(String, Video)], points: usize) -> Result<()> {
    let frames = videos
        .iter()
        .map(|(_, video)| video.frames())
        .sum::<usize>();
    let given = videos
        .iter()
        .map(|(_, video)| video.xy.len() / 2)
        .sum::<usize>();
    let cells = frames.saturating_mul(points);
    if cells > SPARSE_FROM && cells / MAX_SPARSENESS > given {
        return Err(Error::input(format!(
            "{given} positions of at most {points} points a video in {frames} frames; expected videos of about as many \
             points each: split the file"
        )));
    }
    let names = videos
        .iter()
        .map(|(name, video)| name.len().saturating_mul(video.frames()));
    let names = names.fold(0, usize::saturating_add);
    let bytes = cells.saturating_mul(64).saturating_add(names);
    memory::check(bytes as u64, "positions", "split the file")
}

struct File<'a> {
    pickle: Pickle,
    bytes: &'a [u8],
}

/// The tracks of one video.
struct Video {
    space: Space,
    /// Frames x points x (x, y).
    xy: Array3<f64>,
    /// Frames x points.
    visible: Option<Array2<bool>>,
}

impl Video {
    fn frames(&self) -> usize {
        self.xy.dim().0
    }

    fn points(&self) -> usize {
        self.xy.dim().1
    }

    /// A row of a table of `points` points.
    fn row(&self, name: &str, frame: usize, points: usize) -> Vec<String> {
        let mut row = vec![name.to_owned(), frame.to_string()];
        for point in 0..self.points() {
            let number = |axis: usize| match self.xy[[frame, point, axis]] {
                number if number.is_nan() => String::new(),
                number => format!("{number:?}"),
            };
            let visible = self.visible.as_ref();
            let visible = visible.map(|visible| u8::from(visible[[frame, point]]).to_string());
            row.extend([number(0), number(1), visible.unwrap_or_default()]);
        }
        row.resize(2 + 3 * points, String::new());
        row
    }
}

/// An array of so many axes, without a first one of one item, as models add it.
fn without_batch(array: ArrayD<f64>, axes: usize) -> ArrayD<f64> {
    match array.ndim() == axes + 1 && array.shape()[0] == 1 {
        true => array.index_axis_move(Axis(0), 0),
        false => array,
    }
}

/// Where the parts of an array are in the pickle.
struct Stored {
    data: Id,
    dtype: Id,
    shape: Id,
    order: Id,
    /// The order of its axes, where its elements lie in another one.
    axes: Option<Id>,
}

impl File<'_> {
    /// The videos and their names.
    fn videos(&self) -> Result<Vec<(String, Id)>> {
        let pickle = &self.pickle;
        let root = pickle.root();
        let numbered = |n: usize, id: Id| (format!("seq_{n:04}"), id);
        if self.tracks_of(root).is_some() {
            return Ok(vec![numbered(0, root)]);
        }
        let listed = pickle.items(root).unwrap_or_default().iter();
        let listed = listed.enumerate().map(|(n, id)| numbered(n, *id));
        let named = pickle.entries(root).iter();
        let named = named.filter_map(|(key, id)| Some((pickle.text(*key)?.to_owned(), *id)));
        let videos = listed
            .chain(named)
            .filter(|(_, id)| self.tracks_of(*id).is_some());
        let videos: Vec<(String, Id)> = videos.collect();
        match videos.is_empty() {
            true => Err(Error::input(format!(
                "no tracks of points{}; expected `points` and `occluded`, or `tracks` and `visibility`, of one video or in \
                 a dictionary or a list of videos",
                self.found()
            ))),
            false => Ok(videos),
        }
    }

    /// What the pickle holds instead, the first of it.
    fn found(&self) -> String {
        let keys = self.pickle.entries(self.pickle.root()).iter();
        let keys = keys.filter_map(|(key, _)| self.pickle.text(*key)).take(8);
        let keys: Vec<String> = keys.map(|key| format!("`{key}`")).collect();
        match (keys.is_empty(), self.pickle.class(self.pickle.root())) {
            (false, _) => format!(" among {}", keys.join(", ")),
            (true, Some(class)) => format!(" in the `{class}`"),
            (true, None) => String::new(),
        }
    }

    /// Under which name a video has its tracks.
    fn tracks_of(&self, video: Id) -> Option<(&'static str, Id)> {
        ["points", "tracks"]
            .into_iter()
            .find_map(|name| Some((name, self.pickle.get(video, name)?)))
    }

    fn video(&self, id: Id) -> Result<Video> {
        let missing = || Error::input("no `points` or `tracks`");
        let (name, tracks) = self.tracks_of(id).ok_or_else(missing)?;
        let beside = ["occluded", "visibles", "visibility"].into_iter();
        let beside = beside
            .filter_map(|name| Some((name, self.pickle.get(id, name)?)))
            .next();
        // TAP-Vid's arrays and TAPIR's are by point, CoTracker's by frame.
        let is_by_point = name == "points" || beside.is_some_and(|(name, _)| name != "visibility");
        let expected = if is_by_point { "[K, T" } else { "[T, K" };
        let tracks = self.array(tracks, name)?;
        let shape = tracks.shape().to_vec();
        let tracks = without_batch(tracks, 3).into_dimensionality::<Ix3>().ok();
        let mut xy = tracks.filter(|xy| xy.dim().2 == 2).ok_or_else(|| {
            Error::input(format!(
                "`{name}` has shape {shape:?}; expected {expected}, 2]"
            ))
        })?;
        let mut visible = None;
        if let Some((name, id)) = beside {
            let values = self.array(id, name)?;
            let shape = values.shape().to_vec();
            let values = without_batch(values, 2).into_dimensionality::<Ix2>().ok();
            let is_whole = |values: &Array2<f64>| values.dim() == (xy.dim().0, xy.dim().1);
            let values = values.filter(is_whole).ok_or_else(|| {
                Error::input(format!(
                    "`{name}` has shape {shape:?}; expected {expected}], as the positions have"
                ))
            })?;
            visible = Some(values.mapv(|value| (value != 0.0) != (name == "occluded")));
        }
        if is_by_point {
            xy.swap_axes(0, 1);
            visible = visible.map(Array2::reversed_axes);
        }
        let space = if name == "points" {
            Space::Fraction
        } else {
            Space::Pixels
        };
        Ok(Video { space, xy, visible })
    }

    /// An array that numpy pickled.
    fn array(&self, id: Id, name: &str) -> Result<ArrayD<f64>> {
        let not_read = || {
            Error::input(format!(
                "`{name}` is not a numpy array of numbers; expected one, pickled with protocol 3 or later"
            ))
        };
        let stored = self.stored(id).ok_or_else(not_read)?;
        let Node::Bytes(range) = self.pickle.node(stored.data) else {
            return Err(not_read());
        };
        let data = &self.bytes[range.clone()];
        let shape = self.sizes(stored.shape).ok_or_else(not_read)?;
        let is_by_column = match self.pickle.node(stored.order) {
            Node::Bool(is_by_column) => *is_by_column,
            Node::Text(order) => order == "F",
            _ => false,
        };
        let dtype = self.dtype(stored.dtype).ok_or_else(not_read)?;
        let sides = shape.iter().map(|n| *n as u64).collect();
        let header = Header::of(&dtype, is_by_column, sides, 0).ok_or_else(not_read)?;
        header.check(name, data.len() as u64)?;
        let values = match header.values(name, data)? {
            Values::U8(values) => values.into_iter().map(f64::from).collect(),
            Values::F32(values) => values.into_iter().map(f64::from).collect(),
            Values::F64(values) => values,
        };
        let array = ArrayD::from_shape_vec(shape, values).map_err(|_| not_read())?;
        let Some(axes) = stored.axes else {
            return Ok(array);
        };
        let axes = self.sizes(axes).ok_or_else(not_read)?;
        let mut all = axes.clone();
        all.sort_unstable();
        match all.into_iter().eq(0..array.ndim()) {
            true => Ok(array.permuted_axes(axes)),
            false => Err(not_read()),
        }
    }

    fn sizes(&self, id: Id) -> Option<Vec<usize>> {
        let sizes = self.pickle.items(id)?.iter();
        sizes.map(|size| self.pickle.size(*size)).collect()
    }

    /// The class of an object, the arguments that make it, and its state.
    fn object(&self, id: Id) -> Option<(&str, Id, Option<Id>)> {
        let Node::Object {
            arguments, state, ..
        } = self.pickle.node(id)
        else {
            return None;
        };
        Some((self.pickle.class(id)?, *arguments, *state))
    }

    /// The parts of an array in any way in which numpy pickles one.
    fn stored(&self, id: Id) -> Option<Stored> {
        let (class, arguments, state) = self.object(id)?;
        if class.ends_with("multiarray._reconstruct") {
            let &[_, shape, dtype, order, data] = self.pickle.items(state?)? else {
                return None;
            };
            return Some(Stored {
                data,
                dtype,
                shape,
                order,
                axes: None,
            });
        }
        if !class.ends_with("numeric._frombuffer") {
            return None;
        }
        let (data, dtype, shape, order, axes) = match *self.pickle.items(arguments)? {
            [data, dtype, shape, order] => (data, dtype, shape, order, None),
            [data, dtype, shape, order, axes] => (data, dtype, shape, order, Some(axes)),
            _ => return None,
        };
        Some(Stored {
            data,
            dtype,
            shape,
            order,
            axes,
        })
    }

    /// A type as `.npy` files write it, e.g. `<f4`.
    fn dtype(&self, id: Id) -> Option<String> {
        let (class, arguments, state) = self.object(id)?;
        let code = self.pickle.text(*self.pickle.items(arguments)?.first()?)?;
        let order = state.and_then(|state| self.pickle.text(*self.pickle.items(state)?.get(1)?));
        (class == "numpy.dtype").then(|| format!("{}{code}", order.unwrap_or("|")))
    }
}
