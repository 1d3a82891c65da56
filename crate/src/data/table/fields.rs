//! Records and fields of a delimited text.

use std::borrow::Cow;
use std::collections::HashSet;

use crate::data::names::{last_number, numbers, quote_list, stem};
use crate::data::reading::Notice;
use crate::error::{Error, Result};

/// What stands for no value, as pandas reads it.
const MISSING: [&str; 12] = [
    "", "na", "nan", "-nan", "none", "null", "n/a", "<na>", "#na", "#n/a", "nat", "#n/a n/a",
];

/// A delimited text after its header.
pub struct Delimited<'a> {
    pub header: csv::StringRecord,
    pub reader: csv::Reader<&'a [u8]>,
    pub notices: Vec<Notice>,
    /// Lines before the header.
    pub before: u64,
    /// Whether commas can stand in numbers, since they do not separate fields.
    pub has_decimal_comma: bool,
    /// What was read although it is written in an unusual way.
    pub odd: Odd,
}

/// How often something unusual was read, to be told once.
#[derive(Default)]
pub struct Odd {
    /// Rows with empty fields behind the last column.
    pub long_rows: u64,
    pub decimal_commas: u64,
    /// The first frame that is the name of a file.
    pub named_frame: Option<String>,
}

impl Delimited<'_> {
    /// The next record and its line; none at the end.
    ///
    /// # Errors
    /// When it has fewer fields than the header, or more of them that are not empty.
    pub fn next(&mut self) -> Result<Option<(csv::StringRecord, u32)>> {
        let mut record = csv::StringRecord::new();
        if !self
            .reader
            .read_record(&mut record)
            .map_err(|e| unreadable(&e))?
        {
            return Ok(None);
        }
        let line = self.before + record.position().map_or(0, csv::Position::line);
        let expected = self.header.len();
        if record.len() > expected && record.iter().skip(expected).all(str::is_empty) {
            self.odd.long_rows += 1;
            record.truncate(expected);
        }
        if record.len() != expected {
            return Err(Error::input(format!(
                "{} fields; expected {expected} as in the header{}",
                record.len(),
                if self.reader.is_done() {
                    " (is the file cut short?)"
                } else {
                    ""
                }
            ))
            .at(format!("line {line}")));
        }
        Ok(Some((record, line.try_into().unwrap_or(u32::MAX))))
    }

    /// A coordinate; NaN where the field says that there is none.
    pub fn coordinate(&mut self, text: &str) -> Result<f64, String> {
        if MISSING.iter().any(|word| text.eq_ignore_ascii_case(word)) {
            return Ok(f64::NAN);
        }
        if let Ok(number) = text.parse() {
            return Ok(number);
        }
        let with_point = match self.has_decimal_comma && text.matches(',').count() == 1 {
            true => Cow::Owned(text.replace(',', ".")),
            false => Cow::Borrowed(text),
        };
        match with_point.parse() {
            Ok(number) => {
                self.odd.decimal_commas += 1;
                Ok(number)
            }
            Err(_) => {
                let hint = match text.contains(',') {
                    true => " with a decimal point",
                    false => "",
                };
                Err(format!("`{text}` is not a number; expected a number{hint}"))
            }
        }
    }

    /// How sure a point is, from a column of confidences or visibilities; NaN where the field says
    /// nothing.
    pub fn sureness(&mut self, text: &str) -> Result<f64, String> {
        match text {
            _ if text.eq_ignore_ascii_case("true") => Ok(1.0),
            _ if text.eq_ignore_ascii_case("false") => Ok(0.0),
            _ => self.coordinate(text),
        }
    }

    /// The number of a frame: a whole number, or the only number in the name of a file.
    pub fn frame(&mut self, text: &str) -> Result<u64, String> {
        if let Ok(number) = text.parse() {
            return Ok(number);
        }
        if let Some(whole) = whole_number(text) {
            return Ok(whole);
        }
        let is_name = text.starts_with(|c: char| c.is_ascii_alphabetic());
        match (is_name, &numbers(stem(text))[..]) {
            (true, [number]) => {
                self.odd.named_frame.get_or_insert_with(|| text.to_owned());
                Ok(*number)
            }
            _ => Err(format!(
                "`{text}` is not a frame; expected a whole number from 0"
            )),
        }
    }

    /// All notices, with what was read although it is unusual.
    pub fn into_notices(mut self) -> Vec<Notice> {
        let Odd {
            long_rows,
            decimal_commas,
            named_frame,
        } = self.odd;
        let told = [
            (long_rows > 0).then(|| {
                format!(
                    "{long_rows} rows have empty fields behind the last column, which are left out"
                )
            }),
            (decimal_commas > 0)
                .then(|| format!("{decimal_commas} numbers are read with a decimal comma")),
            named_frame.map(|name| format!("frames are the numbers in names such as `{name}`")),
        ];
        self.notices
            .extend(told.into_iter().flatten().map(Notice::from));
        self.notices
    }

    /// The first column of a name, in capitals or not.
    pub fn column(&self, name: &str) -> Option<usize> {
        self.header
            .iter()
            .position(|column| column.eq_ignore_ascii_case(name))
    }

    /// Says which columns are not read, which are all but these.
    pub fn read_only(&mut self, columns: impl IntoIterator<Item = usize>) {
        let columns: HashSet<usize> = columns.into_iter().collect();
        let header = self.header.clone();
        let others = header.iter().enumerate();
        let others: Vec<&str> = others
            .filter(|(at, _)| !columns.contains(at))
            .map(|(_, name)| name)
            .collect();
        self.leave_out(&others);
    }

    /// Says which columns are not read.
    pub fn leave_out(&mut self, columns: &[&str]) {
        if !columns.is_empty() {
            self.notices
                .push(format!("ignored: {}", quote_list(columns)).into());
        }
    }
}

/// A whole number from 0 however it is written: `1.0`, `1e3`.
pub fn whole_number(text: &str) -> Option<u64> {
    let number: f64 = text.parse().ok()?;
    // Beyond 2^53 not every whole number is an f64.
    (number.fract() == 0.0 && (0.0..=9_007_199_254_740_992.0).contains(&number))
        .then_some(number as u64)
}

/// What a column beside x and y says of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beside {
    /// How sure the detector is.
    Confidence,
    /// Whether it is visible: 0 hides it.
    Visible,
}

impl Beside {
    /// Of the column of this name.
    pub fn of(name: &str) -> Option<Self> {
        let is = |words: &[&str]| words.iter().any(|word| name.eq_ignore_ascii_case(word));
        if is(&["likelihood", "score", "confidence", "conf"]) {
            Some(Self::Confidence)
        } else if is(&["visible", "visibility"]) {
            Some(Self::Visible)
        } else {
            None
        }
    }

    /// The position of a point that is this sure.
    pub fn position(self, xy: [f64; 2], sureness: f64) -> [f64; 2] {
        match self == Self::Visible && sureness == 0.0 {
            true => [f64::NAN; 2],
            false => xy,
        }
    }
}

/// A header cell that pandas makes up where there is none.
pub fn is_unnamed(cell: &str) -> bool {
    cell.is_empty() || cell.starts_with("Unnamed: ")
}

/// The number of the frame in the name of an image.
pub fn image_number(image: &str) -> Option<u64> {
    last_number(image)
}

/// An error in a field.
pub fn wrong_field(line: u32, column: &str, message: String) -> Error {
    Error::input(message).at(format!("line {line}, column `{column}`"))
}

pub fn unreadable(error: &csv::Error) -> Error {
    Error::input(format!("not a readable CSV table: {error}"))
}
