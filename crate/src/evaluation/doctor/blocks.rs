//! Two readings of the same data, compared: does the error on held-out frames become smaller in
//! nearly all stretches of the recording, and by much?

use ndarray::{Array3, ArrayView2, ArrayView3, Axis};

use super::subject::Subject;
use crate::data::ranges;
use crate::track::FrameKey;

/// The most stretches.
const MOST_BLOCKS: usize = 64;
/// Sequences are cut into stretches where there are fewer of them.
const FEW_SEQUENCES: usize = 10;
/// The stretches that few sequences are cut into, all together.
const WANTED_BLOCKS: usize = 20;
/// The least frames of a stretch that is cut.
const LEAST_FRAMES: usize = 5;
/// Pairs of a keypoint and an object, over the frames, that are looked at: 5000 frames of 32
/// keypoints and 3 objects, a tenth of a second. Of longer recordings each stretch is cut short.
const BUDGET: usize = 500_000;
/// The least frames that a map is fitted on.
const LEAST_FITTED: f64 = 6.0;
/// Keypoint variance that counts as none, relative to the larger axis: it keeps the fit of an object
/// on a line well posed, and changes no error that is compared here.
const RIDGE: f64 = 1e-9;

/// The joined rows, dealt to stretches.
pub(super) struct Blocks<'a> {
    keypoints: ArrayView3<'a, f64>,
    truth: ArrayView3<'a, f64>,
    keypoint_keys: &'a [FrameKey],
    rows: Vec<Row>,
    count: usize,
    /// What moments are taken around, by keypoint and by object.
    keypoint_origins: Vec<[f64; 2]>,
    truth_origins: Vec<[f64; 2]>,
    /// The frames of the keypoints by sequence and number.
    sorted: Vec<(&'a FrameKey, usize)>,
}

/// A row of the ground truth with the frame it is joined to.
#[derive(Clone, Copy)]
pub(super) struct Row {
    /// The frame of the keypoints.
    pub z: usize,
    /// The row of the ground truth.
    pub x: usize,
    block: usize,
}

/// Which maps are fitted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Model {
    /// Any affine map.
    Affine,
    /// A positive scale and a shift an axis, after the axes of the keypoint were taken so.
    Oriented(Orientation),
}

/// Axes of a keypoint in terms of those of the ground truth.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct Orientation {
    pub swap: bool,
    /// By axis of the ground truth.
    pub flip: [bool; 2],
}

/// Squared distances by stretch and object under maps of the other half of the stretches, and the
/// frames they are summed over.
pub(super) struct Errors {
    squares: Vec<Vec<(f64, f64)>>,
    variances: Vec<f64>,
    /// Where the map of the last half puts the origin of its keypoint.
    origins: Vec<[f64; 2]>,
}

/// How the errors of two readings differ.
#[derive(Clone, Copy, Debug)]
pub(super) struct Comparison {
    /// The mean error of the objects that the second reading explains, under the first one.
    pub before: f64,
    /// The same under the second one.
    pub after: f64,
    /// `after` relative to `before`, objects weighted by their variance.
    pub ratio: f64,
    /// Stretches whose error becomes smaller.
    pub votes: usize,
    /// Stretches that were compared.
    pub of: usize,
}

impl Comparison {
    /// Whether it is as good as excluded that the votes fall like this by chance.
    pub fn is_significant(&self) -> bool {
        chance(self.votes, self.of) <= 1e-3
    }

    /// Whether most stretches become worse, and by much.
    pub fn is_refuted(&self) -> bool {
        self.ratio > 1.2 && chance(self.of - self.votes, self.of) <= 0.05
    }
}

/// The chance that at least `votes` of `of` coins show heads.
fn chance(votes: usize, of: usize) -> f64 {
    let mut term = 0.5_f64.powi(of as i32);
    let mut sum = 0.0;
    for heads in 0..=of {
        if heads >= votes {
            sum += term;
        }
        term *= (of - heads) as f64 / (heads + 1) as f64;
    }
    sum
}

/// The first finite position of each point.
fn origins(points: &Array3<f64>) -> Vec<[f64; 2]> {
    let first = |of: ArrayView2<f64>| {
        let mut seen = of.outer_iter().map(|p| [p[0], p[1]]);
        seen.find(|p| p.iter().all(|v| v.is_finite()))
            .unwrap_or_default()
    };
    points.axis_iter(Axis(1)).map(first).collect()
}

