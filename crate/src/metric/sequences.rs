//! How far a result would hold on other sequences: folds that the maps did not see, and intervals
//! over sequences.
//!
//! Both take the moments of every sequence by itself. Frames of one sequence are much alike, so
//! that sequences, not frames, are what is left out and drawn.

use fastrand::Rng;

use super::evaluation::{Object, Settings};
use super::map::AffineMap;
use super::moments::{Moments, PairMoments};
use super::scale::{exponent, non_negative, times_power};
use super::stats::percentile_interval;
use crate::error::{Error, Result};
use crate::track::MOST_AXES;

/// The metric with maps and best keypoints that were chosen on other sequences than they are scored
/// on.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldOut {
    /// The number of folds.
    pub folds: usize,
    /// The share of objects whose error is at most their threshold.
    pub tracking_capability: f64,
    /// The objects, in the order given.
    pub objects: Vec<HeldOutObject>,
}

/// One object of [`HeldOut`].
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "data", derive(serde::Serialize, serde::Deserialize))]
pub struct HeldOutObject {
    /// Its name.
    pub name: String,
    /// Whether the error is at most the threshold.
    pub tracked: bool,
    /// The mean squared distance over all frames, each with the map fitted without its fold (ndc);
    /// `None` when the object is visible in no frame, or all its frames are in one fold.
    pub error: Option<f64>,
    /// The best keypoint on the other folds, by the fold; `None` where they do not show the object.
    pub keypoints: Vec<Option<usize>>,
}

/// Percentile intervals of a bootstrap over sequences.
#[derive(Debug, Clone, PartialEq)]
pub struct Intervals {
    /// The share of resamples between the ends of an interval.
    pub level: f64,
    /// How many sets of sequences were drawn.
    pub resamples: usize,
    /// Of the tracking capability.
    pub tracking_capability: [f64; 2],
    /// Of the tracking error of each object's best keypoint, in the order given; `None` when a
    /// resample does not show the object.
    pub errors: Vec<Option<[f64; 2]>>,
}

impl Moments {
    /// Adds the moments of other frames of the same keypoints and objects.
    ///
    /// # Errors
    /// When they are of another number of keypoints or objects.
    pub fn merge(&mut self, other: &Self) -> Result<()> {
        if (self.keypoints, self.objects.len(), self.axes)
            != (other.keypoints, other.objects.len(), other.axes)
        {
            return Err(Error::mismatch(format!(
                "moments of {} keypoints and {} objects cannot take those of {} and {}",
                self.keypoints,
                self.objects.len(),
                other.keypoints,
                other.objects.len()
            )));
        }
        self.frames += other.frames;
        self.excluded += other.excluded;
        for (mine, theirs) in self.missing.iter_mut().zip(&other.missing) {
            *mine += theirs;
        }
        for (mine, theirs) in self.objects.iter_mut().zip(&other.objects) {
            mine.merge(theirs);
        }
        if MOST_AXES == 3 {
            for (mine, theirs) in self.others.iter_mut().zip(&other.others) {
                mine.merge(theirs)?;
            }
        }
        Ok(())
    }

    /// What `map` leaves between keypoint `n` and object `k`: the sum over the frames that show both
    /// of the squared distance, infinite beyond the range of f64, and how many these are.
    fn left_by(&self, n: usize, k: usize, map: &AffineMap) -> (f64, u64) {
        #[cfg(feature = "space")]
        if !self.others.is_empty() {
            return super::space::left_by(self, n, k, map);
        }
        let pair = self.objects[k].pair(n);
        let left = if pair.frames > 0 {
            pair.left_by(map)
        } else {
            0.0
        };
        (left, pair.frames)
    }

    /// The moments of all of `parts`.
    fn of<'a>(parts: impl IntoIterator<Item = &'a Self>) -> Result<Self> {
        let mut parts = parts.into_iter();
        let mut all = parts
            .next()
            .cloned()
            .ok_or_else(|| Error::numeric("there is no sequence"))?;
        for part in parts {
            all.merge(part)?;
        }
        Ok(all)
    }
}

