//! Positions of exactly (0, 0), as detectors write what they did not find.

use ndarray::{Array3, ArrayView2, Axis};

use super::finding::{Evidence, Finding, Problem, Remedy, Side};
use super::subject::Subject;
use crate::data::{Layout, Space, ranges};
use crate::track::FrameKey;

/// The least positions of one point.
const LEAST: usize = 3;
/// How many times farther than a usual step a point must jump to (0, 0) and back, unless no other
/// position comes twice.
const JUMP: f64 = 3.0;
/// The share of the other positions that differ from each other where none comes twice.
const UNIQUE: f64 = 0.9;
/// The least distance of such a jump, ndc.
const LEAST_JUMP: f64 = 0.05;

pub(super) fn examine(subject: &Subject) -> Vec<Finding> {
    [Side::Truth, Side::Keypoints]
        .into_iter()
        .filter_map(|side| of(subject, side))
        .collect()
}

fn of(subject: &Subject, side: Side) -> Option<Finding> {
    let reading = subject.reading(side)?;
    if subject.is_said(side, |reading| reading.zero_is_missing)
        || reading.layout == Layout::Extraction
    {
        return None;
    }
    let (keys, points) = match side {
        Side::Truth => (subject.truth.keys(), subject.truth.points_ndc()),
        Side::Keypoints => (subject.keypoints.keys(), subject.keypoints.points()),
    };
    let flip = reading.flip.value.axes();
    let is_zero = |p: [f64; 2]| match reading.space.value {
        Space::Ndc | Space::World => p == [0.0, 0.0],
        Space::Fraction => (0..2).all(|axis| p[axis] == if flip[axis] { 1.0 } else { -1.0 }),
        Space::Pixels => {
            (0..2).all(|axis| is_first_pixel(if flip[axis] { -p[axis] } else { p[axis] }))
        }
    };
    let (count, affected) = stray(keys, points, is_zero);
    if affected == 0 {
        return None;
    }
    let of = points.dim().0 * points.dim().1;
    let what = match side {
        Side::Truth => "object(s)",
        Side::Keypoints => "keypoint(s)",
    };
    Some(Finding {
        problem: Problem::Zeros,
        text: format!(
            "{count} of {of} positions of {} are exactly (0, 0), and {affected} {what} jump there and back: many \
             programs write that for a point that they did not find",
            side.words()
        ),
        evidence: Evidence {
            count,
            of,
            ..Evidence::default()
        },
        remedies: vec![Remedy::ZeroIsMissing { side }],
    })
}

/// Whether this is what pixel 0 of an image of some size becomes.
fn is_first_pixel(v: f64) -> bool {
    let size = 1.0 / (v + 1.0);
    (1.0..=1e5).contains(&size) && (size - size.round()).abs() < 1e-6 * size && {
        1.0 / size.round() - 1.0 == v
    }
}

/// How many positions are zero of points that jump to zero, and how many points these are.
fn stray(
    keys: &[FrameKey],
    points: &Array3<f64>,
    is_zero: impl Fn([f64; 2]) -> bool,
) -> (usize, usize) {
    let sequences = ranges(keys);
    let (mut count, mut affected) = (0, 0);
    for of in points.axis_iter(Axis(1)) {
        let at = |t: usize| [of[[t, 0]], of[[t, 1]]];
        let zeros = (0..keys.len()).filter(|t| is_zero(at(*t))).count();
        if zeros < LEAST {
            continue;
        }
        let (mut steps, mut jumps) = (Vec::new(), Vec::new());
        for range in &sequences {
            for t in range.start + 1..range.start + range.length {
                let (from, to) = (at(t - 1), at(t));
                let step = (from[0] - to[0]).hypot(from[1] - to[1]);
                match (is_zero(from), is_zero(to)) {
                    _ if !step.is_finite() => {}
                    (false, false) => steps.push(step),
                    (true, true) => {}
                    _ => jumps.push(step),
                }
            }
        }
        let stands_out = match median(jumps) {
            None => rests_in_sequences(&of, &sequences, &is_zero),
            Some(jump) => {
                // A simulation may start everything there.
                let starts = sequences.iter().filter(|range| is_zero(at(range.start)));
                let is_far = jump >= JUMP * median(steps).unwrap_or(0.0);
                starts.count() < zeros
                    && jump >= LEAST_JUMP
                    && (is_far || are_unique((0..keys.len()).map(at).filter(|p| !is_zero(*p))))
            }
        };
        if stands_out {
            count += zeros;
            affected += 1;
        }
    }
    (count, affected)
}

/// Whether the point is at zero all along in several sequences, and never elsewhere in them.
fn rests_in_sequences(
    of: &ArrayView2<f64>,
    sequences: &[crate::data::SequenceRange],
    is_zero: &impl Fn([f64; 2]) -> bool,
) -> bool {
    let rests = |range: &&crate::data::SequenceRange| {
        let mut frames = range.start..range.start + range.length;
        frames.all(|t| is_zero([of[[t, 0]], of[[t, 1]]]))
    };
    let resting = sequences.iter().filter(rests).count();
    resting >= 2 && resting < sequences.len()
}

/// Whether hardly a position comes twice, as in measurements that are not rounded.
fn are_unique(positions: impl Iterator<Item = [f64; 2]>) -> bool {
    let finite = positions.filter(|p| p.iter().all(|v| v.is_finite()));
    let mut all: Vec<[u64; 2]> = finite.map(|p| p.map(f64::to_bits)).collect();
    let count = all.len();
    all.sort_unstable();
    all.dedup();
    all.len() as f64 >= UNIQUE * count as f64
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    values.sort_by(f64::total_cmp);
    values.get(middle).copied()
}
