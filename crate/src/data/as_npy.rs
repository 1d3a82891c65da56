//! Points of an HDF5 or Zarr file as arrays of numpy, which are read as those of an NPZ file.

use super::arrays::{
    ArrayFile, CONFIDENCES, ENDS, FRAMES, NODES, POINTS, TRACKS, Values, Y_FIRST, find,
};
use super::export::Export;
use super::named_arrays;
use super::npy::{self, NpyArray};
use super::points::{self, missing, no_numbers};
use super::reading::{AxisOrder, Notice, TableOptions};
use super::sequences::{Sequences, Within};
use super::table::{Columns, ground_truth_csv};
use crate::error::Result;
use crate::track::GroundTruth;

/// What a file of arrays holds of points.
#[derive(Debug)]
pub enum StoredPoints {
    /// A table, which its program keeps as records.
    Table(Export),
    /// Arrays.
    Arrays {
        /// Those that points are read from.
        arrays: Vec<NpyArray>,
        /// Whether there are frames as well, which are left out.
        has_frames: bool,
    },
}

/// An HDF5 file or a Zarr hierarchy, of whose points a person may still have to say what they are.
pub struct PointFile(Box<dyn ArrayFile>);

impl PointFile {
    pub(super) fn new(file: Box<dyn ArrayFile>) -> Self {
        Self(file)
    }

    /// The points.
    ///
    /// # Errors
    /// When there are none, or they cannot be read.
    pub fn stored(&self) -> Result<StoredPoints> {
        let file = &*self.0;
        let (group, ends) = match Sequences::of(file)? {
            Sequences::Ends { group, lengths } => (group.to_owned(), Some(lengths)),
            Sequences::Axis | Sequences::Groups(_) => (String::new(), None),
        };
        let place = Within { file, group };
        if has_points(&place)? {
            let mut arrays = arrays(&place)?;
            arrays.extend(ends.map(|lengths| ends_of(&lengths)));
            return Ok(StoredPoints::Arrays {
                arrays,
                has_frames: find(file, &FRAMES)?.is_some(),
            });
        }
        if let Some(table) = file.export()? {
            return Ok(StoredPoints::Table(table));
        }
        // Those of episodes that lie in groups of their own are no arrays of the file.
        let points = points::ground_truth(file, &TableOptions::default())?;
        let table = table_of(&points.content, points.notices);
        Ok(StoredPoints::Table(table))
    }

    /// The arrays that may hold the positions of objects, with their shapes: all of numbers, of a
    /// few a frame. Of episodes those of the first.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn candidates(&self) -> Result<Vec<(String, Vec<u64>)>> {
        named_arrays::candidates(&*self.0)
    }

    /// The positions of the objects that `columns` names, each with its array, as
    /// `eef=obs/robot0_eef_pos` and `block=state[2:4]`: a table of them as they are, in a unit that
    /// the file does not say.
    ///
    /// # Errors
    /// When an array is not there, or holds no positions.
    pub fn named(&self, columns: &Columns) -> Result<Export> {
        let truth = named_arrays::as_they_are(&*self.0, columns)?;
        Ok(table_of(&truth, Vec::new()))
    }
}

fn table_of(truth: &GroundTruth, notices: Vec<Notice>) -> Export {
    Export {
        table: ground_truth_csv(truth).into_bytes(),
        space: None,
        notices,
    }
}

/// Whether a file has an array of points.
pub(super) fn has_points(file: &dyn ArrayFile) -> Result<bool> {
    find(file, &POINTS).map(|found| found.is_some())
}

/// The arrays that points are read from, as numpy's; those of an NPZ file that holds the same.
fn arrays(file: &dyn ArrayFile) -> Result<Vec<NpyArray>> {
    let Some((name, info)) = find(file, &POINTS)? else {
        return Err(missing(file)?);
    };
    if info.kind.is_none() {
        return Err(no_numbers(name, &info.dtype));
    }
    let mut arrays = Vec::new();
    for name in POINTS.iter().chain(&CONFIDENCES) {
        let Some(info) = file.info(name)? else {
            continue;
        };
        if info.kind.is_none() {
            continue;
        }
        let shape: Vec<usize> = info.shape.iter().map(|n| *n as usize).collect();
        let (dtype, bytes) = elements(&file.read(name, &[])?);
        arrays.push(array(name, &dtype, &shape, &bytes));
    }
    let names = file.point_names().ok().flatten();
    let texts = [NODES, TRACKS].map(|name| (name, file.strings(name).ok()));
    for (name, texts) in std::iter::once(("names", names)).chain(texts) {
        if let Some(texts) = texts {
            let (dtype, bytes) = npy::texts(&texts)?;
            arrays.push(array(name, &dtype, &[texts.len()], &bytes));
        }
    }
    if let Some(axes) = file.axes() {
        let is = u8::from(axes == AxisOrder::Yx);
        arrays.push(array(Y_FIRST, "|u1", &[], &[is]));
    }
    Ok(arrays)
}

/// Where episodes of these lengths end.
fn ends_of(lengths: &[usize]) -> NpyArray {
    let ends = lengths.iter().scan(0_u64, |end, length| {
        *end += *length as u64;
        Some(*end)
    });
    let bytes: Vec<u8> = ends.flat_map(u64::to_le_bytes).collect();
    array(ENDS, "<u8", &[lengths.len()], &bytes)
}

/// A whole array of numpy type `dtype`, its elements row by row.
fn array(name: &str, dtype: &str, shape: &[usize], elements: &[u8]) -> NpyArray {
    let mut bytes = npy::header(dtype, shape);
    bytes.extend(elements);
    NpyArray {
        name: name.to_owned(),
        size: bytes.len() as u64,
        bytes,
    }
}

/// The type and the elements of an array of numbers.
fn elements(values: &Values) -> (String, Vec<u8>) {
    let (dtype, bytes) = match values {
        Values::U8(values) => ("|u1", values.clone()),
        Values::F32(values) => ("<f4", values.iter().flat_map(|v| v.to_le_bytes()).collect()),
        Values::F64(values) => ("<f8", values.iter().flat_map(|v| v.to_le_bytes()).collect()),
    };
    (dtype.to_owned(), bytes)
}
