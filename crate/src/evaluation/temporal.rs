//! How good the best keypoints are over time.

use std::ops::Range;

use super::scoring::Scoring;
use super::thresholds::Thresholds;
use crate::data::ranges;
use crate::error::Result;
use crate::metric::temporal::{
    HeldOutMaps, Paths, TapVid, Tracks, acceleration_error, handed_over, held_out_maps, lag, oks,
    pck, velocity_correlation,
};
use crate::metric::{Best, Settings, context::CLOSE, deal};
use ndarray::{Array3, Axis};

/// Measures over time, beside the TC, of the best keypoint of every object under its map; `None`
/// where there is nothing to be measured. See [`temporal`](crate::metric::temporal).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Temporal {
    /// The objects.
    pub objects: Vec<TemporalObject>,
    /// TAP-Vid's measures of all objects together: the mean over the sequences.
    pub tap_vid: TapVid,
    /// The mean over the frames of the mean object keypoint similarity of the objects.
    pub oks: Option<f64>,
    /// The number of folds of the sequences that the maps are held out on; 0 where there is one
    /// sequence.
    pub folds: usize,
}

/// One object of a [`Temporal`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct TemporalObject {
    /// Its name.
    pub name: String,
    /// Its best keypoint, counted from 0.
    pub keypoint: Option<usize>,
    /// The acceleration error, ndc a frame squared.
    pub jitter: Option<f64>,
    /// The correlation of the velocities of keypoint and object.
    pub velocity_correlation: Option<f64>,
    /// By how many frames the keypoint comes later.
    pub lag: Option<i64>,
    /// The share of frames in which the keypoint loses the object to another one.
    pub handed_over: Option<f64>,
    /// Errors of other maps on sequences that were not fitted.
    pub held_out: HeldOutMaps,
    /// TAP-Vid's measures.
    pub tap_vid: TapVid,
    /// The mean object keypoint similarity.
    pub oks: Option<f64>,
    /// The percentage of correct keypoints within the distances of [`CLOSE`].
    pub pck: Option<[f64; CLOSE.len()]>,
}

impl Scoring {
    /// Measures the best keypoints over time, all joined frames of them; `folds` of the sequences are
    /// held out for other maps, as many as for the held-out errors.
    ///
    /// # Errors
    /// As [`Scoring::evaluate`], and when there are fewer than two folds, or fewer sequences.
    pub fn temporal(
        &self,
        folds: Option<usize>,
        seed: u64,
        thresholds: &Thresholds,
        settings: &Settings,
    ) -> Result<Temporal> {
        self.need_image("the measures over time (temporal)")?;
        let evaluation = self.evaluate(thresholds, settings)?;
        let sequences = ranges(self.keys());
        let fold_of = match folds {
            Some(folds) => Some(deal(sequences.len(), folds, seed)?),
            None => None,
        };
        let fold_of: Option<Vec<usize>> = fold_of.map(|fold_of| {
            let frames = sequences.iter().zip(fold_of);
            let frames = frames.flat_map(|(range, fold)| std::iter::repeat_n(fold, range.length));
            frames.collect()
        });
        let runs = self.runs();
        let all = (self.keys().len(), self.objects().len(), 2);
        let [mut truth, mut mapped] = [(); 2].map(|()| Array3::from_elem(all, f64::NAN));
        let mut objects = Vec::new();
        for (k, object) in evaluation.objects.iter().enumerate() {
            let mut found = TemporalObject::new(&object.name);
            if let Some(Best { keypoint: n, .. }) = object.best {
                let series = self.series(k, n, settings)?;
                truth.index_axis_mut(Axis(1), k).assign(&series.truth_ndc);
                mapped
                    .index_axis_mut(Axis(1), k)
                    .assign(&series.transformed_ndc);
                found.measure(Paths {
                    truth: series.truth_ndc.view(),
                    mapped: series.transformed_ndc.view(),
                    runs: &runs,
                });
                let distances = |n| self.distances(k, n, settings);
                let count = evaluation.errors.dim().1;
                found.keypoint = Some(n);
                found.handed_over = handed_over(n, count, object.threshold, &runs, distances)?;
                if let Some(fold_of) = &fold_of {
                    let seconds = likeliest(n, evaluation.errors.row(k).iter());
                    let object = series.truth_ndc.view();
                    found.held_out =
                        held_out_maps(self.all_keypoints(), object, n, &seconds, fold_of);
                }
            }
            objects.push(found);
        }
        let oks = oks(mapped.view(), truth.view());
        for (object, oks) in objects.iter_mut().zip(oks.objects) {
            object.oks = oks;
        }
        let sequences = sequences
            .iter()
            .map(|range| range.start..range.start + range.length);
        Ok(Temporal {
            objects,
            tap_vid: of_sequences(&truth, &mapped, sequences),
            oks: oks.all,
            folds: folds.unwrap_or(0),
        })
    }

