//! An evaluation as JSON (schema `tracklens/evaluation/3`, or 4 of points in space, which
//! `docs/metrics.md` describes).

use serde::{Deserialize, Serialize};

use super::doctor::Finding;
use super::scoring::{Context, SequenceError};
use super::temporal::{Temporal, TemporalObject};
use crate::data::Join;
#[cfg(feature = "space")]
use crate::data::Projected;
use crate::error::{Error, Result};
use crate::metric::context::{Assignment, CLOSE, Regression};
use crate::metric::{
    AffineMap, Evaluation, HeldOut, HeldOutObject, Intervals, Sufficiency, Transform,
};
use crate::track::{FrameKey, MOST_AXES};

/// The name of the schema, before its number.
const SCHEMA: &str = "tracklens/evaluation/";
/// The newest schema, in which points may be in space. 1 had no join, sequences, context, size of
/// images and command; before 3 the TC was always a number.
const NEWEST: u32 = if MOST_AXES == 3 { 4 } else { IN_IMAGE };
/// The schema of points in the image, which is written of them.
const IN_IMAGE: u32 = 3;

/// How many names of unmatched frames a report shows.
const SHOWN: usize = 5;

/// The result of scoring one detector, as written to JSON. Points and errors are in ndc, (x, y), or
/// in the unit of a ground truth in space ([`dimensions`](Self::dimensions)).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct EvaluationReport {
    /// `tracklens/evaluation/3`; 4 where points are in space.
    pub schema: String,
    /// The version that computed it.
    pub version: String,
    /// The command that repeats it, where one does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command: Option<String>,
    /// Tracking capability: the share of tracked objects; null where an object has not enough data
    /// ([`sufficiency`](Self::sufficiency)).
    pub tc: Option<f64>,
    /// The number of frames T.
    pub frames: u64,
    /// Frames left out because a keypoint was not finite.
    pub excluded: u64,
    /// For every keypoint, the frames in which it is missing, which do not count for it; where one is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub missing: Option<Vec<u64>>,
    /// `identity`, `scale-translate` or `affine`.
    pub transform: String,
    /// The rank rule: `reference` or `centred`.
    pub rank: String,
    /// `fit-and-score-same-frames`: as the authors' code does it.
    pub protocol: String,
    /// The objects.
    pub objects: Vec<ObjectReport>,
    /// `e_{n,k}`: per object, one error a keypoint; null when the object is visible nowhere.
    pub errors: Vec<Vec<Option<f64>>>,
    /// Warnings for the reader.
    pub warnings: Vec<String>,
    /// What looked wrong with the data.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<Finding>,
    /// Width and height of the images in pixels, where they are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image_size: Option<[u32; 2]>,
    /// How many coordinates points have, where some are in space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dimensions: Option<Dimensions>,
    /// Which positions a camera put into the image, where the ground truth was in space and there is
    /// one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<CameraReport>,
    /// How frames were matched to rows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub join: Option<JoinReport>,
    /// Whether the data were enough to tell tracking from chance, by object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sufficiency: Option<Vec<Sufficiency>>,
    /// Which points were hidden because they are not sure, and the TC as a function of the
    /// confidence; where keypoints have one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confidence: Option<ConfidenceReport>,
    /// The same on sequences that the maps were not fitted on, where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOutReport>,
    /// 95 % intervals, where they were asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intervals: Option<IntervalsReport>,
    /// The errors of the best keypoints by sequence, where they were asked for; in the order of the
    /// objects that are visible.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequences: Option<Vec<SequencesReport>>,
    /// Other metrics of the same data, where they were asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub context: Option<ContextReport>,
    /// How good the best keypoints are over time, where it was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temporal: Option<TemporalReport>,
}

/// How many coordinates points have, 2 in the image and 3 in space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Dimensions {
    /// A keypoint.
    pub keypoints: usize,
    /// A position of the ground truth. With 3, errors and thresholds are in its unit, squared.
    pub truth: usize,
}

