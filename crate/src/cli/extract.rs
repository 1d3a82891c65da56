//! `tracklens extract` and `tracklens eval`.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use indicatif::{ProgressBar, ProgressState, ProgressStyle};
use ndarray::{Array2, Array3};

use super::detector::DetectorArguments;
#[cfg(feature = "gpu")]
use super::device::open_and_tell;
use super::files::TruthArguments;
use super::score::ScoringArguments;
use super::signals;
use crate::atomic;
use crate::data::{Columns, FrameSource, Reading, keypoints_csv};
use crate::device::DeviceKind;
#[cfg(not(feature = "gpu"))]
use crate::device::built_without_gpu;
use crate::error::{Error, Result};
use crate::event::{Cancel, Event};
#[cfg(feature = "gpu")]
use crate::extract::DeviceExtractor;
use crate::extract::{CpuExtractor, Extraction, Extractor, extract_frames};
use crate::track::KeypointTrack;
use crate::weights::{read_checkpoint, read_onnx};

/// The path that stands for the standard output.
const STANDARD_OUTPUT: &str = "-";

#[derive(Debug, Args)]
pub(super) struct ExtractArguments {
    #[command(flatten)]
    source: SourceArguments,
    /// Where to write the keypoints: CSV with the columns sequence,frame,keypoint,x,y; `-` for the
    /// standard output
    #[arg(long, value_name = "KP.csv")]
    out: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct EvalArguments {
    #[command(flatten)]
    source: SourceArguments,
    /// Ground truth: CSV with the columns sequence,frame,object,x,y (ndc: -1 to +1 across the
    /// image, y down); default: ground_truth.csv in the folder of the frames, or the points of the
    /// recording
    #[arg(long, value_name = "GT.csv")]
    truth: Option<PathBuf>,
    /// Which column of the ground truth is what, where they have other names (e.g.
    /// x=px,y=py,frame=t,object=label), or without --truth which array of the recording has the
    /// positions of which object (e.g. eef=obs/robot0_eef_pos,cube=obs/object[0:3])
    #[arg(long, value_name = "NAME=COLUMN,…")]
    truth_columns: Option<Columns>,
    /// Also write the keypoints to this file
    #[arg(long, value_name = "KP.csv", value_parser = parse_file)]
    keypoints_out: Option<PathBuf>,
    #[command(flatten)]
    scoring: ScoringArguments,
}

/// The path of a file, for when the standard output is taken.
fn parse_file(text: &str) -> Result<PathBuf> {
    if text == STANDARD_OUTPUT {
        return Err(Error::input(
            "keypoints would mix with the results on the standard output; give a file, or use `tracklens extract --out -`",
        ));
    }
    Ok(PathBuf::from(text))
}

/// Where keypoints come from; shared by `extract` and `eval`.
#[derive(Debug, Args)]
struct SourceArguments {
    /// Weights of an encoder (.safetensors, PyTorch's .pth or burn's .bpk), or any detector as an
    /// ONNX model (.onnx)
    #[arg(long, value_name = "W.safetensors")]
    checkpoint: PathBuf,
    /// Which weights, where a file has several sets: what stands before `encoder.` in their names,
    /// e.g. ema or policy.pi_features_extractor; default: the only ones, or those under
    /// model_state_dict, state_dict, model or weights
    #[arg(long, value_name = "KEY")]
    key: Option<String>,
    #[command(flatten)]
    detector: DetectorArguments,
    /// Folder of image sequences, one folder a sequence (PNG, JPEG, WebP), or a recording (.npz,
    /// .hdf5, .zarr)
    #[arg(long, value_name = "PATH")]
    frames: PathBuf,
    #[command(flatten)]
    reading: TruthArguments,
    /// The device to compute on; gpu needs a build with the feature `gpu`
    #[arg(long, value_enum, default_value_t = DeviceKind::Cpu)]
    device: DeviceKind,
    /// Threads; default: all cores
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// Leave out and count frames that cannot be read, instead of stopping at the first
    #[arg(long)]
    skip_unreadable: bool,
    /// No progress bar
    #[arg(long)]
    quiet: bool,
}

pub(super) fn run(arguments: &ExtractArguments) -> Result<()> {
    let out = &arguments.out;
    let is_stream = out.as_os_str() == STANDARD_OUTPUT;
    if !is_stream {
        atomic::check(out)?;
    }
    let source = &arguments.source;
    let extracted = source.extract(&*source.reading.open(&source.frames)?)?;
    let csv = keypoints_csv(&extracted.track);
    let place = if is_stream {
        say!("{}", csv.trim_end());
        "the standard output".to_owned()
    } else {
        atomic::write(out, csv.as_bytes())?;
        out.display().to_string()
    };
    eprintln!(
        "{} keypoints of {} frames written to {place}",
        extracted.track.keypoints(),
        extracted.track.keys().len(),
    );
    Ok(())
}

pub(super) fn run_eval(arguments: &EvalArguments) -> Result<()> {
    // Before the long work, so that a table that cannot be read does not cost minutes.
    arguments.scoring.check()?;
    let source = &arguments.source;
    let frames = source.reading.open(&source.frames)?;
    let truth = source.reading.need(
        arguments.truth.as_deref(),
        arguments.truth_columns.as_ref(),
        &source.frames,
        &*frames,
        "scoring",
    )?;
    if let Some(path) = &arguments.keypoints_out {
        atomic::check(path)?;
    }
    let camera = arguments.scoring.camera()?;
    let extracted = source.extract(&*frames)?;
    if let Some(path) = &arguments.keypoints_out {
        atomic::write(path, keypoints_csv(&extracted.track).as_bytes())?;
    }
    arguments.scoring.score(
        &truth,
        camera.as_ref(),
        &extracted.track,
        &Reading::of_extraction(),
        source
            .reading
            .image_size
            .or(extracted.image_size)
            .or(camera.as_ref().map(|camera| camera.image_size)),
        Some(&*frames),
    )
}

struct Extracted {
    track: KeypointTrack,
    /// The size of all images, if they share one.
    image_size: Option<[u32; 2]>,
}

impl SourceArguments {
    /// The encoder or the detector.
    fn open(&self) -> Result<Box<dyn Extractor + Sync>> {
        let place = |e: Error| e.at(self.checkpoint.display());
        if let Some(bytes) = read_onnx(&self.checkpoint)? {
            if self.key.is_some() {
                return Err(place(Error::mismatch(
                    "--key chooses among sets of weights, and an ONNX model has one; leave it out",
                )));
            }
            if self.device != DeviceKind::Cpu {
                return Err(place(Error::input(
                    "ONNX models run on the CPU only; leave --device out",
                )));
            }
            return Ok(Box::new(self.detector.open(
                &self.checkpoint,
                bytes,
                self.quiet,
            )?));
        }
        self.detector.check_unused().map_err(place)?;
        let checkpoint = read_checkpoint(&self.checkpoint, self.key.as_deref())?;
        Ok(match self.device {
            DeviceKind::Cpu => Box::new(CpuExtractor::new(&checkpoint).map_err(place)?),
            #[cfg(feature = "gpu")]
            DeviceKind::Gpu => {
                let device = open_and_tell(self.device)?.device;
                Box::new(DeviceExtractor::new(&checkpoint, &device).map_err(place)?)
            }
            #[cfg(not(feature = "gpu"))]
            DeviceKind::Gpu => return Err(built_without_gpu()),
        })
    }

