//! Scoring of arrays.

use std::collections::BTreeMap;

use pyo3::prelude::*;
use tracklens::data::{
    Alignment, AxisOrder, Camera, Flip, Notice, Parsed, PointSequences, Space, TableOptions,
};
use tracklens::error::{Error, Result};
use tracklens::evaluation::{
    EvaluationReport, Matching, MinConfidence, Request, Sides, Threshold, Thresholds,
};
use tracklens::metric::{NonFinite, Rank, Settings};
use tracklens::track::{GroundTruth, KeypointTrack};

use crate::errors::exception;
use crate::evaluation::Evaluation;
use crate::points::Sequences;

/// The options of `tracklens score` that say something about arrays, under their names.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Options {
    names: Option<Vec<String>>,
    objects: Option<Vec<String>>,
    image_size: Option<[u32; 2]>,
    transform: String,
    rank: Option<String>,
    /// The JSON of a camera.
    camera: Option<String>,
    xy_only: bool,
    thresholds: BTreeMap<String, f64>,
    non_finite: String,
    min_confidence: Option<f64>,
    truth_min_confidence: Option<f64>,
    confidence_levels: Vec<f64>,
    shift_frames: i64,
    shift_sequences: i64,
    rare_keypoints: bool,
    folds: Option<usize>,
    bootstrap: Option<usize>,
    resampling_seed: u64,
    sequences: bool,
    context: bool,
    temporal: bool,
    strict: bool,
    truth_reading: Reading,
    keypoints_reading: Reading,
}

/// How the numbers of one side are to be read.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Reading {
    space: Option<String>,
    axis_order: Option<String>,
    flip: Option<String>,
    zero_is_missing: bool,
}

impl Reading {
    fn options(&self, image_size: Option<[u32; 2]>, xy_only: bool) -> Result<TableOptions> {
        Ok(TableOptions {
            space: parsed::<Space>(self.space.as_ref())?,
            axes: parsed::<AxisOrder>(self.axis_order.as_ref())?,
            flip: parsed::<Flip>(self.flip.as_ref())?,
            zero_is_missing: self.zero_is_missing.then_some(true),
            image_size,
            xy_only,
            ..TableOptions::default()
        })
    }
}

fn parsed<T: std::str::FromStr<Err = Error>>(text: Option<&String>) -> Result<Option<T>> {
    text.map(|text| text.parse()).transpose()
}

impl Options {
    /// `axes` is the number of coordinates of a keypoint.
    fn request(&self, image_size: Option<[u32; 2]>, axes: usize) -> Result<Request> {
        let thresholds = self.thresholds.iter();
        let thresholds = thresholds.map(|(name, value)| Threshold::new(name, *value));
        Ok(Request {
            settings: Settings {
                transform: self.transform.parse()?,
                rank: parsed(self.rank.as_ref())?.unwrap_or(Rank::of_axes(axes)),
                rare_keypoints: self.rare_keypoints,
            },
            thresholds: Thresholds::new(thresholds.collect::<Result<Vec<_>>>()?)?,
            image_size,
            folds: self.folds,
            bootstrap: self.bootstrap,
            seed: self.resampling_seed,
            sequences: self.sequences,
            context: self.context,
            temporal: self.temporal,
            confidence_levels: self.confidence_levels.clone(),
        })
    }

    fn matching(&self) -> Result<Matching> {
        Ok(Matching {
            least: MinConfidence::new(self.min_confidence, self.truth_min_confidence)?,
            alignment: Alignment {
                frames: self.shift_frames,
                sequences: self.shift_sequences,
            },
        })
    }

    /// Joins and scores, as `tracklens score` does.
    fn score(
        &self,
        truth: &Parsed<GroundTruth>,
        keypoints: &Parsed<KeypointTrack>,
    ) -> Result<EvaluationReport> {
        let policy: NonFinite = self.non_finite.parse()?;
        let camera = self.camera.as_deref();
        let camera = camera.map(|json| Camera::parse(json.as_bytes(), "`camera`"));
        let camera = camera.transpose()?;
        let projected = camera.as_ref().map(|camera| camera.project(&truth.content));
        let projected = projected.transpose()?;
        let sides = Sides {
            truth: projected
                .as_ref()
                .map_or(&truth.content, |image| &image.truth),
            // What a camera projects is no longer what the array says.
            truth_reading: Some(&truth.reading).filter(|_| projected.is_none()),
            keypoints: &keypoints.content,
            keypoints_reading: Some(&keypoints.reading),
        };
        let image_size = self.image_size.or(camera.map(|camera| camera.image_size));
        let request = self.request(image_size, keypoints.content.axes())?;
        let mut report = sides.score(&request, self.matching()?, policy)?.report;
        if let Some(image) = &projected {
            report.take_camera(image.into());
        }
        if self.strict && report.tc.is_none() {
            return Err(Error::numeric(format!(
                "the TC is unknown because there is not enough data (strict): {}",
                report.warnings.first().map_or("", String::as_str)
            )));
        }
        Ok(report)
    }
}

/// See `_score.py`, which gives every option.
#[pyfunction]
pub(crate) fn score<'py>(
    py: Python<'py>,
    keypoints: &Bound<'py, PyAny>,
    truth: &Bound<'py, PyAny>,
    confidence: Option<&Bound<'py, PyAny>>,
    truth_confidence: Option<&Bound<'py, PyAny>>,
    options: Options,
) -> PyResult<Evaluation> {
    let points =
        |given, sure: Option<&Bound<'py, PyAny>>, name, axes: [&str; 2], reading: &Reading| {
            let points = Sequences::parse(given, name, axes[0])?;
            let sure =
                sure.map(|sure| Sequences::parse(sure, &format!("{name} confidence"), axes[1]));
            let sure = sure.transpose()?;
            let confidences = sure.as_ref().map(Sequences::confidences).transpose()?;
            let options = reading
                .options(options.image_size, options.xy_only)
                .map_err(|e| exception(&e))?;
            PointSequences::new(name, &points.points()?, confidences.as_deref(), &options)
                .map_err(|e| exception(&e))
        };
    let axes = ["T, N, 2", "T, N"];
    let keypoints = points(
        keypoints,
        confidence,
        "keypoints",
        axes,
        &options.keypoints_reading,
    )?;
    let axes = ["T, K, 2", "T, K"];
    let truth = points(
        truth,
        truth_confidence,
        "truth",
        axes,
        &options.truth_reading,
    )?;
    let scored = py.detach(|| -> Result<Evaluation> {
        let keypoints = keypoints.into_keypoints()?;
        let mut truth = truth.into_truth(options.names.clone())?;
        if let Some(objects) = &options.objects {
            truth.content = truth.content.select(objects)?;
        }
        let report = options.score(&truth, &keypoints)?;
        let rules = report
            .join
            .iter()
            .flat_map(|join| join.rules.iter().cloned());
        let said = |whose: &str, notices: &[Notice]| -> Vec<String> {
            notices
                .iter()
                .map(|notice| format!("{whose}: {notice}"))
                .collect()
        };
        let mut notes = said("keypoints", &keypoints.notices);
        notes.extend(said("truth", &truth.notices));
        notes.extend(rules);
        Ok(Evaluation::new(report, notes))
    });
    scored.map_err(|e| exception(&e))
}
