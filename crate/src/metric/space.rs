//! Maps of which the keypoint or the object is in space: 3 -> 3, 2 -> 3 and 3 -> 2.
//!
//! The same least squares as in the plane (`map` has the algebra), of any number of coordinates.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::axes::Axes;
use super::map::{
    self, AffineMap, CENTRED_BOUND, Fit, LEAST_FACTOR, Rank, Transform, out_of_range,
};
use super::moments::{Moments, PairMoments};
use super::planes::Plane;
use super::scale::{exponent, larger, non_negative, times_power};
use crate::error::{Error, Result};
use crate::track::MOST_AXES;

/// The moments of a keypoint with an object, put together from those of their planes. Every value
/// is divided by the power of two of its exponent.
struct Pair {
    frames: u64,
    planes: Vec<(Plane, PairMoments)>,
    keypoint_exponent: i32,
    truth_exponent: Axes<i32>,
    keypoint_mean: DVector<f64>,
    /// Sums of products of the keypoint's coordinates.
    keypoint_squares: DMatrix<f64>,
    truth_mean: Axes<f64>,
    truth_squares: Axes<f64>,
    /// Sums of products, a row a coordinate of the keypoint, a column one of the object.
    cross: DMatrix<f64>,
}

/// The fitted map of keypoint `n` to object `k`, or `None` when no frame shows both.
///
/// # Errors
/// When the map or its error is beyond the range of f64, and when a map that goes coordinate by
/// coordinate is asked for between points of which one has more than the other.
pub fn fit(
    moments: &Moments,
    n: usize,
    k: usize,
    transform: Transform,
    rank: Rank,
) -> Result<Option<Fit>> {
    let pair = Pair::of(moments, n, k);
    if pair.frames == 0 {
        return Ok(None);
    }
    let fit = match transform {
        Transform::Affine => pair.affine(rank),
        other => pair.by_coordinates(moments.axes, other, rank),
    };
    fit.map(Some)
}

/// The sum over the frames of the squared distance that `map` leaves between keypoint `n` and object
/// `k`, and how many these are; as [`PairMoments::left_by`].
pub fn left_by(moments: &Moments, n: usize, k: usize, map: &AffineMap) -> (f64, u64) {
    let pair = Pair::of(moments, n, k);
    let along = |axis| pair.left_along(axis, &map.a[axis], map.b[axis]);
    let left = match pair.frames {
        0 => 0.0,
        _ => (0..map.b.len()).map(along).sum(),
    };
    (left, pair.frames)
}

impl Pair {
    fn of(moments: &Moments, n: usize, k: usize) -> Self {
        let [z, x] = moments.axes;
        let planes = moments.planes();
        let mut planes: Vec<(Plane, PairMoments)> = planes
            .map(|(plane, of)| (plane, of.objects[k].pair(n)))
            .collect();
        // The coordinates of a keypoint are mixed by the map and need one exponent.
        let exponents = planes.iter().map(|(_, pair)| pair.keypoint_exponent[0]);
        let common = exponents.max().unwrap_or(0);
        let mut all = Self {
            frames: planes[0].1.frames,
            planes: Vec::new(),
            keypoint_exponent: common,
            truth_exponent: Axes::of(x, |_| 0),
            keypoint_mean: DVector::zeros(z),
            keypoint_squares: DMatrix::zeros(z, z),
            truth_mean: Axes::of(x, |_| 0.0),
            truth_squares: Axes::of(x, |_| 0.0),
            cross: DMatrix::zeros(z, x),
        };
        for ([of_keypoint, of_object], pair) in &mut planes {
            *pair = pair.rescaled(pair.truth_exponent, [common; 2]);
            let [[i, j], squares] = [*of_keypoint, [0, 2]];
            all.keypoint_squares[(i, i)] = pair.keypoint_squares[squares[0]];
            all.keypoint_squares[(j, j)] = pair.keypoint_squares[squares[1]];
            all.keypoint_squares[(i, j)] = pair.keypoint_squares[1];
            all.keypoint_squares[(j, i)] = pair.keypoint_squares[1];
            for (own, axis) in of_object.iter().enumerate() {
                all.truth_exponent[*axis] = pair.truth_exponent[own];
                all.truth_mean[*axis] = pair.truth_mean[own];
                all.truth_squares[*axis] = pair.truth_squares[own];
                for (own_keypoint, row) in of_keypoint.iter().enumerate() {
                    all.cross[(*row, *axis)] = pair.cross[2 * own_keypoint + own];
                }
            }
            for (own, row) in of_keypoint.iter().enumerate() {
                all.keypoint_mean[*row] = pair.keypoint_mean[own];
            }
        }
        Self { planes, ..all }
    }

