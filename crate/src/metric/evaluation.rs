//! From fitted maps to tracked objects and TC.

use ndarray::Array2;

use super::map::{self, Fit, Rank, Transform};
use super::moments::Moments;
use crate::error::{Error, Result};

/// The paper's threshold for an object of its PandaPush task (cube and target 0.015, eef 0.1;
/// appendix, "Evaluation"; in letters of either case), and 0.015 for any other. It applies to the
/// mean squared distance in ndc.
pub fn default_threshold(name: &str) -> f64 {
    match name.eq_ignore_ascii_case("eef") {
        true => 0.1,
        false => 0.015,
    }
}

/// An object to be tracked.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Its name.
    pub name: String,
    /// The threshold `mu_k` on the tracking error (mean squared distance, in ndc or in the unit of
    /// a ground truth in space).
    pub threshold: f64,
}

impl Object {
    /// An object with its threshold `mu_k`.
    pub fn new(name: impl Into<String>, threshold: f64) -> Self {
        Self {
            name: name.into(),
            threshold,
        }
    }

    /// An object with its [`default_threshold`].
    pub fn with_default_threshold(name: impl Into<String>) -> Self {
        let name = name.into();
        let threshold = default_threshold(&name);
        Self { name, threshold }
    }
}

/// How to score.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Settings {
    /// The map that is fitted.
    pub transform: Transform,
    /// When a direction counts as no motion.
    pub rank: Rank,
    /// Whether a keypoint that is missing in more than half of an object's frames may be its best.
    pub rare_keypoints: bool,
}

/// The metric of one detector on one recording. Fitted and scored on the same frames, as the
/// authors' code.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// TC: the share of tracked objects (equation 2).
    pub tracking_capability: f64,
    /// The number of frames T.
    pub frames: u64,
    /// Frames left out because a keypoint was not finite.
    pub excluded: u64,
    /// For every keypoint, the number of frames in which it is missing; they do not count for it.
    pub missing: Vec<u64>,
    /// How it was scored.
    pub settings: Settings,
    /// The objects, in the order given.
    pub objects: Vec<ObjectEvaluation>,
    /// K x N errors `e_{n,k}`, each over the frames that show both; NaN where there is none.
    pub errors: Array2<f64>,
    /// The number of (keypoint, object) pairs in which the rank rule left a direction out.
    pub directions_dropped: usize,
    /// The numbers of coordinates of a keypoint and of an object.
    pub axes: [usize; 2],
}

/// The metric for one object.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectEvaluation {
    /// Its name.
    pub name: String,
    /// Its threshold `mu_k`.
    pub threshold: f64,
    /// Whether the best keypoint's error is at most the threshold.
    pub tracked: bool,
    /// The number of frames in which it is visible; only these count.
    pub frames: u64,
    /// The number of those frames in which it lies outside the image; 0 for one in space. They
    /// count, as in the authors' code.
    pub outside: u64,
    /// Its best keypoint; `None` when it is visible in no frame, or every keypoint is missing in
    /// more than half of them.
    pub best: Option<Best>,
}

/// The best keypoint of an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Best {
    /// `n*_k`, the first on ties, counted from 0.
    pub keypoint: usize,
    /// Its map and what it leaves.
    pub fit: Fit,
}

impl Moments {
    /// The fitted map of keypoint `n` to object `k`, or `None` when no frame shows both.
    ///
    /// # Errors
    /// When the map or its error is beyond the range of f64.
    ///
    /// # Panics
    /// When `n` or `k` is out of range.
    pub fn fit(&self, n: usize, k: usize, settings: &Settings) -> Result<Option<Fit>> {
        #[cfg(feature = "space")]
        if !self.others.is_empty() {
            return super::space::fit(self, n, k, settings.transform, settings.rank);
        }
        let pair = self.objects[k].pair(n);
        (pair.frames > 0)
            .then(|| map::fit(&pair, settings.transform, settings.rank))
            .transpose()
    }

    /// Tracking errors, best keypoints and TC.
    ///
    /// # Errors
    /// When there is no keypoint, no object or no frame, when the number of `objects` is not K,
    /// when a threshold is not a positive number, or when a map or an error is beyond the range of
    /// f64 ([`farthest_frame`](super::farthest_frame) finds the frame).
    pub fn evaluate(&self, objects: &[Object], settings: &Settings) -> Result<Evaluation> {
        if objects.len() != self.objects.len() {
            return Err(Error::mismatch(format!(
                "{} objects are named; the moments are of {}",
                objects.len(),
                self.objects.len()
            )));
        }
        if objects.is_empty() || self.keypoints == 0 {
            return Err(Error::numeric(format!(
                "nothing to score: {} keypoints and {} objects; expected at least one of each",
                self.keypoints,
                objects.len()
            )));
        }
        if self.frames == 0 {
            return Err(Error::numeric(format!(
                "nothing to score: no frame is left ({} were excluded because a keypoint was not finite)",
                self.excluded
            )));
        }
        if let Some(bad) = objects
            .iter()
            .find(|o| !(o.threshold.is_finite() && o.threshold > 0.0))
        {
            return Err(Error::input(format!(
                "the threshold of object `{}` is {}; expected a positive number",
                bad.name, bad.threshold
            )));
        }
        let mut errors = Array2::from_elem((objects.len(), self.keypoints), f64::NAN);
        let mut directions_dropped = 0;
        let mut evaluated = Vec::with_capacity(objects.len());
        for (k, object) in objects.iter().enumerate() {
            let mut best: Option<Best> = None;
            for n in 0..self.keypoints {
                let named = |e: Error| e.at(format!("keypoint {n} with object `{}`", object.name));
                let Some(fit) = self.fit(n, k, settings).map_err(named)? else {
                    continue;
                };
                errors[[k, n]] = fit.error();
                directions_dropped += usize::from(fit.direction_dropped);
                let counts = settings.rare_keypoints || 2 * fit.frames >= self.objects[k].frames;
                if counts && best.is_none_or(|b| fit.error() < b.fit.error()) {
                    best = Some(Best { keypoint: n, fit });
                }
            }
            evaluated.push(ObjectEvaluation {
                name: object.name.clone(),
                threshold: object.threshold,
                tracked: best.is_some_and(|b| b.fit.error() <= object.threshold),
                frames: self.objects[k].frames,
                outside: if self.axes[1] == 2 {
                    self.objects[k].outside
                } else {
                    0
                },
                best,
            });
        }
        let tracked = evaluated.iter().filter(|o| o.tracked).count();
        Ok(Evaluation {
            tracking_capability: tracked as f64 / objects.len() as f64,
            frames: self.frames,
            excluded: self.excluded,
            missing: self.missing.clone(),
            settings: *settings,
            objects: evaluated,
            errors,
            directions_dropped,
            axes: self.axes,
        })
    }
}
