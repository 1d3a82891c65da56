//! Folders of frames, recordings and tables by their paths.

use std::collections::{BTreeMap, HashSet};
use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;

use super::hints::hint;
use crate::command_line;
use crate::data::{
    AxisOrder, Columns, Flip, Frame, FrameIndex, FrameSource, Ground, HDF5_MAGIC, Layout,
    NPY_MAGIC, Notice, NpyArray, PARQUET_MAGIC, Parsed, Reading, Recording, Space, TableOptions,
    ZIP_MAGIC, ZarrStore, ZipStore, describes_zarr, export_parquet, export_pickle,
    ground_truth_of_arrays, keypoints_of_arrays, parse_ground_truth, parse_keypoints,
    parse_npz_ground_truth, parse_npz_keypoints, read_hdf5_ground_truth, read_hdf5_keypoints,
    read_zarr_ground_truth, read_zarr_keypoints,
};
use crate::error::{Error, ErrorKind, Reason, Result, without_controls};
use crate::pickle::is_pickle;
use crate::track::{GroundTruth, KeypointTrack};
use crate::weights::read;

/// Folders below the given one that are searched for frames.
const DEPTH: usize = 8;

/// Files and folders left out that are named one by one.
const SHOWN: usize = 10;

/// Whether both are the same file; a file that is not there yet is none.
pub(super) fn is_same(a: &Path, b: &Path) -> bool {
    let [a, b] = [a, b].map(Path::canonicalize);
    matches!((a, b), (Ok(a), Ok(b)) if a == b)
}

/// How points are read from tables and recordings, and which of them count.
#[derive(Debug, Args)]
pub(super) struct TruthArguments {
    /// Order of coordinates in points: xy or yx; default: what the file says, else xy
    #[arg(long, value_name = "ORDER")]
    axis_order: Option<AxisOrder>,
    /// Only these objects of the ground truth, in this order (e.g. cube,target,eef); default: all
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    objects: Vec<String>,
    /// Unit of the ground truth's positions: ndc (-1 to +1 across the image), px or fraction (0 to 1
    /// across the image); default: px for DeepLabCut and COCO, otherwise ndc
    #[arg(long, value_name = "SPACE")]
    space: Option<Space>,
    /// Number of the first frame in the ground truth; default: 0
    #[arg(long, value_name = "N")]
    index_base: Option<u64>,
    /// Axes of the ground truth that run the other way: x, y (where y points up), xy or none
    #[arg(long, value_name = "AXES")]
    flip: Option<Flip>,
    /// Take positions of exactly (0, 0) in the ground truth for missing
    #[arg(long)]
    zero_is_missing: bool,
    /// Leave z out of points with three coordinates and score x and y alone, of ground truth and
    /// keypoints; default: they are scored in space
    #[arg(long)]
    xy_only: bool,
    /// Array of the frames in a recording, where there are several, as of two cameras; default:
    /// images or frames, or the only one
    #[arg(long, value_name = "NAME")]
    array: Option<String>,
    /// Size of the images in pixels, for positions and errors in pixels; default: that of the
    /// frames, where there are any
    #[arg(long = command_line::IMAGE_SIZE, value_name = "WxH", value_parser = super::values::parse_size)]
    pub image_size: Option<[u32; 2]>,
}

/// A ground truth, and what its numbers were taken for where it came from a file of its own.
pub(super) struct Truth {
    pub points: GroundTruth,
    pub reading: Option<Reading>,
}

impl TruthArguments {
    /// The ground truth of `truth`, or the one that lies with the frames at `path`; None where
    /// there is none. `columns` says which column is what, or which array of the recording.
    pub fn find(
        &self,
        truth: Option<&Path>,
        columns: Option<&Columns>,
        path: &Path,
        frames: &dyn FrameSource,
    ) -> Result<Option<Truth>> {
        let beside = path.join("ground_truth.csv");
        // Columns without a table are arrays of the recording.
        let is_recording = |path: &&Path| path.is_file() || is_zarr_folder(path);
        let truth = truth.or(columns.map(|_| path).filter(is_recording));
        let found = match (truth, frames.truth()) {
            (Some(truth), _) => self.read_beside(truth, columns, frames)?,
            (None, Some(own)) => {
                tell(path, frames.notices());
                self.select(own.clone(), None)?
            }
            (None, None) if beside.is_file() => self.read_beside(&beside, columns, frames)?,
            (None, None) => {
                // Of points that are there and cannot be used.
                tell(path, frames.notices());
                return Ok(None);
            }
        };
        Ok(Some(found))
    }

