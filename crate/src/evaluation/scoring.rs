//! Ground truth and keypoints, joined and scored.

use std::sync::{Arc, OnceLock};

use ndarray::{Array2, Array3, ArrayView1, ArrayView2, ArrayView3, Axis};

use super::confidence::{MinConfidence, hide, levels};
use super::thresholds::Thresholds;
use crate::data::{Alignment, Join, SequenceRange, join_aligned, ranges};
use crate::error::{Error, ErrorKind, Result};
use crate::memory;
use crate::metric::context::{Assignment, Regression, assignment, regression};
use crate::metric::{
    Accumulator, Axes, Bootstrap, Evaluation, Fit, HeldOut, Intervals, Moments, NonFinite, Object,
    Settings, Sufficiency, deal, farthest_frame, held_out, sufficiency,
};
use crate::track::{FrameKey, GroundTruth, KeypointTrack, MOST_AXES};

/// Bytes that a pair of a keypoint and an object takes: its moments, its error, and both in JSON.
const PAIR: u64 = 11 * 8 + 8 + 16 + 32;
/// As many more where the keypoint has frames of its own.
const OWN_FRAMES: u64 = 800;
/// Of more pairs the moments at the levels of confidence are not kept.
const KEPT_PAIRS: usize = 1 << 12;

/// The most keypoints of a linear regression from all of them: its time grows with their number cubed.
const MOST_IN_REGRESSION: usize = 1024;

/// A ground truth and keypoints with their join. The moments are taken once; scoring with other
/// settings then does not look at the frames again.
#[derive(Debug, Clone)]
pub struct Scoring {
    names: Vec<String>,
    keys: Vec<FrameKey>,
    keypoints: Array3<f64>,
    truth_ndc: Array3<f64>,
    join: Join,
    policy: NonFinite,
    moments: Moments,
    confidence: Confidence,
    by_sequence: OnceLock<Arc<[Moments]>>,
    /// What the default thresholds are times, which are for positions in ndc.
    threshold_unit: f64,
}

/// How sure the points are, and what was hidden for it.
#[derive(Debug, Clone)]
struct Confidence {
    least: MinConfidence,
    /// Keypoints and positions of the ground truth that are hidden, in the joined frames; none where
    /// they have no confidence.
    hidden: [Option<u64>; 2],
    /// The keypoints before any of them was hidden, where they have confidences.
    given: Option<Arc<Given>>,
    curve: OnceLock<Arc<[Level]>>,
}

/// Keypoints of the joined frames as the file gives them.
#[derive(Debug)]
struct Given {
    keypoints: Array3<f64>,
    /// T x N
    confidence: Array2<f64>,
}

/// What is left when keypoints have to be this sure.
#[derive(Debug, Clone)]
pub(super) struct Level {
    pub least: f64,
    /// The share of the keypoints that is not hidden.
    pub kept: f64,
    moments: Moments,
}

/// One object and one keypoint over the joined frames, T x 2 each, or T x 3 in space.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// The object, in ndc or the unit of a ground truth in space; NaN where it is not visible.
    pub truth_ndc: Array2<f64>,
    /// The keypoint as it is.
    pub keypoint: Array2<f64>,
    /// The keypoint under the fitted map, as the object.
    pub transformed_ndc: Array2<f64>,
}

/// How far a keypoint under its map is from an object in one sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct SequenceError {
    /// The joined frames of the sequence, and its name.
    pub range: SequenceRange,
    /// Frames in which the object is visible.
    pub frames: u64,
    /// The mean squared distance over these frames, ndc.
    pub error: f64,
    /// The joined frame with the largest squared distance, the first on ties.
    pub worst: usize,
    /// That squared distance.
    pub worst_error: f64,
}

/// Which points are scored with which.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Matching {
    /// How sure points have to be.
    pub least: MinConfidence,
    /// What is added to the numbers of the ground truth before they are matched.
    pub alignment: Alignment,
}

/// Other metrics of the same data; see [`context`](crate::metric::context).
#[derive(Debug, Clone, PartialEq)]
pub struct Context {
    /// Each object from all keypoints, fitted and predicted on the same frames.
    pub regression: Vec<Regression>,
    /// The same on the folds that were not fitted, where there are folds.
    pub held_out_regression: Option<Vec<Regression>>,
    /// Keypoints matched to objects anew in every frame.
    pub frames: Assignment,
    /// Keypoints matched to objects once a sequence.
    pub sequences: Assignment,
}

