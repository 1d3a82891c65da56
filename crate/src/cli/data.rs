//! `tracklens data`: what is in a data set, and from one format into another.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufWriter, IsTerminal as _};
use std::path::{Component, Path, PathBuf};

use clap::{Args, Subcommand};
use comfy_table::CellAlignment;
use comfy_table::presets::UTF8_HORIZONTAL_ONLY;
use ndarray::ArrayView1;
use serde::Serialize;

use super::convert::{CommonArguments, ConvertArguments, Target, write_points};
use super::extract::{cancel_on_interrupt, progress_bar, show};
use super::files::is_folder_of_images;
use super::terminal::say_json;
use crate::atomic;
use crate::data::{
    self, Frame, FrameSource, Join, NpzWriter, Pixels, SequenceRange, ground_truth_csv, join,
};
use crate::error::{Error, ErrorKind, Result};
use crate::evaluation::JoinReport;
use crate::event::{Cancel, Event};
use crate::track::{FrameKey, GroundTruth};

/// Unreadable frames that are told one by one.
const SHOWN: usize = 10;

#[derive(Debug, Subcommand)]
pub(super) enum DataCommand {
    /// Say what a data set holds: sequences, sizes, ground truth, what does not fit. Decodes every
    /// frame.
    Inspect(InspectArguments),
    /// Write a data set as a folder of PNG images with ground_truth.csv or as an NPZ recording, or
    /// the points of any file as CSV, NPZ, COCO keypoints or DeepLabCut's CSV.
    Convert(ConvertArguments),
}

#[derive(Debug, Args)]
pub(super) struct InspectArguments {
    /// Folder of image sequences, one folder a sequence, or a recording (.npz, .hdf5, .zarr)
    path: PathBuf,
    #[command(flatten)]
    common: CommonArguments,
    /// Print JSON (the default when the output is not a terminal)
    #[arg(long)]
    json: bool,
}

pub(super) fn run(command: &DataCommand) -> Result<()> {
    match command {
        DataCommand::Inspect(arguments) => inspect(arguments),
        DataCommand::Convert(arguments) => convert(arguments),
    }
}

/// Does something with every frame, neighbours together, and gives the results in order, block by
/// block.
fn for_blocks<T: Send>(
    what: &str,
    frames: usize,
    quiet: bool,
    cancel: &Cancel,
    one: impl Fn(usize) -> Result<T> + Sync,
    mut block_done: impl FnMut(Vec<Result<T>>) -> Result<()>,
) -> Result<()> {
    let bar = progress_bar(quiet);
    show(
        &bar,
        &Event::Started {
            what: what.to_owned(),
            total: frames as u64,
        },
    );
    let mut finished = 0;
    data::for_blocks(0..frames, cancel, one, |block| {
        finished += block.len() as u64;
        block_done(block)?;
        let event = Event::Progress {
            done: finished,
            note: String::new(),
        };
        show(&bar, &event);
        Ok(())
    })?;
    show(&bar, &Event::Done);
    Ok(())
}

/// What `inspect` prints as JSON. Schema 1 had its keys in camelCase.
#[derive(Debug, Serialize)]
struct Inspection {
    schema: &'static str,
    frames: usize,
    sequences: usize,
    /// The fewest and the most frames of a sequence.
    sequence_lengths: [usize; 2],
    /// Frames by size, `256x256`.
    sizes: BTreeMap<String, usize>,
    /// `8-bit`, `float` or both.
    pixels: Vec<&'static str>,
    unreadable: Vec<String>,
    ground_truth: Option<TruthInspection>,
}

#[derive(Debug, Serialize)]
struct TruthInspection {
    objects: Vec<ObjectInspection>,
    join: JoinReport,
}

#[derive(Debug, Serialize)]
struct ObjectInspection {
    name: String,
    /// Rows in which it has a position.
    visible: usize,
    /// Of these, outside the image.
    outside: usize,
    /// Smallest and largest, ndc; with z in the unit of the file.
    x: Option<[f64; 2]>,
    y: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    z: Option<[f64; 2]>,
}