    /// As [`TruthArguments::find`], where `purpose` needs one.
    pub fn need(
        &self,
        truth: Option<&Path>,
        columns: Option<&Columns>,
        path: &Path,
        frames: &dyn FrameSource,
        purpose: &str,
    ) -> Result<Truth> {
        self.find(truth, columns, path, frames)?.ok_or_else(|| {
            Error::new(
                ErrorKind::Io,
                format!(
                    "no ground truth lies with the frames, and {purpose} needs one; expected a file ground_truth.csv in \
                     a folder, an array `keypoints` or `sites` in a recording, or --truth GT.csv"
                ),
            )
            .at(path.display())
        })
    }

    /// As [`TruthArguments::need`], of positions in the image.
    pub fn need_in_image(
        &self,
        truth: Option<&Path>,
        path: &Path,
        frames: &dyn FrameSource,
        purpose: &str,
    ) -> Result<Truth> {
        let Truth { points, reading } = self.need(truth, None, path, frames, purpose)?;
        let points = points.in_image(purpose)?;
        Ok(Truth { points, reading })
    }

    /// Reads a table whose positions belong to `frames`.
    fn read_beside(
        &self,
        path: &Path,
        columns: Option<&Columns>,
        frames: &dyn FrameSource,
    ) -> Result<Truth> {
        let truth = self.read_sized(path, columns, || {
            // Frames that cannot be read are told when it is their turn.
            let frame = frames.read(0).ok()?;
            Some([frame.width(), frame.height()])
        })?;
        let needs_size = truth.reading.is_some_and(|reading| {
            // A COCO file has the size of every image.
            reading.space.value == Space::Pixels && reading.layout != Layout::Coco
        });
        if needs_size
            && self.image_size.is_none()
            && let Some((i, [[width, height], [w, h]])) = frames.other_size()
        {
            return Err(Error::mismatch(format!(
                "{}: the frame has {w} x {h} pixels, and the first one {width} x {height}, so that positions in pixels \
                 have no common size; give them as fractions of their own image with --space fraction, or the size \
                 that they all belong to with --image-size WxH",
                frames.index().keys()[i]
            ))
            .at(path.display()));
        }
        Ok(truth)
    }

    /// Reads a table, whose `columns` may be named, or the points of another file.
    pub fn read(&self, path: &Path, columns: Option<&Columns>) -> Result<Truth> {
        self.read_sized(path, columns, || None)
    }

    /// As [`TruthArguments::read`], of keypoints that are read with the same options.
    pub fn read_keypoints(&self, path: &Path, columns: Option<&Columns>) -> Result<KeypointTrack> {
        keypoints_of(path, &self.options(), columns).map(|table| table.content)
    }

    fn read_sized(
        &self,
        path: &Path,
        columns: Option<&Columns>,
        size: impl FnOnce() -> Option<[u32; 2]>,
    ) -> Result<Truth> {
        let kind = Kind::of(path)?;
        // Arrays that a person names may be on the board of a simulator: its size has to be said.
        let is_named = columns.is_some() && matches!(kind, Kind::Hdf5 | Kind::Zarr);
        let options = TableOptions {
            image_size: self.image_size.or_else(|| size().filter(|_| !is_named)),
            ..self.options()
        };
        let name = path.to_string_lossy();
        let table = match kind {
            Kind::Zarr => zarr_store(path)
                .and_then(|store| read_zarr_ground_truth(store, columns, &options))
                .map_err(|e| e.at(path.display()))?,
            Kind::Npz => parse_npz_ground_truth(&read(path)?, &name, &options)?,
            Kind::Hdf5 => read_hdf5_ground_truth(open(path)?, &name, columns, &options)?,
            Kind::Pickle => export_pickle(&read(path)?)
                .and_then(|table| table.renamed(columns, false))
                .map_err(|e| e.at(path.display()))?
                .ground_truth(&name, &options)?,
            Kind::Parquet => export_parquet(read(path)?)
                .and_then(|table| table.renamed(columns, false))
                .map_err(|e| e.at(path.display()))?
                .ground_truth(&name, &options)?,
            Kind::Npy => ground_truth_of_arrays(vec![NpyArray::alone(read(path)?)], &options)
                .map_err(|e| e.at(path.display()))?,
            Kind::Other => parse_ground_truth(&read_table(path, columns, false)?, &name, &options)?,
        };
        tell(path, &table.notices);
        if let (Some([w, h]), Some([width, height])) = (self.image_size, table.reading.image_size)
            && [w, h] != [width, height]
        {
            return Err(Error::mismatch(format!(
                "its images have {width} x {height} pixels, and --image-size says {w}x{h}; leave the option out"
            ))
            .at(path.display()));
        }
        self.select(table.content, Some(table.reading))
    }