    /// A map of each coordinate by itself, from those in the planes of equal coordinates.
    fn by_coordinates(&self, [z, x]: [usize; 2], transform: Transform, rank: Rank) -> Result<Fit> {
        if z != x {
            return Err(Error::mismatch(format!(
                "the map `{}` goes coordinate by coordinate, and keypoints have {z} and objects {x}; \
                 expected as many of both, or the map `{}`",
                transform.name(),
                Transform::Affine.name()
            )));
        }
        let variances = self.keypoint_squares.diagonal();
        let widest = variances.iter().copied().fold(0.0, larger);
        let mut all = Fit {
            map: AffineMap::identity(x),
            squares: Axes::of(x, |_| 0.0),
            frames: self.frames,
            direction_dropped: false,
        };
        for ([of_keypoint, of_object], pair) in &self.planes {
            if of_keypoint != of_object {
                continue;
            }
            let fit = match transform {
                Transform::ScaleTranslate => map::scale_translate(pair, rank, widest)?,
                _ => map::identity(pair)?,
            };
            for (own, axis) in of_object.iter().enumerate() {
                all.map.a[*axis][*axis] = fit.map.a[own][own];
                all.map.b[*axis] = fit.map.b[own];
                all.squares[*axis] = fit.squares[own];
            }
            all.direction_dropped |= fit.direction_dropped;
        }
        all.in_range()
    }

    fn affine(&self, rank: Rank) -> Result<Fit> {
        let eigen = SymmetricEigen::new(self.keypoint_squares.clone());
        let spread = eigen.eigenvalues.map(|d| non_negative(d).sqrt());
        // Noise of rounding in the moments, relative to where the cloud lies: not motion under any
        // rule.
        let root = (self.frames as f64).sqrt();
        let noise = 4.0 * f64::EPSILON * root * (self.keypoint_mean.norm() + spread.max());
        let mut problem = Problem {
            projected: eigen.eigenvectors.transpose() * &self.cross,
            axes: eigen.eigenvectors.transpose(),
            moves: spread.iter().map(|spread| *spread > noise).collect(),
            spread,
            squares: self.truth_squares,
        };
        for (i, moves) in problem.moves.iter().enumerate() {
            let factor = if *moves { 1.0 / problem.spread[i] } else { 0.0 };
            problem.projected.row_mut(i).scale_mut(factor);
        }
        for (axis, squares) in problem.squares.iter_mut().enumerate() {
            let explained = problem.projected.column(axis).norm_squared();
            *squares = non_negative(*squares - explained);
        }
        match rank {
            Rank::Centred => self.centred(problem),
            Rank::Reference => self.reference(problem),
        }
    }

    fn centred(&self, problem: Problem) -> Result<Fit> {
        let (z, x) = self.cross.shape();
        let mut a = DMatrix::zeros(x, z);
        let mut squares = problem.squares;
        let bound = CENTRED_BOUND * problem.spread.max();
        let mut kept = 0;
        for i in 0..z {
            let row = problem.projected.row(i);
            if problem.moves[i] && problem.spread[i] > bound {
                kept += 1;
                a += (row.transpose() / problem.spread[i]) * problem.axes.row(i);
            } else {
                for (squares, value) in squares.iter_mut().zip(row.iter()) {
                    *squares += value * value;
                }
            }
        }
        let mapped = &a * &self.keypoint_mean;
        let b = Axes::of(x, |axis| self.truth_mean[axis] - mapped[axis]);
        self.fitted(&a, self.keypoint_exponent, b, squares, kept < z)
    }

