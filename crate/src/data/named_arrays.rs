//! Objects that a person names, each with the array of its positions: robots are recorded with the
//! positions of objects and grippers under the names of their sensors.

use std::ops::Range;

use ndarray::{Array3, Axis, concatenate, s};

use super::arrays::{ArrayFile, check_declared, listed};
use super::memory::PointSequences;
use super::points::{episode_names, floats, keys, sequence_names};
use super::reading::{Parsed, TableOptions};
use super::sequences::{Sequences, Within};
use super::table::Columns;
use crate::error::{Error, Reason, Result};
use crate::track::{GroundTruth, MOST_AXES};

/// The positions of an object: an array, or some numbers of its last axis, as `obs/object[0:3]`.
struct Part {
    array: String,
    numbers: Option<Range<usize>>,
}

impl Part {
    fn parse(text: &str) -> Result<Self> {
        let Some((array, rest)) = text.split_once('[') else {
            return Ok(Self {
                array: text.to_owned(),
                numbers: None,
            });
        };
        let range = rest.strip_suffix(']').and_then(|range| {
            let (start, end) = range.split_once(':')?;
            let (start, end) = (start.trim().parse().ok()?, end.trim().parse().ok()?);
            (start < end).then_some(start..end)
        });
        let numbers = range.ok_or_else(|| {
            Error::input(format!(
                "`{text}` does not say which numbers of an array; expected e.g. obs/object[0:3]"
            ))
        })?;
        Ok(Self {
            array: array.to_owned(),
            numbers: Some(numbers),
        })
    }

    /// The positions in a file or a group, sequences x frames x coordinates.
    fn read(&self, file: &Within, sequences: &Sequences) -> Result<Array3<f64>> {
        let name = &self.array;
        let info = file.info(name)?.ok_or_else(|| {
            let names = file.names().unwrap_or_default();
            Error::input(format!(
                "there is no array `{name}`, found {}",
                listed(&names)
            ))
        })?;
        let wrong = || {
            Error::input(format!(
                "`{name}` ({}, shape {:?}) holds no positions of one object; expected [T, 2] or \
                 [T, 3], or some of \
                 its numbers, as {name}[0:3]",
                info.dtype, info.shape
            ))
        };
        let sizes = sizes(&info.shape, sequences).ok_or_else(wrong)?;
        if info.kind.is_none() {
            return Err(wrong());
        }
        if let Some(size) = file.size() {
            let declared = sizes.iter().fold(8, |all: u64, n| all.saturating_mul(*n));
            check_declared(declared, size, &format!("`{name}`"))?;
        }
        let values = floats(file.read(name, &[])?);
        let values = Array3::from_shape_vec(sizes.map(|n| n as usize), values);
        let values = values.map_err(|_| wrong())?;
        let numbers = self.numbers.clone().unwrap_or(0..values.dim().2);
        if !(2..=MOST_AXES).contains(&numbers.len()) || numbers.end > values.dim().2 {
            return Err(wrong());
        }
        Ok(values.slice(s![.., .., numbers]).to_owned())
    }
}

/// The most numbers of a frame in which positions are looked for: more are an image or a map.
const MOST_NUMBERS: u64 = 256;

/// The arrays that may hold positions, with their shapes, as [`ground_truth`] names them: numbers,
/// some of each frame. Of episodes those of the first.
pub(super) fn candidates(file: &dyn ArrayFile) -> Result<Vec<(String, Vec<u64>)>> {
    let sequences = Sequences::of(file)?;
    let group = match &sequences {
        Sequences::Axis => "",
        Sequences::Groups(episodes) => &episodes[0].path,
        Sequences::Ends { group, .. } => group,
    };
    let group = group.to_owned();
    let place = Within { file, group };
    let mut found = Vec::new();
    for name in sequences.names(file)? {
        let Some(info) = place.info(&name)? else {
            continue;
        };
        let numbers = sizes(&info.shape, &sequences).map(|[.., numbers]| numbers);
        let is_few = numbers.is_some_and(|numbers| (2..=MOST_NUMBERS).contains(&numbers));
        if is_few && info.kind.is_some() {
            found.push((name, info.shape));
        }
    }
    Ok(found)
}

/// Sequences, frames and numbers of an array of this shape; `None` where it has other axes.
fn sizes(shape: &[u64], sequences: &Sequences) -> Option<[u64; 3]> {
    match *shape {
        [t, n] | [t, 1, n] => Some([1, t, n]),
        [s, t, n] if !sequences.have_one_each() => Some([s, t, n]),
        _ => None,
    }
}