impl Scoring {
    /// Joins `keypoints` to `truth` and takes the moments of the joined frames.
    ///
    /// # Errors
    /// When no frame matches, and when a keypoint is not finite under [`NonFinite::Error`]; the
    /// message names the frame.
    pub fn new(truth: &GroundTruth, keypoints: &KeypointTrack, policy: NonFinite) -> Result<Self> {
        Self::matched(truth, keypoints, policy, Matching::default())
    }

    /// As [`Scoring::new`]: of the points that are sure enough, with the rows of the ground truth
    /// whose numbers are changed.
    ///
    /// # Errors
    /// As [`Scoring::new`].
    pub fn matched(
        truth: &GroundTruth,
        keypoints: &KeypointTrack,
        policy: NonFinite,
        Matching { least, alignment }: Matching,
    ) -> Result<Self> {
        let join = join_aligned(keypoints.keys(), truth.keys(), alignment)?;
        let (left, right): (Vec<usize>, Vec<usize>) = join.pairs.iter().copied().unzip();
        let keys: Vec<FrameKey> = left.iter().map(|i| keypoints.keys()[*i].clone()).collect();
        let mut points = points_of(keypoints.points(), &left);
        let mut truth_ndc = points_of(truth.points_ndc(), &right);
        let given = keypoints.confidence().map(|confidence| {
            Arc::new(Given {
                keypoints: points.clone(),
                confidence: confidence_of(confidence, &left),
            })
        });
        let objects = truth.names().len();
        let axes = [keypoints.axes(), truth.axes()];
        check_pairs(&points, axes, objects, given.is_some())?;
        let hidden_keypoints = least.keypoints.zip(given.as_ref());
        let hidden_keypoints =
            hidden_keypoints.map(|(least, given)| hide(&mut points, &given.confidence, least));
        let hidden_truth = least.truth.zip(truth.confidence());
        let hidden_truth = hidden_truth.map(|(least, confidence)| {
            hide(&mut truth_ndc, &confidence_of(confidence, &right), least)
        });
        let mut accumulator = Accumulator::of_axes(keypoints.keypoints(), objects, axes, policy)?;
        for (t, key) in keys.iter().enumerate() {
            let (z, x) = (
                points.index_axis(Axis(0), t),
                truth_ndc.index_axis(Axis(0), t),
            );
            accumulator.push(z, x).map_err(|e| e.at(key))?;
        }
        let threshold_unit = threshold_unit(&truth_ndc);
        Ok(Self {
            threshold_unit,
            names: truth.names().to_vec(),
            keys,
            keypoints: points,
            truth_ndc,
            join,
            policy,
            moments: accumulator.finish(),
            confidence: Confidence {
                least,
                hidden: [hidden_keypoints, hidden_truth],
                given,
                curve: OnceLock::new(),
            },
            by_sequence: OnceLock::new(),
        })
    }

    /// How sure points have to be, and how many keypoints and positions are hidden for it.
    pub(super) fn hidden(&self) -> (MinConfidence, [Option<u64>; 2]) {
        (self.confidence.least, self.confidence.hidden)
    }

    /// Whether the keypoints say how sure they are.
    pub fn has_confidence(&self) -> bool {
        self.confidence.given.is_some()
    }

    /// Calls `each` with what is left at each of the levels `asked`, or where the confidences differ.
    pub(super) fn at_levels<T>(
        &self,
        asked: &[f64],
        each: impl Fn(&Level) -> Result<T>,
    ) -> Result<Vec<T>> {
        let Some(given) = &self.confidence.given else {
            return Ok(Vec::new());
        };
        if let Some(found) = self.confidence.curve.get().filter(|_| asked.is_empty()) {
            return found.iter().map(each).collect();
        }
        let levels = match asked {
            [] => levels(&given.confidence),
            asked => asked.to_vec(),
        };
        let pairs = self.keypoints.dim().1 * self.names.len();
        if asked.is_empty() && pairs <= KEPT_PAIRS {
            let all = levels.into_iter().map(|least| self.level(given, least));
            let all: Arc<[Level]> = all.collect::<Result<_>>()?;
            return self
                .confidence
                .curve
                .get_or_init(|| all)
                .iter()
                .map(each)
                .collect();
        }
        levels
            .into_iter()
            .map(|least| each(&self.level(given, least)?))
            .collect()
    }