/// A ground truth in space, put into the image by a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct CameraReport {
    /// Positions in front of the camera.
    pub projected: u64,
    /// Positions behind it, which count as not visible.
    pub behind: u64,
}

#[cfg(feature = "space")]
impl From<&Projected> for CameraReport {
    fn from(image: &Projected) -> Self {
        Self {
            projected: image.projected,
            behind: image.behind,
        }
    }
}

/// Points that are not sure, and the TC as a function of how sure keypoints have to be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ConfidenceReport {
    /// Keypoints below it count as missing.
    pub least_keypoints: Option<f64>,
    /// How many they are, in the joined frames; null where keypoints have no confidence.
    pub hidden_keypoints: Option<u64>,
    /// Positions of the ground truth below it count as not visible.
    pub least_truth: Option<f64>,
    /// How many they are, in the joined frames; null where positions have no confidence.
    pub hidden_truth: Option<u64>,
    /// With other smallest confidences of the keypoints, ascending as asked for.
    pub levels: Vec<ConfidenceLevel>,
}

/// The score when keypoints below a confidence count as missing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConfidenceLevel {
    /// The smallest confidence that counts.
    pub least: f64,
    /// The share of the keypoints that is left.
    pub kept: f64,
    /// Null where there is not enough data.
    pub tc: Option<f64>,
    /// The error of every object; null where no keypoint is left in half of its frames.
    pub errors: Vec<Option<f64>>,
}

/// The errors of one object by sequence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SequencesReport {
    /// The name of the object.
    pub object: String,
    /// The keypoint, counted from 0.
    pub keypoint: usize,
    /// The sequences that show the object, the worst one first.
    pub errors: Vec<SequenceReport>,
}

/// [`SequenceError`] as JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SequenceReport {
    /// The name of the sequence.
    pub sequence: String,
    /// Frames in which the object is visible.
    pub frames: u64,
    /// The mean squared distance over these frames.
    pub error: f64,
    /// The number of the frame with the largest squared distance.
    pub worst_frame: u64,
    /// That squared distance.
    pub worst_error: f64,
}

/// [`Context`] as JSON; the shares stand in the order of `close`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ContextReport {
    /// The distances that count as close, as shares of the side of the image.
    pub close: Vec<f64>,
    /// Every object by linear regression from all keypoints, with PCK.
    pub regression: Vec<RegressionReport>,
    /// Keypoints matched one to one to objects, in every frame and in every sequence.
    pub assignment: Vec<AssignmentReport>,
}

/// [`Temporal`] as JSON: a table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct TemporalReport {
    /// The number of folds of the sequences that maps are held out on; 0: none.
    pub folds: usize,
    /// The rows.
    pub measures: Vec<MeasureReport>,
}

/// A row of a [`TemporalReport`]; null where there is nothing to be measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MeasureReport {
    /// Its name, of those in `docs/metrics.md`.
    pub measure: String,
    /// By object, of its best keypoint.
    pub objects: Vec<Option<f64>>,
    /// Of all objects together, where that is not a mean of theirs.
    pub all: Option<f64>,
}

impl TemporalReport {
    /// The report of `temporal`.
    pub fn new(temporal: &Temporal) -> Self {
        type Of = fn(&TemporalObject) -> Option<f64>;
        let all = &temporal.tap_vid;
        let rows: [(&str, Of, Option<f64>); 11] = [
            ("jitter", |o| o.jitter, None),
            ("velocity_correlation", |o| o.velocity_correlation, None),
            ("lag", |o| o.lag.map(|lag| lag as f64), None),
            ("handed_over", |o| o.handed_over, None),
            ("held_out_affine", |o| o.held_out.affine, None),
            ("held_out_orientation", |o| o.held_out.orientation, None),
            ("held_out_projective", |o| o.held_out.projective, None),
            (
                "visibility_accuracy",
                |o| o.tap_vid.occlusion_accuracy,
                all.occlusion_accuracy,
            ),
            (
                "position_accuracy",
                |o| o.tap_vid.position_accuracy,
                all.position_accuracy,
            ),
            (
                "average_jaccard",
                |o| o.tap_vid.average_jaccard,
                all.average_jaccard,
            ),
            ("oks", |o| o.oks, temporal.oks),
        ];
        let row =
            |measure: String, of: &dyn Fn(&TemporalObject) -> Option<f64>, all| MeasureReport {
                measure,
                objects: temporal.objects.iter().map(of).collect(),
                all,
            };
        let pck = CLOSE.iter().enumerate().map(|(i, close)| {
            let of = move |object: &TemporalObject| object.pck.map(|pck| pck[i]);
            row(format!("pck_{:.1}", 100.0 * close), &of, None)
        });
        let rows = rows
            .into_iter()
            .map(|(name, of, all)| row(name.to_owned(), &of, all));
        Self {
            folds: temporal.folds,
            measures: rows.chain(pck).collect(),
        }
    }
}

