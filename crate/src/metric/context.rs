//! Other metrics of the same data, for context: linear regression with PCK, and min-cost
//! assignment.
//!
//! Neither says which keypoint follows which object over time, which is what the tracking error is
//! for; `docs/metrics.md` has the definitions, their sources and where these differ.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use ndarray::{ArrayView2, ArrayView3, Axis};

use super::scale::{exponent, times_power};
use crate::error::{Error, Result};

/// Distances that count as close, as shares of the side of the image: 2 %, 6 of 128 pixels (Jakab
/// et al., 2018), 10 %.
pub const CLOSE: [f64; 3] = [0.02, 6.0 / 128.0, 0.1];

/// The side of an image in ndc.
pub(super) const SIDE: f64 = 2.0;

/// Directions of the keypoints' joint motion with a standard deviation below this share of the
/// largest are left out of the regression, as under [`Rank::Centred`](super::Rank::Centred).
const BOUND: f64 = 1e-6;

/// The farthest coordinate of an assignment: sums of distances up to it keep digits for distances
/// that are close.
pub(super) const FARTHEST: f64 = 1e9;

/// One object predicted from all keypoints.
#[derive(Debug, Clone, PartialEq)]
pub struct Regression {
    /// Frames that were predicted.
    pub frames: u64,
    /// The mean squared distance of the predictions (ndc); `None` where no frame could be
    /// predicted.
    pub error: Option<f64>,
    /// PCK: for each of [`CLOSE`] the share of the frames whose prediction is that close.
    pub close: Option<[f64; CLOSE.len()]>,
}

/// Keypoints matched one to one to objects, trajectory by trajectory.
#[derive(Debug, Clone, PartialEq)]
pub struct Assignment {
    /// The number of trajectories of keypoints.
    pub keypoints: u64,
    /// The number of trajectories of objects.
    pub objects: u64,
    /// For each of [`CLOSE`] the share of the keypoints' trajectories that are matched that
    /// closely.
    pub precision: [f64; CLOSE.len()],
    /// For each of [`CLOSE`] the share of the objects' trajectories that are matched that closely.
    pub recall: [f64; CLOSE.len()],
}

/// Predicts every object's position as a linear function of all keypoints plus a constant, by least
/// squares (of smallest norm where keypoints do not move independently).
///
/// `keypoints` is T x N x 2, `truth` T x K x 2 in ndc (NaN: not visible). `folds` gives every frame
/// its fold: a frame is then predicted from the frames of the other folds; without it the frames
/// that are fitted are predicted. Frames with a keypoint that is not finite are left out.
///
/// # Errors
/// When the numbers of frames differ, or an error is beyond the range of f64
/// ([`farthest_frame`](super::farthest_frame) finds the frame).
pub fn regression(
    keypoints: ArrayView3<f64>,
    truth: ArrayView3<f64>,
    folds: Option<&[usize]>,
) -> Result<Vec<Regression>> {
    let frames = keypoints.dim().0;
    if truth.dim().0 != frames || folds.is_some_and(|folds| folds.len() != frames) {
        return Err(Error::mismatch(format!(
            "{frames} frames of keypoints and {} of ground truth cannot be regressed; expected as many of both, and a fold \
             for each",
            truth.dim().0
        )));
    }
    let usable = |t: usize| is_finite(keypoints.index_axis(Axis(0), t));
    let usable: Vec<usize> = (0..frames).filter(|t| usable(*t)).collect();
    let count = folds.map_or(1, |folds| folds.iter().max().map_or(1, |last| last + 1));
    let scale = |values: &mut dyn Iterator<Item = f64>| {
        let largest = values.fold(
            0.0,
            |largest, v| if v.abs() > largest { v.abs() } else { largest },
        );
        // Within the exponents of normal values, for the factor and its inverse.
        exponent(largest).clamp(-1000, 1000)
    };
    let inputs = scale(
        &mut usable
            .iter()
            .flat_map(|t| keypoints.index_axis(Axis(0), *t))
            .copied(),
    );
    let objects = (0..truth.dim().1).map(|k| {
        let seen = |t: &&usize| truth[[**t, k, 0]].is_finite() && truth[[**t, k, 1]].is_finite();
        let visible: Vec<usize> = usable.iter().filter(seen).copied().collect();
        let outputs = [0, 1].map(|axis| scale(&mut visible.iter().map(|t| truth[[*t, k, axis]])));
        let row = |t: usize| -> DVector<f64> {
            let points = keypoints.index_axis(Axis(0), t);
            let values = points
                .iter()
                .map(|v| times_power(*v, -inputs))
                .chain([0, 1].map(|axis| times_power(truth[[t, k, axis]], -outputs[axis])));
            DVector::from_iterator(points.len() + 2, values)
        };
        let found = regress(&visible, row, outputs, folds, count);
        if found.error.is_some_and(|error| !error.is_finite()) {
            return Err(Error::numeric(format!(
                "the error of the linear regression of object {k} is too large for f64; expected \
                 coordinates near -1 to 1 (check for outliers and the unit)"
            )));
        }
        Ok(found)
    });
    objects.collect()
}