impl PairMoments {
    /// The sum over the frames of the squared distance that `map` leaves; infinite beyond the range
    /// of f64.
    ///
    /// From second moments, so that distances below 1e-7 of the spread of the points are rounding.
    fn left_by(&self, map: &AffineMap) -> f64 {
        let [xx, xy, yy] = self.keypoint_squares;
        let t = self.frames as f64;
        (0..2)
            .map(|axis| {
                // All terms divided by one power of two, that of the largest.
                let factor = [0, 1].map(|column| exponent(map.a[axis][column]));
                let keypoint = self.keypoint_exponent[axis];
                let of_map = factor[0].max(factor[1]).saturating_add(keypoint);
                let scale = self.truth_exponent[axis]
                    .max(of_map)
                    .max(exponent(map.b[axis]));
                let [a, c] =
                    [0, 1].map(|column| times_power(map.a[axis][column], keypoint - scale));
                let truth = self.truth_exponent[axis] - scale;
                let cross =
                    |keypoint_axis: usize| times_power(self.cross[axis + 2 * keypoint_axis], truth);
                let own = a * a * xx + 2.0 * a * c * xy + c * c * yy;
                let with = a * cross(0) + c * cross(1);
                let [mean_x, mean_y] = self.keypoint_mean;
                let mapped = a * mean_x + c * mean_y + times_power(map.b[axis], -scale);
                let shift = mapped - times_power(self.truth_mean[axis], truth);
                let own_truth = times_power(self.truth_squares[axis], 2 * truth);
                let left = non_negative(own - 2.0 * with + own_truth) + t * shift * shift;
                times_power(left, 2 * scale)
            })
            .sum()
    }
}

/// The fold of every sequence: shuffled with `seed`, then dealt in turn.
///
/// # Errors
/// When there are fewer than two folds, or fewer sequences than folds.
pub fn deal(sequences: usize, folds: usize, seed: u64) -> Result<Vec<usize>> {
    if folds < 2 || sequences < folds {
        return Err(Error::input(format!(
            "{folds} folds of {sequences} sequences; expected at least 2 folds and a sequence for each"
        )));
    }
    let mut order: Vec<usize> = (0..sequences).collect();
    let mut rng = Rng::with_seed(seed);
    // Numbers of a fixed width, unlike those of `shuffle`: WebAssembly deals as every other
    // machine.
    for i in 1..order.len() {
        order.swap(i, rng.u64(..=i as u64) as usize);
    }
    let mut fold_of = vec![0; sequences];
    for (place, sequence) in order.into_iter().enumerate() {
        fold_of[sequence] = place % folds;
    }
    Ok(fold_of)
}

/// Scores every fold of the sequences with the best keypoints and maps of the other folds. `parts`
/// are the moments of one sequence each; `seed` deals them to the folds, whose numbers of sequences
/// differ by one at most.
///
/// # Errors
/// When there are fewer than two folds, or fewer sequences than folds, or an error is beyond the
/// range of f64; as [`Moments::evaluate`].
pub fn held_out(
    parts: &[Moments],
    folds: usize,
    seed: u64,
    objects: &[Object],
    settings: &Settings,
) -> Result<HeldOut> {
    let fold_of = deal(parts.len(), folds, seed)?;
    let mut sums = vec![0.0; objects.len()];
    let mut frames = vec![0; objects.len()];
    let mut keypoints = vec![Vec::with_capacity(folds); objects.len()];
    for fold in 0..folds {
        let dealt = |inside: bool| {
            let places = parts.iter().zip(&fold_of);
            places
                .filter(move |(_, own)| (**own == fold) == inside)
                .map(|(part, _)| part)
        };
        let others = Moments::of(dealt(false))?;
        let own = Moments::of(dealt(true))?;
        let evaluation = others.evaluate(objects, settings)?;
        for (k, object) in evaluation.objects.iter().enumerate() {
            keypoints[k].push(object.best.map(|best| best.keypoint));
            let Some(best) = object.best else { continue };
            let (left, shown) = own.left_by(best.keypoint, k, &best.fit.map);
            sums[k] += left;
            frames[k] += shown;
        }
    }
    if let Some(k) = sums.iter().position(|sum| !sum.is_finite()) {
        return Err(Error::numeric(format!(
            "the held-out error of object `{}` is too large for f64; expected coordinates near -1 to 1 \
             (check for outliers and the unit)",
            objects[k].name
        )));
    }
    let objects: Vec<HeldOutObject> = objects
        .iter()
        .zip(sums.iter().zip(&frames))
        .zip(keypoints)
        .map(|((object, (sum, frames)), keypoints)| {
            let error = (*frames > 0).then(|| sum / *frames as f64);
            HeldOutObject {
                name: object.name.clone(),
                error,
                tracked: error.is_some_and(|error| error <= object.threshold),
                keypoints,
            }
        })
        .collect();
    Ok(HeldOut {
        folds,
        tracking_capability: objects.iter().filter(|o| o.tracked).count() as f64
            / objects.len() as f64,
        objects,
    })
}

