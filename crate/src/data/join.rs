//! Which frame belongs to which row.

use std::collections::{HashMap, HashSet};

use super::names::last_number;
use crate::error::{Error, Reason, Result};
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

/// What is added to the numbers of the rows before they are matched to frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Alignment {
    /// To the numbers of the frames.
    pub frames: i64,
    /// To the numbers in the names of the sequences, which then match by number only.
    pub sequences: i64,
}

impl Alignment {
    /// What this alignment does, in words; empty where it does nothing.
    fn rules(self) -> Vec<String> {
        let shifted = [("frame", self.frames), ("sequence", self.sequences)];
        let shifted = shifted.into_iter().filter(|(_, by)| *by != 0);
        shifted
            .map(|(what, by)| {
                format!("{by} was added to the {what} numbers of the ground truth, as asked for")
            })
            .collect()
    }
}

/// Joins by (sequence, frame number).
///
/// Sequences match by name, the others by the last number in the name (`seq_0012` = `12`) where no
/// other has it; a single sequence on either side matches the other whatever the names. Nothing is
/// ever matched by position, which would silently pair the wrong ones when a folder is missing.
///
/// # Errors
/// When no frame matches; the message shows names of both sides.
pub fn join(left: &[FrameKey], right: &[FrameKey]) -> Result<Join> {
    join_aligned(left, right, Alignment::default())
}

/// As [`join`], with rows whose numbers are changed.
///
/// # Errors
/// As [`join`].
pub fn join_aligned(left: &[FrameKey], right: &[FrameKey], alignment: Alignment) -> Result<Join> {
    let (names_left, names_right) = (sequences(left), sequences(right));
    let mut out = Join {
        rules: alignment.rules(),
        ..Join::default()
    };
    let partner = match_sequences(
        &names_left,
        &names_right,
        alignment.sequences,
        &mut out.rules,
    );
    let mut rows: HashMap<(&str, u64), usize> = HashMap::with_capacity(right.len());
    for (i, key) in right.iter().enumerate() {
        rows.insert((key.sequence.as_str(), key.frame), i);
    }
    let mut taken = vec![false; right.len()];
    for (i, key) in left.iter().enumerate() {
        let row = partner
            .get(key.sequence.as_str())
            .zip(before(key.frame, alignment.frames))
            .and_then(|(sequence, frame)| rows.get(&(*sequence, frame)))
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
        let error = nothing_matches(
            [left, right],
            [names_left.len(), names_right.len()],
            &out.rules,
        );
        let missing = (alignment == Alignment::default())
            .then(|| missing_alignment(left, right, &partner))
            .flatten();
        return Err(match missing {
            Some(Alignment { frames, sequences }) => {
                error.because(Reason::OtherNumbers { frames, sequences })
            }
            None => error,
        });
    }
    let start = |keys: &[FrameKey], side: &[usize]| side.iter().map(|i| keys[*i].frame).min();
    let shifted = start(left, &out.unmatched_left) > start(right, &out.unmatched_right)
        && alignment.frames == 0;
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

/// The error of frames and rows, in so many sequences, of which none match.
fn nothing_matches(
    [left, right]: [&[FrameKey]; 2],
    sequences: [usize; 2],
    rules: &[String],
) -> Error {
    let example = |keys: &[FrameKey]| {
        keys.first().map_or_else(
            || "nothing".to_owned(),
            |k| format!("`{}` frame {}", k.sequence, k.frame),
        )
    };
    let rules: String = rules.iter().map(|rule| format!(". {rule}")).collect();
    Error::mismatch(format!(
        "no frame has a row of ground truth: the frames are {} in {} sequences (first: {}), the rows {} in {} (first: \
         {}); expected the same sequence names or numbers, and frame numbers{rules}",
        left.len(),
        sequences[0],
        example(left),
        right.len(),
        sequences[1],
        example(right),
    ))
}

/// What makes most frames match that do not match as they are: one number for all frames, or one
/// for all sequences.
fn missing_alignment(
    left: &[FrameKey],
    right: &[FrameKey],
    partner: &HashMap<&str, &str>,
) -> Option<Alignment> {
    let frames = |keys: &[FrameKey], name: &str| {
        let of = keys.iter().filter(|key| key.sequence == name);
        of.map(|key| key.frame).min()
    };
    let shift = |to: u64, from: u64| i64::try_from(i128::from(to) - i128::from(from)).ok();
    let alignment = match partner.iter().min() {
        Some((a, b)) => Alignment {
            frames: shift(frames(left, a)?, frames(right, b)?)?,
            sequences: 0,
        },
        None => {
            let first = |keys| {
                let names = sequences(keys);
                names.iter().filter_map(|name| last_number(name)).min()
            };
            Alignment {
                frames: 0,
                sequences: shift(first(left)?, first(right)?)?,
            }
        }
    };
    let is_new = alignment != Alignment::default();
    let join = is_new
        .then(|| join_aligned(left, right, alignment).ok())
        .flatten()?;
    (2 * join.pairs.len() >= left.len().min(right.len())).then_some(alignment)
}

/// The number that becomes `number` when `by` is added to it; None where there is none.
fn before(number: u64, by: i64) -> Option<u64> {
    u64::try_from(i128::from(number) - i128::from(by)).ok()
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
    shift: i64,
    rules: &mut Vec<String>,
) -> HashMap<&'a str, &'a str> {
    let by_name: HashSet<&str> = match shift {
        0 => right.iter().copied().collect(),
        _ => HashSet::new(),
    };
    let mut pairs: HashMap<&str, &str> = left
        .iter()
        .filter(|s| by_name.contains(*s))
        .map(|s| (*s, *s))
        .collect();
    if !pairs.is_empty() {
        rules.push("sequences matched by name".to_owned());
    }
    let rest = |names: &[&'a str]| -> Vec<&'a str> {
        names
            .iter()
            .copied()
            .filter(|s| !pairs.contains_key(s))
            .collect()
    };
    let (a, b) = (
        by_number(&rest(left), rules),
        by_number(&rest(right), rules),
    );
    let found: Vec<(u64, &str, &str)> = a
        .iter()
        .filter_map(|(n, s)| Some((*n, *s, *b.get(&before(*n, shift)?)?)))
        .collect();
    if let Some((_, a, b)) = found.iter().min() {
        rules.push(format!(
            "sequences matched by the number in their name (`{a}` = `{b}`)"
        ));
    }
    pairs.extend(found.iter().map(|(_, a, b)| (*a, *b)));
    if pairs.is_empty()
        && shift == 0
        && let ([a], [b]) = (left, right)
    {
        rules.push(format!(
            "the only sequence on either side was matched (`{a}` = `{b}`)"
        ));
        pairs.insert(a, b);
    }
    pairs
}

/// The names with a number that no other has.
fn by_number<'a>(names: &[&'a str], rules: &mut Vec<String>) -> HashMap<u64, &'a str> {
    let mut found: HashMap<u64, Vec<&str>> = HashMap::new();
    for name in names {
        if let Some(number) = last_number(name) {
            found.entry(number).or_default().push(name);
        }
    }
    let mut single = HashMap::new();
    let mut shared = Vec::new();
    for (number, names) in found {
        match names[..] {
            [name] => {
                single.insert(number, name);
            }
            _ => shared.push((number, names)),
        }
    }
    if let Some((number, names)) = shared.iter().min() {
        rules.push(format!(
            "`{}` and `{}` both have the number {number}: sequences that share a number are not matched by it",
            names[0], names[1]
        ));
    }
    single
}