/// Sums over frames around a common centre: their number, of the rows, and of their products.
#[derive(Clone)]
pub(super) struct Sums {
    count: f64,
    first: DVector<f64>,
    second: DMatrix<f64>,
}

impl Sums {
    pub fn new(columns: usize) -> Self {
        Self {
            count: 0.0,
            first: DVector::zeros(columns),
            second: DMatrix::zeros(columns, columns),
        }
    }

    /// Counts a row, which should lie around the origin.
    pub fn push(&mut self, row: DVector<f64>) {
        self.count += 1.0;
        self.second.ger(1.0, &row, &row, 1.0);
        self.first += row;
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.first += &other.first;
        self.second += &other.second;
    }

    /// Least squares of the last two columns on the others and a constant: the 2 x D matrix and the
    /// shift.
    pub fn solve(&self) -> (DMatrix<f64>, DVector<f64>) {
        let inputs = self.first.len() - 2;
        let mean = &self.first / self.count;
        let centred = &self.second - &self.first * mean.transpose();
        let eigen = SymmetricEigen::new(centred.view((0, 0), (inputs, inputs)).into_owned());
        let bound = eigen.eigenvalues.max() * BOUND * BOUND;
        let inverse = eigen
            .eigenvalues
            .map(|value| if value > bound { 1.0 / value } else { 0.0 });
        let axes = &eigen.eigenvectors;
        let cross = centred.view((inputs, 0), (2, inputs));
        let matrix = (cross * axes) * DMatrix::from_diagonal(&inverse) * axes.transpose();
        let shift = mean.rows(inputs, 2) - &matrix * mean.rows(0, inputs);
        (matrix, shift)
    }
}

/// `row` gives a frame divided by powers of two: those of the last two columns are `outputs`.
fn regress(
    visible: &[usize],
    row: impl Fn(usize) -> DVector<f64>,
    outputs: [i32; 2],
    folds: Option<&[usize]>,
    count: usize,
) -> Regression {
    let none = Regression {
        frames: 0,
        error: None,
        close: None,
    };
    let Some(first) = visible.first() else {
        return none;
    };
    let fold_of = |t: usize| folds.map_or(0, |folds| folds[t]);
    // Around a point of the cloud, so that no digits go into its distance from the origin.
    let centre = visible
        .iter()
        .map(|t| row(*t))
        .fold(row(*first) * 0.0, |sum, row| sum + row)
        / visible.len() as f64;
    let mut sums = vec![Sums::new(centre.len()); count];
    for t in visible {
        let centred = row(*t) - &centre;
        sums[fold_of(*t)].push(centred);
    }
    let maps: Vec<Option<(DMatrix<f64>, DVector<f64>)>> = (0..count)
        .map(|fold| {
            let mut fitted = Sums::new(centre.len());
            for (_, sums) in sums
                .iter()
                .enumerate()
                .filter(|(other, _)| folds.is_none() || *other != fold)
            {
                fitted.add(sums);
            }
            (fitted.count > 0.0).then(|| fitted.solve())
        })
        .collect();
    let inputs = centre.len() - 2;
    let (mut frames, mut sum, mut close) = (0, 0.0, [0.0; CLOSE.len()]);
    for t in visible {
        let Some((matrix, shift)) = &maps[fold_of(*t)] else {
            continue;
        };
        let centred = row(*t) - &centre;
        let mut left = matrix * centred.rows(0, inputs) + shift - centred.rows(inputs, 2);
        for axis in 0..2 {
            left[axis] = times_power(left[axis], outputs[axis]);
        }
        frames += 1;
        sum += left.norm_squared();
        for (close, share) in close.iter_mut().zip(CLOSE) {
            *close += f64::from(u8::from(left.norm() <= share * SIDE));
        }
    }
    if frames == 0 {
        return none;
    }
    Regression {
        frames,
        error: Some(sum / frames as f64),
        close: Some(close.map(|count| count / frames as f64)),
    }
}

