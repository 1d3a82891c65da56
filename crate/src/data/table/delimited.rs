//! Text with fields between commas, semicolons or tabs.

use super::fields::{Delimited, unreadable};
use super::rows::{Content, Raw};
use super::{deeplabcut, tidy, wide};
use crate::data::reading::{Layout, TableOptions};
use crate::error::{Error, Result};

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
                notices.push(format!("fields are separated by a {word}").into());
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
    match layout_of(&table.header) {
        Layout::DeepLabCut => deeplabcut::read(table, stem),
        Layout::Wide => wide::read(table, stem),
        _ => tidy::read(table, content, options),
    }
}

/// The layout that a header shows; tidy where it shows none, whose reader says what is missing.
pub fn layout_of(header: &csv::StringRecord) -> Layout {
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