fn inspect(arguments: &InspectArguments) -> Result<()> {
    let common = &arguments.common;
    let frames = common.reading.open(&arguments.path)?;
    let truth = common
        .reading
        .find(common.truth.as_deref(), None, &arguments.path, &*frames)?
        .map(|truth| truth.points);
    let index = frames.index();
    let lengths = || index.sequences().into_iter().map(|s| s.length);
    let mut found = Inspection {
        schema: "tracklens/data/2",
        frames: index.keys().len(),
        sequences: lengths().count(),
        sequence_lengths: [lengths().min().unwrap_or(0), lengths().max().unwrap_or(0)],
        sizes: BTreeMap::new(),
        pixels: Vec::new(),
        unreadable: Vec::new(),
        ground_truth: truth
            .as_ref()
            .map(|truth| inspect_truth(truth, index.keys()))
            .transpose()?,
    };
    let look = |i: usize| {
        let frame = frames.read(i)?;
        let kind = match frame.pixels() {
            Pixels::Bytes(_) => "8-bit",
            Pixels::Floats(_) => "float",
        };
        Ok((format!("{}x{}", frame.width(), frame.height()), kind))
    };
    for_blocks(
        "decoding",
        found.frames,
        common.quiet,
        &cancel_on_interrupt()?,
        look,
        |block| {
            for frame in block {
                match frame {
                    Ok((size, kind)) => {
                        *found.sizes.entry(size).or_insert(0) += 1;
                        if !found.pixels.contains(&kind) {
                            found.pixels.push(kind);
                        }
                    }
                    Err(error) => found.unreadable.push(error.to_string()),
                }
            }
            Ok(())
        },
    )?;
    if let Err(error) = frames.verify() {
        found.unreadable.push(error.to_string());
    }
    let nothing_read = found.sizes.is_empty();
    if arguments.json || !std::io::stdout().is_terminal() {
        say_json(&found, "inspection")?;
    } else {
        print_inspection(&found)?;
    }
    match nothing_read {
        true => Err(Error::input("no frame can be read").at(arguments.path.display())),
        false => Ok(()),
    }
}

fn inspect_truth(truth: &GroundTruth, frames: &[FrameKey]) -> Result<TruthInspection> {
    // A table that fits no frame is a finding here, not a failure.
    let join = match join(frames, truth.keys()) {
        Ok(join) => join,
        Err(error) if error.kind() == ErrorKind::Mismatch => Join {
            unmatched_left: (0..frames.len()).collect(),
            unmatched_right: (0..truth.keys().len()).collect(),
            rules: vec![error.to_string()],
            ..Join::default()
        },
        Err(error) => return Err(error),
    };
    let objects = truth
        .names()
        .iter()
        .zip(truth.points_ndc().axis_iter(ndarray::Axis(1)));
    let objects = objects.map(|(name, points)| {
        let seen: Vec<ArrayView1<f64>> = points
            .rows()
            .into_iter()
            .filter(|p| p.iter().all(|v| v.is_finite()))
            .collect();
        let range = |axis: usize| {
            let values = || seen.iter().map(|p| p[axis]);
            Some([values().reduce(f64::min)?, values().reduce(f64::max)?])
        };
        ObjectInspection {
            name: name.clone(),
            visible: seen.len(),
            outside: seen
                .iter()
                .filter(|p| p.len() == 2 && p.iter().any(|v| v.abs() > 1.0))
                .count(),
            x: range(0),
            y: range(1),
            z: (truth.axes() == 3).then(|| range(2)).flatten(),
        }
    });
    Ok(TruthInspection {
        objects: objects.collect(),
        join: JoinReport::new(&join, frames, truth.keys()),
    })
}