/// [`Regression`] as JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RegressionReport {
    /// The name of the object.
    pub object: String,
    /// Whether the frames that are predicted were not fitted.
    pub held_out: bool,
    /// Frames that were predicted.
    pub frames: u64,
    /// The mean squared distance of the predictions.
    pub error: Option<f64>,
    /// The share of frames whose prediction is close.
    pub pck: Option<Vec<f64>>,
}

/// [`Assignment`] as JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AssignmentReport {
    /// What is matched: `frame` or `sequence`.
    pub trajectory: String,
    /// The number of trajectories of keypoints.
    pub keypoints: u64,
    /// The number of trajectories of objects.
    pub objects: u64,
    /// The share of keypoints' trajectories that are matched closely.
    pub precision: Vec<f64>,
    /// The share of objects' trajectories that are matched closely.
    pub recall: Vec<f64>,
}

/// [`HeldOut`] as JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct HeldOutReport {
    /// The number of folds of the sequences.
    pub folds: usize,
    /// The seed that deals the sequences to the folds.
    pub seed: u64,
    /// The share of objects whose held-out error is at most their threshold.
    pub tc: f64,
    /// The objects.
    pub objects: Vec<HeldOutObject>,
}

/// [`Intervals`] as JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct IntervalsReport {
    /// `percentile bootstrap over sequences`.
    pub method: String,
    /// The share of resamples between the ends of an interval.
    pub level: f64,
    /// The number of resamples.
    pub resamples: usize,
    /// The seed that draws them.
    pub seed: u64,
    /// The interval of the tracking capability.
    pub tc: [f64; 2],
    /// The intervals of the objects' errors.
    pub objects: Vec<IntervalReport>,
}

/// One object of an [`IntervalsReport`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IntervalReport {
    /// Its name.
    pub name: String,
    /// The interval of the tracking error of its best keypoint; null where a resample does not show the object.
    pub error: Option<[f64; 2]>,
}

impl HeldOutReport {
    /// The report of `held_out`, whose folds `seed` dealt.
    pub fn new(held_out: &HeldOut, seed: u64) -> Self {
        Self {
            folds: held_out.folds,
            seed,
            tc: held_out.tracking_capability,
            objects: held_out.objects.clone(),
        }
    }
}

impl IntervalsReport {
    /// The report of `intervals`, drawn with `seed`, over the objects `names`.
    pub fn new(intervals: &Intervals, seed: u64, names: &[String]) -> Self {
        let objects = names.iter().zip(&intervals.errors);
        Self {
            method: "percentile bootstrap over sequences".to_owned(),
            level: intervals.level,
            resamples: intervals.resamples,
            seed,
            tc: intervals.tracking_capability,
            objects: objects
                .map(|(name, error)| IntervalReport {
                    name: name.clone(),
                    error: *error,
                })
                .collect(),
        }
    }
}

