//! Maps beside the affine one, fitted and scored on different sequences.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use ndarray::{ArrayView2, ArrayView3, Axis};

use super::{minus, point};
use crate::metric::context::Sums;

/// Second keypoints that an orientation is tried with.
const MOST_SECONDS: usize = 16;
/// Steps of the projective map's fit, which takes a few.
const STEPS: usize = 50;

/// Mean squared distances on sequences that were not fitted, all over the same frames; `None` where
/// there are none.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HeldOutMaps {
    /// `A z + b`.
    pub affine: Option<f64>,
    /// `A z + B u + b`, where u is the direction from the keypoint to a second one, of length 1;
    /// which one, is chosen where it is fitted. `None` where there is no second keypoint.
    pub orientation: Option<f64>,
    /// `(A z + b) / (1 + c·z)`.
    pub projective: Option<f64>,
}

/// The held-out errors of the maps from keypoint `n` to an object (T x 2, ndc). `keypoints` is
/// T x N x 2, `seconds` are keypoints to take orientations from, the likeliest first; `fold_of` gives
/// every frame its fold. Frames count that show the object, the keypoint and all `seconds`.
pub fn held_out_maps(
    keypoints: ArrayView3<f64>,
    truth: ArrayView2<f64>,
    n: usize,
    seconds: &[usize],
    fold_of: &[usize],
) -> HeldOutMaps {
    let seconds = &seconds[..seconds.len().min(MOST_SECONDS)];
    let at = |n: usize, t: usize| point(keypoints.index_axis(Axis(1), n), t);
    let counts = |t: &usize| {
        let all = [n].into_iter().chain(seconds.iter().copied());
        point(truth, *t).is_some() && all.clone().all(|n| at(n, *t).is_some())
    };
    let frames: Vec<usize> = (0..truth.dim().0).filter(counts).collect();
    let [zero, x] = [[0.0; 2], [0.0; 2]];
    let z = |t: usize| at(n, t).unwrap_or(zero);
    let truth_at = |t: usize| point(truth, t).unwrap_or(x);
    let direction = |m: usize, t: usize| {
        let [dx, dy] = minus(at(m, t).unwrap_or(zero), z(t));
        let length = dx.hypot(dy);
        match length > 0.0 {
            true => [dx / length, dy / length],
            false => zero,
        }
    };
    let affine = |t: usize| DVector::from_iterator(4, z(t).into_iter().chain(truth_at(t)));
    let oriented = |m: usize| {
        move |t: usize| {
            let parts = z(t).into_iter().chain(direction(m, t)).chain(truth_at(t));
            DVector::from_iterator(6, parts)
        }
    };
    let folds = fold_of.iter().max().map_or(0, |last| last + 1);
    let mut sums = [0.0; 3];
    let (mut count, mut has_second) = (0, !seconds.is_empty());
    for fold in 0..folds {
        let (scored, fitted): (Vec<usize>, Vec<usize>) =
            frames.iter().partition(|t| fold_of[**t] == fold);
        if scored.is_empty() {
            continue;
        }
        let Some(map) = Linear::fit(&fitted, affine) else {
            return HeldOutMaps::default();
        };
        count += scored.len() as u64;
        sums[0] += map.error(&scored, affine);
        let fits = seconds.iter().filter_map(|m| {
            let map = Linear::fit(&fitted, oriented(*m))?;
            Some((map.error(&fitted, oriented(*m)), *m, map))
        });
        match fits.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((_, m, map)) => sums[1] += map.error(&scored, oriented(m)),
            None => has_second = false,
        }
        let pairs = |frames: &[usize]| -> Vec<([f64; 2], [f64; 2])> {
            frames.iter().map(|t| (z(*t), truth_at(*t))).collect()
        };
        sums[2] += Projective::fit(&pairs(&fitted), &map).error(&pairs(&scored));
    }
    let [affine, orientation, projective] = sums.map(|sum| super::mean(sum, count));
    HeldOutMaps {
        affine,
        orientation: orientation.filter(|_| has_second),
        projective,
    }
}

/// A linear map with a constant, fitted by least squares. Rows hold its inputs, then the two outputs.
struct Linear {
    centre: DVector<f64>,
    matrix: DMatrix<f64>,
    shift: DVector<f64>,
}

