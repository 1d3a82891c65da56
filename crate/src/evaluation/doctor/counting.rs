//! Frames and sequences that are counted from another number on one side than on the other.

use std::collections::{BTreeMap, HashMap};

use super::blocks::{Blocks, Comparison};
use super::finding::{Evidence, Finding, Problem, Remedy, Side};
use super::subject::Subject;
use crate::data::{Alignment, Layout, last_number};
use crate::track::FrameKey;

/// The most rows that are taken for missing at the beginning of every sequence.
const MOST_MISSING: u64 = 5;

pub(super) fn examine(subject: &Subject, blocks: &Blocks) -> Vec<Finding> {
    // What was shifted as asked for is settled.
    let Alignment {
        frames: by_frames,
        sequences: by_sequences,
    } = subject.alignment;
    let frames = (by_frames == 0).then(|| frames(subject, blocks));
    let sequences = (by_sequences == 0).then(|| sequences(subject, blocks));
    frames.into_iter().chain(sequences).flatten().collect()
}

/// The numbers of the frames of a sequence.
#[derive(Clone, Copy)]
struct Range {
    first: u64,
    last: u64,
    count: u64,
}

impl Range {
    fn is_complete(self) -> bool {
        self.last - self.first < self.count
    }
}

fn ranges(keys: &[FrameKey]) -> HashMap<&str, Range> {
    let mut found: HashMap<&str, Range> = HashMap::new();
    for FrameKey { sequence, frame } in keys {
        let range = found.entry(sequence).or_insert(Range {
            first: *frame,
            last: *frame,
            count: 0,
        });
        range.first = range.first.min(*frame);
        range.last = range.last.max(*frame);
        range.count += 1;
    }
    found
}

/// The sequences of the ground truth by those of the keypoints that they were matched to.
fn partners<'a>(subject: &Subject<'a>) -> BTreeMap<&'a str, &'a str> {
    let (left, right) = (subject.keypoints.keys(), subject.truth.keys());
    let pairs = subject.join.pairs.iter();
    pairs
        .map(|(z, x)| (left[*z].sequence.as_str(), right[*x].sequence.as_str()))
        .collect()
}

/// The value that all share.
fn common<T: PartialEq + Copy>(values: impl IntoIterator<Item = T>) -> Option<T> {
    let mut values = values.into_iter();
    let first = values.next()?;
    values.all(|value| value == first).then_some(first)
}

fn frames(subject: &Subject, blocks: &Blocks) -> Option<Finding> {
    let [left, right] = [subject.keypoints.keys(), subject.truth.keys()].map(ranges);
    let partners = partners(subject);
    let both: Vec<(Range, Range)> = partners
        .iter()
        .filter_map(|(z, x)| Some((*left.get(z)?, *right.get(x)?)))
        .collect();
    let (z, x) = common(both.iter().map(|(z, x)| (z.first, x.first)))?;
    let by = i64::try_from(i128::from(z) - i128::from(x)).ok()?;
    if by == 0 || !both.iter().all(|(z, x)| z.is_complete() && x.is_complete()) {
        return None;
    }
    let compared = blocks.compare(|row| blocks.later(row.z, by));
    let sequences = both.len();
    let are_alike = both.iter().all(|(z, x)| z.count == x.count);
    if are_alike && compared.is_none_or(|c| !c.is_refuted()) {
        let (first, last) = (both[0].0, both[0].1);
        let text = format!(
            "the rows run {} to {}, the frames {} to {}, in all {sequences} sequence(s): one side seems to count from \
             another number{}",
            last.first,
            last.last,
            first.first,
            first.last,
            errors(compared)
        );
        return Some(finding(
            text,
            compared,
            sequences,
            counted(subject, z, x, by)?,
        ));
    }
    let missing = x.checked_sub(z).filter(|n| *n <= MOST_MISSING)?;
    both.iter().all(|(z, x)| z.last == x.last).then(|| Finding {
        problem: Problem::FirstRows,
        text: format!(
            "the ground truth has no rows for the first {missing} frame(s) of all {sequences} sequence(s): it begins at \
             frame {x}, the keypoints at {z}"
        ),
        evidence: Evidence {
            count: sequences,
            of: sequences,
            ..Evidence::default()
        },
        remedies: Vec::new(),
    })
}

