//! Centred first and second moments of keypoints and objects, and their exact merge.

/// Moments over the frames in which one object is visible.
///
/// `T`, the means of the keypoints and of the object, and the sums of products of the deviations
/// from them. Structure of arrays over the N keypoints, so that merging vectorises.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ObjectMoments {
    pub frames: u64,
    pub outside: u64,
    pub truth_mean: [f64; 2],
    /// Sums of squares of x and of y.
    pub truth_squares: [f64; 2],
    pub keypoint_mean: [Vec<f64>; 2],
    /// Sums of products xx, xy, yy.
    pub keypoint_squares: [Vec<f64>; 3],
    /// Sums of products: keypoint x with truth x, y; keypoint y with truth x, y.
    pub cross: [Vec<f64>; 4],
}

impl ObjectMoments {
    pub fn new(keypoints: usize) -> Self {
        let zeros = || vec![0.0; keypoints];
        Self {
            frames: 0,
            outside: 0,
            truth_mean: [0.0; 2],
            truth_squares: [0.0; 2],
            keypoint_mean: [zeros(), zeros()],
            keypoint_squares: [zeros(), zeros(), zeros()],
            cross: [zeros(), zeros(), zeros(), zeros()],
        }
    }

    /// Merges the moments of other frames (pairwise update of Chan, Golub and LeVeque, 1983).
    #[inline(always)]
    pub fn merge(&mut self, other: &Self) {
        if other.frames == 0 {
            return;
        }
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
        let at = |v: &Vec<f64>| v[n];
        PairMoments {
            frames: self.frames,
            keypoint_mean: self.keypoint_mean.each_ref().map(at),
            keypoint_squares: self.keypoint_squares.each_ref().map(at),
            truth_mean: self.truth_mean,
            truth_squares: self.truth_squares,
            cross: self.cross.each_ref().map(at),
        }
    }
}

/// The moments of one (keypoint, object) pair; see [`ObjectMoments`] for the order of the entries.
#[derive(Debug, Clone, Copy)]
pub(super) struct PairMoments {
    pub frames: u64,
    pub keypoint_mean: [f64; 2],
    pub keypoint_squares: [f64; 3],
    pub truth_mean: [f64; 2],
    pub truth_squares: [f64; 2],
    pub cross: [f64; 4],
}

/// What an [`Accumulator`](super::Accumulator) knows of its frames: enough for every map, rank rule
/// and threshold, in O(N K) memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Moments {
    pub(super) keypoints: usize,
    pub(super) frames: u64,
    pub(super) excluded: u64,
    pub(super) objects: Vec<ObjectMoments>,
}

impl Moments {
    /// The number of frames pushed, without the excluded ones.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// The number of frames left out because a keypoint was not finite.
    pub fn excluded(&self) -> u64 {
        self.excluded
    }

    /// For every object, the sum of its squared distances from its mean, ndc.
    pub fn object_squares(&self) -> Vec<f64> {
        let squares = |object: &ObjectMoments| object.truth_squares.iter().sum();
        self.objects.iter().map(squares).collect()
    }
}
