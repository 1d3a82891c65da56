//! An evaluation as JSON and CSV (schema `tracklens/evaluation/1`).

use serde::{Deserialize, Serialize};

use crate::data::Join;
use crate::metric::{Evaluation, Transform};
use crate::track::FrameKey;

const CSV_HEADER: &str = "object,tracked,error,threshold,best_keypoint,error_sum,rmse,rmse_px,frames,outside,\
                          transform,rank,protocol\n";

/// How many names of unmatched frames a report shows.
const SHOWN: usize = 5;

/// The result of scoring one detector, as written to JSON. Points and errors are in ndc, (x, y).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EvaluationReport {
    /// `tracklens/evaluation/1`.
    pub schema: String,
    /// The version that computed it.
    pub version: String,
    /// Tracking capability: the share of tracked objects.
    pub tc: f64,
    /// The number of frames T.
    pub frames: u64,
    /// Frames left out because a keypoint was not finite.
    pub excluded: u64,
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
    /// What a person should know.
    pub warnings: Vec<String>,
}

/// One object of an [`EvaluationReport`]; null where the object is visible in no frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectReport {
    /// Its name.
    pub name: String,
    /// The threshold `mu_k` on the error.
    pub threshold: f64,
    /// Whether the error is at most the threshold.
    pub tracked: bool,
    /// `n*_k`, counted from 0.
    pub best_keypoint: Option<usize>,
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
    /// Of these, frames in which it lies outside the image; they count.
    pub outside: u64,
    /// `truth = a z + b` on column vectors (x, y).
    pub map: Option<MapReport>,
}

/// An affine map on column vectors (x, y).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MapReport {
    /// The matrix, row by row.
    pub a: [[f64; 2]; 2],
    /// The shift.
    pub b: [f64; 2],
}

/// How frames found their rows.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
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

/// What found no partner.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unmatched {
    /// How many.
    pub count: usize,
    /// The first ones by name.
    pub first: Vec<String>,
}

impl EvaluationReport {
    /// The report of `evaluation`; with the `[width, height]` of the images also in pixels, with the join also what
    /// found no partner.
    pub fn new(evaluation: &Evaluation, image_size: Option<[u32; 2]>, join: Option<&JoinReport>) -> Self {
        let objects: Vec<ObjectReport> = evaluation
            .objects
            .iter()
            .map(|object| {
                let fit = object.best.map(|best| best.fit);
                ObjectReport {
                    name: object.name.clone(),
                    threshold: object.threshold,
                    tracked: object.tracked,
                    best_keypoint: object.best.map(|best| best.keypoint),
                    error: fit.map(|f| f.error()),
                    error_sum: fit.map(|f| f.error_sum()),
                    rmse: fit.map(|f| f.rmse()),
                    rmse_px: fit.zip(image_size).map(|(f, size)| f.rmse_px(size)),
                    frames: object.frames,
                    outside: object.outside,
                    map: fit.map(|f| MapReport {
                        a: f.map.a,
                        b: f.map.b,
                    }),
                }
            })
            .collect();
        let finite = |e: &f64| Some(*e).filter(|e| e.is_finite());
        Self {
            schema: "tracklens/evaluation/1".to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            tc: evaluation.tracking_capability,
            frames: evaluation.frames,
            excluded: evaluation.excluded,
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
            objects,
        }
    }

    /// One line an object as CSV: what a spreadsheet of many evaluations is made of.
    pub fn to_csv(&self) -> String {
        use std::fmt::Write as _;
        let text = |value: Option<f64>| value.map(|v| v.to_string()).unwrap_or_default();
        let mut out = String::from(CSV_HEADER);
        for o in &self.objects {
            let name = crate::data::quote_csv(&o.name);
            let best = o.best_keypoint.map(|n| n.to_string()).unwrap_or_default();
            // Writing to a String cannot fail.
            let _ = writeln!(
                out,
                "{name},{},{},{},{best},{},{},{},{},{},{},{},{}",
                o.tracked,
                text(o.error),
                o.threshold,
                text(o.error_sum),
                text(o.rmse),
                text(o.rmse_px),
                o.frames,
                o.outside,
                self.transform,
                self.rank,
                self.protocol
            );
        }
        out
    }
}

fn warnings(evaluation: &Evaluation) -> Vec<String> {
    let mut out = Vec::new();
    for object in &evaluation.objects {
        if object.best.is_none() {
            out.push(format!(
                "object `{}` is visible in no frame and counts as not tracked",
                object.name
            ));
        } else if object.frames < 30 {
            out.push(format!(
                "object `{}` is visible in {} frames: a fitted map needs more to say something",
                object.name, object.frames
            ));
        }
        if object.outside > 0 {
            out.push(format!(
                "object `{}` lies outside the image in {} of {} frames; they count",
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
    if evaluation.excluded > 0 {
        out.push(format!(
            "{} frames were left out because a keypoint was not a finite number",
            evaluation.excluded
        ));
    }
    out
}

impl JoinReport {
    fn warnings(&self) -> Vec<String> {
        let told = |what: &str, unmatched: &Unmatched| {
            let more = if unmatched.count > unmatched.first.len() {
                "; …"
            } else {
                ""
            };
            (unmatched.count > 0)
                .then(|| format!("{} {what}: {}{more}", unmatched.count, unmatched.first.join("; ")))
        };
        let frames = told(
            "frame(s) without a row of ground truth do not count",
            &self.unmatched_frames,
        );
        let rows = told(
            "frame(s) of the ground truth without keypoints do not count",
            &self.unmatched_rows,
        );
        frames.into_iter().chain(rows).collect()
    }

    /// The report of a join of `frames` to `rows`.
    pub fn new(join: &Join, frames: &[FrameKey], rows: &[FrameKey]) -> Self {
        let unmatched = |keys: &[FrameKey], at: &[usize]| Unmatched {
            count: at.len(),
            first: at.iter().take(SHOWN).map(|i| keys[*i].to_string()).collect(),
        };
        Self {
            matched: join.pairs.len(),
            rules: join.rules.clone(),
            unmatched_frames: unmatched(frames, &join.unmatched_left),
            unmatched_rows: unmatched(rows, &join.unmatched_right),
        }
    }
}
