//! Records and fields of a delimited text.

use crate::data::reading::Notice;
use crate::error::{Error, Result};

/// A delimited text after its header.
pub struct Delimited<'a> {
    pub header: csv::StringRecord,
    pub reader: csv::Reader<&'a [u8]>,
    pub notices: Vec<Notice>,
}

impl Delimited<'_> {
    /// The next record and its line; none at the end.
    ///
    /// # Errors
    /// When it has another number of fields than the header.
    pub fn next(&mut self) -> Result<Option<(csv::StringRecord, u64)>> {
        let mut record = csv::StringRecord::new();
        if !self
            .reader
            .read_record(&mut record)
            .map_err(|e| unreadable(&e))?
        {
            return Ok(None);
        }
        let line = record.position().map_or(0, csv::Position::line);
        if record.len() != self.header.len() {
            return Err(Error::input(format!(
                "{} fields; expected {} as in the header{}",
                record.len(),
                self.header.len(),
                if self.reader.is_done() {
                    " (is the file cut short?)"
                } else {
                    ""
                }
            ))
            .at(format!("line {line}")));
        }
        Ok(Some((record, line)))
    }
}

/// A coordinate; NaN where the field is empty.
pub fn coordinate(text: &str) -> Result<f64, String> {
    if text.is_empty() || text.eq_ignore_ascii_case("na") {
        return Ok(f64::NAN);
    }
    text.parse().map_err(|_| {
        let hint = if text.contains(',') {
            " with a decimal point"
        } else {
            ""
        };
        format!("`{text}` is not a number; expected a number{hint}")
    })
}

/// The number of a frame.
pub fn frame(text: &str) -> Result<u64, String> {
    text.parse()
        .map_err(|_| format!("`{text}` is not a frame; expected a whole number from 0"))
}

/// An error in a field.
pub fn wrong_field(line: u64, column: &str, message: String) -> Error {
    Error::input(message).at(format!("line {line}, column `{column}`"))
}

pub fn unreadable(error: &csv::Error) -> Error {
    Error::input(format!("not a readable CSV table: {error}"))
}