/// One object of an [`EvaluationReport`]; null where the object is visible in no frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ObjectReport {
    /// Its name.
    pub name: String,
    /// The threshold `mu_k` on the error.
    pub threshold: f64,
    /// Whether the error is at most the threshold.
    pub tracked: bool,
    /// `n*_k`, counted from 0.
    pub best_keypoint: Option<usize>,
    /// The keypoint with the second smallest error, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_best: Option<KeypointError>,
    /// The mean over time of the squared distance.
    pub error: Option<f64>,
    /// The sum over time of the squared distance.
    pub error_sum: Option<f64>,
    /// The root of `error`.
    pub rmse: Option<f64>,
    /// The root of the mean squared distance in pixels; present when the image size is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rmse_px: Option<f64>,
    /// Frames in which the object is visible.
    pub frames: u64,
    /// How many of them it lies outside the image in; they are included.
    pub outside: u64,
    /// `truth = a z + b` on column vectors (x, y), or (x, y, z).
    pub map: Option<AffineMap>,
}

/// A keypoint and its error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct KeypointError {
    /// Counted from 0.
    pub keypoint: usize,
    /// The mean over time of the squared distance.
    pub error: f64,
}

/// How frames were matched to rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JoinReport {
    /// Frames with a row.
    pub matched: usize,
    /// How sequences and frames were matched, in words.
    pub rules: Vec<String>,
    /// Frames without a row.
    pub unmatched_frames: Unmatched,
    /// Rows without a frame.
    pub unmatched_rows: Unmatched,
}

/// Frames or rows without a partner.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unmatched {
    /// How many.
    pub count: usize,
    /// The first ones by name.
    pub first: Vec<String>,
}

impl EvaluationReport {
    /// The report of `evaluation`; with the `[width, height]` of the images also in pixels, with
    /// the join also what found no partner.
    pub fn new(
        evaluation: &Evaluation,
        image_size: Option<[u32; 2]>,
        join: Option<&JoinReport>,
    ) -> Self {
        let in_image = evaluation.axes == [2; 2];
        // Only what is in the image has an error in its pixels.
        let pixels = image_size.filter(|_| evaluation.axes[1] == 2);
        let objects: Vec<ObjectReport> = evaluation
            .objects
            .iter()
            .zip(evaluation.errors.outer_iter())
            .map(|(object, errors)| {
                let fit = object.best.map(|best| best.fit);
                ObjectReport {
                    name: object.name.clone(),
                    threshold: object.threshold,
                    tracked: object.tracked,
                    best_keypoint: object.best.map(|best| best.keypoint),
                    second_best: object.best.and_then(|best| {
                        let others = errors
                            .iter()
                            .enumerate()
                            .filter(|(n, _)| *n != best.keypoint);
                        let second = others.min_by(|a, b| a.1.total_cmp(b.1));
                        second.map(|(keypoint, error)| KeypointError {
                            keypoint,
                            error: *error,
                        })
                    }),
                    error: fit.map(|f| f.error()),
                    error_sum: fit.map(|f| f.error_sum()),
                    rmse: fit.map(|f| f.rmse()),
                    rmse_px: fit.zip(pixels).map(|(f, size)| f.rmse_px(size)),
                    frames: object.frames,
                    outside: object.outside,
                    map: fit.map(|f| f.map),
                }
            })
            .collect();
        let finite = |e: &f64| Some(*e).filter(|e| e.is_finite());
        Self {
            schema: format!("{SCHEMA}{}", if in_image { IN_IMAGE } else { NEWEST }),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: None,
            tc: Some(evaluation.tracking_capability),
            frames: evaluation.frames,
            excluded: evaluation.excluded,
            missing: evaluation
                .missing
                .iter()
                .any(|missing| *missing > 0)
                .then(|| evaluation.missing.clone()),
            transform: evaluation.settings.transform.name().to_owned(),
            rank: evaluation.settings.rank.name().to_owned(),
            protocol: "fit-and-score-same-frames".to_owned(),
            errors: evaluation
                .errors
                .outer_iter()
                .map(|row| row.iter().map(finite).collect())
                .collect(),
            warnings: join
                .into_iter()
                .flat_map(JoinReport::warnings)
                .chain(warnings(evaluation))
                .collect(),
            findings: Vec::new(),
            objects,
            image_size,
            dimensions: (!in_image).then_some(Dimensions {
                keypoints: evaluation.axes[0],
                truth: evaluation.axes[1],
            }),
            camera: None,
            join: join.cloned(),
            sufficiency: None,
            confidence: None,
            held_out: None,
            intervals: None,
            sequences: None,
            context: None,
            temporal: None,
        }
    }

