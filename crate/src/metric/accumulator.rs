//! One pass over the frames.

use ndarray::{Array2, ArrayView2, Axis};

use super::moments::{Moments, ObjectMoments};
use super::planes::planes;
use super::scale::{ORDINARY, exponent, times_power};
use crate::error::{Error, Reason, Result};
use crate::track::MOST_AXES;

/// Frames gathered before their moments are taken. Two sweeps over a block that stays in the cache
/// make the centred moments exact to rounding wherever the cloud of points lies, which running sums
/// do not.
const BLOCK: usize = 64;

/// Keypoints handled at once; rows of the block are padded to a multiple of it.
const LANES: usize = 4;

/// What to do with a frame in which a keypoint is NaN (missing) or infinite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NonFinite {
    /// Leave the frame out for the keypoint that is missing, and count it. An infinite keypoint is
    /// refused.
    #[default]
    ExcludePoint,
    /// Refuse it.
    Error,
    /// Leave the frame out for all keypoints, so that they stay comparable, and count it.
    ExcludeFrame,
}

impl std::str::FromStr for NonFinite {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name {
            "exclude-point" => Ok(Self::ExcludePoint),
            "error" => Ok(Self::Error),
            "exclude-frame" => Ok(Self::ExcludeFrame),
            _ => Err(Error::input(format!(
                "`{name}` says nothing about keypoints that are not finite; expected `exclude-point`, `error` or `exclude-frame`"
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
    missing: Vec<u64>,
    objects: Vec<ObjectMoments>,
    pending: Block,
    scratch: Centred,
    /// For a keypoint with frames of its own.
    alone: Option<Box<Centred>>,
    axes: [usize; 2],
    /// Of points in space, the accumulators of the other pairs of coordinates; this one takes the
    /// first two.
    others: Vec<Self>,
}

/// Frames not yet accounted for. Keypoints as separate rows of x and y, padded to [`LANES`].
#[derive(Debug, Clone)]
struct Block {
    frames: usize,
    stride: usize,
    keypoint: [Vec<f64>; 2],
    /// (x, y) a frame, per object; NaN where not visible.
    truth: Vec<Vec<[f64; 2]>>,
    /// The frame and the keypoint of points that are missing; they are NaN above until the block is
    /// accounted for.
    missing: Vec<(usize, usize)>,
}

/// A block's frames around their mean.
#[derive(Debug, Clone)]
struct Centred {
    visible: Vec<usize>,
    /// The largest magnitudes of the keypoints.
    peak: [Vec<f64>; 2],
    /// The keypoints of the block divided by the powers of two of their exponents, where one is
    /// not 0.
    scaled: [Vec<f64>; 2],
    mean: [Vec<f64>; 2],
    keypoint: [Vec<f64>; 2],
    squares: [Vec<f64>; 3],
    truth: Vec<[f64; 2]>,
    moments: ObjectMoments,
}

impl Accumulator {
    /// An empty accumulator for N `keypoints` and K `objects` of `axes` coordinates, two or three
    /// each.
    ///
    /// # Errors
    /// When there are points of another number of coordinates.
    pub fn of_axes(
        keypoints: usize,
        objects: usize,
        axes: [usize; 2],
        policy: NonFinite,
    ) -> Result<Self> {
        if axes.iter().any(|count| !(2..=MOST_AXES).contains(count)) {
            return Err(Error::mismatch(format!(
                "points of {} and {} coordinates; expected two to {MOST_AXES}",
                axes[0], axes[1]
            )));
        }
        let mut first = Self::new(keypoints, objects, policy);
        first.axes = axes;
        if MOST_AXES == 3 {
            first.others = vec![Self::new(keypoints, objects, policy); planes(axes).len() - 1];
        }
        Ok(first)
    }

    /// An empty accumulator for N `keypoints` and K `objects` in the image.
    pub fn new(keypoints: usize, objects: usize, policy: NonFinite) -> Self {
        let stride = keypoints.next_multiple_of(LANES);
        let block = || vec![0.0; BLOCK * stride];
        Self {
            keypoints,
            policy,
            frames: 0,
            excluded: 0,
            missing: vec![0; keypoints],
            objects: vec![ObjectMoments::new(keypoints); objects],
            pending: Block {
                frames: 0,
                stride,
                keypoint: [block(), block()],
                truth: vec![Vec::with_capacity(BLOCK); objects],
                missing: Vec::new(),
            },
            scratch: Centred::new(keypoints),
            alone: None,
            axes: [2; 2],
            others: Vec::new(),
        }
    }

    /// Adds a frame: N x 2 `keypoints` and the K x 2 `truth` in ndc, (x, y), or x, y and z of
    /// points in space. A NaN in an object's truth means that it is not visible in this frame,
    /// which then does not count for it.
    ///
    /// # Errors
    /// When a shape is not (N, 2) or (K, 2), when a truth is infinite, and when a keypoint is
    /// infinite or, under [`NonFinite::Error`], NaN. The accumulator is unchanged then.
    pub fn push(&mut self, keypoints: ArrayView2<f64>, truth: ArrayView2<f64>) -> Result<()> {
        let expected = [
            (self.keypoints, self.axes[0]),
            (self.objects.len(), self.axes[1]),
        ];
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
        if MOST_AXES == 2 || self.others.is_empty() {
            return self.push_to_plane(keypoints, truth);
        }
        let (keypoints, truth) = (whole(keypoints), whole(truth));
        for (plane, pairs) in planes(self.axes).into_iter().enumerate() {
            let [z, x] = [&keypoints, &truth];
            let (z, x) = (z.select(Axis(1), &pairs[0]), x.select(Axis(1), &pairs[1]));
            let taken = match plane.checked_sub(1) {
                None => self.push_to_plane(z.view(), x.view()),
                Some(other) => self.others[other].push_to_plane(z.view(), x.view()),
            };
            // What one refuses, the first one refuses, before any is changed.
            taken?;
        }
        Ok(())
    }

    /// As [`push`](Self::push), of two coordinates each.
    fn push_to_plane(&mut self, keypoints: ArrayView2<f64>, truth: ArrayView2<f64>) -> Result<()> {
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
        if probe.iter().any(|p| p.is_nan()) && !self.takes(keypoints)? {
            return Ok(());
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

    /// Whether a frame counts in which a keypoint is not finite. Counts what is left out.
    fn takes(&mut self, keypoints: ArrayView2<f64>) -> Result<bool> {
        let is_missing = |n: usize| keypoints.row(n).iter().any(|v| v.is_nan());
        let refused = (0..self.keypoints).find(|n| match self.policy {
            NonFinite::ExcludePoint => {
                !is_missing(*n) && keypoints.row(*n).iter().any(|v| v.is_infinite())
            }
            NonFinite::Error => keypoints.row(*n).iter().any(|v| !v.is_finite()),
            NonFinite::ExcludeFrame => false,
        });
        if let Some(n) = refused {
            return Err(Error::input(format!(
                "keypoint {n} is ({}, {}): missing or not finite; expected finite values \
                 (`exclude-point` leaves missing points out and counts them, `exclude-frame` whole \
                 frames)",
                keypoints[[n, 0]],
                keypoints[[n, 1]]
            ))
            .because(Reason::NonFinite { keypoint: n }));
        }
        if self.policy == NonFinite::ExcludeFrame {
            self.excluded += 1;
            return Ok(false);
        }
        for n in (0..self.keypoints).filter(|n| is_missing(*n)) {
            self.missing[n] += 1;
            self.pending.missing.push((self.pending.frames, n));
        }
        Ok(true)
    }

    /// Adds the frames of another accumulator.
    ///
    /// # Errors
    /// When the other one is for another number of keypoints or objects.
    pub fn merge(&mut self, mut other: Self) -> Result<()> {
        if (self.keypoints, self.objects.len(), self.axes)
            != (other.keypoints, other.objects.len(), other.axes)
        {
            return Err(Error::mismatch(format!(
                "an accumulator of {} keypoints and {} objects cannot take one of {} and {}",
                self.keypoints,
                self.objects.len(),
                other.keypoints,
                other.objects.len()
            )));
        }
        if MOST_AXES == 3 {
            let others = std::mem::take(&mut other.others);
            for (mine, theirs) in self.others.iter_mut().zip(others) {
                mine.merge(theirs)?;
            }
        }
        let other = other.finish();
        self.frames += other.frames;
        self.excluded += other.excluded;
        for (mine, theirs) in self.missing.iter_mut().zip(&other.missing) {
            *mine += theirs;
        }
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
            missing: self.missing,
            objects: self.objects,
            axes: self.axes,
            others: match MOST_AXES {
                3 => self.others.into_iter().map(Self::finish).collect(),
                _ => Vec::new(),
            },
        }
    }

    /// Takes the moments of the pending frames, with the widest vectors the CPU has. Lanes do not
    /// mix and nothing is fused, so the numbers are the same with every width.
    fn flush(&mut self) {
        self.flush_partial();
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the CPU has AVX2.
            unsafe { self.flush_avx2() };
            return;
        }
        self.flush_lanes();
    }

    /// Takes the moments of the keypoints with frames of their own, and puts zeros in the place of
    /// missing points, whose moments with the others do not count.
    fn flush_partial(&mut self) {
        let block = &mut self.pending;
        let missing = std::mem::take(&mut block.missing);
        if missing.is_empty() && self.objects.iter().all(|object| object.partial.is_empty()) {
            return;
        }
        let alone = self.alone.get_or_insert_with(|| Box::new(Centred::new(1)));
        for (object, truth) in self.objects.iter_mut().zip(&block.truth) {
            for (_, n) in &missing {
                object.part(*n);
            }
            for (n, part) in &mut object.partial {
                let column = block.keypoint.each_ref().map(|axis| {
                    let mut column = vec![0.0; BLOCK * LANES];
                    for t in 0..block.frames {
                        column[t * LANES] = axis[t * block.stride + n];
                    }
                    column
                });
                let is_seen = |t: &usize| {
                    let point = column.each_ref().map(|axis| axis[t * LANES]);
                    point.iter().chain(&truth[*t]).all(|v| !v.is_nan())
                };
                alone.visible.clear();
                alone.visible.extend((0..block.frames).filter(is_seen));
                if !alone.visible.is_empty() {
                    alone.centre(&column, LANES);
                    alone.with_truth(truth, LANES);
                    part.merge_frames(&alone.moments);
                }
            }
        }
        for (t, n) in missing {
            for axis in &mut block.keypoint {
                axis[t * block.stride + n] = 0.0;
            }
        }
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
                object.merge_frames(&scratch.moments);
            }
            truth.clear();
        }
        block.frames = 0;
    }
}

impl Centred {
    fn new(keypoints: usize) -> Self {
        let stride = keypoints.next_multiple_of(LANES);
        let row = || vec![0.0; stride];
        let block = || vec![0.0; BLOCK * stride];
        Self {
            visible: Vec::with_capacity(BLOCK),
            peak: [row(), row()],
            scaled: [Vec::new(), Vec::new()],
            mean: [row(), row()],
            keypoint: [block(), block()],
            squares: [row(), row(), row()],
            truth: Vec::with_capacity(BLOCK),
            moments: ObjectMoments::new(keypoints),
        }
    }

