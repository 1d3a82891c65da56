//! One evaluation with everything that is asked of it: what the terminal and the page both call.

use super::evaluation::{
    ContextReport, EvaluationReport, HeldOutReport, IntervalsReport, JoinReport, SequencesReport,
};
use crate::error::{Error, Result};
use crate::metric::{NonFinite, Settings, Transform};
use crate::scoring::Scoring;

/// How to score, and what to say beside the errors.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// The map and the rank rule.
    pub settings: Settings,
    /// Thresholds by object name; the others keep their default.
    pub thresholds: Vec<(String, f64)>,
    /// Width and height of the images, for errors in pixels.
    pub image_size: Option<[u32; 2]>,
    /// Also fit and score on different sequences, in this many folds.
    pub folds: Option<usize>,
    /// Also give 95 % intervals, from this many resamples.
    pub bootstrap: Option<usize>,
    /// Deals sequences to folds and draws the bootstrap.
    pub seed: u64,
    /// Also give the errors by sequence.
    pub sequences: bool,
    /// Also give what others measure.
    pub context: bool,
}

/// The files of an evaluation, as they are named in a command.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Inputs {
    /// The ground truth.
    pub truth: String,
    /// The table of keypoints, in place of a checkpoint and frames.
    pub keypoints: Option<String>,
    /// The checkpoint.
    pub checkpoint: Option<String>,
    /// The folder of frames, or a recording.
    pub frames: Option<String>,
    /// Options of reading, word by word, e.g. `--space`, `px`.
    pub options: Vec<String>,
}

impl Request {
    /// Scores; `join` is how the frames of `scoring` found their rows.
    ///
    /// # Errors
    /// As the calls of [`Scoring`] that it makes.
    pub fn evaluate(&self, scoring: &Scoring, join: &JoinReport) -> Result<EvaluationReport> {
        let (thresholds, settings, seed) = (&self.thresholds, &self.settings, self.seed);
        let evaluation = scoring.evaluate(thresholds, settings)?;
        let mut report = EvaluationReport::new(&evaluation, self.image_size, Some(join));
        if settings.transform != Transform::Identity && self.folds.is_none() {
            let sequences = scoring.sequence_count();
            let told = scoring.hardly_moving()?.into_iter().map(|k| {
                format!(
                    "object `{}` hardly moves within the {sequences} sequences: a fitted map comes close to so few positions \
                     whatever the keypoint does. Score more sequences, or on held-out folds (--folds)",
                    scoring.objects()[k]
                )
            });
            report.warnings.extend(told);
        }
        if let Some(folds) = self.folds {
            let held_out = scoring.held_out(folds, seed, thresholds, settings)?;
            report.held_out = Some(HeldOutReport::new(&held_out, seed));
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
            let context = scoring.context(self.folds.map(|folds| (folds, seed)))?;
            report.context = Some(ContextReport::new(&context, scoring.objects()));
        }
        Ok(report)
    }

    /// The command of the terminal that gives the same evaluation of `inputs`, with quotes where a
    /// shell needs them. What is the default is left out.
    ///
    /// # Errors
    /// When a name cannot be written in a shell.
    pub fn command(&self, inputs: &Inputs, policy: NonFinite) -> Result<String> {
        let mut words: Vec<String> = vec!["tracklens".to_owned()];
        let mut add = |parts: &[&str]| words.extend(parts.iter().map(|part| (*part).to_owned()));
        match (&inputs.keypoints, &inputs.checkpoint) {
            (None, Some(checkpoint)) => {
                add(&["eval", "--checkpoint", checkpoint]);
                add(&["--frames", inputs.frames.as_deref().unwrap_or(".")]);
                add(&["--truth", &inputs.truth]);
            }
            (keypoints, _) => {
                add(&["score", "--truth", &inputs.truth]);
                add(&[
                    "--keypoints",
                    keypoints.as_deref().unwrap_or("keypoints.csv"),
                ]);
                if let Some([width, height]) = self.image_size {
                    add(&["--image-size", &format!("{width}x{height}")]);
                }
            }
        }
        for option in &inputs.options {
            add(&[option]);
        }
        let default = Settings::default();
        if self.settings.transform != default.transform {
            add(&["--transform", self.settings.transform.name()]);
        }
        if self.settings.rank != default.rank {
            add(&["--rank", self.settings.rank.name()]);
        }
        for (name, threshold) in &self.thresholds {
            add(&["--threshold", &format!("{name}={threshold}")]);
        }
        if policy == NonFinite::ExcludeFrame {
            add(&["--non-finite", "exclude-frame"]);
        }
        if let Some(folds) = self.folds {
            add(&["--folds", &folds.to_string()]);
        }
        if let Some(resamples) = self.bootstrap {
            add(&["--bootstrap", &resamples.to_string()]);
        }
        if self.seed != 0 && (self.folds.is_some() || self.bootstrap.is_some()) {
            add(&["--resampling-seed", &self.seed.to_string()]);
        }
        for (asked, option) in [(self.sequences, "--sequences"), (self.context, "--context")] {
            if asked {
                add(&[option]);
            }
        }
        shell_line(words.iter().map(String::as_str))
    }
}

/// Words as one line of a shell, quoted where needed.
///
/// # Errors
/// When a word cannot be written in a shell.
pub fn shell_line<'a>(words: impl IntoIterator<Item = &'a str>) -> Result<String> {
    shlex::try_join(words)
        .map_err(|e| Error::input(format!("a command cannot be written for these names: {e}")))
}