    /// Whether errors are in the unit of a ground truth in space, not in ndc.
    pub fn is_in_space(&self) -> bool {
        self.dimensions
            .is_some_and(|dimensions| dimensions.truth == 3)
    }

    /// Takes up that a camera put the ground truth into the image.
    pub fn take_camera(&mut self, camera: CameraReport) {
        if camera.behind > 0 {
            self.warnings.push(format!(
                "{} of {} positions lie behind the camera and count as not visible",
                camera.behind,
                camera.behind + camera.projected
            ));
        }
        self.camera = Some(camera);
    }

    /// Says that the thresholds of `names`, which are defaults, are times `unit`.
    pub(super) fn take_threshold_unit(&mut self, names: &[&str], unit: f64) {
        if MOST_AXES == 3 && unit != 1.0 && !names.is_empty() {
            self.warnings.push(format!(
                "the thresholds of {} are the defaults of an image, with the longest side of the box around all \
                 objects ({:.6}) in the place of its side; give your own with --threshold, in the squared unit of \
                 the ground truth",
                names.join(", "),
                2.0 * unit.sqrt()
            ));
        }
    }

    /// Takes up whether the data were enough: the TC is unknown where they were not. An object that
    /// is visible nowhere counts as not tracked instead.
    pub fn judge(&mut self, sufficiency: Vec<Sufficiency>) {
        let visible = sufficiency.iter().zip(&self.objects);
        let unknown: Vec<String> = visible
            .filter(|(found, object)| !found.is_known && object.frames > 0)
            .map(|(found, object)| why_unknown(found, object.threshold))
            .collect();
        if !unknown.is_empty() {
            self.tc = None;
            self.warnings.splice(0..0, unknown);
        }
        self.sufficiency = Some(sufficiency);
    }

    /// Takes up what was hidden, and says it.
    pub(super) fn take_confidence(&mut self, confidence: ConfidenceReport) {
        let keypoints = (confidence.least_keypoints, confidence.hidden_keypoints);
        let truth = (confidence.least_truth, confidence.hidden_truth);
        for ((least, hidden), what, are) in [
            (keypoints, "keypoints", "missing"),
            (truth, "positions of the ground truth", "not visible"),
        ] {
            let Some(least) = least else { continue };
            self.warnings.push(match hidden {
                Some(n) => format!("{n} {what} have a confidence below {least} and count as {are}"),
                None => {
                    format!("the {what} have no confidence: the smallest one, {least}, hides none")
                }
            });
        }
        self.confidence = Some(confidence);
    }

    /// Takes up the held-out errors, and says if they make another TC.
    pub fn hold_out(&mut self, held_out: HeldOutReport) {
        if let Some(tc) = self.tc.filter(|tc| *tc != held_out.tc) {
            self.warnings.push(format!(
                "on held-out sequences TC is {:.3} instead of {tc:.3}: maps fitted on these \
                 sequences do not carry over to others",
                held_out.tc
            ));
        }
        self.held_out = Some(held_out);
    }