    /// Takes the keypoints of the visible frames around their mean, and their products.
    #[inline(always)]
    fn centre(&mut self, keypoint: &[Vec<f64>; 2], stride: usize) {
        let keypoint = keypoint.each_ref().map(|axis| &axis[..]);
        self.centre_as_is(keypoint, stride);
        if self.is_ordinary() {
            for exponents in &mut self.moments.keypoint_exponent {
                exponents.fill(0);
            }
            return;
        }
        let scales = [0, 1].map(|axis| self.scale(axis, keypoint[axis], stride));
        if scales != [false; 2] {
            let scaled = std::mem::take(&mut self.scaled);
            let chosen = [0, 1].map(|axis| {
                if scales[axis] {
                    &scaled[axis][..]
                } else {
                    keypoint[axis]
                }
            });
            self.centre_as_is(chosen, stride);
            self.scaled = scaled;
        }
    }

    /// Whether no keypoint needs an exponent: every magnitude is at least its mean and at most that
    /// and the root of the sum of squares. Not for zeros, whose exponent is looked up.
    fn is_ordinary(&self) -> bool {
        (0..2).all(|axis| {
            let means = &self.moments.keypoint_mean[axis];
            let values = means.iter().zip(&self.moments.keypoint_squares[2 * axis]);
            let ordinary = |(mean, squares): (&f64, &f64)| {
                ORDINARY.contains(&mean.abs()) && *squares < ORDINARY.end * ORDINARY.end
            };
            values.map(ordinary).fold(true, |all, one| all & one)
        })
    }

