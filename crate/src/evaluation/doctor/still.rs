//! Objects that do not move.

use ndarray::Axis;

use super::finding::{Evidence, Finding, Problem};
use super::subject::Subject;

/// The root of the variance up to which an object counts as one that does not move, ndc: a pixel of
/// an image of 256.
const STILL: f64 = 1.0 / 128.0;
/// Fewer positions say nothing about moving.
const LEAST: usize = 10;

pub(super) fn examine(subject: &Subject) -> Vec<Finding> {
    let points = subject.truth.points_ndc();
    let objects = subject.truth.names().iter().enumerate();
    let still = objects.filter_map(|(k, name)| {
        let of = points.index_axis(Axis(1), k);
        let rows = subject.join.pairs.iter().map(|(_, x)| of.row(*x));
        let seen: Vec<[f64; 2]> = rows
            .map(|p| [p[0], p[1]])
            .filter(|p| p.iter().all(|v| v.is_finite()))
            .collect();
        let count = seen.len();
        let mean = [0, 1].map(|axis| seen.iter().map(|p| p[axis]).sum::<f64>() / count as f64);
        let squares = seen
            .iter()
            .map(|p| (p[0] - mean[0]).powi(2) + (p[1] - mean[1]).powi(2));
        let spread = (squares.sum::<f64>() / count as f64).sqrt();
        let is_still = count >= LEAST && spread <= STILL;
        is_still.then(|| Finding {
            problem: Problem::Still,
            text: format!(
                "`{name}` hardly moves (by {spread:.1e} in all {count} frames): a keypoint that never moves follows it \
                 as well as any"
            ),
            evidence: Evidence {
                count,
                of: count,
                ..Evidence::default()
            },
            remedies: Vec::new(),
        })
    });
    still.collect()
}
