//! `tracklens data convert` of points: any file of them into a table or arrays.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::files::{TruthArguments, is_folder_of_images};
use crate::atomic;
use crate::data::{
    Columns, NpzWriter, SequenceRange, coco_json, deeplabcut_csv, ground_truth_csv, keypoints_csv,
    ranges,
};
use crate::error::{Error, Result};
use crate::track::{GroundTruth, KeypointTrack};

#[derive(Debug, Args)]
pub(super) struct ConvertArguments {
    /// Folder of image sequences, one folder a sequence, a recording (.npz, .hdf5, .zarr), or a file
    /// of points
    pub input: PathBuf,
    /// What to write; must not exist yet
    pub out: PathBuf,
    /// Form of OUT; default: by its ending, .npz for npz, .csv for tidy, .json for coco, otherwise
    /// folder
    #[arg(long, value_name = "FORM")]
    pub to: Option<Target>,
    /// INPUT holds keypoints of a detector
    #[arg(long)]
    pub keypoints: bool,
    /// Which column of INPUT is what, where they have other names (e.g.
    /// x=px,y=py,frame=t,object=label)
    #[arg(long, value_name = "NAME=COLUMN,…")]
    pub columns: Option<Columns>,
    #[command(flatten)]
    pub common: CommonArguments,
}

#[derive(Debug, Args)]
pub(super) struct CommonArguments {
    /// Ground truth; default: ground_truth.csv in the folder, or the points of the recording
    #[arg(long, value_name = "GT.csv")]
    pub truth: Option<PathBuf>,
    #[command(flatten)]
    pub reading: TruthArguments,
    /// No progress bar
    #[arg(long)]
    pub quiet: bool,
}

/// What is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Target {
    /// A folder of PNG images with ground_truth.csv
    Folder,
    /// NPZ arrays, frames included where there are any
    Npz,
    /// CSV, one row a point, in ndc (with z in the unit of INPUT)
    Tidy,
    /// COCO keypoints, JSON, in pixels
    Coco,
    /// DeepLabCut's CSV of labels, in pixels
    Deeplabcut,
}

impl Target {
    /// What the ending of a file asks for.
    pub fn of(out: &Path) -> Self {
        let ending = out.extension().unwrap_or_default().to_string_lossy();
        match ending.to_ascii_lowercase().as_str() {
            "npz" => Self::Npz,
            "csv" => Self::Tidy,
            "json" => Self::Coco,
            _ => Self::Folder,
        }
    }
}

/// Points of either kind.
enum Points {
    Truth(GroundTruth),
    Keypoints(KeypointTrack),
}

impl Points {
    /// The same as points with names; keypoints have their numbers.
    fn named(self) -> Result<GroundTruth> {
        match self {
            Self::Truth(points) => Ok(points),
            Self::Keypoints(track) => {
                let names = (0..track.keypoints()).map(|n| n.to_string()).collect();
                let points =
                    GroundTruth::new(track.keys().to_vec(), names, track.points().clone())?;
                points.with_confidence(track.confidence().cloned())
            }
        }
    }
}

