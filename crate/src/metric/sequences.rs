//! How far a result would hold on other sequences: folds that the maps did not see, and intervals over sequences.
//!
//! Both take the moments of every sequence by itself. Frames of one sequence are much alike, so that sequences, not
//! frames, are what is left out and drawn.

use fastrand::Rng;

use super::evaluation::{Object, Settings};
use super::map::AffineMap;
use super::moments::{Moments, PairMoments};
use super::stats::percentile_interval;
use crate::error::{Error, Result};

/// The metric with maps and best keypoints that were chosen on other sequences than they are scored on.
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
pub struct HeldOutObject {
    /// Its name.
    pub name: String,
    /// The mean squared distance over all frames, each with the map fitted without its fold (ndc); `None` when the object
    /// is visible in no frame, or all its frames are in one fold.
    pub error: Option<f64>,
    /// Whether the error is at most the threshold.
    pub tracked: bool,
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
    /// Of the tracking error of each object's best keypoint, in the order given; `None` when a resample does not show
    /// the object.
    pub errors: Vec<Option<[f64; 2]>>,
}

impl Moments {
    /// Adds the moments of other frames of the same keypoints and objects.
    ///
    /// # Errors
    /// When they are of another number of keypoints or objects.
    pub fn merge(&mut self, other: &Self) -> Result<()> {
        if (self.keypoints, self.objects.len()) != (other.keypoints, other.objects.len()) {
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
        for (mine, theirs) in self.objects.iter_mut().zip(&other.objects) {
            mine.merge(theirs);
        }
        Ok(())
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
    /// The sum over the frames of the squared distance that `map` leaves.
    ///
    /// From second moments, so that distances below 1e-7 of the spread of the points are rounding.
    fn left_by(&self, map: &AffineMap) -> f64 {
        let [xx, xy, yy] = self.keypoint_squares;
        let t = self.frames as f64;
        (0..2)
            .map(|axis| {
                let [a, c] = map.a[axis];
                let own = a * a * xx + 2.0 * a * c * xy + c * c * yy;
                let with = a * self.cross[axis] + c * self.cross[axis + 2];
                let shift = map.apply(self.keypoint_mean)[axis] - self.truth_mean[axis];
                (own - 2.0 * with + self.truth_squares[axis]).max(0.0) + t * shift * shift
            })
            .sum()
    }
}

/// Scores every fold of the sequences with the best keypoints and maps of the other folds. `parts` are the moments of one
/// sequence each; `seed` deals them to the folds, whose numbers of sequences differ by one at most.
///
/// # Errors
/// When there are fewer than two folds, or fewer sequences than folds; as [`Moments::evaluate`].
pub fn held_out(
    parts: &[Moments],
    folds: usize,
    seed: u64,
    objects: &[Object],
    settings: &Settings,
) -> Result<HeldOut> {
    if folds < 2 || parts.len() < folds {
        return Err(Error::input(format!(
            "{folds} folds of {} sequences; expected at least 2 folds and a sequence for each",
            parts.len()
        )));
    }
    let mut order: Vec<usize> = (0..parts.len()).collect();
    Rng::with_seed(seed).shuffle(&mut order);
    let mut sums = vec![0.0; objects.len()];
    let mut frames = vec![0; objects.len()];
    let mut keypoints = vec![Vec::with_capacity(folds); objects.len()];
    for fold in 0..folds {
        let dealt = |inside: bool| {
            let places = order.iter().enumerate();
            places
                .filter(move |(place, _)| (place % folds == fold) == inside)
                .map(|(_, part)| &parts[*part])
        };
        let others = Moments::of(dealt(false))?;
        let own = Moments::of(dealt(true))?;
        let evaluation = others.evaluate(objects, settings)?;
        for (k, object) in evaluation.objects.iter().enumerate() {
            keypoints[k].push(object.best.map(|best| best.keypoint));
            let Some(best) = object.best else { continue };
            let moments = &own.objects[k];
            if moments.frames > 0 {
                sums[k] += moments.pair(best.keypoint).left_by(&best.fit.map);
                frames[k] += moments.frames;
            }
        }
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
        tracking_capability: objects.iter().filter(|o| o.tracked).count() as f64 / objects.len() as f64,
        objects,
    })
}

/// Percentile intervals of TC and of the errors: `resamples` times as many sequences as there are, drawn with replacement.
/// `parts` are the moments of one sequence each.
///
/// The best keypoint is chosen anew in every resample. O(resamples x sequences x N x K) time.
///
/// # Errors
/// When there are fewer than two sequences, no resample, or `level` is not between 0 and 1; as [`Moments::evaluate`].
pub fn bootstrap(
    parts: &[Moments],
    resamples: usize,
    level: f64,
    seed: u64,
    objects: &[Object],
    settings: &Settings,
) -> Result<Intervals> {
    if parts.len() < 2 || resamples == 0 {
        return Err(Error::input(format!(
            "{resamples} resamples of {} sequences; expected at least 1 of at least 2",
            parts.len()
        )));
    }
    if !(level > 0.0 && level < 1.0) {
        return Err(Error::input(format!(
            "the level {level}; expected one between 0 and 1, e.g. 0.95"
        )));
    }
    let mut rng = Rng::with_seed(seed);
    let mut capabilities = Vec::with_capacity(resamples);
    let mut errors = vec![Vec::with_capacity(resamples); objects.len()];
    for _ in 0..resamples {
        let drawn = (0..parts.len()).map(|_| &parts[rng.usize(0..parts.len())]);
        let evaluation = Moments::of(drawn)?.evaluate(objects, settings)?;
        capabilities.push(evaluation.tracking_capability);
        for (errors, object) in errors.iter_mut().zip(&evaluation.objects) {
            errors.extend(object.best.map(|best| best.fit.error()));
        }
    }
    Ok(Intervals {
        level,
        resamples,
        tracking_capability: percentile_interval(&capabilities, level)?,
        errors: errors
            .into_iter()
            .map(|errors| {
                let all = errors.len() == resamples;
                all.then(|| percentile_interval(&errors, level)).transpose()
            })
            .collect::<Result<_>>()?,
    })
}