    /// Reads the JSON of an evaluation, of this schema or an older one. `name` is that of the file.
    ///
    /// # Errors
    /// When it is not such JSON, has a newer schema, or its parts do not fit each other; the message
    /// says what to do.
    pub fn parse(bytes: &[u8], name: &str) -> Result<Self> {
        let wrong = |text: String| Error::input(text).at(name);
        #[derive(Deserialize)]
        struct Head {
            schema: Option<String>,
        }
        let head: Head = serde_json::from_slice(bytes).map_err(|e| {
            wrong(format!(
                "not the JSON of an evaluation ({e}); expected what `tracklens score --json` prints"
            ))
        })?;
        let schema = head.schema.as_deref().unwrap_or_default();
        let number = schema
            .strip_prefix(SCHEMA)
            .and_then(|n| n.parse::<u32>().ok());
        match number {
            Some(1..=NEWEST) => {}
            Some(newer) if newer > NEWEST => {
                return Err(wrong(format!(
                    "the evaluation has the schema `{schema}`; this version ({}) reads up to `{SCHEMA}{NEWEST}`. Use the \
                     version of tracklens that wrote it, or a newer one",
                    env!("CARGO_PKG_VERSION")
                )));
            }
            _ => {
                return Err(wrong(format!(
                    "the schema is `{schema}`; expected `{SCHEMA}{IN_IMAGE}` or {NEWEST}, as `tracklens score --json` writes it"
                )));
            }
        }
        let report: Self = serde_json::from_slice(bytes).map_err(|e| {
            wrong(format!(
                "the evaluation is not complete: {e}; save it again"
            ))
        })?;
        let keypoints = report.errors.first().map_or(0, Vec::len);
        let fits = report.errors.len() == report.objects.len()
            && report.errors.iter().all(|row| row.len() == keypoints)
            && report
                .objects
                .iter()
                .all(|object| object.best_keypoint.is_none_or(|n| n < keypoints));
        if report.objects.is_empty() || keypoints == 0 || !fits {
            return Err(wrong(format!(
                "{} objects and a matrix of {} x {keypoints} errors do not make an evaluation; expected one row an object, \
                 of equal lengths",
                report.objects.len(),
                report.errors.len()
            )));
        }
        Ok(report)
    }
}

fn why_unknown(found: &Sufficiency, threshold: f64) -> String {
    let name = &found.name;
    let Some(needed) = found.needed else {
        return format!(
            "TC is unknown: object `{name}` hardly moves. Its variance is {:.5} and its threshold \
             {threshold}, so that any keypoint passes for tracking it. Score frames in which it \
             moves more, or lower its threshold (--threshold)",
            found.variance
        );
    };
    let enough = match needed.sequences {
        Some(sequences) => format!("{sequences} sequences ({} frames)", needed.frames),
        None => format!("{} frames", needed.frames),
    };
    format!(
        "TC is unknown: the frames of object `{name}` amount to {:.1} independent positions, too \
         few to tell tracking from chance. {enough} like these are enough",
        found.observations
    )
}

/// What the map is between points of which one has more coordinates than the other.
fn on_dimensions(axes: [usize; 2]) -> Option<String> {
    let text = match axes {
        _ if MOST_AXES == 2 => return None,
        [2, 3] => {
            "keypoints have two coordinates and the ground truth three: the map is the best linear one from the \
             image into space, and errors are in the unit of the ground truth"
        }
        [3, 2] => {
            "keypoints have three coordinates and the ground truth two: the map is the best linear one from space \
             into the image, and errors are in ndc"
        }
        _ => return None,
    };
    Some(text.to_owned())
}

fn warnings(evaluation: &Evaluation) -> Vec<String> {
    let mut out: Vec<String> = on_dimensions(evaluation.axes).into_iter().collect();
    for object in &evaluation.objects {
        if object.best.is_none() {
            let why = if object.frames == 0 {
                "is visible in no frame"
            } else {
                "has no keypoint that is found in at least half of its frames"
            };
            out.push(format!(
                "object `{}` {why} and counts as not tracked",
                object.name
            ));
        } else if object.frames < 30 {
            out.push(format!(
                "object `{}` is visible in only {} frame(s), too few to judge a fitted map",
                object.name, object.frames
            ));
        }
        if object.outside > 0 {
            out.push(format!(
                "object `{}` is outside the image in {} of {} frames (included)",
                object.name, object.outside, object.frames
            ));
        }
    }
    if evaluation.directions_dropped > 0 && evaluation.settings.transform != Transform::Identity {
        out.push(format!(
            "in {} of {} keypoint-object pairs the keypoint does not move in every direction; the rank rule \
             `{}` left that direction out of the fit",
            evaluation.directions_dropped,
            evaluation.errors.len(),
            evaluation.settings.rank.name()
        ));
    }
    let missing = evaluation.missing.iter().enumerate();
    let missing: Vec<String> = missing
        .filter(|(_, count)| **count > 0)
        .map(|(n, count)| format!("{n} ({count})"))
        .collect();
    if !missing.is_empty() {
        let more = missing.len().saturating_sub(SHOWN);
        let shown = missing[..missing.len() - more].join(", ");
        let rest = if more > 0 {
            format!(" and {more} more")
        } else {
            String::new()
        };
        out.push(format!(
            "{} keypoint(s) are missing in some of {} frames, which do not count for them: {shown}{rest}",
            missing.len(),
            evaluation.frames
        ));
    }
    if evaluation.excluded > 0 {
        out.push(format!(
            "{} frames were left out because a keypoint was not a finite number",
            evaluation.excluded
        ));
    }
    out
}