    /// The rule of the authors' code, on the design matrix `[1 z]`.
    fn reference(&self, problem: Problem) -> Result<Fit> {
        let (z, x) = self.cross.shape();
        let root = (self.frames as f64).sqrt();
        // Divided by a power of two that keeps it in range; its first column has no exponent.
        let design = self.keypoint_exponent.max(0);
        let to_design = self.keypoint_exponent - design;
        let mut r = DMatrix::zeros(z + 1, z + 1);
        let mut target = DMatrix::zeros(z + 1, x);
        r[(0, 0)] = times_power(root, -design);
        for j in 0..z {
            r[(0, j + 1)] = times_power(root * self.keypoint_mean[j], to_design);
            for i in (0..z).filter(|i| problem.moves[*i]) {
                r[(i + 1, j + 1)] =
                    times_power(problem.spread[i] * problem.axes[(i, j)], to_design);
            }
        }
        for axis in 0..x {
            target[(0, axis)] = root * self.truth_mean[axis];
            for i in 0..z {
                target[(i + 1, axis)] = problem.projected[(i, axis)];
            }
        }
        let svd = r.svd(true, true);
        let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
            return Err(out_of_range("the singular values of the keypoint"));
        };
        let rcond = f64::from(f32::EPSILON) * self.frames.max(z as u64 + 1) as f64;
        let bound = rcond * svd.singular_values.max();
        let mut weights = DMatrix::zeros(z + 1, x);
        let mut squares = problem.squares;
        let mut kept = 0;
        for i in 0..=z {
            let along = u.column(i).transpose() * &target;
            if svd.singular_values[i] > bound {
                kept += 1;
                weights += v_t.row(i).transpose() * along / svd.singular_values[i];
            } else {
                for (squares, value) in squares.iter_mut().zip(along.iter()) {
                    *squares += value * value;
                }
            }
        }
        let a = weights.rows(1, z).transpose();
        let b = Axes::of(x, |axis| times_power(weights[(0, axis)], -design));
        self.fitted(&a, design, b, squares, kept <= z)
    }

    /// The fit without exponents; `keypoint` is that of the keypoint's coordinates in `a`.
    fn fitted(
        &self,
        a: &DMatrix<f64>,
        keypoint: i32,
        b: Axes<f64>,
        squares: Axes<f64>,
        direction_dropped: bool,
    ) -> Result<Fit> {
        let (x, z) = a.shape();
        let truth = &self.truth_exponent;
        let factor =
            |row: usize, column: usize| times_power(a[(row, column)], truth[row] - keypoint);
        let fit = Fit {
            map: AffineMap {
                a: Axes::of(x, |row| Axes::of(z, |column| factor(row, column))),
                b: Axes::of(x, |axis| times_power(b[axis], truth[axis])),
            },
            squares: Axes::of(x, |axis| times_power(squares[axis], 2 * truth[axis])),
            frames: self.frames,
            direction_dropped,
        };
        for (row, factors) in fit.map.a.iter().enumerate() {
            let is_lost = factors.iter().all(|factor| factor.abs() < LEAST_FACTOR);
            if is_lost && a.row(row).iter().any(|v| *v != 0.0) {
                return Err(out_of_range(
                    "a factor of the fitted map is too small for f64",
                ));
            }
        }
        fit.in_range()
    }

    /// The sum of the squared distances along one coordinate of the object that `a z + b` leaves.
    fn left_along(&self, axis: usize, a: &[f64], b: f64) -> f64 {
        // All terms divided by one power of two, that of the largest.
        let of_factors = a.iter().map(|factor| exponent(*factor)).max().unwrap_or(0);
        let of_map = of_factors.saturating_add(self.keypoint_exponent);
        let scale = self.truth_exponent[axis].max(of_map).max(exponent(b));
        let to_scale = self.keypoint_exponent - scale;
        let a = DVector::from_iterator(a.len(), a.iter().map(|a| times_power(*a, to_scale)));
        let truth = self.truth_exponent[axis] - scale;
        let own = (&self.keypoint_squares * &a).dot(&a);
        let with = self
            .cross
            .column(axis)
            .map(|v| times_power(v, truth))
            .dot(&a);
        let mapped = self.keypoint_mean.dot(&a) + times_power(b, -scale);
        let shift = mapped - times_power(self.truth_mean[axis], truth);
        let own_truth = times_power(self.truth_squares[axis], 2 * truth);
        let left = non_negative(own - 2.0 * with + own_truth);
        times_power(left + self.frames as f64 * shift * shift, 2 * scale)
    }
}

/// The least-squares problem along the principal axes of the keypoint.
struct Problem {
    /// A row a principal axis.
    axes: DMatrix<f64>,
    /// The roots of the sums of squares along the axes.
    spread: DVector<f64>,
    /// Whether that is more than rounding.
    moves: Vec<bool>,
    /// What each axis explains of each coordinate of the object; its square is in the squares.
    projected: DMatrix<f64>,
    /// What is left of each coordinate of the object when all axes are used.
    squares: Axes<f64>,
}

const _: () = assert!(MOST_AXES == 3, "space needs three coordinates");