fn print_inspection(found: &Inspection) -> Result<()> {
    let [fewest, most] = found.sequence_lengths;
    let each = if fewest == most {
        fewest.to_string()
    } else {
        format!("{fewest} to {most}")
    };
    say!(
        "{} frames in {} sequences of {each}, {} pixels",
        found.frames,
        found.sequences,
        found.pixels.join(" and ")
    );
    for (size, count) in &found.sizes {
        say!("{count} frames of {size}");
    }
    if !found.unreadable.is_empty() {
        say!("warning: {} frames cannot be read", found.unreadable.len());
        for error in found.unreadable.iter().take(SHOWN) {
            say!("  {error}");
        }
    }
    let Some(truth) = &found.ground_truth else {
        say!("no ground truth");
        return Ok(());
    };
    let mut table = comfy_table::Table::new();
    let in_space = truth.objects.iter().any(|object| object.z.is_some());
    let mut header = vec!["object", "visible", "outside the image", "x", "y"];
    header.extend(in_space.then_some("z"));
    let columns = header.len();
    table.load_preset(UTF8_HORIZONTAL_ONLY).set_header(header);
    let range = |range: Option<[f64; 2]>| match range {
        Some([low, high]) => format!("{low:.3} to {high:.3}"),
        None => "–".to_owned(),
    };
    for object in &truth.objects {
        let mut row = vec![
            object.name.clone(),
            object.visible.to_string(),
            object.outside.to_string(),
            range(object.x),
            range(object.y),
        ];
        row.extend(in_space.then(|| range(object.z)));
        table.add_row(row);
    }
    for column in 1..columns {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    say!("{table}");
    for rule in &truth.join.rules {
        say!("note: {rule}");
    }
    let join = &truth.join;
    for (unmatched, what) in [
        (&join.unmatched_frames, "frames have no row of ground truth"),
        (&join.unmatched_rows, "rows of ground truth have no frame"),
    ] {
        say!("{} {what}", unmatched.count);
        for name in &unmatched.first {
            say!("  {name}");
        }
    }
    Ok(())
}

fn convert(arguments: &ConvertArguments) -> Result<()> {
    let (out, common) = (&arguments.out, &arguments.common);
    let parent = match out.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let refused = |why: &str| Err(Error::new(ErrorKind::Io, why).at(out.display()));
    if out.symlink_metadata().is_ok() {
        return refused("is there already; give another name, or delete it");
    }
    if !parent.is_dir() {
        return refused("lies in no folder that exists; expected a folder or a file to write");
    }
    let target = arguments.to.unwrap_or_else(|| Target::of(out));
    let has_frames =
        is_folder_of_images(&arguments.input) || common.reading.is_recording(&arguments.input)?;
    if !has_frames || !matches!(target, Target::Folder | Target::Npz) {
        return write_points(arguments, target);
    }
    let frames = common.reading.open(&arguments.input)?;
    let truth = common.reading.find(
        common.truth.as_deref(),
        arguments.columns.as_ref(),
        &arguments.input,
        &*frames,
    )?;
    let truth = truth
        .map(|truth| aligned(&truth.points, frames.index().keys()))
        .transpose()?;
    if truth.is_none() {
        eprintln!("note: there is no ground truth; the frames are written without");
    }
    let job = Job {
        frames: &*frames,
        truth,
        parent,
        out,
        quiet: common.quiet,
        cancel: cancel_on_interrupt()?,
    };
    match target {
        Target::Npz => job.write_npz()?,
        _ => job.write_folder()?,
    }
    eprintln!(
        "{} frames written to {}",
        frames.index().keys().len(),
        out.display()
    );
    Ok(())
}

/// The ground truth of exactly the frames `keys`, NaN where a frame has no row; says what did not
/// join.
fn aligned(truth: &GroundTruth, keys: &[FrameKey]) -> Result<GroundTruth> {
    let join = join(keys, truth.keys())?;
    for rule in &join.rules {
        eprintln!("note: {rule}");
    }
    for (side, what) in [
        (&join.unmatched_left, "frames have no row of ground truth"),
        (
            &join.unmatched_right,
            "rows of ground truth have no frame and are left out",
        ),
    ] {
        if !side.is_empty() {
            eprintln!("note: {} {what}", side.len());
        }
    }
    let objects = truth.names().len();
    let mut points = ndarray::Array3::from_elem((keys.len(), objects, truth.axes()), f64::NAN);
    let mut confidence = truth
        .confidence()
        .map(|_| ndarray::Array2::from_elem((keys.len(), objects), f64::NAN));
    for (frame, row) in join.pairs {
        points
            .index_axis_mut(ndarray::Axis(0), frame)
            .assign(&truth.frame(row));
        if let (Some(to), Some(from)) = (&mut confidence, truth.confidence()) {
            to.row_mut(frame).assign(&from.row(row));
        }
    }
    GroundTruth::new(keys.to_vec(), truth.names().to_vec(), points)?.with_confidence(confidence)
}

/// One conversion.
struct Job<'a> {
    frames: &'a dyn FrameSource,
    /// Of exactly these frames.
    truth: Option<GroundTruth>,
    parent: &'a Path,
    out: &'a Path,
    quiet: bool,
    cancel: Cancel,
}