    fn options(&self) -> TableOptions {
        TableOptions {
            space: self.space,
            axes: self.axis_order,
            index_base: self.index_base,
            first_keypoint: None,
            image_size: self.image_size,
            flip: self.flip,
            zero_is_missing: self.zero_is_missing.then_some(true),
            xy_only: self.xy_only,
        }
    }

    fn select(&self, points: GroundTruth, reading: Option<Reading>) -> Result<Truth> {
        let points = match self.objects[..] {
            [] => points,
            _ => points.select(&self.objects)?,
        };
        Ok(Truth { points, reading })
    }

    /// Whether a file holds frames as arrays, as far as they can be read.
    pub fn is_recording(&self, path: &Path) -> Result<bool> {
        let Some(recording) = self.recording(path)? else {
            return Ok(false);
        };
        let why_not = recording.err();
        Ok(why_not.is_none_or(|e| e.reason() != Some(&Reason::NoFrames)))
    }

    /// A recording, as far as it can be read; None where the file is none.
    fn recording(&self, path: &Path) -> Result<Option<Result<Recording>>> {
        let (array, options) = (self.array.as_deref(), self.options());
        Ok(match Kind::of(path)? {
            Kind::Zarr => Some(
                zarr_store(path).and_then(|store| Recording::from_zarr(store, array, &options)),
            ),
            Kind::Npz => Some(Recording::from_npz(
                BufReader::new(open(path)?),
                array,
                &options,
            )),
            Kind::Hdf5 => Some(Recording::from_hdf5_file(open(path)?, array, &options)),
            Kind::Npy | Kind::Pickle | Kind::Parquet | Kind::Other => None,
        })
    }

    /// Opens a folder of images or a recording; says what is left out.
    pub fn open(&self, path: &Path) -> Result<Arc<dyn FrameSource>> {
        if is_folder_of_images(path) {
            let folder = Folder::open(path)?;
            let ignored = folder.ignored();
            if let Some(first) = ignored.first() {
                let more = if ignored.len() > 1 { ", …" } else { "" };
                note(&format!(
                    "left out {} file(s) that are not images: {}{more}",
                    ignored.len(),
                    first.display()
                ));
            }
            for (path, why) in folder.skipped.iter().take(SHOWN) {
                note(&format!("left out {}: {why}", path.display()));
            }
            if let Some(more) = folder.skipped.len().checked_sub(SHOWN).filter(|n| *n > 0) {
                note(&format!("left out {more} more"));
            }
            return Ok(Arc::new(folder));
        }
        let recording = self.recording(path)?.unwrap_or_else(|| {
            Err(Error::input(
                "neither a folder nor a recording; expected a folder of images, an NPZ, HDF5 or \
                 Zarr file",
            ))
        });
        let recording = recording.map_err(|e| e.at(path.display()))?;
        Ok(Arc::new(Placed {
            place: path.display().to_string(),
            recording,
        }))
    }
}

/// A recording whose errors name its file.
struct Placed {
    place: String,
    recording: Recording,
}

impl FrameSource for Placed {
    fn index(&self) -> &FrameIndex {
        self.recording.index()
    }

    fn read(&self, i: usize) -> Result<Frame> {
        self.recording.read(i).map_err(|e| e.at(&self.place))
    }

    fn truth(&self) -> Option<&GroundTruth> {
        self.recording.truth()
    }

    fn notices(&self) -> &[Notice] {
        self.recording.notices()
    }

    fn verify(&self) -> Result<()> {
        self.recording.verify().map_err(|e| e.at(&self.place))
    }

    fn has_floats(&self) -> bool {
        self.recording.has_floats()
    }
}

/// What a file of points or frames is, by its first bytes.
enum Kind {
    Zarr,
    Npz,
    Hdf5,
    Npy,
    Pickle,
    Parquet,
    Other,
}

impl Kind {
    fn of(path: &Path) -> Result<Self> {
        if is_zarr_folder(path) {
            return Ok(Self::Zarr);
        }
        let mut head = Vec::new();
        open(path)?
            .take(8)
            .read_to_end(&mut head)
            .map_err(|e| Error::io(path.display(), &e))?;
        let kind = Self::of_bytes(&head);
        // Both are ZIP archives; one that is damaged is told by the reader of NPZ.
        let is_zarr = matches!(kind, Self::Npz)
            && ZipStore::open(BufReader::new(open(path)?)).is_ok_and(|store| store.is_some());
        Ok(if is_zarr { Self::Zarr } else { kind })
    }

