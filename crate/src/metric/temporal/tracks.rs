//! What benchmarks of point tracking and of poses measure.

use ndarray::ArrayView3;

use crate::metric::context::{CLOSE, SIDE};

/// Distances that count as close in TAP-Vid, in pixels of an image of 256 x 256.
pub const PIXELS: [f64; 5] = [1.0, 2.0, 4.0, 8.0, 16.0];
/// Pixels of TAP-Vid's images for one of ndc.
const PIXELS_OF_NDC: f64 = 128.0;
/// OKS's constant of every point. COCO measured one for each joint, 0.025 to 0.107; for the points of
/// a scene nobody did.
const SIGMA: f64 = 0.05;

/// What is counted for TAP-Vid's measures.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tracks {
    frames: u64,
    /// Frames in which both are there or both are not.
    agreed: u64,
    visible: u64,
    /// By the distance, positions that are close.
    correct: [u64; PIXELS.len()],
    /// By the distance, keypoints without an object, or far from it.
    wrong: [u64; PIXELS.len()],
}

/// TAP-Vid's measures; `None` where there is nothing to be measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TapVid {
    /// The share of the frames in which the keypoint is there if the object is visible, and missing
    /// if it is not.
    pub occlusion_accuracy: Option<f64>,
    /// The mean over [`PIXELS`] of the share of the visible positions to which the keypoint is close.
    pub position_accuracy: Option<f64>,
    /// The mean over [`PIXELS`] of the Jaccard index: keypoints that are close, over all visible
    /// positions and all keypoints that are not close to one.
    pub average_jaccard: Option<f64>,
}

impl Tracks {
    /// Counts a frame: an object and a keypoint under its map, ndc, where they are there.
    pub fn push(&mut self, truth: Option<[f64; 2]>, mapped: Option<[f64; 2]>) {
        self.frames += 1;
        self.agreed += u64::from(truth.is_some() == mapped.is_some());
        self.visible += u64::from(truth.is_some());
        let Some(mapped) = mapped else { return };
        let distance = truth.map(|x| {
            let off = super::minus(mapped, x);
            off[0].hypot(off[1]) * PIXELS_OF_NDC
        });
        for (i, pixels) in PIXELS.into_iter().enumerate() {
            match distance.is_some_and(|distance| distance < pixels) {
                true => self.correct[i] += 1,
                false => self.wrong[i] += 1,
            }
        }
    }

    /// The measures of all that was counted.
    pub fn measures(&self) -> TapVid {
        let share = |part: u64, all: u64| (all > 0).then(|| part as f64 / all as f64);
        let average = |of: &dyn Fn(usize) -> Option<f64>| {
            let shares: Option<Vec<f64>> = (0..PIXELS.len()).map(of).collect();
            shares.map(|shares| shares.iter().sum::<f64>() / PIXELS.len() as f64)
        };
        TapVid {
            occlusion_accuracy: share(self.agreed, self.frames),
            position_accuracy: average(&|i| share(self.correct[i], self.visible)),
            average_jaccard: average(&|i| share(self.correct[i], self.visible + self.wrong[i])),
        }
    }
}

/// Object keypoint similarity, with the objects of a frame as the points of one instance.
#[derive(Debug, Clone, PartialEq)]
pub struct Oks {
    /// For each object the mean over the frames in which it counts.
    pub objects: Vec<Option<f64>>,
    /// The mean over the frames of the mean over the objects.
    pub all: Option<f64>,
}

/// Object keypoint similarity of `mapped` and `truth`, T x K x 2 in ndc, NaN where one is missing:
/// exp(-d² / (2 s² κ²)) with s² the area of the box around the visible objects of the frame and
/// κ = 2 · 0.05. A missing keypoint has a similarity of 0; frames that show no two objects, or only
/// such in a line along an axis, have no scale and do not count.
pub fn oks(mapped: ArrayView3<f64>, truth: ArrayView3<f64>) -> Oks {
    let (frames, objects, _) = truth.dim();
    let kappa = 2.0 * SIGMA;
    let (mut sums, mut counts) = (vec![0.0; objects], vec![0; objects]);
    let (mut sum, mut count) = (0.0, 0);
    let at = |points: &ArrayView3<f64>, t: usize, k: usize| {
        let at = [points[[t, k, 0]], points[[t, k, 1]]];
        at.iter().all(|v| v.is_finite()).then_some(at)
    };
    for t in 0..frames {
        let seen = || (0..objects).filter_map(|k| Some((k, at(&truth, t, k)?)));
        let [width, height] = [0, 1].map(|axis| extent(seen().map(|(_, x)| x[axis])));
        let area = width * height;
        if !(area.is_finite() && area > 0.0) {
            continue;
        }
        let (mut of_frame, mut points) = (0.0, 0.0);
        for (k, x) in seen() {
            let similarity = at(&mapped, t, k).map_or(0.0, |z| {
                let off = super::minus(z, x);
                (-(off[0] * off[0] + off[1] * off[1]) / (2.0 * area * kappa * kappa)).exp()
            });
            sums[k] += similarity;
            counts[k] += 1;
            of_frame += similarity;
            points += 1.0;
        }
        sum += of_frame / points;
        count += 1;
    }
    Oks {
        objects: sums
            .iter()
            .zip(&counts)
            .map(|(sum, count)| super::mean(*sum, *count))
            .collect(),
        all: super::mean(sum, count),
    }
}

/// How far values reach.
fn extent(values: impl Iterator<Item = f64>) -> f64 {
    let wider = |range: Option<[f64; 2]>, v: f64| {
        let [low, high] = range.unwrap_or([v; 2]);
        Some([
            if v < low { v } else { low },
            if v > high { v } else { high },
        ])
    };
    values
        .fold(None, wider)
        .map_or(0.0, |[low, high]| high - low)
}

/// The percentage of correct keypoints: for each of [`CLOSE`] the share of the frames that show the
/// object in which the keypoint is that close, a missing one is not. `None` where no frame does.
pub fn pck(paths: super::Paths) -> Option<[f64; CLOSE.len()]> {
    let (mut frames, mut close) = (0, [0; CLOSE.len()]);
    for t in 0..paths.truth.dim().0 {
        let Some(x) = super::point(paths.truth, t) else {
            continue;
        };
        frames += 1;
        let Some(z) = super::point(paths.mapped, t) else {
            continue;
        };
        let off = super::minus(z, x);
        for (close, share) in close.iter_mut().zip(CLOSE) {
            *close += u64::from(off[0].hypot(off[1]) <= share * SIDE);
        }
    }
    (frames > 0).then(|| close.map(|close| close as f64 / f64::from(frames)))
}
