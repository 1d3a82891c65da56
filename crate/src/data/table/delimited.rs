//! Text with fields between commas, semicolons or tabs.

use super::{Content, Layout, Raw, TableOptions, deeplabcut, tidy, wide};
use crate::error::{Error, Result};

/// A delimited text after its header.
pub struct Delimited<'a> {
    pub header: csv::StringRecord,
    pub reader: csv::Reader<&'a [u8]>,
    pub notices: Vec<String>,
}

/// Reads a table of the layout that its header shows.
pub fn read(text: &str, name: &str, content: Content, options: &TableOptions) -> Result<Raw> {
    let first_line = text.lines().next().unwrap_or_default();
    if first_line.trim().is_empty() {
        return Err(Error::input(format!(
            "the table has no header; expected `{}` in the first line",
            tidy::columns(content).join(",")
        )));
    }
    let mut notices = Vec::new();
    let delimiter = [(',', "comma"), (';', "semicolon"), ('\t', "tab")]
        .into_iter()
        .max_by_key(|(c, _)| (first_line.matches(*c).count(), *c == ','))
        .filter(|(c, _)| first_line.contains(*c));
    let delimiter = match delimiter {
        Some((c, word)) => {
            if c != ',' {
                notices.push(format!("fields are separated by a {word}"));
            }
            c as u8
        }
        None => b',',
    };
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let header = reader.headers().map_err(|e| unreadable(&e))?.clone();
    let table = Delimited {
        header,
        reader,
        notices,
    };
    // The names of the sequence and of its video are what the files are called, where the table
    // does not say.
    let file = name.rsplit(['/', '\\']).next().unwrap_or(name);
    let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
    match layout(&table.header) {
        Layout::DeepLabCut => deeplabcut::read(table, stem),
        Layout::Wide => wide::read(table, stem),
        _ => tidy::read(table, content, options),
    }
}

/// The layout that a header shows; tidy where it shows none, whose reader says what is missing.
pub fn layout(header: &csv::StringRecord) -> Layout {
    let has = |column: &str| header.iter().any(|h| h.eq_ignore_ascii_case(column));
    if header
        .get(0)
        .is_some_and(|first| first.eq_ignore_ascii_case("scorer"))
    {
        Layout::DeepLabCut
    } else if has("x") && has("y") || wide::points(header).is_empty() {
        Layout::Tidy
    } else {
        Layout::Wide
    }
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

fn unreadable(error: &csv::Error) -> Error {
    Error::input(format!("not a readable CSV table: {error}"))
}
