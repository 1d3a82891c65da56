//! One pass over the frames.

use ndarray::ArrayView2;

use super::moments::{Moments, ObjectMoments};
use crate::error::{Error, Reason, Result};

/// Frames gathered before their moments are taken. Two sweeps over a block that stays in the cache
/// make the centred moments exact to rounding wherever the cloud of points lies, which running sums
/// do not.
const BLOCK: usize = 64;

/// Keypoints handled at once; rows of the block are padded to a multiple of it.
const LANES: usize = 4;

/// What to do with a frame in which a keypoint is NaN or infinite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NonFinite {
    /// Refuse it: a detector should not emit such points.
    #[default]
    Error,
    /// Leave the frame out for all keypoints, so that they stay comparable, and count it.
    ExcludeFrame,
}

impl std::str::FromStr for NonFinite {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name {
            "error" => Ok(Self::Error),
            "exclude-frame" => Ok(Self::ExcludeFrame),
            _ => Err(Error::input(format!(
                "`{name}` says nothing about keypoints that are not finite; expected `error` or `exclude-frame`"
            ))),
        }
    }
}

/// Streaming accumulator of the metric: push frames, merge with others, finish.
///
/// O(N K) time a frame, O(N K) memory whatever the number of frames. Splitting the frames over
/// accumulators and merging them gives the same moments up to rounding.
#[derive(Debug, Clone)]
pub struct Accumulator {
    keypoints: usize,
    policy: NonFinite,
    frames: u64,
    excluded: u64,
    objects: Vec<ObjectMoments>,
    pending: Block,
    scratch: Centred,
}

/// Frames not yet accounted for. Keypoints as separate rows of x and y, padded to [`LANES`].
#[derive(Debug, Clone)]
struct Block {
    frames: usize,
    stride: usize,
    keypoint: [Vec<f64>; 2],
    /// (x, y) a frame, per object; NaN where not visible.
    truth: Vec<Vec<[f64; 2]>>,
}

/// A block's frames around their mean.
#[derive(Debug, Clone)]
struct Centred {
    visible: Vec<usize>,
    mean: [Vec<f64>; 2],
    keypoint: [Vec<f64>; 2],
    squares: [Vec<f64>; 3],
    truth: Vec<[f64; 2]>,
    moments: ObjectMoments,
}

impl Accumulator {
    /// An empty accumulator for N `keypoints` and K `objects`.
    pub fn new(keypoints: usize, objects: usize, policy: NonFinite) -> Self {
        let stride = keypoints.next_multiple_of(LANES);
        let row = || vec![0.0; stride];
        let block = || vec![0.0; BLOCK * stride];
        Self {
            keypoints,
            policy,
            frames: 0,
            excluded: 0,
            objects: vec![ObjectMoments::new(keypoints); objects],
            pending: Block {
                frames: 0,
                stride,
                keypoint: [block(), block()],
                truth: vec![Vec::with_capacity(BLOCK); objects],
            },
            scratch: Centred {
                visible: Vec::with_capacity(BLOCK),
                mean: [row(), row()],
                keypoint: [block(), block()],
                squares: [row(), row(), row()],
                truth: Vec::with_capacity(BLOCK),
                moments: ObjectMoments::new(keypoints),
            },
        }
    }

