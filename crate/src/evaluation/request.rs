//! A whole evaluation: what the terminal and the page both call.

use super::confidence::MinConfidence;
use super::document::{
    ConfidenceLevel, ConfidenceReport, ContextReport, EvaluationReport, HeldOutReport,
    IntervalsReport, JoinReport, SequencesReport, TemporalReport,
};
use super::scoring::{Level, Scoring};
use super::thresholds::Thresholds;
use crate::error::{Error, Result};
use crate::metric::Settings;

/// Folds of the sequences by default.
const FOLDS: usize = 5;

/// How to score, and what to report with the errors.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// The map and the rank rule.
    pub settings: Settings,
    /// The thresholds on the errors.
    pub thresholds: Thresholds,
    /// Width and height of the images, for errors in pixels.
    pub image_size: Option<[u32; 2]>,
    /// Also fit and score on different sequences, in this many folds; 0: do not. By default in
    /// five, or as many as there are sequences, if there are at least two.
    pub folds: Option<usize>,
    /// Also give 95 % intervals, from this many resamples.
    pub bootstrap: Option<usize>,
    /// Seeds the folds and the bootstrap.
    pub seed: u64,
    /// Also give the errors by sequence.
    pub sequences: bool,
    /// Also give other metrics of the same data.
    pub context: bool,
    /// Also measure the best keypoints over time.
    pub temporal: bool,
    /// The confidences from which on keypoints count in the curve of the TC, where they have any; by
    /// default where the confidences differ.
    pub confidence_levels: Vec<f64>,
}

impl Request {
    /// Scores; `join` says how the frames of `scoring` were matched to rows.
    ///
    /// # Errors
    /// As the calls of [`Scoring`] that it makes.
    pub fn evaluate(&self, scoring: &Scoring, join: &JoinReport) -> Result<EvaluationReport> {
        let (thresholds, settings, seed) = (&self.thresholds, &self.settings, self.seed);
        let evaluation = scoring.evaluate(thresholds, settings)?;
        let mut report = EvaluationReport::new(&evaluation, self.image_size, Some(join));
        let given = |name: &&str| thresholds.given().iter().all(|own| own.object() != *name);
        let defaults: Vec<&str> = scoring
            .objects()
            .iter()
            .map(String::as_str)
            .filter(given)
            .collect();
        report.take_threshold_unit(&defaults, scoring.threshold_unit());
        report.judge(scoring.sufficiency(thresholds)?);
        if let Some(confidence) = self.confidence(scoring)? {
            report.take_confidence(confidence);
        }
        match self.folds {
            Some(0) => {}
            Some(folds) => {
                let held_out = scoring.held_out(folds, seed, thresholds, settings)?;
                report.hold_out(HeldOutReport::new(&held_out, seed));
            }
            None if scoring.sequence_count() < 2 => {}
            None => {
                let folds = scoring.sequence_count().min(FOLDS);
                match scoring.held_out(folds, seed, thresholds, settings) {
                    Ok(held_out) => report.hold_out(HeldOutReport::new(&held_out, seed)),
                    Err(e) => report
                        .warnings
                        .push(format!("there are no held-out errors: {e}")),
                }
            }
        }
        if let Some(resamples) = self.bootstrap {
            let intervals = scoring.bootstrap(resamples, seed, thresholds, settings)?;
            report.intervals = Some(IntervalsReport::new(&intervals, seed, scoring.objects()));
        }
        if self.sequences {
            let objects = evaluation.objects.iter().enumerate();
            let best =
                objects.filter_map(|(k, object)| Some((k, &object.name, object.best?.keypoint)));
            let sequences = best.map(|(k, name, keypoint)| {
                let errors = scoring.sequence_errors(k, keypoint, settings)?;
                Ok(SequencesReport::new(
                    name,
                    keypoint,
                    &errors,
                    scoring.keys(),
                ))
            });
            report.sequences = Some(sequences.collect::<Result<_>>()?);
        }
        if self.context {
            let context = scoring.context(self.folds.filter(|n| *n > 0).map(|n| (n, seed)))?;
            report.context = Some(ContextReport::new(&context, scoring.objects()));
        }
        Ok(report)
    }

    /// The measures over time, if they are asked for. Apart from [`Request::evaluate`], so that a
    /// program that never asks for them is not larger for it.
    ///
    /// # Errors
    /// As [`Scoring::temporal`].
    pub fn temporal(&self, scoring: &Scoring) -> Result<Option<TemporalReport>> {
        let sequences = scoring.sequence_count();
        let folds = self.folds.unwrap_or(FOLDS.min(sequences));
        let folds = (folds > 1 && sequences > 1).then_some(folds);
        let measure = || scoring.temporal(folds, self.seed, &self.thresholds, &self.settings);
        let measured = self.temporal.then(measure).transpose()?;
        Ok(measured.as_ref().map(TemporalReport::new))
    }

    /// What was hidden, and the score as a function of the confidence; none where there is neither.
    fn confidence(&self, scoring: &Scoring) -> Result<Option<ConfidenceReport>> {
        if let Some(bad) = self
            .confidence_levels
            .iter()
            .find(|level| !level.is_finite())
        {
            return Err(Error::input(format!(
                "the level of confidence {bad} is not a finite number"
            )));
        }
        let (least, [keypoints, truth]) = scoring.hidden();
        let level = |level: &Level| {
            let scored = scoring.evaluate_level(level, &self.thresholds, &self.settings)?;
            let (evaluation, enough) = scored;
            let visible = enough.iter().zip(&evaluation.objects);
            let is_known = visible
                .clone()
                .all(|(enough, object)| enough.is_known || object.frames == 0);
            let errors = evaluation.objects.iter().map(|o| Some(o.best?.fit.error()));
            Ok(ConfidenceLevel {
                least: level.least,
                kept: level.kept,
                tc: is_known.then_some(evaluation.tracking_capability),
                errors: errors.collect(),
            })
        };
        let levels = scoring.at_levels(&self.confidence_levels, level)?;
        if levels.is_empty() && least == MinConfidence::default() {
            return Ok(None);
        }
        Ok(Some(ConfidenceReport {
            least_keypoints: least.keypoints,
            hidden_keypoints: keypoints,
            least_truth: least.truth,
            hidden_truth: truth,
            levels,
        }))
    }
}