/// The objects that `columns` names, each with its array, as `eef=obs/robot0_eef_pos`; of
/// robomimic's episodes the arrays of each, of a replay buffer those of its group.
///
/// # Errors
/// When an array is not there or holds no positions, and when positions in the image have no unit.
pub(super) fn ground_truth(
    file: &dyn ArrayFile,
    columns: &Columns,
    options: &TableOptions,
) -> Result<Parsed<GroundTruth>> {
    let named = Named::read(file, columns)?;
    if options.space.is_none() && (options.xy_only || named.is_flat()) {
        return Err(Error::input(
            "the file does not say in which unit the positions of these arrays are; expected the \
             unit",
        )
        .because(Reason::UnknownUnit));
    }
    named.into_truth(options)
}

/// As [`ground_truth`], of positions that stay as they are, whatever their unit.
///
/// # Errors
/// When an array is not there or holds no positions.
pub(super) fn as_they_are(file: &dyn ArrayFile, columns: &Columns) -> Result<GroundTruth> {
    let Named {
        objects,
        sequences,
        positions,
    } = Named::read(file, columns)?;
    let views: Vec<_> = positions.iter().map(|one| one.view()).collect();
    let lengths: Vec<usize> = positions.iter().map(|one| one.dim().0).collect();
    let points = concatenate(Axis(0), &views).map_err(|e| Error::mismatch(e.to_string()))?;
    GroundTruth::new(keys(&sequences, &lengths), objects, points)
}

/// Objects by name with their positions.
struct Named {
    objects: Vec<String>,
    sequences: Vec<String>,
    /// Of each sequence: frames x objects x coordinates.
    positions: Vec<Array3<f64>>,
}

impl Named {
    /// Whether some have no z.
    fn is_flat(&self) -> bool {
        self.positions.iter().any(|one| one.dim().2 == 2)
    }

    fn into_truth(self, options: &TableOptions) -> Result<Parsed<GroundTruth>> {
        let views: Vec<_> = self.positions.iter().map(|one| one.view()).collect();
        let mut points = PointSequences::new("columns", &views, None, options)?;
        points.name_sequences(self.sequences);
        points.into_truth(Some(self.objects))
    }

    fn read(file: &dyn ArrayFile, columns: &Columns) -> Result<Self> {
        let sequences = Sequences::of(file)?;
        let mut names = Vec::new();
        let mut parts = Vec::new();
        for (name, array) in columns.pairs() {
            names.push(name.to_owned());
            parts.push(Part::parse(array)?);
        }
        let read = |group: &str| -> Result<Vec<Array3<f64>>> {
            let group = group.to_owned();
            let file = Within { file, group };
            let objects: Result<Vec<_>> = parts
                .iter()
                .map(|part| part.read(&file, &sequences))
                .collect();
            together(&objects?, &names)
        };
        let (sequences, positions) = match &sequences {
            Sequences::Axis => {
                let all = read("")?;
                (sequence_names(all.len()), all)
            }
            Sequences::Groups(episodes) => {
                let mut all = Vec::new();
                for episode in episodes {
                    let one =
                        read(&episode.path).map_err(|e| e.at(format!("`{}`", episode.path)))?;
                    all.extend(one);
                }
                (episodes.iter().map(|one| one.name.clone()).collect(), all)
            }
            Sequences::Ends { group, lengths } => {
                let whole = read(group)?;
                (episode_names(lengths.len()), divided(&whole[0], lengths)?)
            }
        };
        Ok(Self {
            objects: names,
            sequences,
            positions,
        })
    }
}

/// The objects of every sequence: frames x objects x coordinates.
fn together(objects: &[Array3<f64>], names: &[String]) -> Result<Vec<Array3<f64>>> {
    let Some(first) = objects.first() else {
        return Err(Error::input(
            "no object is named; expected e.g. eef=obs/robot0_eef_pos",
        ));
    };
    let (count, frames, axes) = first.dim();
    if let Some((other, name)) = objects
        .iter()
        .zip(names)
        .find(|(o, _)| o.dim() != first.dim())
    {
        return Err(Error::mismatch(format!(
            "`{}` has positions of shape {:?}, `{name}` of {:?}; expected the same sequences, \
             frames and coordinates",
            names[0],
            first.shape(),
            other.shape()
        )));
    }
    let mut all = vec![Array3::zeros((frames, objects.len(), axes)); count];
    for (k, object) in objects.iter().enumerate() {
        for (to, from) in all.iter_mut().zip(object.outer_iter()) {
            to.index_axis_mut(Axis(1), k).assign(&from);
        }
    }
    Ok(all)
}

/// The rows of all episodes as those of each.
fn divided(rows: &Array3<f64>, lengths: &[usize]) -> Result<Vec<Array3<f64>>> {
    let all: usize = lengths.iter().sum();
    if rows.dim().0 != all {
        return Err(Error::input(format!(
            "the arrays have {} rows, and the last episode ends at {all}; expected as many",
            rows.dim().0
        )));
    }
    let mut start = 0;
    let mut next = |length: &usize| {
        start += length;
        rows.slice(s![start - length..start, .., ..]).to_owned()
    };
    Ok(lengths.iter().map(&mut next).collect())
}