impl<'a> Blocks<'a> {
    pub fn of(subject: &Subject<'a>) -> Self {
        let keypoint_keys = subject.keypoints.keys();
        let pairs = &subject.join.pairs;
        let joined: Vec<FrameKey> = pairs
            .iter()
            .map(|(z, _)| keypoint_keys[*z].clone())
            .collect();
        let sequences = ranges(&joined);
        let pieces = match sequences.len() {
            few @ 1..FEW_SEQUENCES => WANTED_BLOCKS.div_ceil(few),
            _ => 1,
        };
        let mut cuts: Vec<(usize, usize)> = Vec::new();
        for range in &sequences {
            let pieces = pieces.min(range.length / LEAST_FRAMES).max(1);
            for piece in 0..pieces {
                let start = range.start + piece * range.length / pieces;
                let end = range.start + (piece + 1) * range.length / pieces;
                cuts.push((start, end));
            }
        }
        let count = cuts.len().min(MOST_BLOCKS);
        let points = subject.keypoints.keypoints() * subject.truth.names().len();
        let most = (BUDGET / points.max(1) / count.max(1)).max(LEAST_FRAMES);
        let mut taken = vec![0; count];
        let mut rows = Vec::new();
        for (i, (start, end)) in cuts.iter().enumerate() {
            let block = i * count / cuts.len();
            for (z, x) in &pairs[*start..*end] {
                if taken[block] < most {
                    taken[block] += 1;
                    rows.push(Row {
                        z: *z,
                        x: *x,
                        block,
                    });
                }
            }
        }
        let mut sorted: Vec<(&FrameKey, usize)> = keypoint_keys.iter().zip(0..).collect();
        sorted.sort_unstable();
        let (keypoints, truth) = (subject.keypoints.points(), subject.truth.points_ndc());
        Self {
            keypoints: keypoints.view(),
            truth: truth.view(),
            keypoint_origins: origins(keypoints),
            truth_origins: origins(truth),
            keypoint_keys,
            rows,
            count,
            sorted,
        }
    }

    /// The frame of the keypoints that comes `by` frames after frame `z`.
    pub fn later(&self, z: usize, by: i64) -> Option<usize> {
        let FrameKey { sequence, frame } = &self.keypoint_keys[z];
        self.frame(sequence, frame.checked_add_signed(by)?)
    }

    /// The frame of the keypoints with this name and number.
    pub fn frame(&self, sequence: &str, frame: u64) -> Option<usize> {
        let found = self.sorted.binary_search_by(|(key, _)| {
            (key.sequence.as_str(), key.frame).cmp(&(sequence, frame))
        });
        Some(self.sorted[found.ok()?].1)
    }

    /// Compares the join with the one that takes the frame `other` for a row.
    pub fn compare(&self, other: impl Fn(&Row) -> Option<usize>) -> Option<Comparison> {
        let both: Vec<(Row, Row)> = self
            .rows
            .iter()
            .filter_map(|row| {
                Some((
                    *row,
                    Row {
                        z: other(row)?,
                        ..*row
                    },
                ))
            })
            .collect();
        let now = self.sums(both.iter().map(|(now, then)| (*now, then.z)));
        let then = self.sums(both.iter().map(|(now, then)| (*then, now.z)));
        let [now, then] = [now, then].map(|sums| self.errors(&sums, Model::Affine));
        then.against(&now, 0.5)
    }

    /// The errors of the join under maps of a kind.
    pub fn errors_under(&self, models: &[Model]) -> Vec<Errors> {
        let sums = self.sums(self.rows.iter().map(|row| (*row, row.z)));
        models
            .iter()
            .map(|model| self.errors(&sums, *model))
            .collect()
    }

    /// Where the fitted maps put the origin of the keypoints, on average over both axes and the
    /// objects that they explain up to a `share` of their variance; None where they explain none.
    pub fn origin(&self, share: f64) -> Option<f64> {
        let sums = self.sums(self.rows.iter().map(|row| (*row, row.z)));
        let errors = self.errors(&sums, Model::Affine);
        let explained = errors.explained(share);
        let origins = explained.iter().map(|k| errors.origins[*k]);
        let sum: f64 = origins.map(|[x, y]| (x + y) / 2.0).sum();
        (!explained.is_empty()).then(|| sum / explained.len() as f64)
    }