    fn of_bytes(head: &[u8]) -> Self {
        match head {
            _ if head.starts_with(ZIP_MAGIC) => Self::Npz,
            _ if head.starts_with(HDF5_MAGIC) => Self::Hdf5,
            _ if head.starts_with(NPY_MAGIC) => Self::Npy,
            _ if head.starts_with(PARQUET_MAGIC) => Self::Parquet,
            _ if is_pickle(head) => Self::Pickle,
            _ => Self::Other,
        }
    }
}

/// Whether a path is a folder that may hold images: no Zarr hierarchy.
pub(super) fn is_folder_of_images(path: &Path) -> bool {
    path.is_dir() && !is_zarr_folder(path)
}

/// Whether a folder is a Zarr hierarchy.
fn is_zarr_folder(path: &Path) -> bool {
    let files = std::fs::read_dir(path).into_iter().flatten().flatten();
    let mut names = files.map(|file| file.file_name());
    names.any(|name| name.to_str().is_some_and(describes_zarr))
}

/// The files of a Zarr hierarchy, in a folder or a ZIP archive.
fn zarr_store(path: &Path) -> Result<Box<dyn ZarrStore>> {
    if path.is_dir() {
        return Ok(Box::new(FolderStore::open(path)?));
    }
    match ZipStore::open(BufReader::new(open(path)?))? {
        Some(store) => Ok(Box::new(store)),
        None => Err(Error::input("there is no Zarr array in the archive")),
    }
}

/// A Zarr hierarchy in a folder.
struct FolderStore {
    /// By their keys, paths with `/`.
    files: BTreeMap<String, PathBuf>,
    size: u64,
}

impl FolderStore {
    fn open(folder: &Path) -> Result<Self> {
        let mut walk = Walk::default();
        walk.visit(folder, DEPTH)
            .map_err(|e| Error::io(folder.display(), &e))?;
        let mut store = Self {
            files: BTreeMap::new(),
            size: 0,
        };
        for path in walk.files {
            let below = path.strip_prefix(folder).unwrap_or(&path);
            let parts = below.iter().map(|part| part.to_string_lossy().into_owned());
            let key = parts.collect::<Vec<_>>().join("/");
            let about = path.metadata().map_err(|e| Error::io(path.display(), &e))?;
            store.size += about.len();
            store.files.insert(key, path);
        }
        Ok(store)
    }
}

impl ZarrStore for FolderStore {
    fn keys(&self) -> Vec<String> {
        self.files.keys().cloned().collect()
    }

    fn has(&self, key: &str) -> bool {
        self.files.contains_key(key)
    }

    fn read(&self, key: &str) -> Result<Vec<u8>> {
        match self.files.get(key) {
            Some(path) => read(path),
            None => Err(Error::input(format!("there is no file `{key}`"))),
        }
    }

    fn size(&self) -> u64 {
        self.size
    }
}

/// The frames of a folder.
struct Folder {
    index: FrameIndex,
    paths: Vec<PathBuf>,
    /// What could not be searched or read, and why.
    skipped: Vec<(PathBuf, String)>,
}

impl FrameSource for Folder {
    fn index(&self) -> &FrameIndex {
        &self.index
    }

    fn read(&self, i: usize) -> Result<Frame> {
        let path = &self.paths[self.index.order()[i]];
        Frame::decode(&read(path)?).map_err(|e| e.at(path.display()))
    }

    fn other_size(&self) -> Option<(usize, [[u32; 2]; 2])> {
        let size = |i: usize| Frame::size_of(&read(&self.paths[self.index.order()[i]]).ok()?);
        let first = size(0)?;
        let others = (1..self.index.keys().len()).filter_map(|i| Some((i, size(i)?)));
        let mut differing = others.filter(|(_, other)| *other != first);
        differing.next().map(|(i, other)| (i, [first, other]))
    }
}

