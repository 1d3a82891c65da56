//! Axes that are swapped or run the other way.
//!
//! An affine map takes up either without a word. So maps are fitted that only scale and shift an
//! axis, with the axes as they are and in each of the seven other orientations.

use super::blocks::{Blocks, Model, Orientation};
use super::finding::{Evidence, Finding, Problem, Remedy, Side};
use super::subject::Subject;
use crate::data::{AxisOrder, Flip, Ground, Layout};

/// The share of its variance up to which an object is followed in an orientation.
const FOLLOWED: f64 = 0.2;
/// The error in another orientation, relative to the error as things are, up to which the axes are
/// worth a word.
const LARGE: f64 = 0.25;
/// Errors this close are alike: where an object moves along one axis only, the other may point
/// either way.
const ALIKE: f64 = 1.05;

pub(super) fn examine(subject: &Subject, blocks: &Blocks) -> Option<Finding> {
    // Those with the fewest changes come first.
    let mut others = vec![Orientation::default()];
    for flip in [[false, true], [true, false], [true, true]] {
        others.push(Orientation { swap: false, flip });
    }
    for flip in [[false, false], [false, true], [true, false], [true, true]] {
        others.push(Orientation { swap: true, flip });
    }
    let models: Vec<Model> = others.iter().map(|o| Model::Oriented(*o)).collect();
    let errors = blocks.errors_under(&models);
    let as_is = &errors[0];
    if !as_is.explained(FOLLOWED).is_empty() {
        return None;
    }
    let compared: Vec<_> = others
        .iter()
        .zip(&errors)
        .skip(1)
        .filter_map(|(orientation, errors)| Some((*orientation, errors.against(as_is, FOLLOWED)?)))
        .collect();
    let best = compared
        .iter()
        .map(|(_, c)| c.ratio)
        .min_by(f64::total_cmp)?;
    let (orientation, found) = compared.iter().find(|(_, c)| c.ratio <= ALIKE * best)?;
    if found.ratio > LARGE || !found.is_significant() {
        return None;
    }
    let Orientation { swap, flip } = *orientation;
    let side = side(subject, swap)?;
    Some(Finding {
        problem: Problem::Axes,
        text: format!(
            "{} {} relative to {}: an affine map would hide it. With maps that only scale and shift, the error on held-out \
             frames is {:.5} as it is and {:.5} without, smaller in {} of {} stretches",
            side.words(),
            words(swap, flip),
            match side {
                Side::Truth => Side::Keypoints.words(),
                Side::Keypoints => Side::Truth.words(),
            },
            found.before,
            found.after,
            found.votes,
            found.of
        ),
        evidence: Evidence {
            before: Some(found.before),
            after: Some(found.after),
            count: found.votes,
            of: found.of,
        },
        remedies: vec![remedy(subject, side, *orientation)],
    })
}

/// How the axes of a table are to be read, given how they are read now.
fn remedy(subject: &Subject, side: Side, Orientation { swap, flip }: Orientation) -> Remedy {
    // What the keypoints need undone, the ground truth needs done.
    let flip = match (side, swap) {
        (Side::Truth, true) => [flip[1], flip[0]],
        _ => flip,
    };
    let reading = subject.reading(side);
    let is_swapped = reading.is_some_and(|reading| reading.axes.value == AxisOrder::Yx);
    let [x, y] = reading
        .map(|reading| reading.flip.value)
        .unwrap_or_default()
        .axes();
    let now = if swap { [y, x] } else { [x, y] };
    Remedy::Axes {
        side,
        order: match is_swapped != swap {
            true => AxisOrder::Yx,
            false => AxisOrder::Xy,
        },
        flip: Flip::of([now[0] != flip[0], now[1] != flip[1]]),
    }
}

/// The table whose axes are to be read another way: the keypoints, unless they were extracted here
/// or a person said how theirs are; None where both are settled.
fn side(subject: &Subject, swap: bool) -> Option<Side> {
    let is_open = |side: Side| {
        let Some(reading) = subject.reading(side) else {
            return true;
        };
        let is_extraction = reading.layout == Layout::Extraction;
        let is_said = match swap {
            true => reading.axes.by == Ground::Said,
            false => reading.flip.by == Ground::Said,
        };
        !is_extraction && !is_said
    };
    [Side::Keypoints, Side::Truth]
        .into_iter()
        .find(|side| is_open(*side))
}

fn words(swap: bool, flip: [bool; 2]) -> &'static str {
    match (swap, flip) {
        (false, [true, true]) => "are turned by 180 degrees: x and y run the other way",
        (false, [true, false]) => "have an x that runs the other way",
        (false, _) => "have a y that runs the other way",
        (true, [false, false]) => "have x and y swapped",
        (true, [true, true]) => "have x and y swapped and running the other way",
        (true, _) => "are turned by 90 degrees: x and y are swapped, and one runs the other way",
    }
}
