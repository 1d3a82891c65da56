//! Points in files that are neither text nor arrays, as the table that their own program would
//! export; from there on they are read as any table.

use super::reading::{Notice, Parsed, Space, TableOptions};
use super::table::{Columns, parse_ground_truth, parse_keypoints};
use crate::error::{Error, ErrorKind, Result};
use crate::track::{GroundTruth, KeypointTrack};

/// A table that a file of another kind was turned into.
#[derive(Debug, Clone, PartialEq)]
pub struct Export {
    /// The table, CSV.
    pub table: Vec<u8>,
    /// The unit of the positions, where the file always has them so and its table cannot say it.
    pub space: Option<Space>,
    /// What a person should know of how it was made.
    pub notices: Vec<Notice>,
}

impl Export {
    /// A table of these rows, the header first.
    pub(super) fn of(
        rows: impl Iterator<Item = Result<Vec<String>>>,
        space: Option<Space>,
    ) -> Result<Self> {
        let mut writer = ExportWriter::default();
        for row in rows {
            writer.row(&row?)?;
        }
        writer.finish(space)
    }

    /// With the names that are expected, where `columns` says which column is what.
    ///
    /// # Errors
    /// As [`Columns::apply`].
    pub fn renamed(mut self, columns: Option<&Columns>, is_keypoints: bool) -> Result<Self> {
        if let Some(columns) = columns {
            self.table = columns.apply(&self.table, is_keypoints)?;
        }
        Ok(self)
    }

    fn options(&self, options: &TableOptions) -> TableOptions {
        TableOptions {
            space: options.space.or(self.space),
            ..*options
        }
    }

    /// The points as a ground truth; `name` is the file's.
    ///
    /// # Errors
    /// As [`parse_ground_truth`].
    pub fn ground_truth(&self, name: &str, options: &TableOptions) -> Result<Parsed<GroundTruth>> {
        let parsed = parse_ground_truth(&self.table, name, &self.options(options))?;
        Ok(self.told(parsed))
    }

    /// The points as keypoints of a detector; `name` is the file's.
    ///
    /// # Errors
    /// As [`parse_keypoints`].
    pub fn keypoints(&self, name: &str, options: &TableOptions) -> Result<Parsed<KeypointTrack>> {
        let parsed = parse_keypoints(&self.table, name, &self.options(options))?;
        Ok(self.told(parsed))
    }

    fn told<T>(&self, mut parsed: Parsed<T>) -> Parsed<T> {
        parsed.notices.splice(0..0, self.notices.iter().cloned());
        parsed
    }
}

/// Writes the table of an export, row by row.
pub(super) struct ExportWriter(csv::Writer<Vec<u8>>);

impl Default for ExportWriter {
    fn default() -> Self {
        Self(csv::Writer::from_writer(Vec::new()))
    }
}

impl ExportWriter {
    /// Writes a row; the header comes first.
    pub fn row<C: AsRef<[u8]>>(&mut self, cells: impl IntoIterator<Item = C>) -> Result<()> {
        let written = self.0.write_record(cells);
        written.map_err(|e| Error::new(ErrorKind::Io, e.to_string()))
    }

    pub fn finish(self, space: Option<Space>) -> Result<Export> {
        let table = self.0.into_inner();
        Ok(Export {
            table: table.map_err(|e| Error::new(ErrorKind::Io, e.to_string()))?,
            space,
            notices: Vec::new(),
        })
    }
}

#[cfg(feature = "parquet")]
impl ExportWriter {
    /// The bytes of the rows that are written, but for the last few.
    pub fn size(&self) -> u64 {
        self.0.get_ref().len() as u64
    }
}

/// A number with every digit that is needed to read it again; nothing for NaN.
#[cfg(any(feature = "hdf5", feature = "parquet"))]
pub(super) fn number_text(number: f64) -> String {
    match number {
        _ if number.is_nan() => String::new(),
        _ if number.fract() == 0.0 && number.abs() < 1e15 => format!("{number}"),
        // Unlike `{}`, with an exponent where there would be many zeros.
        _ => format!("{number:?}"),
    }
}
