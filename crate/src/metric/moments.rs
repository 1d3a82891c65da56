//! Centred first and second moments of keypoints and objects, and their exact merge.

use std::collections::BTreeMap;

use super::scale::{ZERO, larger, times_power};

/// The axes of [`ObjectMoments::keypoint_squares`].
const PRODUCTS: [(usize, usize); 3] = [(0, 0), (0, 1), (1, 1)];

/// The axes of [`ObjectMoments::cross`]: that of the keypoint, that of the object.
const CROSS: [(usize, usize); 4] = [(0, 0), (0, 1), (1, 0), (1, 1)];

/// Moments over the frames in which one object is visible.
///
/// `T`, the means of the keypoints and of the object, and the sums of products of the deviations
/// from them. Structure of arrays over the N keypoints, so that merging vectorises.
///
/// Every axis has an exponent: its values are divided by that power of two (see `scale`).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ObjectMoments {
    pub frames: u64,
    pub outside: u64,
    pub truth_exponent: [i32; 2],
    pub keypoint_exponent: [Vec<i32>; 2],
    pub truth_mean: [f64; 2],
    /// Sums of squares of x and of y.
    pub truth_squares: [f64; 2],
    pub keypoint_mean: [Vec<f64>; 2],
    /// Sums of products xx, xy, yy.
    pub keypoint_squares: [Vec<f64>; 3],
    /// Sums of products: keypoint x with truth x, y; keypoint y with truth x, y.
    pub cross: [Vec<f64>; 4],
    /// The moments of each keypoint that is missing in a frame, by itself and over its own frames;
    /// they count in place of those above.
    pub partial: BTreeMap<usize, ObjectMoments>,
}

impl ObjectMoments {
    pub fn new(keypoints: usize) -> Self {
        let zeros = || vec![0.0; keypoints];
        Self {
            frames: 0,
            outside: 0,
            truth_exponent: [ZERO; 2],
            keypoint_exponent: [vec![ZERO; keypoints], vec![ZERO; keypoints]],
            truth_mean: [0.0; 2],
            truth_squares: [0.0; 2],
            keypoint_mean: [zeros(), zeros()],
            keypoint_squares: [zeros(), zeros(), zeros()],
            cross: [zeros(), zeros(), zeros(), zeros()],
            partial: BTreeMap::new(),
        }
    }

    /// The moments of keypoint `n` by itself, to be changed: from now on it has frames of its own.
    pub fn part(&mut self, n: usize) -> &mut Self {
        if !self.partial.contains_key(&n) {
            self.partial.insert(n, self.one(n));
        }
        self.partial.entry(n).or_insert_with(|| Self::new(1))
    }

    /// The moments of keypoint `n` by itself.
    fn one(&self, n: usize) -> Self {
        if let Some(part) = self.partial.get(&n) {
            return part.clone();
        }
        Self {
            frames: self.frames,
            outside: self.outside,
            truth_exponent: self.truth_exponent,
            keypoint_exponent: self.keypoint_exponent.each_ref().map(|v| vec![v[n]]),
            truth_mean: self.truth_mean,
            truth_squares: self.truth_squares,
            keypoint_mean: self.keypoint_mean.each_ref().map(|v| vec![v[n]]),
            keypoint_squares: self.keypoint_squares.each_ref().map(|v| vec![v[n]]),
            cross: self.cross.each_ref().map(|v| vec![v[n]]),
            partial: BTreeMap::new(),
        }
    }

    /// Merges the moments of other frames.
    pub fn merge(&mut self, other: &Self) {
        let mine = self.partial.keys();
        let mut parts: Vec<usize> = mine.chain(other.partial.keys()).copied().collect();
        parts.sort_unstable();
        parts.dedup();
        for n in parts {
            self.part(n).merge_frames(&other.one(n));
        }
        self.merge_frames(other);
    }