/// Percentile intervals of TC and of the errors: `resamples` times as many sequences as there are,
/// drawn with replacement. `parts` are the moments of one sequence each.
///
/// The best keypoint is chosen anew in every resample. O(resamples x sequences x N x K) time.
///
/// # Errors
/// When there are fewer than two sequences, no resample, or `level` is not between 0 and 1; as
/// [`Moments::evaluate`].
pub fn bootstrap(
    parts: &[Moments],
    resamples: usize,
    level: f64,
    seed: u64,
    objects: &[Object],
    settings: &Settings,
) -> Result<Intervals> {
    let mut bootstrap = Bootstrap::new(level, seed, objects.to_vec(), *settings)?;
    bootstrap.draw(parts, resamples)?;
    bootstrap.finish()
}

/// More resamples than anybody needs; each is kept.
const MOST_RESAMPLES: usize = 1_000_000;

/// A [`bootstrap`] that can be drawn in steps, for those who have to do something else in between.
#[derive(Debug, Clone)]
pub struct Bootstrap {
    level: f64,
    rng: Rng,
    objects: Vec<Object>,
    settings: Settings,
    capabilities: Vec<f64>,
    errors: Vec<Vec<f64>>,
}

impl Bootstrap {
    /// Nothing is drawn yet.
    ///
    /// # Errors
    /// When `level` is not between 0 and 1.
    pub fn new(level: f64, seed: u64, objects: Vec<Object>, settings: Settings) -> Result<Self> {
        if !(level > 0.0 && level < 1.0) {
            return Err(Error::input(format!(
                "the level {level}; expected one between 0 and 1, e.g. 0.95"
            )));
        }
        Ok(Self {
            level,
            rng: Rng::with_seed(seed),
            errors: vec![Vec::new(); objects.len()],
            objects,
            settings,
            capabilities: Vec::new(),
        })
    }

    /// Draws the sequences `resamples` times more; the same `parts` every time.
    ///
    /// # Errors
    /// When there are fewer than two sequences, or more than a million resamples in all; as
    /// [`Moments::evaluate`].
    pub fn draw(&mut self, parts: &[Moments], resamples: usize) -> Result<()> {
        if parts.len() < 2 {
            return Err(Error::input(format!(
                "{resamples} resamples of {} sequences; expected at least 1 of at least 2",
                parts.len()
            )));
        }
        if resamples > MOST_RESAMPLES - self.capabilities.len().min(MOST_RESAMPLES) {
            return Err(Error::input(format!(
                "{resamples} resamples of the sequences; expected at most {MOST_RESAMPLES} in all"
            )));
        }
        for _ in 0..resamples {
            let drawn =
                (0..parts.len()).map(|_| &parts[self.rng.u64(0..parts.len() as u64) as usize]);
            let evaluation = Moments::of(drawn)?.evaluate(&self.objects, &self.settings)?;
            self.capabilities.push(evaluation.tracking_capability);
            for (errors, object) in self.errors.iter_mut().zip(&evaluation.objects) {
                errors.extend(object.best.map(|best| best.fit.error()));
            }
        }
        Ok(())
    }

    /// The intervals of what was drawn.
    ///
    /// # Errors
    /// When nothing was drawn.
    pub fn finish(self) -> Result<Intervals> {
        let resamples = self.capabilities.len();
        if resamples == 0 {
            return Err(Error::input(
                "0 resamples of the sequences; expected at least 1",
            ));
        }
        Ok(Intervals {
            level: self.level,
            resamples,
            tracking_capability: percentile_interval(&self.capabilities, self.level)?,
            errors: self
                .errors
                .into_iter()
                .map(|errors| {
                    let all = errors.len() == resamples;
                    all.then(|| percentile_interval(&errors, self.level))
                        .transpose()
                })
                .collect::<Result<_>>()?,
        })
    }
}