impl Job<'_> {
    fn failed(&self, error: &std::io::Error) -> Error {
        Error::io(self.out.display(), error)
    }

    /// Writes into a folder beside, which gets its name once it is whole.
    fn write_folder(&self) -> Result<()> {
        if self.frames.has_floats() {
            eprintln!(
                "note: the frames are floats; 8-bit images change them by up to 1/510 (convert to .npz keeps them)"
            );
        }
        let keys = self.frames.index().keys();
        let (folder, _lock) = atomic::temporary_folder(self.parent).map_err(|e| self.failed(&e))?;
        for sequence in self.frames.index().sequences() {
            // Joined to the folder, another path would lead out of it.
            let is_below = Path::new(&sequence.name)
                .components()
                .all(|part| matches!(part, Component::Normal(_)));
            if !is_below {
                return Err(Error::input(format!(
                    "the sequence `{}` is not the name of a folder; rename it",
                    sequence.name
                )));
            }
            fs::create_dir_all(folder.path().join(&sequence.name)).map_err(|e| self.failed(&e))?;
        }
        let digits = keys
            .iter()
            .map(|k| k.frame.to_string().len())
            .max()
            .unwrap_or(0)
            .max(3);
        let one = |i: usize| {
            let png = self.frames.read(i)?.to_png()?;
            let FrameKey { sequence, frame } = &keys[i];
            let path = folder
                .path()
                .join(sequence)
                .join(format!("frame_{frame:0digits$}.png"));
            fs::write(&path, png).map_err(|e| self.failed(&e))
        };
        for_blocks(
            "writing images",
            keys.len(),
            self.quiet,
            &self.cancel,
            one,
            |block| block.into_iter().collect(),
        )?;
        if let Some(truth) = &self.truth {
            fs::write(
                folder.path().join("ground_truth.csv"),
                ground_truth_csv(truth),
            )
            .map_err(|e| self.failed(&e))?;
        }
        #[cfg(unix)]
        {
            // Temporary folders are private; a data set is as readable as any other folder.
            use std::os::unix::fs::PermissionsExt as _;
            fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755))
                .map_err(|e| self.failed(&e))?;
        }
        fs::rename(folder.path(), self.out).map_err(|e| self.failed(&e))?;
        // The folder has another name now; there is nothing left to delete.
        let _ = folder.keep();
        Ok(())
    }

    /// Writes into a file beside, which gets its name once it is whole.
    fn write_npz(&self) -> Result<()> {
        let index = self.frames.index();
        let sequences = index.sequences();
        let length = sequences[0].length;
        let are_alike = sequences.iter().all(|s| s.length == length);
        let is_named = |(s, range): (usize, &SequenceRange)| {
            let frames = &index.keys()[range.start..range.start + range.length];
            let name = match are_alike {
                true => format!("seq_{s:04}"),
                false => format!("episode_{s}"),
            };
            range.name == name && frames.iter().zip(0..).all(|(key, t)| key.frame == t)
        };
        if !sequences.iter().enumerate().all(is_named) {
            let names = if are_alike {
                "seq_0000, seq_0001"
            } else {
                "episode_0, episode_1"
            };
            eprintln!(
                "note: an array has no names: sequences become {names}, …, frames count from 0"
            );
        }
        // Sequences of unequal length lie one after the other.
        let leading = match are_alike {
            true => vec![sequences.len(), length],
            false => vec![index.keys().len()],
        };
        let first = self.frames.read(0)?;
        let size = [first.width(), first.height()];
        let floats = self.frames.has_floats();
        let file = atomic::temporary_file(self.parent).map_err(|e| self.failed(&e))?;
        let mut npz = NpzWriter::new(BufWriter::new(file));
        let shape = [&leading[..], &[size[1] as usize, size[0] as usize, 3]].concat();
        let placed = |e: Error| e.at(self.out.display());
        npz.array("images", if floats { "<f4" } else { "|u1" }, &shape)
            .map_err(placed)?;
        let one = |i: usize| -> Result<Vec<u8>> {
            let frame = self.frames.read(i)?;
            if [frame.width(), frame.height()] != size {
                return Err(Error::mismatch(format!(
                    "{}: the frame is {} x {}, the first one {} x {}; an array needs frames of one size",
                    index.keys()[i],
                    frame.width(),
                    frame.height(),
                    size[0],
                    size[1]
                )));
            }
            Ok(bytes(&frame))
        };
        for_blocks(
            "writing the array",
            index.keys().len(),
            self.quiet,
            &self.cancel,
            one,
            |block| {
                for frame in block {
                    npz.write(&frame?).map_err(placed)?;
                }
                Ok(())
            },
        )?;
        if let Some(truth) = &self.truth {
            let shape = [&leading[..], &[truth.names().len(), truth.axes()]].concat();
            npz.floats("keypoints", &shape, truth.points_ndc().iter().copied())
                .map_err(placed)?;
            npz.strings("names", truth.names()).map_err(placed)?;
        }
        if !are_alike {
            let ends = sequences.iter().map(|s| (s.start + s.length) as i64);
            let bytes: Vec<u8> = ends.flat_map(i64::to_le_bytes).collect();
            npz.array("episode_ends", "<i8", &[sequences.len()])
                .and_then(|()| npz.write(&bytes))
                .map_err(placed)?;
        }
        let file = npz.finish().map_err(placed)?;
        let file = file.into_inner().map_err(|e| self.failed(e.error()))?;
        file.as_file().sync_all().map_err(|e| self.failed(&e))?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            let readable = fs::Permissions::from_mode(0o644);
            file.as_file()
                .set_permissions(readable)
                .map_err(|e| self.failed(&e))?;
        }
        file.persist_noclobber(self.out)
            .map_err(|e| self.failed(&e.error))?;
        Ok(())
    }
}

/// The pixels as an array of numpy holds them.
fn bytes(frame: &Frame) -> Vec<u8> {
    match frame.pixels() {
        Pixels::Bytes(bytes) => bytes.clone(),
        Pixels::Floats(floats) => floats.iter().flat_map(|v| v.to_le_bytes()).collect(),
    }
}