    /// Moments by stretch, keypoint and object. Each row comes with a frame in which a keypoint must
    /// be there too, or the row does not count for it.
    fn sums(&self, rows: impl Iterator<Item = (Row, usize)>) -> Vec<Sums> {
        let (keypoints, objects) = (self.keypoints.dim().1, self.truth.dim().1);
        let mut sums = vec![Sums::default(); self.count * keypoints * objects];
        let at = |points: &ArrayView3<f64>, t: usize, i: usize, origin: &[f64; 2]| {
            [0, 1].map(|axis| points[[t, i, axis]] - origin[axis])
        };
        for (row, also) in rows {
            let block = &mut sums[row.block * keypoints * objects..][..keypoints * objects];
            for (n, origin) in self.keypoint_origins.iter().enumerate() {
                let z = at(&self.keypoints, row.z, n, origin);
                let is_seen = z.iter().all(|v| v.is_finite())
                    && (0..2).all(|axis| self.keypoints[[also, n, axis]].is_finite());
                if !is_seen {
                    continue;
                }
                for (k, origin) in self.truth_origins.iter().enumerate() {
                    let x = at(&self.truth, row.x, k, origin);
                    if x.iter().all(|v| v.is_finite()) {
                        block[n * objects + k].push(z, x);
                    }
                }
            }
        }
        sums
    }

    fn errors(&self, sums: &[Sums], model: Model) -> Errors {
        let (keypoints, objects) = (self.keypoints.dim().1, self.truth.dim().1);
        let pairs = keypoints * objects;
        let mut halves = [vec![Sums::default(); pairs], vec![Sums::default(); pairs]];
        for (i, sum) in sums.iter().enumerate() {
            halves[i / pairs.max(1) % 2][i % pairs].add(sum);
        }
        let mut squares = vec![vec![(0.0, 0.0); objects]; self.count];
        let mut variances = vec![0.0; objects];
        let mut origins = vec![[0.0; 2]; objects];
        for k in 0..objects {
            let mut frames = 0.0;
            for n in 0..keypoints {
                let mut all = halves[0][n * objects + k];
                all.add(&halves[1][n * objects + k]);
                if all.count > frames {
                    (frames, variances[k]) = (all.count, all.variance());
                }
            }
            for (half, fitted) in halves.iter().enumerate() {
                let fits = (0..keypoints).filter_map(|n| {
                    let sums = &fitted[n * objects + k];
                    if sums.count < LEAST_FITTED || sums.count < frames / 4.0 {
                        return None;
                    }
                    let map = sums.fit(model);
                    let error = sums.left(&map) / sums.count;
                    Some((n, map, error))
                });
                let best = fits.min_by(|a, b| a.2.total_cmp(&b.2));
                let Some((n, map, _)) = best else { continue };
                let [z0, z1] = self.keypoint_origins[n];
                origins[k] = [0, 1].map(|axis| {
                    let [a0, a1] = map.a[axis];
                    self.truth_origins[k][axis] + map.b[axis] - a0 * z0 - a1 * z1
                });
                for block in (0..self.count).filter(|block| block % 2 != half) {
                    let sums = &sums[block * pairs + n * objects + k];
                    squares[block][k] = (sums.left(&map), sums.count);
                }
            }
        }
        Errors {
            squares,
            variances,
            origins,
        }
    }
}

impl Errors {
    /// The mean squared distance of object `k`; None where it is in no frame.
    fn mean(&self, k: usize) -> Option<f64> {
        let (mut sum, mut frames) = (0.0, 0.0);
        for block in &self.squares {
            sum += block[k].0;
            frames += block[k].1;
        }
        (frames > 0.0).then(|| sum / frames)
    }

    /// The objects whose error is at most this share of their variance.
    pub fn explained(&self, share: f64) -> Vec<usize> {
        let is_explained = |k: &usize| {
            let variance = self.variances[*k];
            variance > 0.0 && self.mean(*k).is_some_and(|error| error <= share * variance)
        };
        (0..self.variances.len()).filter(is_explained).collect()
    }

    /// Compares this reading with an `earlier` one on the objects that it explains up to a `share`
    /// of their variance; None where it explains none.
    pub fn against(&self, earlier: &Self, share: f64) -> Option<Comparison> {
        let objects = self.explained(share);
        if objects.is_empty() {
            return None;
        }
        let mean = |errors: &Self, weigh: bool| {
            let each = objects.iter().filter_map(|k| {
                let weight = if weigh { self.variances[*k] } else { 1.0 };
                Some(errors.mean(*k)? / weight)
            });
            each.sum::<f64>() / objects.len() as f64
        };
        let (mut votes, mut of) = (0, 0);
        for (before, after) in earlier.squares.iter().zip(&self.squares) {
            let sum = |block: &[(f64, f64)]| -> f64 {
                objects
                    .iter()
                    .map(|k| block[*k].0 / self.variances[*k])
                    .sum()
            };
            let (before, after) = (sum(before), sum(after));
            if before != after {
                of += 1;
                votes += usize::from(after < before);
            }
        }
        let ratio = mean(self, true) / mean(earlier, true);
        (ratio.is_finite() && of > 0).then(|| Comparison {
            before: mean(earlier, false),
            after: mean(self, false),
            ratio,
            votes,
            of,
        })
    }
}