    fn extract(&self, frames: &dyn FrameSource) -> Result<Extracted> {
        let cancel = cancel_on_interrupt()?;
        let bar = progress_bar(self.quiet);
        let threads = self.threads.map_or(0, NonZeroUsize::get);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| Error::input(format!("{threads} threads cannot be started: {e}")))?;
        let extractor = self.open()?;
        let all = 0..frames.index().keys().len();
        let observer = |event: Event| show(&bar, &event);
        let found =
            pool.install(|| extract_frames(&*extractor, frames, all, &observer, &cancel))?;

        let unreadable: Vec<&Error> = found.iter().filter_map(|f| f.as_ref().err()).collect();
        if let Some(first) = unreadable.first() {
            if !self.skip_unreadable || unreadable.len() == found.len() {
                return Err((*first).clone());
            }
            eprintln!(
                "note: {} of {} frames are left out:",
                unreadable.len(),
                found.len()
            );
            for error in unreadable {
                eprintln!("note:   {error}");
            }
        }
        let (keys, good): (Vec<_>, Vec<&Extraction>) = frames
            .index()
            .keys()
            .iter()
            .zip(&found)
            .filter_map(|(key, found)| Some((key.clone(), found.as_ref().ok()?)))
            .unzip();
        let points =
            Array3::from_shape_fn((good.len(), extractor.keypoints(), 2), |(t, n, axis)| {
                f64::from(good[t].points[n][axis])
            });
        let has_confidence = !good.is_empty() && good.iter().all(|g| g.confidences.is_some());
        let confidence = has_confidence.then(|| {
            Array2::from_shape_fn((good.len(), extractor.keypoints()), |(t, n)| {
                let all = good[t].confidences.as_ref();
                all.map_or(f64::NAN, |all| f64::from(all[n]))
            })
        });
        let size = good.first().map(|g| g.image_size);
        let same = good.iter().all(|g| Some(g.image_size) == size);
        if !same && extractor.input_size().is_none() {
            eprintln!("note: the frames have different sizes and the checkpoint has no input size");
        }
        Ok(Extracted {
            track: KeypointTrack::new(keys, points)?.with_confidence(confidence)?,
            image_size: size.filter(|_| same),
        })
    }
}

/// A [`Cancel`] that Ctrl-C sets.
pub(super) fn cancel_on_interrupt() -> Result<Cancel> {
    let cancel = Cancel::default();
    let switch = cancel.clone();
    signals::on_end(move || switch.cancel())?;
    Ok(cancel)
}

/// The bar that [`show`] draws on.
pub(super) fn progress_bar(quiet: bool) -> ProgressBar {
    if quiet {
        ProgressBar::hidden()
    } else {
        ProgressBar::new(0)
    }
}

/// Translates events for the terminal.
pub(super) fn show(bar: &ProgressBar, event: &Event) {
    match event {
        Event::Started { what, total } => {
            let template = "{msg} {wide_bar} {pos}/{len} ({speed}, {eta} left)";
            let style =
                ProgressStyle::with_template(template).unwrap_or(ProgressStyle::default_bar());
            let speed = |state: &ProgressState, out: &mut dyn std::fmt::Write| {
                // Nothing can be done when the terminal takes no text.
                let _ = write!(out, "{:.1}/s", state.per_sec());
            };
            bar.set_style(style.with_key("speed", speed));
            bar.set_length(*total);
            bar.set_message(what.clone());
            bar.enable_steady_tick(Duration::from_millis(200));
        }
        Event::Progress { done, note } => {
            bar.set_position(*done);
            if !note.is_empty() {
                bar.set_message(note.clone());
            }
        }
        Event::Warning(text) => bar.suspend(|| eprintln!("warning: {text}")),
        Event::Done => bar.finish_and_clear(),
    }
}