impl Folder {
    /// Finds the frames below `folder`: one folder a sequence, or the images of the folder itself.
    fn open(folder: &Path) -> Result<Self> {
        let mut walk = Walk::default();
        walk.visit(folder, DEPTH)
            .map_err(|e| Error::io(folder.display(), &e))?;
        let Walk {
            files: paths,
            skipped,
            ..
        } = walk;
        // With the folder's own name: images that lie in it directly are the sequence of that name.
        let own = folder
            .canonicalize()
            .map_err(|e| Error::io(folder.display(), &e))?;
        // The root of a file system has no name.
        let own = own.file_name().map_or_else(
            || "root".to_owned(),
            |name| name.to_string_lossy().into_owned(),
        );
        let relative = |path: &PathBuf| {
            let below = path.strip_prefix(folder).unwrap_or(path);
            let parts = below.iter().map(|part| part.to_string_lossy().into_owned());
            std::iter::once(own.clone())
                .chain(parts)
                .collect::<Vec<_>>()
                .join("/")
        };
        let names: Vec<String> = paths.iter().map(relative).collect();
        let index = FrameIndex::new(&names).map_err(|e| e.at(folder.display()))?;
        Ok(Self {
            index,
            paths,
            skipped,
        })
    }

    /// The files that are neither images nor the ground truth.
    fn ignored(&self) -> Vec<&Path> {
        let paths = self
            .index
            .ignored()
            .iter()
            .map(|i| self.paths[*i].as_path());
        paths
            .filter(|path| !path.ends_with("ground_truth.csv") && !path.ends_with(EPISODES))
            .collect()
    }
}

/// The file of a data set that has the episode of every sequence.
pub(super) const EPISODES: &str = "sequences.csv";

/// What lies in a folder and below it.
#[derive(Default)]
struct Walk {
    files: Vec<PathBuf>,
    /// What is left out, and why.
    skipped: Vec<(PathBuf, String)>,
    /// Files and folders that were visited.
    visited: HashSet<Place>,
}

/// What a path leads to, however many names it has.
#[derive(PartialEq, Eq, Hash)]
struct Place {
    /// Device and number, where the system has such.
    #[cfg(unix)]
    inode: (u64, u64),
    #[cfg(not(unix))]
    path: PathBuf,
}

impl Place {
    fn of(path: &Path) -> std::io::Result<Self> {
        #[cfg(unix)]
        {
            use std::os::unix::fs::MetadataExt as _;
            let found = std::fs::metadata(path)?;
            Ok(Self {
                inode: (found.dev(), found.ino()),
            })
        }
        #[cfg(not(unix))]
        {
            let path = path.canonicalize()?;
            Ok(Self { path })
        }
    }
}

impl Walk {
    /// Visits `folder` and what is below it, each file and folder once. Follows links, so that a data set may be
    /// linked together, after everything else in a folder, so that a folder keeps its own name.
    fn visit(&mut self, folder: &Path, depth: usize) -> std::io::Result<()> {
        self.visited.insert(Place::of(folder)?);
        let mut paths = std::fs::read_dir(folder)?
            .map(|entry| Ok(entry?.path()))
            .collect::<std::io::Result<Vec<PathBuf>>>()?;
        paths.sort_by_cached_key(|path| (path.is_symlink(), path.clone()));
        for path in paths {
            if let Err(why) = self.take(&path, depth) {
                self.skipped.push((path, why));
            }
        }
        Ok(())
    }

    fn take(&mut self, path: &Path, depth: usize) -> Result<(), String> {
        let failed = |e: std::io::Error| match path.is_symlink() && !path.exists() {
            true => "a link to nothing".to_owned(),
            false => e.to_string(),
        };
        let found = std::fs::metadata(path).map_err(failed)?;
        if found.is_file() {
            if !self.visited.insert(Place::of(path).map_err(failed)?) {
                return Err("a file that is in the data set already".to_owned());
            }
            self.files.push(path.to_owned());
            return Ok(());
        }
        if !found.is_dir() {
            return Err("not a regular file".to_owned());
        }
        if self.visited.contains(&Place::of(path).map_err(failed)?) {
            return Err("a folder that is in the data set already".to_owned());
        }
        match depth {
            0 => Err(format!("more than {DEPTH} folders deep")),
            _ => self.visit(path, depth - 1).map_err(failed),
        }
    }
}

fn open(path: &Path) -> Result<File> {
    File::open(path).map_err(|e| Error::io(path.display(), &e))
}

/// Reads a file; of a table whose `columns` are named, with the names that are expected.
fn read_table(path: &Path, columns: Option<&Columns>, is_keypoints: bool) -> Result<Vec<u8>> {
    let bytes = read(path)?;
    match columns {
        Some(columns) => columns
            .apply(&bytes, is_keypoints)
            .map_err(|e| e.at(path.display())),
        None => Ok(bytes),
    }
}

