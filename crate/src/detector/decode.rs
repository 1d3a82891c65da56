//! From maps, profiles and numbers to points.

use super::settings::{Columns, Decoding, Unit};
use crate::error::{Error, Result};

/// A point in ndc, and how sure the detector is of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    pub point: [f64; 2],
    pub confidence: Option<f64>,
}

/// How maps become points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MapDecoding {
    pub decoding: Decoding,
    pub temperature: f64,
}

impl MapDecoding {
    /// The point of a heat map with rows of `width` values; the confidence is its largest value.
    pub fn map(&self, values: &[f32], width: usize) -> Result<Found> {
        let peak = peak(values)?;
        let height = values.len() / width;
        let cells = match self.decoding {
            Decoding::Argmax => {
                let [column, row] = [peak % width, peak / width];
                let value = |column: usize, row: usize| f64::from(values[row * width + column]);
                let x = vertex(column, width, |column| value(column, row));
                let y = vertex(row, height, |row| value(column, row));
                [x, y]
            }
            Decoding::SoftArgmax => {
                let largest = f64::from(values[peak]);
                let (mut sum, mut mean) = (0.0, [0.0; 2]);
                for (row, values) in values.chunks_exact(width).enumerate() {
                    for (column, value) in values.iter().enumerate() {
                        let weight = ((f64::from(*value) - largest) / self.temperature).exp();
                        sum += weight;
                        mean[0] += weight * column as f64;
                        mean[1] += weight * row as f64;
                    }
                }
                mean.map(|m| m / sum)
            }
        };
        Ok(Found {
            point: [ndc(cells[0], width), ndc(cells[1], height)],
            confidence: Some(f64::from(values[peak])),
        })
    }

    /// The point of two profiles; the confidence is the smaller one of their largest values.
    pub fn profiles(&self, profiles: [&[f32]; 2]) -> Result<Found> {
        let [x, y] = profiles.map(|profile| self.map(profile, profile.len()));
        let (x, y) = (x?, y?);
        Ok(Found {
            point: [x.point[0], y.point[0]],
            confidence: x.confidence.zip(y.confidence).map(|(x, y)| x.min(y)),
        })
    }
}

/// The place of the largest value, the first of equal ones.
fn peak(values: &[f32]) -> Result<usize> {
    let mut peak = 0;
    for (i, value) in values.iter().enumerate() {
        if !value.is_finite() {
            return Err(Error::numeric("a value of its map is not a finite number"));
        }
        if *value > values[peak] {
            peak = i;
        }
    }
    Ok(peak)
}

/// The vertex of the parabola through the values at `at` and its neighbours: through their logarithms
/// where all are positive, which is exact for a Gaussian (Zhang et al., Distribution-Aware Coordinate
/// Representation for Human Pose Estimation, 2020). A cell at the border is taken as it is.
fn vertex(at: usize, cells: usize, value: impl Fn(usize) -> f64) -> f64 {
    if at == 0 || at + 1 >= cells {
        return at as f64;
    }
    let mut three = [value(at - 1), value(at), value(at + 1)];
    if three.iter().all(|v| *v > 0.0) {
        three = three.map(f64::ln);
    }
    let [before, middle, after] = three;
    let curvature = before - 2.0 * middle + after;
    // The middle is the largest, so this is at most half a cell; flat maps have no vertex.
    match curvature < 0.0 {
        true => at as f64 + (before - after) / (2.0 * curvature),
        false => at as f64,
    }
}

/// The centre of cell `at` of `cells` from edge to edge of the image.
fn ndc(at: f64, cells: usize) -> f64 {
    (2.0 * at + 1.0) / cells as f64 - 1.0
}

/// The point of a row of numbers, in an input of `size`.
pub(super) fn point(
    numbers: &[f32],
    columns: Columns,
    unit: Unit,
    size: [usize; 2],
) -> Result<Found> {
    if numbers.iter().any(|v| !v.is_finite()) {
        return Err(Error::numeric("one of its numbers is not finite"));
    }
    let axes = columns.axes();
    let point = [0, 1].map(|axis| {
        let value = f64::from(numbers[axes[axis]]);
        match unit {
            Unit::Pixels => ndc(value, size[axis]),
            Unit::Fraction => 2.0 * value - 1.0,
            Unit::Ndc => value,
        }
    });
    Ok(Found {
        point,
        confidence: columns.has_confidence().then(|| f64::from(numbers[2])),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gaussian(width: usize, height: usize, at: [f64; 2], sigma: f64) -> Vec<f32> {
        (0..width * height)
            .map(|i| {
                let [dx, dy] = [(i % width) as f64 - at[0], (i / width) as f64 - at[1]];
                (-(dx * dx + dy * dy) / (2.0 * sigma * sigma)).exp() as f32
            })
            .collect()
    }

    #[test]
    fn the_peak_of_a_gaussian_is_found_between_cells() {
        let argmax = MapDecoding {
            decoding: Decoding::Argmax,
            temperature: 1.0,
        };
        let at = [20.3, 11.8];
        let found = argmax.map(&gaussian(48, 32, at, 2.0), 48).expect("a point");
        let expected = [ndc(at[0], 48), ndc(at[1], 32)];
        for axis in 0..2 {
            // Values in f32 move the logarithms by 1e-7, divided by a curvature of 1/4.
            assert!(
                (found.point[axis] - expected[axis]).abs() < 1e-6,
                "{found:?}"
            );
        }
    }

    #[test]
    fn the_mean_of_a_distribution_is_its_soft_argmax() {
        // The logarithm of a Gaussian over the temperature: its softmax is the Gaussian itself.
        let soft = MapDecoding {
            decoding: Decoding::SoftArgmax,
            temperature: 0.1,
        };
        let at = [20.3, 15.8];
        let map: Vec<f32> = gaussian(48, 32, at, 2.0)
            .iter()
            .map(|v| 0.1 * v.ln().max(-80.0))
            .collect();
        let found = soft.map(&map, 48).expect("a point");
        for (axis, side) in [(0, 48), (1, 32)] {
            // The sampled Gaussian's mean is exact to rounding in f32 at this sigma.
            assert!(
                (found.point[axis] - ndc(at[axis], side)).abs() < 1e-6,
                "{found:?}"
            );
        }
    }

    #[test]
    fn borders_and_flat_maps_give_their_first_largest_cell() {
        let argmax = MapDecoding {
            decoding: Decoding::Argmax,
            temperature: 1.0,
        };
        let mut map = vec![0.0; 12];
        assert_eq!(
            argmax.map(&map, 4).expect("a point").point,
            [ndc(0.0, 4), ndc(0.0, 3)]
        );
        map[11] = 2.0;
        let found = argmax.map(&map, 4).expect("a point");
        assert_eq!(found.point, [ndc(3.0, 4), ndc(2.0, 3)]);
        assert_eq!(found.confidence, Some(2.0));
        map[5] = f32::NAN;
        assert!(argmax.map(&map, 4).is_err());
    }
}
