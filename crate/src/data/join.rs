//! Which frame belongs to which row.

use std::collections::{HashMap, HashSet};

use super::frames::last_number;
use crate::error::{Error, Result};
use crate::track::FrameKey;

/// Frames (left) joined to rows of a ground truth (right), with what found no partner.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Join {
    /// Positions of partners, in the order of the left side.
    pub pairs: Vec<(usize, usize)>,
    /// Positions on the left without a partner.
    pub unmatched_left: Vec<usize>,
    /// Positions on the right without a partner.
    pub unmatched_right: Vec<usize>,
    /// How sequences were matched, and what looks odd, in words.
    pub rules: Vec<String>,
}

/// Joins by (sequence, frame number).
///
/// Sequences match by name; where no name matches, by the last number in the name (`seq_0012` = `12`); a single
/// sequence on either side matches the other whatever the names. Nothing is ever matched by position, which
/// would silently pair the wrong ones when a folder is missing.
///
/// # Errors
/// When no frame matches; the message shows names of both sides.
pub fn join(left: &[FrameKey], right: &[FrameKey]) -> Result<Join> {
    let (names_left, names_right) = (sequences(left), sequences(right));
    let mut out = Join::default();
    let partner = match_sequences(&names_left, &names_right, &mut out.rules);
    let mut rows: HashMap<(&str, u64), usize> = HashMap::with_capacity(right.len());
    for (i, key) in right.iter().enumerate() {
        rows.insert((key.sequence.as_str(), key.frame), i);
    }
    let mut taken = vec![false; right.len()];
    for (i, key) in left.iter().enumerate() {
        let row = partner
            .get(key.sequence.as_str())
            .and_then(|sequence| rows.get(&(*sequence, key.frame)))
            .filter(|row| !taken[**row]);
        match row {
            Some(&row) => {
                taken[row] = true;
                out.pairs.push((i, row));
            }
            None => out.unmatched_left.push(i),
        }
    }
    out.unmatched_right = (0..right.len()).filter(|i| !taken[*i]).collect();
    if out.pairs.is_empty() {
        let example = |keys: &[FrameKey]| {
            keys.first().map_or_else(
                || "nothing".to_owned(),
                |k| format!("`{}` frame {}", k.sequence, k.frame),
            )
        };
        return Err(Error::mismatch(format!(
            "no frame has a row of ground truth: the frames are {} in {} sequences (first: {}), the rows {} in {} \
             (first: {}); expected the same sequence names or numbers, and frame numbers",
            left.len(),
            names_left.len(),
            example(left),
            right.len(),
            names_right.len(),
            example(right),
        )));
    }
    let start = |keys: &[FrameKey], side: &[usize]| side.iter().map(|i| keys[*i].frame).min();
    let shifted = start(left, &out.unmatched_left) > start(right, &out.unmatched_right);
    let first = |keys: &[FrameKey]| keys.iter().map(|k| k.frame).min().unwrap_or_default();
    if shifted && first(left) == first(right) + 1 && !out.unmatched_right.is_empty() {
        out.rules.push(format!(
            "the frames count from {} and the rows from {}: if they mean the same frames, renumber one side; nothing \
             was shifted",
            first(left),
            first(right)
        ));
    }
    Ok(out)
}

fn sequences(keys: &[FrameKey]) -> Vec<&str> {
    let mut seen = HashSet::new();
    keys.iter()
        .map(|k| k.sequence.as_str())
        .filter(|s| seen.insert(*s))
        .collect()
}

fn match_sequences<'a>(
    left: &[&'a str],
    right: &[&'a str],
    rules: &mut Vec<String>,
) -> HashMap<&'a str, &'a str> {
    let by_name: HashSet<&str> = right.iter().copied().collect();
    let same: HashMap<&str, &str> = left
        .iter()
        .filter(|s| by_name.contains(*s))
        .map(|s| (*s, *s))
        .collect();
    if !same.is_empty() {
        rules.push("sequences matched by name".to_owned());
        return same;
    }
    let numbered = |names: &[&'a str]| -> Option<HashMap<u64, &'a str>> {
        let map: HashMap<u64, &str> = names.iter().filter_map(|s| Some((last_number(s)?, *s))).collect();
        (map.len() == names.len()).then_some(map)
    };
    if let (Some(a), Some(b)) = (numbered(left), numbered(right)) {
        let pairs: HashMap<&str, &str> = a.iter().filter_map(|(n, s)| Some((*s, *b.get(n)?))).collect();
        if let Some((a, b)) = left.iter().find_map(|s| Some((s, pairs.get(s)?))) {
            rules.push(format!(
                "sequences matched by the number in their name (`{a}` = `{b}`)"
            ));
            return pairs;
        }
    }
    if let ([a], [b]) = (left, right) {
        rules.push(format!(
            "the only sequence on either side was matched (`{a}` = `{b}`)"
        ));
        return HashMap::from([(*a, *b)]);
    }
    HashMap::new()
}
