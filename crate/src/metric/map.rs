//! The maps from keypoints to objects, fitted by ordinary least squares.

use nalgebra::{Matrix2, Matrix3, Matrix3x2, SymmetricEigen, Vector2};

use super::axes::Axes;
use super::moments::PairMoments;
use super::scale::{larger, non_negative, times_power};
use crate::error::{Error, Result};

/// Which map is fitted between a keypoint and an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Transform {
    /// None: the keypoint itself.
    Identity,
    /// A scale and a shift per axis.
    ScaleTranslate,
    /// `A z + b` with any matrix A (the paper's choice).
    #[default]
    Affine,
}

/// When a direction of a keypoint's motion counts as no motion at all and is left out of the fit
/// (the minimum-norm solution is taken).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Rank {
    /// As the authors' code: singular values of the design matrix `[z 1]` below `eps_f32 * max(T,
    /// columns)` times the largest. Depends on the unit and the origin of the coordinates, so it
    /// belongs to ndc.
    #[default]
    Reference,
    /// Directions whose standard deviation is below 1e-6 of the largest, on centred data: the same
    /// answer in any unit and anywhere in the plane or in space.
    Centred,
}

/// An enum whose values have names on the command line and in JSON.
macro_rules! named {
    ($type:ty, $what:literal, $($name:literal = $value:path),+) => {
        impl $type {
            /// Every value.
            pub const ALL: &[Self] = &[$($value),+];

            /// The name on the command line and in JSON.
            pub fn name(self) -> &'static str {
                match self {
                    $($value => $name),+
                }
            }
        }

        impl std::str::FromStr for $type {
            type Err = Error;

            fn from_str(name: &str) -> Result<Self> {
                Self::ALL.iter().copied().find(|value| value.name() == name).ok_or_else(|| {
                    let names: Vec<&str> = Self::ALL.iter().map(|value| value.name()).collect();
                    Error::input(format!(
                        concat!("`{}` is no ", $what, "; expected one of {}"),
                        name,
                        names.join(", ")
                    ))
                })
            }
        }
    };
}

named!(
    Transform,
    "transform",
    "identity" = Transform::Identity,
    "scale-translate" = Transform::ScaleTranslate,
    "affine" = Transform::Affine
);
named!(
    Rank,
    "rank rule",
    "reference" = Rank::Reference,
    "centred" = Rank::Centred
);

impl Rank {
    /// The rule for keypoints of so many coordinates where none is asked for: the authors' belongs to
    /// ndc, and those in space have another unit.
    pub fn of_axes(axes: usize) -> Self {
        if axes == 2 {
            Self::Reference
        } else {
            Self::Centred
        }
    }
}

/// `truth = A z + b`, on column vectors (x, y) or (x, y, z).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "data", derive(serde::Serialize, serde::Deserialize))]
pub struct AffineMap {
    /// The matrix A, row by row: a row a coordinate of the object, a column one of the keypoint.
    pub a: Axes<Axes<f64>>,
    /// The shift b.
    pub b: Axes<f64>,
}

/// A fitted map and what it leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// `truth_from_keypoint`.
    pub map: AffineMap,
    /// Sums over the frames of the squared distance along each coordinate of the object.
    pub squares: Axes<f64>,
    /// The number of frames T the sums run over.
    pub frames: u64,
    /// Whether the rank rule left a direction out.
    pub direction_dropped: bool,
}

impl AffineMap {
    /// The map that changes nothing, of points of so many coordinates.
    pub fn identity(axes: usize) -> Self {
        let unit = |row: usize, column: usize| f64::from(u8::from(row == column));
        Self {
            a: Axes::of(axes, |row| Axes::of(axes, |column| unit(row, column))),
            b: Axes::of(axes, |_| 0.0),
        }
    }

    /// `A point + b`, of as many coordinates as the object has.
    pub fn apply(&self, point: &[f64]) -> Axes<f64> {
        Axes::of(self.b.len(), |row| {
            let products = self.a[row].iter().zip(point).map(|(a, z)| a * z);
            products.reduce(|sum, product| sum + product).unwrap_or(0.0) + self.b[row]
        })
    }
}

impl Fit {
    /// The tracking error `e`: the mean over time of the squared distance.
    pub fn error(&self) -> f64 {
        self.error_sum() / self.frames as f64
    }