    /// [`centre`](Self::centre) without exponents.
    #[inline(always)]
    fn centre_as_is(&mut self, keypoint: [&[f64]; 2], stride: usize) {
        let count = self.visible.len();
        let first = self.visible[0] * stride;
        let n = self.moments.cross[0].len();
        for (axis, source) in keypoint.into_iter().enumerate() {
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
        moments.frames = count as u64;
        for axis in 0..2 {
            moments.keypoint_mean[axis].copy_from_slice(&self.mean[axis][..n]);
        }
        for (to, from) in moments.keypoint_squares.iter_mut().zip(&self.squares) {
            to.copy_from_slice(&from[..n]);
        }
    }

    /// Finds the exponents of the keypoints along `axis`. Fills and chooses `scaled` if one is not
    /// 0: zeros need no scaling.
    fn scale(&mut self, axis: usize, source: &[f64], stride: usize) -> bool {
        let n = self.moments.cross[0].len();
        let peak = &mut self.peak[axis][..];
        peak.fill(0.0);
        for t in &self.visible {
            for (peak, z) in peak.iter_mut().zip(&source[t * stride..(t + 1) * stride]) {
                let z = z.abs();
                *peak = if z > *peak { z } else { *peak };
            }
        }
        let exponents = &mut self.moments.keypoint_exponent[axis];
        let mut scaled = false;
        for (e, peak) in exponents.iter_mut().zip(peak.iter()) {
            *e = exponent(*peak);
            scaled |= *e != 0 && *peak != 0.0;
        }
        if scaled {
            let to = &mut self.scaled[axis];
            to.clear();
            to.extend_from_slice(source);
            for row in to.chunks_exact_mut(stride) {
                for (z, e) in row[..n].iter_mut().zip(exponents.iter()) {
                    *z = times_power(*z, -*e);
                }
            }
        }
        scaled
    }

    /// Adds the moments of one object's `truth` in the same frames.
    #[inline(always)]
    fn with_truth(&mut self, truth: &[[f64; 2]], stride: usize) {
        let mut peak = [0.0; 2];
        for t in &self.visible {
            for axis in 0..2 {
                let x: f64 = truth[*t][axis].abs();
                peak[axis] = if x > peak[axis] { x } else { peak[axis] };
            }
        }
        let exponents = peak.map(exponent);
        self.truth.clear();
        self.truth.extend(self.visible.iter().map(|t| truth[*t]));
        for axis in (0..2).filter(|axis| exponents[*axis] != 0) {
            for point in &mut self.truth {
                point[axis] = times_power(point[axis], -exponents[axis]);
            }
        }
        let pivot = self.truth[0];
        let count = self.visible.len() as f64;
        let mut mean = [0.0; 2];
        for point in &self.truth {
            for axis in 0..2 {
                mean[axis] += point[axis] - pivot[axis];
            }
        }
        for axis in 0..2 {
            mean[axis] = pivot[axis] + mean[axis] / count;
        }
        for point in &mut self.truth {
            *point = [point[0] - mean[0], point[1] - mean[1]];
        }

        let moments = &mut self.moments;
        let outside = |t: &&usize| truth[**t].iter().any(|v| v.abs() > 1.0);
        moments.outside = self.visible.iter().filter(outside).count() as u64;
        moments.truth_exponent = exponents;
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

/// Points with all coordinates NaN where one is, or infinite: what is missing is missing in every
/// plane.
fn whole(points: ArrayView2<f64>) -> Array2<f64> {
    let mut points = points.to_owned();
    for mut point in points.rows_mut() {
        let odd = point.iter().copied().filter(|v| !v.is_finite());
        if let Some(odd) = odd.reduce(|a, b| if a.is_nan() { a } else { b }) {
            point.fill(odd);
        }
    }
    points
}

#[inline(always)]
fn lanes(values: &[f64], at: usize) -> [f64; LANES] {
    let mut out = [0.0; LANES];
    out.copy_from_slice(&values[at..at + LANES]);
    out
}
