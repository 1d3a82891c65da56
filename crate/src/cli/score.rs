//! `tracklens score`, and the options of scoring.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};

use clap::Args;

use super::files::{self, KeypointsReading, Truth, TruthArguments};
use super::film::film;
use super::hints::finding_line;
use super::outcome;
use super::painter::Painter;
use super::terminal::{own_command, say_json};
use super::values::{parse_finite, parse_html_path};
use crate::atomic;
use crate::command_line;
use crate::data::{Alignment, Camera, Columns, FrameSource, Projected, Reading};
use crate::error::{Error, Result};
use crate::evaluation::{
    EvaluationReport, Matching, MinConfidence, Request, Scored, Sides, Threshold, Thresholds,
};
use crate::metric::{NonFinite, Rank, Settings, Transform};
use crate::report::evaluation::{evaluation_csv, evaluation_figures, evaluation_page};
use crate::track::KeypointTrack;
use crate::weights::read;

#[derive(Debug, Args)]
pub(super) struct ScoreArguments {
    /// Ground truth: CSV with the columns sequence,frame,object,x,y (ndc: -1 to +1 across the
    /// image, y down) or with two columns an object (cube_x,cube_y), DeepLabCut's CSV, COCO
    /// keypoints (JSON), any of these as Parquet, or a recording (.npz, .hdf5, .zarr); with a z
    /// (cube_z) in space, in any unit
    #[arg(long = command_line::TRUTH, value_name = "GT.csv")]
    truth: PathBuf,
    /// Keypoints: CSV with the columns sequence,frame,keypoint,x,y (keypoints counted from 0),
    /// another of these tables, or an NPZ file
    #[arg(long = command_line::KEYPOINTS, value_name = "KP.csv")]
    keypoints: PathBuf,
    #[command(flatten)]
    keypoints_reading: KeypointsReading,
    /// Which column of the ground truth is what, where they have other names (e.g.
    /// x=px,y=py,frame=t,object=label)
    #[arg(long, value_name = "NAME=COLUMN,…")]
    columns: Option<Columns>,
    #[command(flatten)]
    reading: TruthArguments,
    #[command(flatten)]
    scoring: ScoringArguments,
}