    /// The sum over time of the squared distance, as equation 1 of the paper writes it.
    pub fn error_sum(&self) -> f64 {
        let squares = self.squares.iter().copied();
        squares.reduce(|sum, square| sum + square).unwrap_or(0.0)
    }

    /// The root of the mean squared distance, in the unit of the object's coordinates.
    pub fn rmse(&self) -> f64 {
        self.error().sqrt()
    }

    /// The root of the mean squared distance in pixels of an image of `[width, height]`, of an
    /// object in ndc.
    pub fn rmse_px(&self, size: [u32; 2]) -> f64 {
        let sum: f64 = (0..2)
            .map(|axis| self.squares[axis] * (f64::from(size[axis]) / 2.0).powi(2))
            .sum();
        if sum.is_finite() {
            return (sum / self.frames as f64).sqrt();
        }
        let along = |axis: usize| {
            (self.squares[axis] / self.frames as f64).sqrt() * (f64::from(size[axis]) / 2.0)
        };
        along(0).hypot(along(1))
    }
}

/// Relative bound of [`Rank::Centred`] on standard deviations. Second moments in f64 resolve ratios
/// of variances down to about 1e-14; this stays well above.
pub(super) const CENTRED_BOUND: f64 = 1e-6;

/// The least squares of `pair`.
///
/// # Errors
/// When the map or what it leaves is beyond the range of f64.
pub(super) fn fit(pair: &PairMoments, transform: Transform, rank: Rank) -> Result<Fit> {
    match transform {
        Transform::Identity => identity(pair),
        Transform::ScaleTranslate => scale_translate(pair, rank, pair.widest()),
        Transform::Affine => affine(pair, rank),
    }
}

pub(super) fn identity(pair: &PairMoments) -> Result<Fit> {
    // Keypoint and object are compared as they are, and need the same exponents.
    let [keypoint, truth] = [pair.keypoint_exponent, pair.truth_exponent];
    let exponents = [0, 1].map(|axis| keypoint[axis].max(truth[axis]));
    let m = pair.rescaled(exponents, exponents);
    let t = m.frames as f64;
    let own = [m.keypoint_squares[0], m.keypoint_squares[2]];
    let with = [m.cross[0], m.cross[3]];
    let squares = [0, 1].map(|axis| {
        let shift = m.truth_mean[axis] - m.keypoint_mean[axis];
        let left = non_negative(m.truth_squares[axis] + own[axis] - 2.0 * with[axis]);
        times_power(left + t * shift * shift, 2 * exponents[axis])
    });
    Fit {
        map: AffineMap::identity(2),
        squares: squares.into(),
        frames: m.frames,
        direction_dropped: false,
    }
    .in_range()
}

/// `widest` is the largest variance that the centred rule compares with, times the frames.
pub(super) fn scale_translate(m: &PairMoments, rank: Rank, widest: f64) -> Result<Fit> {
    let own = [m.keypoint_squares[0], m.keypoint_squares[2]];
    let with = [m.cross[0], m.cross[3]];
    let mut fit = Fit {
        map: AffineMap::identity(2),
        squares: [0.0; 2].into(),
        frames: m.frames,
        direction_dropped: false,
    };
    for axis in 0..2 {
        // One axis alone is the affine problem with the other axis at rest.
        let alone = PairMoments {
            keypoint_mean: [m.keypoint_mean[axis], 0.0],
            keypoint_squares: [own[axis], 0.0, 0.0],
            truth_exponent: [m.truth_exponent[axis], 0],
            truth_mean: [m.truth_mean[axis], 0.0],
            truth_squares: [m.truth_squares[axis], 0.0],
            cross: [with[axis], 0.0, 0.0, 0.0],
            ..*m
        };
        let solved = least_squares(&alone, rank, 2, widest)?;
        fit.map.a[axis][axis] = solved.map.a[0][0];
        fit.map.b[axis] = solved.map.b[0];
        fit.squares[axis] = solved.squares[0];
        fit.direction_dropped |= solved.direction_dropped;
    }
    fit.in_range()
}

fn affine(m: &PairMoments, rank: Rank) -> Result<Fit> {
    least_squares(m, rank, 3, f64::INFINITY)
}

