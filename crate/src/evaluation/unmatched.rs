//! Frames or rows without a partner, by sequence.

use std::fmt::Write as _;

use serde::Serialize;

use crate::track::FrameKey;

/// The frames of a sequence that found no partner.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct UnmatchedSequence {
    /// The name of the sequence.
    pub sequence: String,
    /// How many there are.
    pub count: usize,
    /// Their numbers, e.g. `0–4, 7`.
    pub frames: String,
}

/// The frames of `keys` at `positions` (ascending), by sequence.
pub fn unmatched_sequences(keys: &[FrameKey], positions: &[usize]) -> Vec<UnmatchedSequence> {
    let same = |a: &usize, b: &usize| keys[*a].sequence == keys[*b].sequence;
    let sequences = positions.chunk_by(same);
    sequences
        .map(|run| UnmatchedSequence {
            sequence: keys[run[0]].sequence.clone(),
            count: run.len(),
            frames: ranges(run.iter().map(|i| keys[*i].frame)),
        })
        .collect()
}

fn ranges(numbers: impl Iterator<Item = u64>) -> String {
    let mut numbers: Vec<u64> = numbers.collect();
    numbers.sort_unstable();
    let mut text = String::new();
    for run in numbers.chunk_by(|a, b| a + 1 == *b) {
        let comma = if text.is_empty() { "" } else { ", " };
        // Writing to a String cannot fail.
        let _ = match run {
            [one] => write!(text, "{comma}{one}"),
            _ => write!(text, "{comma}{}–{}", run[0], run[run.len() - 1]),
        };
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unmatched_frames_are_listed_by_sequence_with_ranges() {
        let key = |sequence: &str, frame| FrameKey {
            sequence: sequence.to_owned(),
            frame,
        };
        let keys = [
            key("a", 0),
            key("a", 1),
            key("a", 3),
            key("b", 7),
            key("b", 8),
            key("b", 9),
        ];
        let found = unmatched_sequences(&keys, &[0, 1, 2, 3, 5]);
        let found: Vec<_> = found
            .iter()
            .map(|s| (s.sequence.as_str(), s.count, s.frames.as_str()))
            .collect();
        assert_eq!(found, [("a", 3, "0–1, 3"), ("b", 2, "7, 9")]);
    }
}