/// How to score and how to show it; shared by `score` and `eval`.
#[derive(Debug, Args)]
pub(super) struct ScoringArguments {
    /// The map fitted between a keypoint and an object: affine, scale-translate or identity
    #[arg(long = command_line::TRANSFORM, default_value = "affine")]
    transform: Transform,
    #[command(flatten)]
    thresholds: ThresholdArguments,
    /// When a direction counts as no motion: reference (as the authors' code) or centred (in any
    /// unit); default: reference, and centred of keypoints with three coordinates
    #[arg(long = command_line::RANK, value_name = "RANK")]
    rank: Option<Rank>,
    /// Camera as JSON (docs/formats.md): it projects a ground truth with three coordinates into its
    /// image, in which it is scored then
    #[arg(long = command_line::CAMERA, value_name = "CAMERA.json")]
    camera: Option<PathBuf>,
    /// Frames in which a keypoint is missing: exclude-point (left out for that keypoint and counted),
    /// exclude-frame (left out for all) or error
    #[arg(long = command_line::NON_FINITE, value_name = "POLICY", default_value = "exclude-point")]
    non_finite: NonFinite,
    /// Keypoints whose confidence (likelihood, score, visible) is below it count as missing
    #[arg(
        long = command_line::MIN_CONFIDENCE, value_name = "C", value_parser = parse_finite,
        allow_negative_numbers = true
    )]
    min_confidence: Option<f64>,
    /// Positions of the ground truth whose confidence is below it count as not visible; COCO's v is 1
    /// for what is hidden by something, 2 for what is visible
    #[arg(
        long = command_line::TRUTH_MIN_CONFIDENCE, value_name = "C", value_parser = parse_finite,
        allow_negative_numbers = true
    )]
    truth_min_confidence: Option<f64>,
    /// Smallest confidences at which the TC is also given (e.g. 0.5,0.9); default: where the
    /// confidences differ
    #[arg(
        long, value_name = "LEVELS", value_delimiter = ',', value_parser = parse_finite,
        allow_negative_numbers = true
    )]
    confidence_levels: Vec<f64>,
    /// Add this to the frame numbers of the ground truth before they are matched
    #[arg(
        long = command_line::SHIFT_FRAMES,
        value_name = "N",
        default_value_t = 0,
        allow_negative_numbers = true
    )]
    shift_frames: i64,
    /// Add this to the sequence numbers of the ground truth before they are matched
    #[arg(
        long = command_line::SHIFT_SEQUENCES,
        value_name = "N",
        default_value_t = 0,
        allow_negative_numbers = true
    )]
    shift_sequences: i64,
    /// Let a keypoint that is missing in more than half of an object's frames be its best one
    #[arg(long)]
    rare_keypoints: bool,
    /// Folds of the sequences for held-out errors, whose maps are fitted on other sequences; 0: none.
    /// Default: 5, or one a sequence
    #[arg(long = command_line::FOLDS, value_name = "N")]
    folds: Option<usize>,
    /// Also give 95 % intervals, by drawing the sequences this many times with replacement
    #[arg(long = command_line::BOOTSTRAP, value_name = "RESAMPLES")]
    bootstrap: Option<usize>,
    /// Seed of the folds and the bootstrap
    #[arg(long = command_line::RESAMPLING_SEED, value_name = "SEED", default_value_t = 0)]
    resampling_seed: u64,
    /// Also give the error of every object by sequence, the worst one first
    #[arg(long = command_line::SEQUENCES)]
    sequences: bool,
    /// Also give other metrics: linear regression from all keypoints with PCK (Jakab et al.),
    /// precision and recall of a min-cost assignment (Kulkarni et al.)
    #[arg(long = command_line::CONTEXT)]
    context: bool,
    /// Also measure the best keypoints over time: jitter, lag, hand-over, other maps, TAP-Vid's
    /// measures, OKS and PCK
    #[arg(long = command_line::TEMPORAL)]
    temporal: bool,
    /// Exit with 5 when the TC is unknown because there is not enough data
    #[arg(long)]
    strict: bool,
    /// Also write everything as one HTML file
    #[arg(long, value_name = "FILE.html", value_parser = parse_html_path)]
    report: Option<PathBuf>,
    /// Also write every figure into this folder, as SVG and PNG
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
    /// Print the evaluation as JSON (the default when the output is not a terminal)
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print one line an object as CSV
    #[arg(long)]
    csv: bool,
}

/// The thresholds on the errors; shared by `score`, `eval` and `report`.
#[derive(Debug, Args)]
pub(super) struct ThresholdArguments {
    /// Threshold on an object's error (mean squared distance, ndc, or the unit of a ground truth in
    /// space); repeatable. Default: cube 0.015, target 0.015, eef 0.1, others 0.015; in space that
    /// times the square of half the longest side of the box around all objects
    #[arg(long = command_line::THRESHOLD, value_name = "NAME=VALUE")]
    thresholds: Vec<Threshold>,
}

impl ThresholdArguments {
    pub fn parse(&self) -> Result<Thresholds> {
        Thresholds::new(self.thresholds.iter().cloned())
    }
}

pub(super) fn run(arguments: &ScoreArguments) -> Result<()> {
    arguments.scoring.check()?;
    let truth = arguments
        .reading
        .read(&arguments.truth, arguments.columns.as_ref())?;
    let camera = arguments.scoring.camera()?;
    let own = truth.reading.and_then(|reading| reading.image_size);
    let image_size = arguments.reading.image_size.or(own);
    let image_size = image_size.or(camera.as_ref().map(|camera| camera.image_size));
    let keypoints = files::read_keypoints(
        &arguments.keypoints,
        &arguments.reading,
        &arguments.keypoints_reading,
        image_size,
    )?;
    arguments.scoring.score(
        &truth,
        camera.as_ref(),
        &keypoints.content,
        &keypoints.reading,
        image_size,
        None,
    )
}

impl ScoringArguments {
    /// Checks, before long work, that results can be written.
    ///
    /// # Errors
    /// When they cannot.
    pub fn check(&self) -> Result<()> {
        self.report.as_deref().map_or(Ok(()), atomic::check)
    }