/// Least squares of the truth on `[1 z]` from moments.
///
/// With the centred products `C = V diag(d) V'` of the keypoint, the design matrix is `Q R` with `R
/// = [[sqrt(T), sqrt(T) m'], [0, diag(sqrt(d)) V']]`, and `Q' x` follows from the cross products:
/// all that the singular value decomposition of the T-row problem needs, in 3 x 3, without ever
/// squaring the offset of the cloud from the origin. `columns` is the reference's number of columns
/// (1 + moving axes), `widest` the largest variance the centred rule compares with.
///
/// All of it in the scale of the moments' exponents, except where the reference rule compares the
/// keypoint with the column of ones.
fn least_squares(m: &PairMoments, rank: Rank, columns: u64, widest: f64) -> Result<Fit> {
    let projection = Projection::of(m);
    match rank {
        Rank::Centred => projection.centred(columns, widest),
        Rank::Reference => projection.reference(columns),
    }
}

/// The object along the principal axes of a keypoint.
struct Projection<'a> {
    moments: &'a PairMoments,
    exponents: Exponents,
    /// The principal axes, one a row.
    axes: Matrix2<f64>,
    /// The root of the keypoint's sum of squares along each axis.
    spread: Vector2<f64>,
    /// Noise of rounding in the moments, relative to where the cloud lies: not motion under any
    /// rule.
    noise: f64,
    /// The object along each axis, one a row.
    projected: Matrix2<f64>,
    /// What the axes leave of the object's sums of squares.
    left: [f64; 2],
}

impl<'a> Projection<'a> {
    fn of(moments: &'a PairMoments) -> Self {
        let m = moments;
        let [xx, xy, yy] = m.keypoint_squares;
        let eigen = SymmetricEigen::new(Matrix2::new(xx, xy, xy, yy));
        let spread = eigen.eigenvalues.map(|d| non_negative(d).sqrt());
        let axes = eigen.eigenvectors.transpose();
        let cross = Matrix2::new(m.cross[0], m.cross[1], m.cross[2], m.cross[3]);
        let offset = m.keypoint_mean[0].hypot(m.keypoint_mean[1]);
        let noise = 4.0 * f64::EPSILON * (m.frames as f64).sqrt() * (offset + spread.max());
        let mut projected = axes * cross;
        for i in 0..2 {
            let factor = if spread[i] > noise {
                1.0 / spread[i]
            } else {
                0.0
            };
            projected.set_row(i, &(projected.row(i) * factor));
        }
        let explained = |column: usize| projected.column(column).norm_squared();
        let left = [0, 1].map(|axis| non_negative(m.truth_squares[axis] - explained(axis)));
        Self {
            moments,
            exponents: Exponents {
                truth: m.truth_exponent,
                keypoint: m.keypoint_exponent[0],
            },
            axes,
            spread,
            noise,
            projected,
            left,
        }
    }

    fn centred(&self, columns: u64, widest: f64) -> Result<Fit> {
        let (m, spread) = (self.moments, self.spread);
        let bound = CENTRED_BOUND * larger(spread.max(), finite_root(widest));
        let mut a = Matrix2::zeros();
        let mut squares = self.left;
        let mut kept = 0;
        for i in 0..2 {
            if spread[i] > self.noise && spread[i] > bound {
                kept += 1;
                a += (self.projected.row(i).transpose() / spread[i]) * self.axes.row(i);
            } else {
                for axis in 0..2 {
                    squares[axis] += self.projected[(i, axis)].powi(2);
                }
            }
        }
        let b = Vector2::from(m.truth_mean) - a * Vector2::from(m.keypoint_mean);
        let moving_axes = (columns - 1) as usize;
        self.exponents
            .fitted(a, b, squares, m.frames, kept < moving_axes)
    }