/// Sums over frames of a keypoint `z` and an object `x`, each from an origin of its own.
#[derive(Clone, Copy, Default)]
struct Sums {
    count: f64,
    z: [f64; 2],
    x: [f64; 2],
    /// `z0 z0`, `z0 z1`, `z1 z1`.
    zz: [f64; 3],
    xx: [f64; 2],
    /// By axis of `x`, with each axis of `z`.
    xz: [[f64; 2]; 2],
}

/// `x = a z + b`, between the origins of [`Sums`].
struct Map {
    a: [[f64; 2]; 2],
    b: [f64; 2],
}

impl Sums {
    fn push(&mut self, z: [f64; 2], x: [f64; 2]) {
        self.count += 1.0;
        self.zz[0] += z[0] * z[0];
        self.zz[1] += z[0] * z[1];
        self.zz[2] += z[1] * z[1];
        for axis in 0..2 {
            self.z[axis] += z[axis];
            self.x[axis] += x[axis];
            self.xx[axis] += x[axis] * x[axis];
            self.xz[axis][0] += x[axis] * z[0];
            self.xz[axis][1] += x[axis] * z[1];
        }
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        for i in 0..3 {
            self.zz[i] += other.zz[i];
        }
        for axis in 0..2 {
            self.z[axis] += other.z[axis];
            self.x[axis] += other.x[axis];
            self.xx[axis] += other.xx[axis];
            self.xz[axis][0] += other.xz[axis][0];
            self.xz[axis][1] += other.xz[axis][1];
        }
    }

    /// The mean squared distance of the object from its mean.
    fn variance(&self) -> f64 {
        let along = |axis: usize| self.xx[axis] / self.count - (self.x[axis] / self.count).powi(2);
        (along(0) + along(1)).max(0.0)
    }

    fn fit(&self, model: Model) -> Map {
        let n = self.count;
        let own = |i: usize, j: usize| self.zz[i + j] - self.z[i] * self.z[j] / n;
        let cross = |axis: usize, i: usize| self.xz[axis][i] - self.x[axis] * self.z[i] / n;
        let mut a = [[0.0; 2]; 2];
        match model {
            Model::Affine => {
                let ridge = RIDGE * (own(0, 0) + own(1, 1));
                let (c00, c01, c11) = (own(0, 0) + ridge, own(0, 1), own(1, 1) + ridge);
                let det = c00 * c11 - c01 * c01;
                if det > 0.0 {
                    for (axis, row) in a.iter_mut().enumerate() {
                        let (x0, x1) = (cross(axis, 0), cross(axis, 1));
                        *row = [(c11 * x0 - c01 * x1) / det, (c00 * x1 - c01 * x0) / det];
                    }
                }
            }
            Model::Oriented(Orientation { swap, flip }) => {
                for (axis, row) in a.iter_mut().enumerate() {
                    let i = if swap { 1 - axis } else { axis };
                    let sign = if flip[axis] { -1.0 } else { 1.0 };
                    if own(i, i) > 0.0 && cross(axis, i) * sign > 0.0 {
                        row[i] = cross(axis, i) / own(i, i);
                    }
                }
            }
        }
        let b =
            [0, 1].map(|axis| (self.x[axis] - a[axis][0] * self.z[0] - a[axis][1] * self.z[1]) / n);
        Map { a, b }
    }

    /// The sum of the squared distances under a map.
    fn left(&self, map: &Map) -> f64 {
        let along = |axis: usize| {
            let ([a0, a1], b) = (map.a[axis], map.b[axis]);
            a0 * a0 * self.zz[0]
                + 2.0 * a0 * a1 * self.zz[1]
                + a1 * a1 * self.zz[2]
                + b * b * self.count
                + self.xx[axis]
                - 2.0 * (a0 * self.xz[axis][0] + a1 * self.xz[axis][1])
                + 2.0 * b * (a0 * self.z[0] + a1 * self.z[1])
                - 2.0 * b * self.x[axis]
        };
        (along(0) + along(1)).max(0.0)
    }
}
