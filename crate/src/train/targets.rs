//! What the targets of the training frames have in common.

use nalgebra::{Matrix3, SymmetricEigen};

use super::{Dataset, Sequence};
use crate::error::{Error, Result};
use crate::event::Cancel;

/// Added to the variances of colours, relative to their mean: colours that never occur get a weight
/// of at most a thousand times that of an average one.
const FLOOR: f64 = 1e-3;

/// The moments of the training targets.
pub(super) struct TargetMoments {
    /// The mean image: red, green and blue planes.
    pub mean: Vec<f64>,
    /// Covariance of the colours of what the targets have beyond the mean image.
    covariance: [[f64; 3]; 3],
}

impl TargetMoments {
    /// Those of all frames of `training`.
    pub fn of(dataset: &Dataset, training: &[&Sequence], cancel: &Cancel) -> Result<Self> {
        let mut mean = Vec::new();
        let mut products = [[0.0; 3]; 3];
        let mut frames = 0;
        for sequence in training {
            cancel.check()?;
            let all: Vec<(&Sequence, usize)> =
                (0..sequence.len()).map(|t| (*sequence, t)).collect();
            let (_, targets) = dataset.gather(&all)?;
            let size = targets.len() / all.len();
            mean.resize(size, 0.0);
            for target in targets.chunks_exact(size) {
                for (sum, value) in mean.iter_mut().zip(target) {
                    *sum += f64::from(*value);
                }
                add_products(&mut products, target, |v| f64::from(*v));
            }
            frames += all.len();
        }
        for value in &mut mean {
            *value /= frames as f64;
        }
        let mut of_mean = [[0.0; 3]; 3];
        add_products(&mut of_mean, &mean, |v| *v);
        let plane = (mean.len() / 3) as f64;
        let covariance = [0, 1, 2].map(|i: usize| {
            [0, 1, 2].map(|j: usize| (products[i][j] / frames as f64 - of_mean[i][j]) / plane)
        });
        Ok(Self { mean, covariance })
    }

    /// The lower triangular matrix that turns differences of colours into ones whose squares add up
    /// to a Mahalanobis distance, scaled so that the mean image keeps its mean squared error.
    ///
    /// # Errors
    /// When every target is the mean image.
    pub fn whitening(&self) -> Result<[[f64; 3]; 3]> {
        let mean_variance = self.mean_variance()?;
        let inverse = inverse_factor(&self.floored(mean_variance));
        let scale = mean_variance.sqrt();
        Ok(inverse.map(|row| row.map(|v| v * scale)))
    }

    /// The same with the square root of the covariance in place of the covariance.
    ///
    /// # Errors
    /// When every target is the mean image.
    pub fn half_whitening(&self) -> Result<[[f64; 3]; 3]> {
        let covariance = self.floored(self.mean_variance()?);
        let SymmetricEigen {
            eigenvalues,
            eigenvectors,
        } = Matrix3::from_fn(|i, j| covariance[i][j]).symmetric_eigen();
        let roots = eigenvalues.map(f64::sqrt);
        let root = eigenvectors * Matrix3::from_diagonal(&roots) * eigenvectors.transpose();
        let inverse = inverse_factor(&[0, 1, 2].map(|i| [0, 1, 2].map(|j| root[(i, j)])));
        let scale = (eigenvalues.sum() / roots.sum()).sqrt();
        Ok(inverse.map(|row| row.map(|v| v * scale)))
    }

    /// The covariance with a little more of each variance, so that it can be inverted.
    fn floored(&self, mean_variance: f64) -> [[f64; 3]; 3] {
        let mut covariance = self.covariance;
        for (i, row) in covariance.iter_mut().enumerate() {
            row[i] += FLOOR * mean_variance;
        }
        covariance
    }

    /// The variance of a colour.
    fn mean_variance(&self) -> Result<f64> {
        let mean = (0..3).map(|i| self.covariance[i][i]).sum::<f64>() / 3.0;
        // Rounding of 8-bit images is 1e-6.
        if mean < 1e-9 {
            return Err(Error::input(
                "the training targets are all alike: no colour to whiten; expected frames in which something moves",
            ));
        }
        Ok(mean)
    }
}

/// The inverse of Cholesky's factor L of a matrix, row by row.
fn inverse_factor(matrix: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut factor = [[0.0; 3]; 3];
    let mut inverse = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let rest = matrix[i][j] - known;
            factor[i][j] = if i == j {
                rest.sqrt()
            } else {
                rest / factor[j][j]
            };
        }
        for j in 0..=i {
            let unit = if i == j { 1.0 } else { 0.0 };
            let known: f64 = (j..i).map(|k| factor[i][k] * inverse[k][j]).sum();
            inverse[i][j] = (unit - known) / factor[i][i];
        }
    }
    inverse
}

/// Adds the products of the colours of all pixels of an image of three planes.
fn add_products<T>(to: &mut [[f64; 3]; 3], planes: &[T], value: impl Fn(&T) -> f64) {
    let plane = planes.len() / 3;
    for (i, row) in to.iter_mut().enumerate() {
        for (j, sum) in row.iter_mut().enumerate() {
            let [a, b] = [i, j].map(|k| &planes[k * plane..(k + 1) * plane]);
            *sum += a
                .iter()
                .zip(b)
                .map(|(a, b)| value(a) * value(b))
                .sum::<f64>();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whitened_colours_have_equal_variances_and_no_covariance() {
        let covariance = [[0.5, 0.3, 0.1], [0.3, 0.4, 0.2], [0.1, 0.2, 0.6]];
        let moments = TargetMoments {
            mean: Vec::new(),
            covariance,
        };
        let w = moments.whitening().expect("a matrix");
        for i in 0..3 {
            for j in 0..3 {
                let mut whitened = 0.0;
                for (k, row) in covariance.iter().enumerate() {
                    for (l, value) in row.iter().enumerate() {
                        whitened += w[i][k] * value * w[j][l];
                    }
                }
                // The mean of the variances is 0.5.
                let expected = if i == j { 0.5 } else { 0.0 };
                // The floor adds a thousandth to variances.
                assert!((whitened - expected).abs() < 3e-3, "{i} {j}: {whitened}");
            }
        }
    }

    #[test]
    fn half_whitened_errors_are_those_of_the_inverse_square_root() {
        let covariance = [[0.5, 0.3, 0.1], [0.3, 0.4, 0.2], [0.1, 0.2, 0.6]];
        let moments = TargetMoments {
            mean: Vec::new(),
            covariance,
        };
        let matrix = moments.half_whitening().expect("a matrix");
        let w = Matrix3::from_fn(|i, j| matrix[i][j]);
        let c = Matrix3::from_fn(|i, j| covariance[i][j]);
        // (W' W)^2 is the inverse of the covariance but for a factor; the floor adds a thousandth to
        // variances.
        let square = (w.transpose() * w) * (w.transpose() * w) * c;
        let factor = square.trace() / 3.0;
        let rest = square - Matrix3::identity() * factor;
        assert!(rest.abs().max() < 1e-2 * factor, "{square}");
        // The mean image keeps its error.
        let kept = (w * c * w.transpose()).trace() / c.trace();
        assert!((kept - 1.0).abs() < 3e-3, "{kept}");
        // Lower triangular, as the trainer has it.
        assert_eq!([w[(0, 1)], w[(0, 2)], w[(1, 2)]], [0.0; 3]);
    }

    #[test]
    fn targets_that_are_all_alike_have_no_colour_to_whiten() {
        let moments = TargetMoments {
            mean: Vec::new(),
            covariance: [[0.0; 3]; 3],
        };
        assert!(moments.whitening().is_err());
    }
}
