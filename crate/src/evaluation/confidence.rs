//! Points that a detector is not sure of, and how the score depends on how sure it has to be.

use ndarray::{Array2, Array3, s};

use crate::error::{Error, Result};

/// Levels of confidence that a curve is drawn at when there are no more.
const LEVELS: usize = 12;

/// How sure points have to be to count. What is less sure is missing; what has no confidence counts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MinConfidence {
    /// Of keypoints, in the unit of their file.
    pub keypoints: Option<f64>,
    /// Of positions of the ground truth, in the unit of its file.
    pub truth: Option<f64>,
}

impl MinConfidence {
    /// # Errors
    /// When one is not a finite number.
    pub fn new(keypoints: Option<f64>, truth: Option<f64>) -> Result<Self> {
        for (value, whose) in [(keypoints, "keypoints"), (truth, "the ground truth")] {
            if let Some(value) = value.filter(|value| !value.is_finite()) {
                return Err(Error::input(format!(
                    "the smallest confidence of {whose} is {value}; expected a finite number"
                )));
            }
        }
        Ok(Self { keypoints, truth })
    }
}

/// Hides the points whose confidence is below `least` and counts those that were not hidden before.
pub(super) fn hide(points: &mut Array3<f64>, confidence: &Array2<f64>, least: f64) -> u64 {
    let mut hidden = 0;
    for ((t, n), confidence) in confidence.indexed_iter() {
        let mut position = points.slice_mut(s![t, n, ..]);
        if *confidence < least && position.iter().all(|v| v.is_finite()) {
            position.fill(f64::NAN);
            hidden += 1;
        }
    }
    hidden
}

/// Levels at which the confidences differ: each of them where they are few, tenths where they are
/// probabilities, else every tenth part of them. None where all are equal.
pub(super) fn levels(confidence: &Array2<f64>) -> Vec<f64> {
    let mut all: Vec<f64> = confidence
        .iter()
        .copied()
        .filter(|c| c.is_finite())
        .collect();
    all.sort_unstable_by(f64::total_cmp);
    let (Some(first), Some(last)) = (all.first().copied(), all.last().copied()) else {
        return Vec::new();
    };
    if first == last {
        return Vec::new();
    }
    let mut found: Vec<f64> = Vec::new();
    for value in &all {
        if found.last() != Some(value) {
            found.push(*value);
        }
        if found.len() > LEVELS {
            break;
        }
    }
    if found.len() <= LEVELS {
        return found;
    }
    if first >= 0.0 && last <= 1.0 {
        let tenths = (0..10).map(|i| f64::from(i) / 10.0);
        return tenths.chain([0.95, 0.99]).collect();
    }
    let mut parts: Vec<f64> = (0..10).map(|i| all[i * all.len() / 10]).collect();
    parts.dedup();
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[f64]) -> Vec<f64> {
        let shape = (values.len(), 1);
        levels(&Array2::from_shape_vec(shape, values.to_vec()).expect("a column"))
    }

    #[test]
    fn levels_are_where_confidences_differ() {
        assert_eq!(of(&[2.0, 1.0, f64::NAN, 2.0]), [1.0, 2.0]);
        assert!(of(&[0.9, 0.9]).is_empty() && of(&[f64::NAN]).is_empty());
        let many: Vec<f64> = (0..100).map(|i| f64::from(i) / 100.0).collect();
        assert_eq!(of(&many)[..3], [0.0, 0.1, 0.2]);
        let large: Vec<f64> = (0..100).map(|i| f64::from(i) * 3.0).collect();
        assert_eq!(of(&large)[..3], [0.0, 30.0, 60.0]);
    }

    #[test]
    fn only_what_is_surely_less_sure_is_hidden() {
        let mut points = Array3::zeros((1, 3, 2));
        points[[0, 2, 1]] = f64::NAN;
        let confidence = Array2::from_shape_vec((1, 3), vec![0.2, f64::NAN, 0.1]).expect("a row");
        assert_eq!(hide(&mut points, &confidence, 0.2), 0);
        assert_eq!(
            hide(&mut points, &confidence, 0.3),
            1,
            "one is hidden anyway"
        );
        assert!(points[[0, 0, 0]].is_nan() && points[[0, 0, 1]].is_nan());
        assert_eq!(points[[0, 1, 0]], 0.0);
        assert!(MinConfidence::new(Some(f64::NAN), None).is_err());
    }
}