    /// Ranges of the joined frames whose numbers follow each other in a sequence.
    fn runs(&self) -> Vec<Range<usize>> {
        let mut runs: Vec<Range<usize>> = Vec::new();
        for (t, key) in self.keys().iter().enumerate() {
            let before = t.checked_sub(1).map(|before| &self.keys()[before]);
            let follows = before.is_some_and(|before| {
                before.sequence == key.sequence && before.frame.checked_add(1) == Some(key.frame)
            });
            match runs.last_mut() {
                Some(run) if follows => run.end = t + 1,
                _ => runs.push(t..t + 1),
            }
        }
        runs
    }
}

impl TemporalObject {
    fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            keypoint: None,
            jitter: None,
            velocity_correlation: None,
            lag: None,
            handed_over: None,
            held_out: HeldOutMaps::default(),
            tap_vid: TapVid::default(),
            oks: None,
            pck: None,
        }
    }

    /// What the paths of object and keypoint alone tell.
    fn measure(&mut self, paths: Paths) {
        self.jitter = acceleration_error(paths);
        self.velocity_correlation = velocity_correlation(paths, 0);
        self.lag = lag(paths);
        self.pck = pck(paths);
        let mut tracks = Tracks::default();
        for (x, z) in paths.truth.outer_iter().zip(paths.mapped.outer_iter()) {
            tracks.push(there([x[0], x[1]]), there([z[0], z[1]]));
        }
        self.tap_vid = tracks.measures();
    }
}

fn there(point: [f64; 2]) -> Option<[f64; 2]> {
    point.iter().all(|v| v.is_finite()).then_some(point)
}

/// The other keypoints by their errors, the smallest first; those without one are left out.
fn likeliest<'a>(n: usize, errors: impl Iterator<Item = &'a f64>) -> Vec<usize> {
    let others = errors
        .enumerate()
        .filter(|(m, error)| *m != n && error.is_finite());
    let mut others: Vec<(usize, &f64)> = others.collect();
    others.sort_by(|a, b| a.1.total_cmp(b.1));
    others.into_iter().map(|(m, _)| m).collect()
}

/// TAP-Vid's measures of all objects of a sequence, as means over the sequences.
fn of_sequences(
    truth: &Array3<f64>,
    mapped: &Array3<f64>,
    sequences: impl Iterator<Item = Range<usize>>,
) -> TapVid {
    let measured: Vec<TapVid> = sequences
        .map(|frames| {
            let mut tracks = Tracks::default();
            for t in frames {
                let [truth, mapped] = [truth, mapped].map(|points| points.index_axis(Axis(0), t));
                for (x, z) in truth.rows().into_iter().zip(mapped.rows()) {
                    tracks.push(there([x[0], x[1]]), there([z[0], z[1]]));
                }
            }
            tracks.measures()
        })
        .collect();
    let mean = |of: &dyn Fn(&TapVid) -> Option<f64>| {
        let values: Vec<f64> = measured.iter().filter_map(of).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    TapVid {
        occlusion_accuracy: mean(&|of| of.occlusion_accuracy),
        position_accuracy: mean(&|of| of.position_accuracy),
        average_jaccard: mean(&|of| of.average_jaccard),
    }
}