    /// Adds a frame: N x 2 `keypoints` and the K x 2 `truth` in ndc, (x, y). A NaN in an object's
    /// truth means that it is not visible in this frame, which then does not count for it.
    ///
    /// # Errors
    /// When a shape is not (N, 2) or (K, 2), when a truth is infinite, and when a keypoint is not
    /// finite under [`NonFinite::Error`]. The accumulator is unchanged then.
    pub fn push(&mut self, keypoints: ArrayView2<f64>, truth: ArrayView2<f64>) -> Result<()> {
        let expected = [(self.keypoints, 2), (self.objects.len(), 2)];
        if [keypoints.dim(), truth.dim()] != expected {
            return Err(Error::mismatch(format!(
                "a frame has keypoints of shape {:?} and ground truth of shape {:?}; expected {:?} and {:?}",
                keypoints.dim(),
                truth.dim(),
                expected[0],
                expected[1]
            )));
        }
        if let Some(k) = truth
            .rows()
            .into_iter()
            .position(|p| p.iter().any(|v| v.is_infinite()))
        {
            return Err(Error::input(format!(
                "the ground truth of object {k} is infinite; expected numbers, or NaN where it is not visible"
            )));
        }
        let at = self.pending.frames * self.pending.stride;
        let [xs, ys] = &mut self.pending.keypoint;
        let xs = &mut xs[at..at + self.keypoints];
        let ys = &mut ys[at..at + self.keypoints];
        match keypoints.as_slice() {
            Some(points) => {
                for ((x, y), point) in xs.iter_mut().zip(ys.iter_mut()).zip(points.chunks_exact(2))
                {
                    (*x, *y) = (point[0], point[1]);
                }
            }
            None => {
                for ((x, y), point) in xs.iter_mut().zip(ys.iter_mut()).zip(keypoints.rows()) {
                    (*x, *y) = (point[0], point[1]);
                }
            }
        }
        // Zero times a finite number is zero, times anything else it is NaN. In lanes, so that it
        // vectorises.
        let mut probe = [0.0; LANES];
        for row in &self.pending.keypoint {
            for lane in row[at..at + self.pending.stride].chunks_exact(LANES) {
                for (p, z) in probe.iter_mut().zip(lane) {
                    *p += z * 0.0;
                }
            }
        }
        if probe.iter().any(|p| p.is_nan()) {
            return self.not_finite(keypoints);
        }
        for (points, point) in self.pending.truth.iter_mut().zip(truth.rows()) {
            points.push([point[0], point[1]]);
        }
        self.frames += 1;
        self.pending.frames += 1;
        if self.pending.frames == BLOCK {
            self.flush();
        }
        Ok(())
    }

    fn not_finite(&mut self, keypoints: ArrayView2<f64>) -> Result<()> {
        if self.policy == NonFinite::ExcludeFrame {
            self.excluded += 1;
            return Ok(());
        }
        let n = keypoints
            .rows()
            .into_iter()
            .position(|p| p.iter().any(|v| !v.is_finite()))
            .unwrap_or_default();
        Err(Error::input(format!(
            "keypoint {n} is ({}, {}): missing or not finite; expected numbers (`exclude-frame` leaves such \
             frames out and counts them)",
            keypoints[[n, 0]],
            keypoints[[n, 1]]
        ))
        .because(Reason::NonFinite { keypoint: n }))
    }

    /// Adds the frames of another accumulator.
    ///
    /// # Errors
    /// When the other one is for another number of keypoints or objects.
    pub fn merge(&mut self, other: Self) -> Result<()> {
        if (self.keypoints, self.objects.len()) != (other.keypoints, other.objects.len()) {
            return Err(Error::mismatch(format!(
                "an accumulator of {} keypoints and {} objects cannot take one of {} and {}",
                self.keypoints,
                self.objects.len(),
                other.keypoints,
                other.objects.len()
            )));
        }
        let other = other.finish();
        self.frames += other.frames;
        self.excluded += other.excluded;
        for (mine, theirs) in self.objects.iter_mut().zip(&other.objects) {
            mine.merge(theirs);
        }
        Ok(())
    }

    /// The moments of all frames.
    pub fn finish(mut self) -> Moments {
        self.flush();
        Moments {
            keypoints: self.keypoints,
            frames: self.frames,
            excluded: self.excluded,
            objects: self.objects,
        }
    }

    /// Takes the moments of the pending frames, with the widest vectors the CPU has. Lanes do not
    /// mix and nothing is fused, so the numbers are the same with every width.
    fn flush(&mut self) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the CPU has AVX2.
            unsafe { self.flush_avx2() };
            return;
        }
        self.flush_lanes();
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn flush_avx2(&mut self) {
        self.flush_lanes();
    }

    #[inline(always)]
    fn flush_lanes(&mut self) {
        let block = &mut self.pending;
        let scratch = &mut self.scratch;
        // Objects visible in the same frames share the keypoints' own moments; mostly that is all
        // of them.
        let mut centred_for: Option<Vec<usize>> = None;
        for (object, truth) in self.objects.iter_mut().zip(&mut block.truth) {
            scratch.visible.clear();
            let seen = |t: &usize| truth[*t].iter().all(|v| !v.is_nan());
            scratch.visible.extend((0..block.frames).filter(seen));
            if !scratch.visible.is_empty() {
                if centred_for.as_ref() != Some(&scratch.visible) {
                    scratch.centre(&block.keypoint, block.stride);
                    centred_for = Some(scratch.visible.clone());
                }
                scratch.with_truth(truth, block.stride);
                object.merge(&scratch.moments);
            }
            truth.clear();
        }
        block.frames = 0;
    }
}

