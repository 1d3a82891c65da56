//! Points in files that are neither text nor arrays, as the table that their own program would
//! export; from there on they are read as any table.

use super::reading::{Parsed, Space, TableOptions};
use super::table::{parse_ground_truth, parse_keypoints};
use crate::error::{Error, ErrorKind, Result};
use crate::track::{GroundTruth, KeypointTrack};

/// A table that a file of another kind was turned into.
#[derive(Debug, Clone, PartialEq)]
pub struct Export {
    /// The table, CSV.
    pub table: Vec<u8>,
    /// The unit of the positions, where the file always has them so and its table cannot say it.
    pub space: Option<Space>,
}

impl Export {
    /// A table of these rows, the header first.
    pub(super) fn of(
        rows: impl Iterator<Item = Result<Vec<String>>>,
        space: Option<Space>,
    ) -> Result<Self> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let failed = |e: csv::Error| Error::new(ErrorKind::Io, e.to_string());
        for row in rows {
            writer.write_record(row?).map_err(failed)?;
        }
        let table = writer.into_inner();
        let table = table.map_err(|e| Error::new(ErrorKind::Io, e.to_string()))?;
        Ok(Self { table, space })
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
        parse_ground_truth(&self.table, name, &self.options(options))
    }

    /// The points as keypoints of a detector; `name` is the file's.
    ///
    /// # Errors
    /// As [`parse_keypoints`].
    pub fn keypoints(&self, name: &str, options: &TableOptions) -> Result<Parsed<KeypointTrack>> {
        parse_keypoints(&self.table, name, &self.options(options))
    }
}