/// Matches keypoints, as they are, to objects: in every trajectory one to one, with the smallest
/// sum of mean Euclidean distances (ndc), of which those above a bound do not count.
///
/// `keypoints` is T x N x 2, `truth` T x K x 2 in ndc (NaN: not visible), `trajectories` are ranges
/// of frames. Frames with a keypoint that is not finite are left out, as are objects from
/// trajectories that do not show them.
///
/// # Errors
/// When the numbers of frames differ, or a coordinate is so large that rounding would decide who is
/// matched with whom ([`farthest_frame`](super::farthest_frame) finds the frame).
pub fn assignment(
    keypoints: ArrayView3<f64>,
    truth: ArrayView3<f64>,
    trajectories: impl IntoIterator<Item = std::ops::Range<usize>>,
) -> Result<Assignment> {
    let (frames, n, _) = keypoints.dim();
    if truth.dim().0 != frames {
        return Err(Error::mismatch(format!(
            "{frames} frames of keypoints and {} of ground truth cannot be matched; expected as many of both",
            truth.dim().0
        )));
    }
    for points in [&keypoints, &truth] {
        let beyond = |v: &f64| v.is_finite() && v.abs() > FARTHEST;
        if let Some(value) = points.iter().find(|v| beyond(v)) {
            return Err(Error::numeric(format!(
                "a coordinate is {value:e}; keypoints can be assigned to objects up to \
                 {FARTHEST:e} (check for outliers and the unit)"
            )));
        }
    }
    let (mut predicted, mut actual, mut matched) = (0, 0, [0_u64; CLOSE.len()]);
    for trajectory in trajectories {
        let mut costs: Vec<Vec<f64>> = Vec::with_capacity(truth.dim().1);
        let usable: Vec<usize> = trajectory
            .filter(|t| *t < frames && is_finite(keypoints.index_axis(Axis(0), *t)))
            .collect();
        if usable.is_empty() {
            continue;
        }
        for k in 0..truth.dim().1 {
            let mut sums = vec![0.0; n];
            let mut seen = 0;
            for t in &usable {
                let [x, y] = [truth[[*t, k, 0]], truth[[*t, k, 1]]];
                if x.is_finite() && y.is_finite() {
                    seen += 1;
                    for (i, sum) in sums.iter_mut().enumerate() {
                        *sum += (keypoints[[*t, i, 0]] - x).hypot(keypoints[[*t, i, 1]] - y);
                    }
                }
            }
            if seen > 0 {
                costs.push(sums.iter().map(|sum| sum / f64::from(seen)).collect());
            }
        }
        predicted += n as u64;
        actual += costs.len() as u64;
        for (k, i) in min_cost(&costs) {
            for (matched, share) in matched.iter_mut().zip(CLOSE) {
                *matched += u64::from(costs[k][i] <= share * SIDE);
            }
        }
    }
    let share = |total: u64| matched.map(|count| count as f64 / total.max(1) as f64);
    Ok(Assignment {
        keypoints: predicted,
        objects: actual,
        precision: share(predicted),
        recall: share(actual),
    })
}

fn is_finite(points: ArrayView2<f64>) -> bool {
    points.iter().all(|v| v.is_finite())
}

/// Pairs (row, column) of a matrix of finite costs with the smallest sum; as many as its shorter
/// side has.
///
/// The Hungarian method with potentials, O(rows^2 columns): a row after the other is added along a
/// shortest path.
fn min_cost(costs: &[Vec<f64>]) -> Vec<(usize, usize)> {
    let (rows, columns) = (costs.len(), costs.first().map_or(0, Vec::len));
    if rows > columns {
        let turned: Vec<Vec<f64>> = (0..columns)
            .map(|column| costs.iter().map(|row| row[column]).collect())
            .collect();
        return min_cost(&turned)
            .into_iter()
            .map(|(column, row)| (row, column))
            .collect();
    }
    // Rows and columns are counted from 1; column 0 holds the row that is being added.
    let (mut of_row, mut of_column) = (vec![0.0; rows + 1], vec![0.0; columns + 1]);
    let mut matched = vec![0; columns + 1];
    for row in 1..=rows {
        matched[0] = row;
        let mut column = 0;
        let mut slack = vec![f64::INFINITY; columns + 1];
        let mut before = vec![0; columns + 1];
        let mut visited = vec![false; columns + 1];
        while matched[column] != 0 {
            visited[column] = true;
            let from = matched[column];
            let (mut step, mut next) = (f64::INFINITY, 0);
            for j in (1..=columns).filter(|j| !visited[*j]) {
                let reduced = costs[from - 1][j - 1] - of_row[from] - of_column[j];
                if reduced < slack[j] {
                    (slack[j], before[j]) = (reduced, column);
                }
                if slack[j] < step {
                    (step, next) = (slack[j], j);
                }
            }
            for j in 0..=columns {
                if visited[j] {
                    of_row[matched[j]] += step;
                    of_column[j] -= step;
                } else {
                    slack[j] -= step;
                }
            }
            column = next;
        }
        while column != 0 {
            matched[column] = matched[before[column]];
            column = before[column];
        }
    }
    (1..=columns)
        .filter(|column| matched[*column] != 0)
        .map(|column| (matched[column] - 1, column - 1))
        .collect()
}