    /// [`merge`](Self::merge) without the keypoints that have frames of their own.
    #[inline(always)]
    pub fn merge_frames(&mut self, other: &Self) {
        if other.frames == 0 {
            return;
        }
        if (self.truth_exponent, &self.keypoint_exponent)
            == (other.truth_exponent, &other.keypoint_exponent)
        {
            self.merge_alike(other);
            return;
        }
        let truth = [0, 1].map(|axis| self.truth_exponent[axis].max(other.truth_exponent[axis]));
        let mut keypoint = self.keypoint_exponent.clone();
        for axis in 0..2 {
            let theirs = &other.keypoint_exponent[axis];
            for (exponent, theirs) in keypoint[axis].iter_mut().zip(theirs) {
                *exponent = (*exponent).max(*theirs);
            }
        }
        self.rescale(truth, &keypoint);
        let mut other = other.clone();
        other.rescale(truth, &keypoint);
        self.merge_alike(&other);
    }

    /// The same moments with other exponents.
    fn rescale(&mut self, truth: [i32; 2], keypoint: &[Vec<i32>; 2]) {
        let truth_step = [0, 1].map(|axis| self.truth_exponent[axis] - truth[axis]);
        for axis in 0..2 {
            let step = truth_step[axis];
            self.truth_mean[axis] = times_power(self.truth_mean[axis], step);
            self.truth_squares[axis] = times_power(self.truth_squares[axis], 2 * step);
        }
        for n in 0..self.keypoint_mean[0].len() {
            let step = [0, 1].map(|axis| self.keypoint_exponent[axis][n] - keypoint[axis][n]);
            if (truth_step, step) == ([0; 2], [0; 2]) {
                continue;
            }
            for axis in 0..2 {
                let mean = &mut self.keypoint_mean[axis][n];
                *mean = times_power(*mean, step[axis]);
            }
            for (squares, (a, b)) in self.keypoint_squares.iter_mut().zip(PRODUCTS) {
                squares[n] = times_power(squares[n], step[a] + step[b]);
            }
            for (cross, (a, b)) in self.cross.iter_mut().zip(CROSS) {
                cross[n] = times_power(cross[n], step[a] + truth_step[b]);
            }
        }
        self.truth_exponent = truth;
        self.keypoint_exponent.clone_from(keypoint);
    }

    /// The pairwise update of Chan, Golub and LeVeque (1983), with equal exponents.
    #[inline(always)]
    fn merge_alike(&mut self, other: &Self) {
        let (t1, t2) = (self.frames as f64, other.frames as f64);
        let total = t1 + t2;
        let to_mean = t2 / total;
        let between = t1 * to_mean;
        self.frames += other.frames;
        self.outside += other.outside;
        let truth_step = [0, 1].map(|axis| other.truth_mean[axis] - self.truth_mean[axis]);
        for axis in 0..2 {
            self.truth_squares[axis] +=
                other.truth_squares[axis] + between * truth_step[axis] * truth_step[axis];
            self.truth_mean[axis] += to_mean * truth_step[axis];
        }
        for n in 0..self.keypoint_mean[0].len() {
            let step =
                [0, 1].map(|axis| other.keypoint_mean[axis][n] - self.keypoint_mean[axis][n]);
            for axis in 0..2 {
                self.keypoint_mean[axis][n] += to_mean * step[axis];
            }
            for (i, product) in [step[0] * step[0], step[0] * step[1], step[1] * step[1]]
                .into_iter()
                .enumerate()
            {
                self.keypoint_squares[i][n] += other.keypoint_squares[i][n] + between * product;
            }
            for (i, product) in [
                step[0] * truth_step[0],
                step[0] * truth_step[1],
                step[1] * truth_step[0],
                step[1] * truth_step[1],
            ]
            .into_iter()
            .enumerate()
            {
                self.cross[i][n] += other.cross[i][n] + between * product;
            }
        }
    }