    fn level(&self, given: &Given, least: f64) -> Result<Level> {
        let mut keypoints = given.keypoints.clone();
        let hidden = hide(&mut keypoints, &given.confidence, least);
        let there = given.keypoints.rows().into_iter();
        let there = there.filter(|p| p.iter().all(|v| v.is_finite())).count();
        let (count, objects) = (keypoints.dim().1, self.names.len());
        let policy = self.curve_policy();
        let mut accumulator = Accumulator::of_axes(count, objects, self.axes(), policy)?;
        for (t, key) in self.keys.iter().enumerate() {
            let z = keypoints.index_axis(Axis(0), t);
            let x = self.truth_ndc.index_axis(Axis(0), t);
            accumulator.push(z, x).map_err(|e| e.at(key))?;
        }
        Ok(Level {
            least,
            kept: 1.0 - hidden as f64 / there.max(1) as f64,
            moments: accumulator.finish(),
        })
    }

    /// Where missing keypoints are an error, hiding some is not.
    fn curve_policy(&self) -> NonFinite {
        match self.policy {
            NonFinite::Error => NonFinite::ExcludePoint,
            policy => policy,
        }
    }

    /// Scores what is left at a level of confidence, and says whether it is enough data.
    pub(super) fn evaluate_level(
        &self,
        level: &Level,
        thresholds: &Thresholds,
        settings: &Settings,
    ) -> Result<(Evaluation, Vec<Sufficiency>)> {
        let evaluation = level
            .moments
            .evaluate(&self.with(thresholds)?, settings)
            .map_err(|e| self.located(e))?;
        let hidden = match &self.confidence.given {
            Some(given) if self.policy == NonFinite::ExcludeFrame => {
                let mut keypoints = given.keypoints.clone();
                hide(&mut keypoints, &given.confidence, level.least);
                Some(keypoints)
            }
            _ => None,
        };
        let keypoints = hidden.as_ref().unwrap_or(&self.keypoints);
        let enough = self.sufficiency_of(keypoints, &level.moments, thresholds)?;
        Ok((evaluation, enough))
    }

    /// The numbers of coordinates of a keypoint and of an object: 2 in the image, 3 in space.
    pub fn axes(&self) -> [usize; 2] {
        self.moments.axes()
    }

    /// What the default thresholds are times: 1 for a ground truth in ndc. In space the longest side
    /// of the box around all objects takes the place of the side of the image, which is 2 in ndc:
    /// the square of half of it.
    pub fn threshold_unit(&self) -> f64 {
        self.threshold_unit
    }

    /// The names of the objects.
    pub fn objects(&self) -> &[String] {
        &self.names
    }

    /// The joined frames, in the order of the keypoints.
    pub fn keys(&self) -> &[FrameKey] {
        &self.keys
    }

    /// How frames found their rows.
    pub fn join(&self) -> &Join {
        &self.join
    }

    /// The number of sequences that the joined frames are of.
    pub fn sequence_count(&self) -> usize {
        self.keys.chunk_by(|a, b| a.sequence == b.sequence).count()
    }

    /// Whether there is enough data to score each object; see [`sufficiency`].
    ///
    /// # Errors
    /// As [`Scoring::evaluate`].
    pub fn sufficiency(&self, thresholds: &Thresholds) -> Result<Vec<Sufficiency>> {
        self.sufficiency_of(&self.keypoints, &self.moments, thresholds)
    }

    /// As [`Scoring::sufficiency`], for `keypoints` of which `moments` were taken.
    fn sufficiency_of(
        &self,
        keypoints: &Array3<f64>,
        moments: &Moments,
        thresholds: &Thresholds,
    ) -> Result<Vec<Sufficiency>> {
        let objects = self.with(thresholds)?;
        let mut truth = self.truth_ndc.clone();
        if self.policy == NonFinite::ExcludeFrame {
            let frames = truth.outer_iter_mut().zip(keypoints.outer_iter());
            for (mut truth, keypoints) in frames {
                if keypoints.iter().any(|v| !v.is_finite()) {
                    truth.fill(f64::NAN);
                }
            }
        }
        let sequences: Vec<_> = ranges(&self.keys)
            .into_iter()
            .map(|range| range.start..range.start + range.length)
            .collect();
        sufficiency(
            truth.view(),
            &sequences,
            self.keypoints.dim().1,
            self.axes()[0],
            least_seen(moments),
            &objects,
        )
        .map_err(|e| self.located(e))
    }