    /// The camera, where there is one.
    ///
    /// # Errors
    /// When its file is not that of a camera.
    pub fn camera(&self) -> Result<Option<Camera>> {
        let parse = |path: &PathBuf| Camera::parse(&read(path)?, &path.to_string_lossy());
        self.camera.as_ref().map(parse).transpose()
    }

    /// The ground truth as the camera sees it.
    fn projected(&self, truth: &Truth, camera: &Camera) -> Result<Projected> {
        let path = self.camera.as_deref().unwrap_or(Path::new(""));
        let projected = camera.project(&truth.points);
        projected.map_err(|e| e.at(path.display()))
    }

    /// `axes` is the number of coordinates of a keypoint.
    fn request(&self, image_size: Option<[u32; 2]>, axes: usize) -> Result<Request> {
        Ok(Request {
            settings: Settings {
                transform: self.transform,
                rank: self.rank.unwrap_or(Rank::of_axes(axes)),
                rare_keypoints: self.rare_keypoints,
            },
            thresholds: self.thresholds.parse()?,
            image_size,
            folds: self.folds,
            bootstrap: self.bootstrap,
            seed: self.resampling_seed,
            // Their figures and tables need them.
            sequences: self.sequences || self.report.is_some() || self.figures.is_some(),
            context: self.context,
            temporal: self.temporal,
            confidence_levels: self.confidence_levels.clone(),
        })
    }

    /// Scores and prints. `camera` puts the ground truth into the image, where it is in space;
    /// `image_size` is the size of the images, where it is known; `frames` are shown in the report.
    pub fn score(
        &self,
        truth: &Truth,
        camera: Option<&Camera>,
        keypoints: &KeypointTrack,
        keypoints_reading: &Reading,
        image_size: Option<[u32; 2]>,
        frames: Option<&dyn FrameSource>,
    ) -> Result<()> {
        let alignment = Alignment {
            frames: self.shift_frames,
            sequences: self.shift_sequences,
        };
        let matching = Matching {
            least: MinConfidence::new(self.min_confidence, self.truth_min_confidence)?,
            alignment,
        };
        let projected = camera.map(|camera| self.projected(truth, camera));
        let projected = projected.transpose()?;
        let points = projected
            .as_ref()
            .map_or(&truth.points, |image| &image.truth);
        let sides = Sides {
            truth: points,
            // What a camera projects is no longer what the file says.
            truth_reading: truth.reading.as_ref().filter(|_| camera.is_none()),
            keypoints,
            keypoints_reading: Some(keypoints_reading),
        };
        let request = self.request(image_size, keypoints.axes())?;
        let Scored {
            scoring,
            join,
            mut report,
        } = sides.score(&request, matching, self.non_finite)?;
        if let Some(image) = &projected {
            report.take_camera(image.into());
        }
        report.command = Some(own_command()?);
        if let Some(path) = &self.report {
            let film = film(&scoring, &report, &request.settings, frames)?;
            atomic::write(path, evaluation_page(&report, film.as_ref())?.as_bytes())?;
            eprintln!("report written to {}", path.display());
        }
        if let Some(folder) = &self.figures {
            write_figures(&report, folder)?;
        }
        for rule in &join.rules {
            eprintln!("note: {rule}");
        }
        if self.csv {
            say!("{}", evaluation_csv(&report).trim_end());
            for warning in &report.warnings {
                eprintln!("warning: {warning}");
            }
            for finding in &report.findings {
                eprintln!("{}", finding_line(finding));
            }
        } else if self.json || !std::io::stdout().is_terminal() {
            say_json(&report, "evaluation")?;
        } else {
            outcome::print(&report)?;
        }
        if self.strict && report.tc.is_none() {
            return Err(Error::numeric(
                "the TC is unknown because there is not enough data; the warnings say what is (--strict)",
            ));
        }
        Ok(())
    }
}

fn write_figures(report: &EvaluationReport, folder: &Path) -> Result<()> {
    let figures = evaluation_figures(report)?;
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), &e))?;
    let painter = Painter::new();
    for figure in &figures {
        let path = |ending: &str| folder.join(format!("{}.{ending}", figure.name));
        atomic::write(&path("svg"), figure.svg.as_bytes())?;
        atomic::write(&path("png"), &painter.png(&figure.svg)?)?;
    }
    eprintln!("{} figures written to {}", figures.len(), folder.display());
    Ok(())
}
