//! Positions of exactly (0, 0) or (-1, -1), as detectors write what they did not find.

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

/// What stands for a point that was not found.
#[derive(Clone, Copy, PartialEq)]
enum Mark {
    Zero,
    MinusOne,
}

impl Mark {
    /// Whether this is what the mark became when a coordinate was read.
    fn is(self, v: f64, space: Space, is_flipped: bool) -> bool {
        let v = if is_flipped { -v } else { v };
        match (space, self) {
            (Space::Ndc | Space::World, Self::Zero) => v == 0.0,
            (Space::Ndc | Space::World, Self::MinusOne) => v == -1.0,
            (Space::Fraction, Self::Zero) => v == -1.0,
            (Space::Fraction, Self::MinusOne) => v == -3.0,
            (Space::Pixels, Self::Zero) => is_pixel(v, 1.0),
            (Space::Pixels, Self::MinusOne) => is_pixel(v, -1.0),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Zero => "(0, 0)",
            Self::MinusOne => "(-1, -1)",
        }
    }
}

pub(super) fn examine(subject: &Subject) -> Vec<Finding> {
    let sides = [Side::Truth, Side::Keypoints];
    let cases = [Mark::Zero, Mark::MinusOne].map(|mark| sides.map(|side| (mark, side)));
    let found = cases.as_flattened().iter();
    found
        .filter_map(|(mark, side)| of(subject, *mark, *side))
        .collect()
}

fn of(subject: &Subject, mark: Mark, side: Side) -> Option<Finding> {
    let reading = subject.reading(side)?;
    let is_settled = mark == Mark::Zero && subject.is_said(side, |r| r.zero_is_missing);
    if is_settled || reading.layout == Layout::Extraction {
        return None;
    }
    let (keys, points) = match side {
        Side::Truth => (subject.truth.keys(), subject.truth.points_ndc()),
        Side::Keypoints => (subject.keypoints.keys(), subject.keypoints.points()),
    };
    let flip = reading.flip.value.axes();
    let space = reading.space.value;
    let is_mark = |p: [f64; 2]| (0..2).all(|axis| mark.is(p[axis], space, flip[axis]));
    let (count, affected) = stray(keys, points, is_mark);
    if affected == 0 {
        return None;
    }
    let of = points.dim().0 * points.dim().1;
    let what = match side {
        Side::Truth => "object(s)",
        Side::Keypoints => "keypoint(s)",
    };
    let remedies = match mark {
        Mark::Zero => vec![Remedy::ZeroIsMissing { side }],
        Mark::MinusOne => Vec::new(),
    };
    let advice = match mark {
        Mark::Zero => "",
        Mark::MinusOne => "; leave such cells empty",
    };
    Some(Finding {
        problem: Problem::Zeros,
        text: format!(
            "{count} of {of} positions of {} are exactly {}, and {affected} {what} jump there and back: many \
             programs write that for a point that they did not find{advice}",
            side.words(),
            mark.name()
        ),
        evidence: Evidence {
            count,
            of,
            ..Evidence::default()
        },
        remedies,
    })
}

/// Whether this is what a pixel of an image of some size becomes: pixel 0 for the distance 1, of its
/// centre from the edge in half pixels, pixel -1 for -1.
fn is_pixel(v: f64, distance: f64) -> bool {
    let size = distance / (v + 1.0);
    (1.0..=1e5).contains(&size) && (size - size.round()).abs() < 1e-6 * size && {
        distance / size.round() - 1.0 == v
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