    /// Scores with `thresholds`.
    ///
    /// # Errors
    /// When a threshold is given for an object that the ground truth does not have; as
    /// [`Moments::evaluate`].
    pub fn evaluate(&self, thresholds: &Thresholds, settings: &Settings) -> Result<Evaluation> {
        self.moments
            .evaluate(&self.with(thresholds)?, settings)
            .map_err(|e| self.located(e))
    }

    /// A numeric error with the frame that is to blame for it, if one is.
    fn located(&self, error: Error) -> Error {
        if error.kind() != ErrorKind::Numeric {
            return error;
        }
        match farthest_frame(self.keypoints.view(), self.truth_ndc.view()) {
            Some((t, value)) => error.at(format!("{} (coordinate {value:e})", self.keys[t])),
            None => error,
        }
    }

    /// Scores every fold of the sequences with maps and best keypoints of the others; see
    /// [`held_out`].
    ///
    /// # Errors
    /// As [`Scoring::evaluate`] and [`held_out`].
    pub fn held_out(
        &self,
        folds: usize,
        seed: u64,
        thresholds: &Thresholds,
        settings: &Settings,
    ) -> Result<HeldOut> {
        let objects = self.with(thresholds)?;
        held_out(&self.sequences()?, folds, seed, &objects, settings).map_err(|e| self.located(e))
    }

    /// 95 % intervals over the sequences; see [`Bootstrap`].
    ///
    /// # Errors
    /// As [`Scoring::evaluate`] and [`Bootstrap`].
    pub fn bootstrap(
        &self,
        resamples: usize,
        seed: u64,
        thresholds: &Thresholds,
        settings: &Settings,
    ) -> Result<Intervals> {
        let (mut bootstrap, sequences) = self.start_bootstrap(seed, thresholds, settings)?;
        bootstrap
            .draw(&sequences, resamples)
            .map_err(|e| self.located(e))?;
        bootstrap.finish()
    }

    /// The start of [`Scoring::bootstrap`], and what to draw from.
    ///
    /// # Errors
    /// As [`Scoring::evaluate`].
    pub fn start_bootstrap(
        &self,
        seed: u64,
        thresholds: &Thresholds,
        settings: &Settings,
    ) -> Result<(Bootstrap, Arc<[Moments]>)> {
        let bootstrap = Bootstrap::new(0.95, seed, self.with(thresholds)?, *settings)?;
        Ok((bootstrap, self.sequences()?))
    }

    /// Other metrics of the same frames; with the number of folds and the seed that deals the
    /// sequences to them also on frames that were not fitted.
    ///
    /// # Errors
    /// When there are fewer than two folds, or fewer sequences than folds, or a value is beyond the
    /// range of f64.
    pub fn context(&self, folds: Option<(usize, u64)>) -> Result<Context> {
        self.measure_context(folds).map_err(|e| self.located(e))
    }

    fn measure_context(&self, folds: Option<(usize, u64)>) -> Result<Context> {
        self.need_image("the other metrics (context)")?;
        let (keypoints, truth) = (self.keypoints.view(), self.truth_ndc.view());
        let count = keypoints.dim().1;
        if count > MOST_IN_REGRESSION {
            return Err(Error::numeric(format!(
                "a linear regression from {count} keypoints together takes hours; the other metrics \
                 (context) take up to {MOST_IN_REGRESSION}"
            )));
        }
        // The products of all columns by the fold, and what their eigenvectors are found in.
        let columns = 2 * count as u64 + 2;
        let matrices = folds.map_or(1, |(folds, _)| folds as u64) + 6;
        memory::check(
            matrices.saturating_mul(columns * columns * 8),
            "linear regression from all keypoints",
            "score fewer keypoints, or without the other metrics (context)",
        )?;
        let sequences = ranges(&self.keys);
        let held_out_regression = folds
            .map(|(folds, seed)| {
                let fold_of = deal(sequences.len(), folds, seed)?;
                let ranges = sequences.iter().zip(&fold_of);
                let fold_of: Vec<usize> = ranges
                    .flat_map(|(range, fold)| std::iter::repeat_n(*fold, range.length))
                    .collect();
                regression(keypoints, truth, Some(&fold_of))
            })
            .transpose()?;
        Ok(Context {
            regression: regression(keypoints, truth, None)?,
            held_out_regression,
            frames: assignment(keypoints, truth, (0..self.keys.len()).map(|t| t..t + 1))?,
            sequences: assignment(
                keypoints,
                truth,
                sequences
                    .iter()
                    .map(|range| range.start..range.start + range.length),
            )?,
        })
    }

