//! `tracklens score`, and how evaluations are shown.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};

use clap::Args;
use comfy_table::CellAlignment;
use comfy_table::presets::UTF8_HORIZONTAL_ONLY;

use super::files::{self, KeypointsReading, TruthArguments};
use super::painter::Painter;
use super::values::parse_html_path;
use crate::atomic;
use crate::data::{AxisOrder, Space};
use crate::error::{Error, Result};
use crate::metric::{NonFinite, Rank, Settings, Transform};
use crate::report::{
    ContextReport, EvaluationReport, JoinReport, Request, evaluation_figures, evaluation_page,
    shell_line,
};
use crate::scoring::Scoring;
use crate::track::{GroundTruth, KeypointTrack};

#[derive(Debug, Args)]
pub(super) struct ScoreArguments {
    /// Ground truth: CSV with the columns sequence,frame,object,x,y (ndc: -1 to +1 across the
    /// image, y down) or with two columns an object (cube_x,cube_y), DeepLabCut's CSV, COCO
    /// keypoints (JSON), or a recording (.npz, .hdf5)
    #[arg(long, value_name = "GT.csv")]
    truth: PathBuf,
    /// Keypoints: CSV with the columns sequence,frame,keypoint,x,y (keypoints counted from 0),
    /// another of these tables, or an NPZ file
    #[arg(long, value_name = "KP.csv")]
    keypoints: PathBuf,
    /// Unit of the keypoints: ndc or px; default: px for DeepLabCut and COCO, otherwise ndc
    #[arg(long, value_name = "SPACE")]
    keypoints_space: Option<Space>,
    /// Number of the first frame, and in a table with one row a point of the first keypoint;
    /// default: 0
    #[arg(long, value_name = "N")]
    keypoints_index_base: Option<u64>,
    /// Order of coordinates of the keypoints: xy or yx; default: --axis-order
    #[arg(long, value_name = "ORDER")]
    keypoints_axis_order: Option<AxisOrder>,
    #[command(flatten)]
    reading: TruthArguments,
    #[command(flatten)]
    scoring: ScoringArguments,
}