impl Linear {
    /// `None` where there is nothing to be fitted.
    fn fit(frames: &[usize], row: impl Fn(usize) -> DVector<f64>) -> Option<Self> {
        let first = row(*frames.first()?);
        // Around a point of the cloud, so that no digits go into its distance from the origin.
        let centre = frames.iter().fold(first * 0.0, |sum, t| sum + row(*t)) / frames.len() as f64;
        let mut sums = Sums::new(centre.len());
        for t in frames {
            sums.push(row(*t) - &centre);
        }
        let (matrix, shift) = sums.solve();
        Some(Self {
            centre,
            matrix,
            shift,
        })
    }

    /// The sum of squared distances.
    fn error(&self, frames: &[usize], row: impl Fn(usize) -> DVector<f64>) -> f64 {
        let inputs = self.centre.len() - 2;
        let left = |t: &usize| {
            let centred = row(*t) - &self.centre;
            &self.matrix * centred.rows(0, inputs) + &self.shift - centred.rows(inputs, 2)
        };
        frames.iter().map(|t| left(t).norm_squared()).sum()
    }
}

/// `(A z + b) / (1 + c·z)` around the centre of the keypoints: a, b, c of x, then of y, then the
/// two of the denominator.
struct Projective {
    centre: [f64; 2],
    values: SVector<f64, 8>,
}

impl Projective {
    /// The least squares of the distances by Levenberg and Marquardt's method from the affine map,
    /// than which it is no worse where it is fitted.
    fn fit(pairs: &[([f64; 2], [f64; 2])], affine: &Linear) -> Self {
        let centre = [affine.centre[0], affine.centre[1]];
        let (matrix, shift) = (&affine.matrix, &affine.shift);
        let constant = |axis: usize| shift[axis] + affine.centre[2 + axis];
        let mut found = Self {
            centre,
            values: SVector::from([
                matrix[(0, 0)],
                matrix[(0, 1)],
                constant(0),
                matrix[(1, 0)],
                matrix[(1, 1)],
                constant(1),
                0.0,
                0.0,
            ]),
        };
        let mut error = found.error(pairs);
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let (square, gradient) = found.slopes(pairs);
            let damped = square + SMatrix::from_diagonal(&(square.diagonal() * damping));
            let step = damped.cholesky().map(|solver| solver.solve(&gradient));
            let next = step.map(|step| Self {
                centre,
                values: found.values - step,
            });
            match next.map(|next| (next.error(pairs), next)) {
                Some((lower, next)) if lower < error => {
                    let is_done = error - lower <= 1e-14 * error;
                    (found, error) = (next, lower);
                    damping *= 0.1;
                    if is_done {
                        break;
                    }
                }
                _ if damping > 1e12 => break,
                _ => damping *= 10.0,
            }
        }
        found
    }

    /// A point under the map, with what it is divided by.
    fn apply(&self, z: [f64; 2]) -> ([f64; 2], f64) {
        let [dx, dy] = minus(z, self.centre);
        let v = &self.values;
        let under = 1.0 + v[6] * dx + v[7] * dy;
        let x = (v[0] * dx + v[1] * dy + v[2]) / under;
        let y = (v[3] * dx + v[4] * dy + v[5]) / under;
        ([x, y], under)
    }

    /// The sum of squared distances; infinite where a point of the keypoint lies on the other side of
    /// the line that the map sends to infinity.
    fn error(&self, pairs: &[([f64; 2], [f64; 2])]) -> f64 {
        let squared = |(z, x): &([f64; 2], [f64; 2])| match self.apply(*z) {
            (at, under) if under > 0.0 => {
                let off = minus(at, *x);
                off[0] * off[0] + off[1] * off[1]
            }
            _ => f64::INFINITY,
        };
        pairs.iter().map(squared).sum()
    }

    /// Jᵀ J and Jᵀ r of the distances r with their derivatives J.
    fn slopes(&self, pairs: &[([f64; 2], [f64; 2])]) -> (SMatrix<f64, 8, 8>, SVector<f64, 8>) {
        let (mut square, mut gradient) = (SMatrix::zeros(), SVector::zeros());
        for (z, x) in pairs {
            let (at, under) = self.apply(*z);
            let off = minus(at, *x);
            let [dx, dy] = minus(*z, self.centre).map(|v| v / under);
            for axis in 0..2 {
                let mut slope = SVector::<f64, 8>::zeros();
                slope[3 * axis] = dx;
                slope[3 * axis + 1] = dy;
                slope[3 * axis + 2] = 1.0 / under;
                slope[6] = -at[axis] * dx;
                slope[7] = -at[axis] * dy;
                square += slope * slope.transpose();
                gradient += slope * off[axis];
            }
        }
        (square, gradient)
    }
}