    /// The moments of each sequence.
    fn sequences(&self) -> Result<Arc<[Moments]>> {
        if let Some(found) = self.by_sequence.get() {
            return Ok(found.clone());
        }
        let moments = |range: SequenceRange| {
            let (count, objects) = (self.keypoints.dim().1, self.names.len());
            let mut accumulator = Accumulator::of_axes(count, objects, self.axes(), self.policy)?;
            for t in range.start..range.start + range.length {
                let (z, x) = (
                    self.keypoints.index_axis(Axis(0), t),
                    self.truth_ndc.index_axis(Axis(0), t),
                );
                accumulator.push(z, x).map_err(|e| e.at(&self.keys[t]))?;
            }
            Ok(accumulator.finish())
        };
        let all: Vec<Moments> = ranges(&self.keys)
            .into_iter()
            .map(moments)
            .collect::<Result<_>>()?;
        Ok(self.by_sequence.get_or_init(|| all.into()).clone())
    }

    fn with(&self, thresholds: &Thresholds) -> Result<Vec<Object>> {
        thresholds.objects(&self.names, "the ground truth has", self.threshold_unit)
    }

    /// Fails where points are in space, of which `what` says nothing.
    pub(super) fn need_image(&self, what: &str) -> Result<()> {
        match self.axes() {
            _ if MOST_AXES == 2 => Ok(()),
            [2, 2] => Ok(()),
            _ => Err(Error::mismatch(format!(
                "{what} compare distances with the size of the image, and points have three coordinates; \
                 expected points in the image: leave z out, or project the ground truth with its camera"
            ))),
        }
    }

    /// The N keypoints of joined frame `t` as they are, N x 2 (in space 3); `None` past the last
    /// frame.
    pub fn keypoints(&self, t: usize) -> Option<ArrayView2<'_, f64>> {
        (t < self.keys.len()).then(|| self.keypoints.index_axis(Axis(0), t))
    }

    /// The keypoints of all joined frames as they are, T x N x 2 (in space 3).
    pub(super) fn all_keypoints(&self) -> ArrayView3<'_, f64> {
        self.keypoints.view()
    }

    /// The points of object `k` and keypoint `n` with the map that `settings` fit.
    ///
    /// # Errors
    /// When there is no such object or keypoint, or the object is visible in no frame.
    pub fn series(&self, k: usize, n: usize, settings: &Settings) -> Result<Series> {
        let (objects, keypoints) = (self.names.len(), self.keypoints.dim().1);
        if k >= objects || n >= keypoints {
            return Err(Error::input(format!(
                "there is no object {k} with keypoint {n}; expected objects below {objects}, keypoints below {keypoints}"
            )));
        }
        let fit = self
            .moments
            .fit(n, k, settings)
            .map_err(|e| self.located(e))?;
        let fit: Fit = fit.ok_or_else(|| {
            Error::numeric(format!(
                "object `{}` is visible in no frame: there is no map to it",
                self.names[k]
            ))
        })?;
        let keypoint = self.keypoints.index_axis(Axis(1), n).to_owned();
        let axes = self.axes();
        let mut transformed_ndc = Array2::from_elem((self.keys.len(), axes[1]), f64::NAN);
        for (mut to, point) in transformed_ndc.rows_mut().into_iter().zip(keypoint.rows()) {
            let mapped = fit.map.apply(&Axes::of(axes[0], |axis| point[axis]));
            to.iter_mut()
                .zip(mapped.iter())
                .for_each(|(to, from)| *to = *from);
        }
        Ok(Series {
            truth_ndc: self.truth_ndc.index_axis(Axis(1), k).to_owned(),
            keypoint,
            transformed_ndc,
        })
    }

    /// The squared distance between object `k` and keypoint `n` under the map that `settings` fit,
    /// in every joined frame (ndc); NaN where the object or the keypoint is missing or the frame was
    /// left out.
    ///
    /// # Errors
    /// As [`Scoring::series`].
    pub fn distances(&self, k: usize, n: usize, settings: &Settings) -> Result<Vec<f64>> {
        let series = self.series(k, n, settings)?;
        let points = series
            .truth_ndc
            .outer_iter()
            .zip(series.transformed_ndc.outer_iter());
        let distance = |(t, (x, z)): (usize, (ArrayView1<f64>, ArrayView1<f64>))| {
            let frame = self.keypoints.index_axis(Axis(0), t);
            let counts = match self.policy {
                NonFinite::ExcludePoint => frame.row(n).iter().all(|v| v.is_finite()),
                NonFinite::Error | NonFinite::ExcludeFrame => frame.iter().all(|v| v.is_finite()),
            };
            if counts {
                let squares = x.iter().zip(z).map(|(x, z)| (x - z).powi(2));
                squares
                    .reduce(|sum, square| sum + square)
                    .unwrap_or(f64::NAN)
            } else {
                f64::NAN
            }
        };
        Ok(points.enumerate().map(distance).collect())
    }

    /// The error of object `k` with keypoint `n` by the sequence, the worst one first; sequences
    /// that do not show the object are left out. The map is the one of all frames.
    ///
    /// # Errors
    /// As [`Scoring::series`].
    pub fn sequence_errors(
        &self,
        k: usize,
        n: usize,
        settings: &Settings,
    ) -> Result<Vec<SequenceError>> {
        let distances = self.distances(k, n, settings)?;
        let mut errors: Vec<SequenceError> = ranges(&self.keys)
            .into_iter()
            .filter_map(|range| {
                let (mut frames, mut sum, mut worst) =
                    (0_u64, 0.0, (range.start, f64::NEG_INFINITY));
                let own = distances.iter().enumerate();
                for (t, distance) in own.skip(range.start).take(range.length) {
                    if distance.is_nan() {
                        continue;
                    }
                    frames += 1;
                    sum += distance;
                    if *distance > worst.1 {
                        worst = (t, *distance);
                    }
                }
                (frames > 0).then(|| SequenceError {
                    range,
                    frames,
                    error: sum / frames as f64,
                    worst: worst.0,
                    worst_error: worst.1,
                })
            })
            .collect();
        errors.sort_by(|a, b| b.error.total_cmp(&a.error));
        Ok(errors)
    }
}