    /// The moments of one keypoint with the object.
    pub fn pair(&self, n: usize) -> PairMoments {
        if let Some(part) = self.partial.get(&n) {
            return part.pair(0);
        }
        let at = |v: &Vec<f64>| v[n];
        let pair = PairMoments {
            frames: self.frames,
            truth_exponent: self.truth_exponent,
            keypoint_exponent: self.keypoint_exponent.each_ref().map(|v| v[n]),
            keypoint_mean: self.keypoint_mean.each_ref().map(at),
            keypoint_squares: self.keypoint_squares.each_ref().map(at),
            truth_mean: self.truth_mean,
            truth_squares: self.truth_squares,
            cross: self.cross.each_ref().map(at),
        };
        // The axes of a keypoint are mixed by the map and need one exponent; zeros take any.
        let keypoint = pair.keypoint_exponent[0].max(pair.keypoint_exponent[1]);
        pair.rescaled(
            pair.truth_exponent.map(|e| if e == ZERO { 0 } else { e }),
            [if keypoint == ZERO { 0 } else { keypoint }; 2],
        )
    }
}

/// The moments of one (keypoint, object) pair; see [`ObjectMoments`] for the order of the entries.
#[derive(Debug, Clone, Copy)]
pub(super) struct PairMoments {
    pub frames: u64,
    pub truth_exponent: [i32; 2],
    pub keypoint_exponent: [i32; 2],
    pub keypoint_mean: [f64; 2],
    pub keypoint_squares: [f64; 3],
    pub truth_mean: [f64; 2],
    pub truth_squares: [f64; 2],
    pub cross: [f64; 4],
}

impl PairMoments {
    /// The same moments with other exponents.
    pub fn rescaled(mut self, truth: [i32; 2], keypoint: [i32; 2]) -> Self {
        let truth_step = [0, 1].map(|axis| self.truth_exponent[axis] - truth[axis]);
        let step = [0, 1].map(|axis| self.keypoint_exponent[axis] - keypoint[axis]);
        for axis in 0..2 {
            self.truth_mean[axis] = times_power(self.truth_mean[axis], truth_step[axis]);
            self.truth_squares[axis] = times_power(self.truth_squares[axis], 2 * truth_step[axis]);
            self.keypoint_mean[axis] = times_power(self.keypoint_mean[axis], step[axis]);
        }
        for (squares, (a, b)) in self.keypoint_squares.iter_mut().zip(PRODUCTS) {
            *squares = times_power(*squares, step[a] + step[b]);
        }
        for (cross, (a, b)) in self.cross.iter_mut().zip(CROSS) {
            *cross = times_power(*cross, step[a] + truth_step[b]);
        }
        self.truth_exponent = truth;
        self.keypoint_exponent = keypoint;
        self
    }

    /// The larger sum of squares of the keypoint along an axis.
    pub fn widest(&self) -> f64 {
        larger(self.keypoint_squares[0], self.keypoint_squares[2])
    }
}

/// What an [`Accumulator`](super::Accumulator) knows of its frames: enough for every map, rank rule
/// and threshold, in O(N K) memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Moments {
    pub(super) keypoints: usize,
    pub(super) frames: u64,
    pub(super) excluded: u64,
    pub(super) missing: Vec<u64>,
    pub(super) objects: Vec<ObjectMoments>,
    /// The numbers of coordinates of a keypoint and of an object.
    pub(super) axes: [usize; 2],
    /// Of points in space, the moments of the other pairs of coordinates; those above are of the
    /// first two.
    pub(super) others: Vec<Moments>,
}

impl Moments {
    /// The numbers of coordinates of a keypoint and of an object.
    pub fn axes(&self) -> [usize; 2] {
        self.axes
    }

    /// The number of frames pushed, without the excluded ones.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// The number of frames left out because a keypoint was not finite.
    pub fn excluded(&self) -> u64 {
        self.excluded
    }

    /// For every keypoint, the number of frames in which it is missing.
    pub fn missing(&self) -> &[u64] {
        &self.missing
    }
}