/// What keypoints are read with in place of the ground truth's options.
#[derive(Debug, Args)]
pub(super) struct KeypointsReading {
    /// Unit of the keypoints: ndc, px or fraction; default: px for DeepLabCut and COCO, otherwise ndc
    #[arg(long = "keypoints-space", value_name = "SPACE")]
    keypoints_space: Option<Space>,
    /// Number of the first frame, and in a table with one row a point of the first keypoint;
    /// default: 0
    #[arg(long = "keypoints-index-base", value_name = "N")]
    keypoints_index_base: Option<u64>,
    /// Number of the first keypoint in a table with one row a point; default: that of the first
    /// frame
    #[arg(long, value_name = "N")]
    first_keypoint: Option<u64>,
    /// Order of coordinates of the keypoints: xy or yx; default: --axis-order
    #[arg(long = "keypoints-axis-order", value_name = "ORDER")]
    keypoints_axis_order: Option<AxisOrder>,
    /// Axes of the keypoints that run the other way: x, y (where y points up), xy or none
    #[arg(long = "keypoints-flip", value_name = "AXES")]
    keypoints_flip: Option<Flip>,
    /// Which column of the keypoints is what, where they have other names (e.g.
    /// x=px,y=py,frame=t,keypoint=id)
    #[arg(long = "keypoints-columns", value_name = "NAME=COLUMN,…")]
    keypoints_columns: Option<Columns>,
    /// Take keypoints at exactly (0, 0) for missing
    #[arg(long = "keypoints-zero-is-missing")]
    keypoints_zero_is_missing: bool,
}

/// Reads keypoints: a table, or the points of an NPZ file. `image_size` is that of the images, where
/// it is known.
pub(super) fn read_keypoints(
    path: &Path,
    arguments: &TruthArguments,
    reading: &KeypointsReading,
    image_size: Option<[u32; 2]>,
) -> Result<Parsed<KeypointTrack>> {
    let options = TableOptions {
        space: reading.keypoints_space,
        index_base: reading.keypoints_index_base,
        first_keypoint: reading.first_keypoint,
        axes: reading.keypoints_axis_order.or(arguments.axis_order),
        image_size,
        flip: reading.keypoints_flip,
        zero_is_missing: reading.keypoints_zero_is_missing.then_some(true),
        xy_only: arguments.xy_only,
    };
    let mut parsed = keypoints_of(path, &options, reading.keypoints_columns.as_ref())?;
    if reading.keypoints_axis_order.is_none() && arguments.axis_order.is_some() {
        // What was said of both sides together may be meant of one: it can be questioned.
        parsed.reading.axes.by = Ground::Guess;
    }
    Ok(parsed)
}

/// Keypoints of a file of any kind.
fn keypoints_of(
    path: &Path,
    options: &TableOptions,
    columns: Option<&Columns>,
) -> Result<Parsed<KeypointTrack>> {
    let name = path.to_string_lossy();
    let table = match Kind::of(path)? {
        Kind::Hdf5 => read_hdf5_keypoints(open(path)?, &name, columns, options)?,
        Kind::Pickle => export_pickle(&read(path)?)
            .and_then(|table| table.renamed(columns, true))
            .map_err(|e| e.at(path.display()))?
            .keypoints(&name, options)?,
        Kind::Parquet => export_parquet(read(path)?)
            .and_then(|table| table.renamed(columns, true))
            .map_err(|e| e.at(path.display()))?
            .keypoints(&name, options)?,
        Kind::Zarr => zarr_store(path)
            .and_then(|store| read_zarr_keypoints(store, options))
            .map_err(|e| e.at(path.display()))?,
        Kind::Npz => parse_npz_keypoints(&read(path)?, &name, options)?,
        Kind::Npy => keypoints_of_arrays(vec![NpyArray::alone(read(path)?)], options)
            .map_err(|e| e.at(path.display()))?,
        Kind::Other => parse_keypoints(&read_table(path, columns, true)?, &name, options)?,
    };
    tell(path, &table.notices);
    Ok(table)
}

fn tell(path: &Path, notices: &[Notice]) {
    for notice in notices {
        let hint = notice.reason.as_ref().and_then(hint);
        let hint = hint.map(|hint| format!("; {hint}")).unwrap_or_default();
        note(&format!("{}: {notice}{hint}", path.display()));
    }
}

/// Writes a note to standard error; names in it must not give orders to the terminal.
fn note(text: &str) {
    eprintln!("note: {}", without_controls(text));
}