/// What makes frames that begin at `z` and rows that begin at `x` begin alike; None where a person
/// said what they begin with.
fn counted(subject: &Subject, z: u64, x: u64, by: i64) -> Option<Remedy> {
    let (side, first) = match by {
        -1 => (Side::Truth, x),
        1 => (Side::Keypoints, z),
        _ => return Some(Remedy::ShiftFrames { by }),
    };
    if subject.is_said(side, |reading| reading.index_base) {
        return None;
    }
    let base = subject.reading(side).filter(|reading| {
        let is_numbered = matches!(reading.layout, Layout::Arrays | Layout::Extraction);
        !is_numbered && first == 1
    });
    Some(match base {
        Some(reading) => Remedy::CountFrom {
            side,
            first: reading.index_base.value + 1,
            first_keypoint: (side == Side::Keypoints).then_some(reading.first_keypoint),
        },
        None => Remedy::ShiftFrames { by },
    })
}

/// Sequences whose numbers are one more on one side, and whose ends found no partner.
fn sequences(subject: &Subject, blocks: &Blocks) -> Option<Finding> {
    let [left, right] = [subject.keypoints.keys(), subject.truth.keys()].map(numbers);
    let (left, right) = (left?, right?);
    let are_numbered = partners(subject)
        .iter()
        .all(|(z, x)| last_number(z) == last_number(x));
    if left.len() < 2 || left.len() != right.len() || !are_numbered {
        return None;
    }
    let ends = |of: &BTreeMap<u64, &str>| Some((*of.keys().next()?, *of.keys().next_back()?));
    let ((z, z_last), (x, x_last)) = (ends(&left)?, ends(&right)?);
    let by = match (z.checked_sub(x), x.checked_sub(z)) {
        (Some(1), _) => 1,
        (_, Some(1)) => -1,
        _ => return None,
    };
    let is_shifted = |(z, x): (&u64, &u64)| x.checked_add_signed(by) == Some(*z);
    if !left.keys().zip(right.keys()).all(is_shifted) {
        return None;
    }
    let compared = blocks.compare(|row| {
        let key = &subject.truth.keys()[row.x];
        let number = last_number(&key.sequence)?.checked_add_signed(by)?;
        blocks.frame(left.get(&number)?, key.frame)
    });
    if compared.is_some_and(|c| c.is_refuted()) {
        return None;
    }
    let text = format!(
        "the sequences of the ground truth are numbered {x} to {x_last}, those of the keypoints {z} to {z_last}: one \
         side seems to count from another number{}",
        errors(compared)
    );
    Some(finding(
        text,
        compared,
        left.len(),
        Remedy::ShiftSequences { by },
    ))
}

/// The sequences by the number in their names, where each has another one.
fn numbers(keys: &[FrameKey]) -> Option<BTreeMap<u64, &str>> {
    let mut found = BTreeMap::new();
    for FrameKey { sequence, .. } in keys {
        let before = found.insert(last_number(sequence)?, sequence.as_str());
        if before.is_some_and(|before| before != sequence) {
            return None;
        }
    }
    Some(found)
}

/// What the remedy does to the error, in words.
fn errors(compared: Option<Comparison>) -> String {
    compared.map_or_else(String::new, |c| {
        format!(
            "; the error on held-out frames is {:.5} now and would be {:.5}",
            c.before, c.after
        )
    })
}

fn finding(
    text: String,
    compared: Option<Comparison>,
    sequences: usize,
    remedy: Remedy,
) -> Finding {
    Finding {
        problem: Problem::Counting,
        text,
        evidence: Evidence {
            before: compared.map(|c| c.before),
            after: compared.map(|c| c.after),
            count: sequences,
            of: sequences,
        },
        remedies: vec![remedy],
    }
}