impl Centred {
    /// Takes the keypoints of the visible frames around their mean, and their products.
    #[inline(always)]
    fn centre(&mut self, keypoint: &[Vec<f64>; 2], stride: usize) {
        let count = self.visible.len();
        let first = self.visible[0] * stride;
        for (axis, source) in keypoint.iter().enumerate() {
            let pivot = &source[first..first + stride];
            let mean = &mut self.mean[axis][..];
            mean.fill(0.0);
            // Deviations from the first frame: exact zeros for a constant keypoint, whatever its
            // value.
            for t in &self.visible {
                let row = &source[t * stride..(t + 1) * stride];
                for ((m, z), p) in mean.iter_mut().zip(row).zip(pivot) {
                    *m += z - p;
                }
            }
            for (m, p) in mean.iter_mut().zip(pivot) {
                *m = p + *m / count as f64;
            }
            for (row, t) in self.keypoint[axis]
                .chunks_exact_mut(stride)
                .zip(&self.visible)
            {
                let source = &source[t * stride..(t + 1) * stride];
                for ((c, z), m) in row.iter_mut().zip(source).zip(mean.iter()) {
                    *c = z - m;
                }
            }
        }
        let [xs, ys] = self.keypoint.each_ref().map(|v| &v[..count * stride]);
        for lane in (0..stride).step_by(LANES) {
            let mut sums = [[0.0; LANES]; 3];
            for at in (lane..xs.len()).step_by(stride) {
                let (x, y) = (lanes(xs, at), lanes(ys, at));
                for i in 0..LANES {
                    sums[0][i] += x[i] * x[i];
                    sums[1][i] += x[i] * y[i];
                    sums[2][i] += y[i] * y[i];
                }
            }
            for (row, sum) in self.squares.iter_mut().zip(sums) {
                row[lane..lane + LANES].copy_from_slice(&sum);
            }
        }
        let moments = &mut self.moments;
        let n = moments.cross[0].len();
        moments.frames = count as u64;
        for axis in 0..2 {
            moments.keypoint_mean[axis].copy_from_slice(&self.mean[axis][..n]);
        }
        for (to, from) in moments.keypoint_squares.iter_mut().zip(&self.squares) {
            to.copy_from_slice(&from[..n]);
        }
    }

    /// Adds the moments of one object's `truth` in the same frames.
    #[inline(always)]
    fn with_truth(&mut self, truth: &[[f64; 2]], stride: usize) {
        let pivot = truth[self.visible[0]];
        let count = self.visible.len() as f64;
        let mut mean = [0.0; 2];
        for t in &self.visible {
            for axis in 0..2 {
                mean[axis] += truth[*t][axis] - pivot[axis];
            }
        }
        for axis in 0..2 {
            mean[axis] = pivot[axis] + mean[axis] / count;
        }
        let deviation = |t: &usize| [truth[*t][0] - mean[0], truth[*t][1] - mean[1]];
        self.truth.clear();
        self.truth.extend(self.visible.iter().map(deviation));

        let moments = &mut self.moments;
        let outside = |t: &&usize| truth[**t].iter().any(|v| v.abs() > 1.0);
        moments.outside = self.visible.iter().filter(outside).count() as u64;
        moments.truth_mean = mean;
        moments.truth_squares =
            [0, 1].map(|axis| self.truth.iter().map(|d| d[axis] * d[axis]).sum());
        let n = moments.cross[0].len();
        for lane in (0..stride).step_by(LANES) {
            let mut sums = [[0.0; LANES]; 4];
            for (t, d) in self.truth.iter().enumerate() {
                let at = t * stride + lane;
                let (x, y) = (lanes(&self.keypoint[0], at), lanes(&self.keypoint[1], at));
                for i in 0..LANES {
                    sums[0][i] += x[i] * d[0];
                    sums[1][i] += x[i] * d[1];
                    sums[2][i] += y[i] * d[0];
                    sums[3][i] += y[i] * d[1];
                }
            }
            let end = n.min(lane + LANES);
            for (row, sum) in moments.cross.iter_mut().zip(sums) {
                row[lane..end].copy_from_slice(&sum[..end - lane]);
            }
        }
    }
}

#[inline(always)]
fn lanes(values: &[f64], at: usize) -> [f64; LANES] {
    let mut out = [0.0; LANES];
    out.copy_from_slice(&values[at..at + LANES]);
    out
}