/// How to score and how to show it; shared by `score` and `eval`.
#[derive(Debug, Args)]
pub(super) struct ScoringArguments {
    /// The map fitted between a keypoint and an object: affine, scale-translate or identity
    #[arg(long, default_value = "affine")]
    transform: Transform,
    /// Threshold on an object's error (mean squared distance, ndc); repeatable. Default: cube
    /// 0.015, target 0.015, eef 0.1, others 0.015
    #[arg(long = "threshold", value_name = "NAME=VALUE", value_parser = parse_threshold)]
    thresholds: Vec<(String, f64)>,
    /// When a direction counts as no motion: reference (as the authors' code) or centred (in any
    /// unit)
    #[arg(long, default_value = "reference")]
    rank: Rank,
    /// Frames in which a keypoint is not finite: error, or exclude-frame (left out and counted)
    #[arg(long, value_name = "POLICY", default_value = "error")]
    non_finite: NonFinite,
    /// Also fit and score on different sequences, in this many folds
    #[arg(long, value_name = "N")]
    folds: Option<usize>,
    /// Also give 95 % intervals, by drawing the sequences this many times with replacement
    #[arg(long, value_name = "RESAMPLES")]
    bootstrap: Option<usize>,
    /// Deals sequences to folds and draws the bootstrap
    #[arg(long, value_name = "SEED", default_value_t = 0)]
    resampling_seed: u64,
    /// Also give the error of every object by sequence, the worst one first
    #[arg(long)]
    sequences: bool,
    /// Also give what others measure: linear regression from all keypoints with PCK (Jakab et al.),
    /// precision and recall of a min-cost assignment (Kulkarni et al.)
    #[arg(long)]
    context: bool,
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

pub(super) fn parse_threshold(text: &str) -> Result<(String, f64)> {
    const EXPECTED: &str = "expected NAME=VALUE with a number above 0, e.g. cube=0.015";
    if text.contains(',') && text.matches('=').count() > 1 {
        return Err(Error::input(format!(
            "`{text}` gives more than one threshold; {EXPECTED}, and --threshold once for every object: --threshold \
             cube=0.015 --threshold eef=0.1"
        )));
    }
    let (name, value) = text
        .rsplit_once('=')
        .map(|(name, value)| (name.trim(), value.trim()))
        .filter(|(name, _)| !name.is_empty())
        .ok_or_else(|| Error::input(format!("`{text}` is no threshold; {EXPECTED}")))?;
    match value.parse::<f64>() {
        Ok(number) if number.is_finite() && number > 0.0 => Ok((name.to_owned(), number)),
        Ok(_) => Err(Error::input(format!(
            "the threshold of `{name}` is {value}, which is not a finite number above 0; {EXPECTED}"
        ))),
        Err(_) => Err(Error::input(format!(
            "the threshold of `{name}` is `{value}`, which is no number; {EXPECTED}"
        ))),
    }
}

pub(super) fn run(arguments: &ScoreArguments) -> Result<()> {
    arguments.scoring.check()?;
    let truth = arguments.reading.read(&arguments.truth)?;
    let keypoints = files::read_keypoints(
        &arguments.keypoints,
        &arguments.reading,
        &KeypointsReading {
            space: arguments.keypoints_space,
            axes: arguments.keypoints_axis_order,
            index_base: arguments.keypoints_index_base,
        },
    )?;
    arguments
        .scoring
        .score(&truth, &keypoints, arguments.reading.image_size)
}

impl ScoringArguments {
    /// Checks, before long work, that results can be written.
    ///
    /// # Errors
    /// When they cannot.
    pub fn check(&self) -> Result<()> {
        self.report.as_deref().map_or(Ok(()), atomic::check)
    }

    fn request(&self, image_size: Option<[u32; 2]>) -> Request {
        Request {
            settings: Settings {
                transform: self.transform,
                rank: self.rank,
            },
            thresholds: self.thresholds.clone(),
            image_size,
            folds: self.folds,
            bootstrap: self.bootstrap,
            seed: self.resampling_seed,
            // Their figures and tables need them.
            sequences: self.sequences || self.report.is_some() || self.figures.is_some(),
            context: self.context,
        }
    }