impl SequencesReport {
    /// The report of `errors`; `keys` are the joined frames.
    pub fn new(object: &str, keypoint: usize, errors: &[SequenceError], keys: &[FrameKey]) -> Self {
        let sequence = |error: &SequenceError| SequenceReport {
            sequence: error.range.name.clone(),
            frames: error.frames,
            error: error.error,
            worst_frame: keys[error.worst].frame,
            worst_error: error.worst_error,
        };
        Self {
            object: object.to_owned(),
            keypoint,
            errors: errors.iter().map(sequence).collect(),
        }
    }
}

impl ContextReport {
    /// The report of `context`, whose objects are `names`.
    pub fn new(context: &Context, names: &[String]) -> Self {
        let regression = |held_out: bool, found: &[Regression]| {
            let objects = names.iter().zip(found);
            objects
                .map(|(name, found)| RegressionReport {
                    object: name.clone(),
                    held_out,
                    frames: found.frames,
                    error: found.error,
                    pck: found.close.map(|shares| shares.to_vec()),
                })
                .collect::<Vec<_>>()
        };
        let assignment = |trajectory: &str, found: &Assignment| AssignmentReport {
            trajectory: trajectory.to_owned(),
            keypoints: found.keypoints,
            objects: found.objects,
            precision: found.precision.to_vec(),
            recall: found.recall.to_vec(),
        };
        let mut objects = regression(false, &context.regression);
        if let Some(held_out) = &context.held_out_regression {
            objects.extend(regression(true, held_out));
        }
        Self {
            close: CLOSE.to_vec(),
            regression: objects,
            assignment: vec![
                assignment("frame", &context.frames),
                assignment("sequence", &context.sequences),
            ],
        }
    }
}

impl JoinReport {
    fn warnings(&self) -> Vec<String> {
        let counted = |what: &str, unmatched: &Unmatched| {
            let more = if unmatched.count > unmatched.first.len() {
                "; …"
            } else {
                ""
            };
            // Of most frames, so few can be matched by chance.
            let question = match unmatched.count > self.matched {
                true => {
                    ". These are most: are frames numbered alike in both, and sequences named alike?"
                }
                false => "",
            };
            (unmatched.count > 0).then(|| {
                format!(
                    "{} {what}: {}{more}{question}",
                    unmatched.count,
                    unmatched.first.join("; ")
                )
            })
        };
        let frames = counted(
            "frame(s) without a row of ground truth do not count",
            &self.unmatched_frames,
        );
        let rows = counted(
            "frame(s) of the ground truth without keypoints do not count",
            &self.unmatched_rows,
        );
        frames.into_iter().chain(rows).collect()
    }

    /// The report of a join of `frames` to `rows`.
    pub fn new(join: &Join, frames: &[FrameKey], rows: &[FrameKey]) -> Self {
        let unmatched = |keys: &[FrameKey], at: &[usize]| Unmatched {
            count: at.len(),
            first: at
                .iter()
                .take(SHOWN)
                .map(|i| keys[*i].to_string())
                .collect(),
        };
        Self {
            matched: join.pairs.len(),
            rules: join.rules.clone(),
            unmatched_frames: unmatched(frames, &join.unmatched_left),
            unmatched_rows: unmatched(rows, &join.unmatched_right),
        }
    }
}