    fn reference(&self, columns: u64) -> Result<Fit> {
        let m = self.moments;
        let root = (m.frames as f64).sqrt();
        // The design matrix, whose first column has no exponent, is divided by a power of two that
        // keeps it in range.
        let design = self.exponents.keypoint.max(0);
        let mut target = Matrix3x2::zeros();
        for axis in 0..2 {
            target[(0, axis)] = root * m.truth_mean[axis];
            for i in 0..2 {
                target[(i + 1, axis)] = self.projected[(i, axis)];
            }
        }
        let svd = self.design_matrix(root, design).svd(true, true);
        let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
            // Both factors were asked for; without them nothing is explained.
            let (a, b) = (Matrix2::zeros(), Vector2::zeros());
            return self.exponents.fitted(a, b, self.left, m.frames, true);
        };
        let rcond = f64::from(f32::EPSILON) * m.frames.max(columns) as f64;
        let bound = rcond * svd.singular_values.max();
        let mut weights = Matrix3x2::zeros();
        let mut squares = self.left;
        let mut kept = 0;
        for i in 0..3 {
            let along = u.column(i).transpose() * target;
            if svd.singular_values[i] > bound {
                kept += 1;
                weights += v_t.row(i).transpose() * along / svd.singular_values[i];
            } else {
                for axis in 0..2 {
                    squares[axis] += along[axis] * along[axis];
                }
            }
        }
        let a = Matrix2::new(
            weights[(1, 0)],
            weights[(2, 0)],
            weights[(1, 1)],
            weights[(2, 1)],
        );
        let b = Vector2::new(weights[(0, 0)], weights[(0, 1)]);
        // The weights of all columns are in the scale of the design matrix.
        let shift = [0, 1].map(|axis| times_power(b[axis], -design));
        let exponents = Exponents {
            keypoint: design,
            ..self.exponents
        };
        exponents.fitted(a, shift.into(), squares, m.frames, kept < columns)
    }

    /// `R` of the design matrix, divided by 2 to the power of `design`; `root` is that of the number
    /// of frames.
    fn design_matrix(&self, root: f64, design: i32) -> Matrix3<f64> {
        let to_design = self.exponents.keypoint - design;
        let mut r = Matrix3::zeros();
        r[(0, 0)] = times_power(root, -design);
        for j in 0..2 {
            r[(0, j + 1)] = times_power(root * self.moments.keypoint_mean[j], to_design);
            for i in 0..2 {
                r[(i + 1, j + 1)] = if self.spread[i] > self.noise {
                    times_power(self.spread[i] * self.axes[(i, j)], to_design)
                } else {
                    0.0
                };
            }
        }
        r
    }
}

fn finite_root(widest: f64) -> f64 {
    if widest.is_finite() {
        widest.sqrt()
    } else {
        0.0
    }
}

/// The powers of two that what is fitted is in.
#[derive(Clone, Copy)]
struct Exponents {
    truth: [i32; 2],
    keypoint: i32,
}

impl Exponents {
    /// The fit without exponents.
    fn fitted(
        self,
        a: Matrix2<f64>,
        b: Vector2<f64>,
        squares: [f64; 2],
        frames: u64,
        direction_dropped: bool,
    ) -> Result<Fit> {
        let factor = |row: usize, column: usize| {
            times_power(a[(row, column)], self.truth[row] - self.keypoint)
        };
        let fit = Fit {
            map: AffineMap {
                a: [0, 1]
                    .map(|row| [factor(row, 0), factor(row, 1)].into())
                    .into(),
                b: [0, 1]
                    .map(|axis| times_power(b[axis], self.truth[axis]))
                    .into(),
            },
            squares: [0, 1]
                .map(|axis| times_power(squares[axis], 2 * self.truth[axis]))
                .into(),
            frames,
            direction_dropped,
        };
        for row in 0..2 {
            let lost = |column: usize| fit.map.a[row][column].abs() < LEAST_FACTOR;
            if a.row(row).iter().any(|v| *v != 0.0) && lost(0) && lost(1) {
                return Err(out_of_range(
                    "a factor of the fitted map is too small for f64",
                ));
            }
        }
        fit.in_range()
    }
}

/// Factors below this have lost digits: subnormal values have fewer.
pub(super) const LEAST_FACTOR: f64 = f64::MIN_POSITIVE;

impl Fit {
    /// The fit, if every value of it is finite.
    pub(super) fn in_range(self) -> Result<Self> {
        let AffineMap { a, b } = self.map;
        let map = a.iter().flat_map(|row| row.iter()).chain(b.iter());
        if !map.copied().all(f64::is_finite) {
            return Err(out_of_range("the fitted map is too large for f64"));
        }
        if !self.error_sum().is_finite() {
            return Err(out_of_range(
                "the sum of squared distances is too large for f64",
            ));
        }
        Ok(self)
    }
}

pub(super) fn out_of_range(what: &str) -> Error {
    Error::numeric(format!(
        "{what}; expected coordinates near -1 to 1 (check for outliers and the unit)"
    ))
}