/// Checks that there is memory for every pair of a keypoint and an object.
fn check_pairs(
    keypoints: &Array3<f64>,
    axes: [usize; 2],
    objects: usize,
    has_confidence: bool,
) -> Result<()> {
    let count = keypoints.dim().1;
    let misses = |n: &usize| {
        let of_frames = keypoints.index_axis(Axis(1), *n);
        of_frames.iter().any(|v| v.is_nan())
    };
    let missing = match has_confidence {
        true => count,
        false => (0..count).filter(misses).count(),
    };
    // In space there are moments of six planes at most.
    let planes = if axes == [2, 2] { 1 } else { 6 };
    let bytes = (count as u64 * PAIR + missing as u64 * OWN_FRAMES)
        .saturating_mul(objects as u64)
        .saturating_mul(planes);
    memory::check(
        bytes,
        &format!("errors of {count} keypoints for {objects} objects"),
        "score fewer keypoints or objects at a time",
    )
}

/// See [`Scoring::threshold_unit`].
fn threshold_unit(truth: &Array3<f64>) -> f64 {
    let axes = truth.dim().2;
    if MOST_AXES == 2 || axes == 2 {
        return 1.0;
    }
    let side = |axis: usize| {
        let values = truth.index_axis(Axis(2), axis);
        let values = values.iter().copied().filter(|v| v.is_finite());
        let ends = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
            [low.min(v), high.max(v)]
        });
        ends[1] - ends[0]
    };
    let longest = (0..axes).map(side).fold(0.0, f64::max);
    // Objects that rest all along are told apart by their variance.
    if longest > 0.0 {
        (longest / 2.0).powi(2)
    } else {
        1.0
    }
}

/// The smallest share of the frames that show a keypoint, of those that are shown in at least half.
fn least_seen(moments: &Moments) -> f64 {
    let frames = moments.frames().max(1) as f64;
    let missing = moments.missing().iter();
    let shares = missing.map(|missing| 1.0 - *missing as f64 / frames);
    shares.filter(|share| *share >= 0.5).fold(1.0, f64::min)
}

/// The points of the frames `which`. ndarray's `select` takes eight times the code in WebAssembly.
fn points_of(points: &Array3<f64>, which: &[usize]) -> Array3<f64> {
    let (_, count, axes) = points.dim();
    let shape = (which.len(), count, axes);
    Array3::from_shape_fn(shape, |(t, n, axis)| points[[which[t], n, axis]])
}

/// The confidences of the frames `which`.
fn confidence_of(confidence: &Array2<f64>, which: &[usize]) -> Array2<f64> {
    let shape = (which.len(), confidence.dim().1);
    Array2::from_shape_fn(shape, |(t, n)| confidence[[which[t], n]])
}