    /// Scores and prints. `image_size` is the size of the images, where it is known.
    pub fn score(
        &self,
        truth: &GroundTruth,
        keypoints: &KeypointTrack,
        image_size: Option<[u32; 2]>,
    ) -> Result<()> {
        let scoring = Scoring::new(truth, keypoints, self.non_finite)?;
        let join = JoinReport::new(scoring.join(), keypoints.keys(), truth.keys());
        let mut report = self.request(image_size).evaluate(&scoring, &join)?;
        report.command = Some(own_command()?);
        if let Some(path) = &self.report {
            atomic::write(path, evaluation_page(&report)?.as_bytes())?;
            eprintln!("report written to {}", path.display());
        }
        if let Some(folder) = &self.figures {
            write_figures(&report, folder)?;
        }
        for rule in &join.rules {
            eprintln!("note: {rule}");
        }
        if self.csv {
            say!("{}", report.to_csv().trim_end());
            for warning in &report.warnings {
                eprintln!("warning: {warning}");
            }
        } else if self.json || !std::io::stdout().is_terminal() {
            let json = serde_json::to_string_pretty(&report).map_err(|e| {
                Error::input(format!("the evaluation cannot be written as JSON: {e}"))
            })?;
            say!("{json}");
        } else {
            print_table(&report)?;
        }
        Ok(())
    }
}

/// How this program was called.
fn own_command() -> Result<String> {
    let arguments: Vec<String> = std::env::args_os()
        .skip(1)
        .map(|argument| argument.to_string_lossy().into_owned())
        .collect();
    shell_line(
        ["tracklens"]
            .into_iter()
            .chain(arguments.iter().map(String::as_str)),
    )
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

fn print_table(report: &EvaluationReport) -> Result<()> {
    let mut table = comfy_table::Table::new();
    table.load_preset(UTF8_HORIZONTAL_ONLY).set_header([
        "object",
        "tracked",
        "error",
        "threshold",
        "best keypoint",
        "RMSE",
        "frames",
    ]);
    let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |v| format!("{v:.5}"));
    for object in &report.objects {
        let rmse = match object.rmse_px {
            Some(px) => format!("{} ({px:.1} px)", number(object.rmse)),
            None => number(object.rmse),
        };
        table.add_row([
            object.name.clone(),
            if object.tracked { "yes" } else { "no" }.to_owned(),
            number(object.error),
            object.threshold.to_string(),
            object
                .best_keypoint
                .map_or_else(|| "–".to_owned(), |n| n.to_string()),
            rmse,
            object.frames.to_string(),
        ]);
    }
    for column in 2..7 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let tracked = report.objects.iter().filter(|o| o.tracked).count();
    say!(
        "TC {:.3}: {tracked} of {} objects tracked over {} frames",
        report.tc,
        report.objects.len(),
        report.frames
    );
    say!("{table}");
    if let Some(intervals) = &report.intervals {
        let range = |name: &str, [low, high]: [f64; 2]| format!("{name} {low:.5} to {high:.5}");
        let errors = intervals.objects.iter();
        let errors: Vec<String> = errors
            .filter_map(|o| Some(range(&o.name, o.error?)))
            .collect();
        say!(
            "95 % intervals over sequences of these errors, fitted and scored on the same frames ({} resamples): {}; {}",
            intervals.resamples,
            range("TC", intervals.tc),
            errors.join("; ")
        );
    }
    if let Some(held_out) = &report.held_out {
        let objects = held_out.objects.iter();
        let errors: Vec<String> = objects
            .map(|o| format!("{} {}", o.name, number(o.error)))
            .collect();
        say!(
            "on held-out sequences ({} folds): TC {:.3}; {}",
            held_out.folds,
            held_out.tc,
            errors.join("; ")
        );
    }
    if let Some(sequences) = &report.sequences {
        for of in sequences {
            let worst = of.errors.iter().take(3).map(|sequence| {
                format!(
                    "{} {:.5} (frame {} {:.5})",
                    sequence.sequence, sequence.error, sequence.worst_frame, sequence.worst_error
                )
            });
            let worst: Vec<String> = worst.collect();
            say!("worst sequences of {}: {}", of.object, worst.join("; "));
        }
    }
    if let Some(context) = &report.context {
        print_context(context)?;
    }
    say!(
        "error: mean squared distance in ndc; map: {}, rank rule: {}, fitted and scored on the same frames",
        report.transform,
        report.rank
    );
    for warning in &report.warnings {
        say!("warning: {warning}");
    }
    Ok(())
}

fn print_context(context: &ContextReport) -> Result<()> {
    let shares = |shares: &[f64]| {
        let shares = context.close.iter().zip(shares);
        let shares: Vec<String> = shares
            .map(|(close, share)| format!("{:.1} % within {:.1} %", 100.0 * share, 100.0 * close))
            .collect();
        shares.join(", ")
    };
    for row in &context.regression {
        say!(
            "linear regression from all keypoints, {}, of {}: error {}; PCK {}",
            if row.held_out {
                "held out"
            } else {
                "same frames"
            },
            row.object,
            row.error
                .map_or_else(|| "–".to_owned(), |e| format!("{e:.5}")),
            row.pck
                .as_ref()
                .map_or_else(|| "–".to_owned(), |pck| shares(pck))
        );
    }
    for row in &context.assignment {
        say!(
            "min-cost assignment once a {}: precision {}; recall {}",
            row.trajectory,
            shares(&row.precision),
            shares(&row.recall)
        );
    }
    Ok(())
}