/// Writes the points of the input.
pub(super) fn write_points(arguments: &ConvertArguments, target: Target) -> Result<()> {
    let reading = &arguments.common.reading;
    let input = &arguments.input;
    let mut image_size = reading.image_size;
    let points = match is_folder_of_images(input) {
        true => {
            let frames = reading.open(input)?;
            let first = frames.read(0)?;
            image_size = image_size.or(Some([first.width(), first.height()]));
            let truth = arguments.common.truth.as_deref();
            Points::Truth(
                reading
                    .need(truth, None, input, &*frames, "a table")?
                    .points,
            )
        }
        false if arguments.keypoints => {
            Points::Keypoints(reading.read_keypoints(input, arguments.columns.as_ref())?)
        }
        false => {
            let truth = reading.read(input, arguments.columns.as_ref())?;
            let own = truth.reading.and_then(|reading| reading.image_size);
            image_size = image_size.or(own);
            Points::Truth(truth.points)
        }
    };
    let out = &arguments.out;
    let size = || {
        image_size.ok_or_else(|| {
            Error::input(
                "it has positions in pixels, and the size of the images is not known; give the size \
                 with --image-size WIDTHxHEIGHT",
            )
            .at(out.display())
        })
    };
    let (frames, bytes) = match (target, points) {
        (Target::Tidy, Points::Keypoints(track)) => {
            (track.keys().len(), keypoints_csv(&track).into_bytes())
        }
        (target, points) => {
            let points = points.named()?;
            let points = match target {
                Target::Coco => points.in_image("COCO")?,
                Target::Deeplabcut => points.in_image("DeepLabCut's table of labels")?,
                _ => points,
            };
            let bytes = match target {
                Target::Tidy => ground_truth_csv(&points).into_bytes(),
                Target::Npz => npz(&points)?,
                Target::Coco => coco_json(&points, size()?)?.into_bytes(),
                Target::Deeplabcut => deeplabcut_csv(&points, size()?)?,
                Target::Folder => {
                    return Err(Error::input(
                        "it has no frames to be written into a folder; expected a name that ends in .csv, .npz or .json, or \
                         --to",
                    )
                    .at(input.display()));
                }
            };
            if target == Target::Coco && points.confidence().is_some() {
                eprintln!("note: COCO keypoints have no confidences; they are left out");
            }
            (points.keys().len(), bytes)
        }
    };
    atomic::write(out, &bytes)?;
    eprintln!("points of {frames} frames written to {}", out.display());
    Ok(())
}

/// Points as arrays `keypoints`, S x T x K x 2 in ndc (in space 3), `names`, and `confidence` where there is one.
/// Frames without points are NaN.
fn npz(points: &GroundTruth) -> Result<Vec<u8>> {
    let sequences = ranges(points.keys());
    let frames = |range: &SequenceRange| range.start..range.start + range.length;
    let numbers = sequences
        .iter()
        .flat_map(|range| points.keys()[frames(range)].iter().map(|key| key.frame));
    let length = numbers.max().map_or(0, |last| last + 1);
    let objects = points.names().len();
    let rows = (sequences.len() as u64).saturating_mul(length);
    if rows > 16 * points.keys().len() as u64 + 1024 {
        return Err(Error::input(format!(
            "{} frames have numbers up to {}; an array has all of them: write a table, or count the frames from 0 \
             (--index-base)",
            points.keys().len(),
            length.saturating_sub(1)
        )));
    }
    let length = length as usize;
    let renamed = sequences
        .iter()
        .enumerate()
        .any(|(s, range)| range.name != format!("seq_{s:04}"));
    if renamed {
        eprintln!("note: an array has no names of sequences: they become seq_0000, seq_0001, …");
    }
    let empty = rows as usize - points.keys().len();
    if empty > 0 {
        eprintln!("note: {empty} frames without a row become frames in which nothing is visible");
    }
    let axes = points.axes();
    let mut xy = ndarray::Array4::from_elem((sequences.len(), length, objects, axes), f64::NAN);
    let shape = (sequences.len(), length, objects);
    let mut confidence = ndarray::Array3::from_elem(shape, f64::NAN);
    for (s, range) in sequences.iter().enumerate() {
        for t in frames(range) {
            let place = [s, points.keys()[t].frame as usize];
            let mut row = xy.index_axis_mut(ndarray::Axis(0), place[0]);
            row.index_axis_mut(ndarray::Axis(0), place[1])
                .assign(&points.frame(t));
            if let Some(given) = points.confidence() {
                let mut row = confidence.index_axis_mut(ndarray::Axis(0), place[0]);
                row.row_mut(place[1]).assign(&given.row(t));
            }
        }
    }
    let mut npz = NpzWriter::new(Cursor::new(Vec::new()));
    npz.floats("keypoints", xy.shape(), xy.iter().copied())?;
    npz.strings("names", points.names())?;
    if points.confidence().is_some() {
        npz.floats("confidence", confidence.shape(), confidence.iter().copied())?;
    }
    npz.finish().map(Cursor::into_inner)
}
