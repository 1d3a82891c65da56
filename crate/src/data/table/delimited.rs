//! Text with fields between commas, semicolons or tabs.

use super::fields::{Delimited, Odd, is_unnamed, unreadable};
use super::rows::{Content, Raw};
use super::{deeplabcut, mot, tidy, wide};
use crate::data::reading::{Layout, Notice, TableOptions};
use crate::error::{Error, Result};

/// Reads a table of the layout that its header shows.
pub fn read(text: &str, name: &str, content: Content, options: &TableOptions) -> Result<Raw> {
    let start = Start::of(text);
    let Start {
        before,
        rest,
        comments,
        ..
    } = start;
    let first_line = rest.lines().next().unwrap_or_default();
    if first_line.trim().is_empty() {
        return Err(Error::input(format!(
            "the table has no header; expected `{}` in the first line",
            tidy::columns(content).join(",")
        )));
    }
    let mut notices: Vec<Notice> = Vec::new();
    if comments > 0 {
        notices.push(match comments {
            1 => "the line before the header begins with #".to_owned().into(),
            _ => format!("{comments} lines before the header begin with #").into(),
        });
    }
    let (delimiter, word) = start.delimiter();
    if delimiter != b',' {
        notices.push(format!("fields are separated by a {word}").into());
    }
    let layout = layout_of(rest, delimiter);
    let stem = stem(name);
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .flexible(true)
        .has_headers(layout != Layout::Mot)
        .trim(csv::Trim::All)
        .from_reader(rest.as_bytes());
    let header = reader.headers().map_err(|e| unreadable(&e))?.clone();
    let table = Delimited {
        header,
        reader,
        notices,
        before,
        has_decimal_comma: delimiter != b',',
        odd: Odd::default(),
    };
    match layout {
        Layout::DeepLabCut => deeplabcut::read(table, stem, options),
        Layout::Mot => mot::read(table, stem),
        Layout::Wide | Layout::Sleap => wide::read(table, stem, layout, options),
        _ => tidy::read(table, content, options),
    }
}

/// What a file is called without its folder and ending: the name of the sequence and of its video,
/// where the table does not say.
pub fn stem(name: &str) -> &str {
    let file = name.rsplit(['/', '\\']).next().unwrap_or(name);
    file.rsplit_once('.').map_or(file, |(stem, _)| stem)
}

/// A table from its header on.
pub struct Start<'a> {
    /// Lines before the header.
    before: u64,
    /// The separator that a line `sep=;` gives, as Excel writes it.
    separator: Option<(u8, &'static str)>,
    pub rest: &'a str,
    comments: usize,
}

impl<'a> Start<'a> {
    /// The separator, which is said or stands most often in the header, and what it is called.
    pub fn delimiter(&self) -> (u8, &'static str) {
        let first_line = self.rest.lines().next().unwrap_or_default();
        self.separator.unwrap_or_else(|| delimiter_of(first_line))
    }

    /// Passes over empty lines, comments and Excel's line `sep=;`.
    pub fn of(text: &'a str) -> Self {
        let mut start = Self {
            before: 0,
            separator: None,
            rest: text,
            comments: 0,
        };
        while let Some((line, rest)) = start.rest.split_once('\n') {
            let line = line.trim();
            let said = line.strip_prefix("sep=").and_then(separator);
            if said.is_some() {
                start.separator = said;
            } else if line.starts_with('#') {
                start.comments += 1;
            } else if !line.is_empty() {
                break;
            }
            start.before += 1;
            start.rest = rest;
        }
        start
    }
}

const SEPARATORS: [(u8, &str); 3] = [(b',', "comma"), (b';', "semicolon"), (b'\t', "tab")];

fn separator(text: &str) -> Option<(u8, &'static str)> {
    SEPARATORS
        .into_iter()
        .find(|(byte, _)| text.as_bytes() == [*byte])
}

/// The separator that stands most often in the first line; a comma where there is none.
fn delimiter_of(first_line: &str) -> (u8, &'static str) {
    let count = |byte: u8| first_line.bytes().filter(|b| *b == byte).count();
    SEPARATORS
        .into_iter()
        .max_by_key(|(byte, _)| (count(*byte), *byte == b','))
        .unwrap_or(SEPARATORS[0])
}

/// The layout of a table and the fields of its header, by its beginning.
pub fn look_at(text: &str) -> (Layout, csv::StringRecord) {
    let start = Start::of(text);
    let first_line = start.rest.lines().next().unwrap_or_default();
    let (delimiter, _) = start.delimiter();
    let header = fields(first_line, delimiter);
    (layout_of(start.rest, delimiter), header)
}

fn fields(line: &str, delimiter: u8) -> csv::StringRecord {
    line.split(delimiter as char)
        .map(|field| field.trim().trim_matches('"').trim())
        .collect()
}

/// The layout of a table from its header on; tidy where nothing shows another one, whose reader says
/// what is missing.
fn layout_of(rest: &str, delimiter: u8) -> Layout {
    let mut lines = rest.lines().map(|line| fields(line, delimiter));
    let header = lines.next().unwrap_or_default();
    let has = |column: &str| header.iter().any(|h| h.eq_ignore_ascii_case(column));
    let first = header.get(0).unwrap_or_default();
    let is_deeplabcut = first.eq_ignore_ascii_case("scorer")
        || is_unnamed(first)
            && lines.take(2).any(|line| {
                line.get(0)
                    .is_some_and(|cell| cell.eq_ignore_ascii_case("bodyparts"))
            });
    if is_deeplabcut {
        Layout::DeepLabCut
    } else if mot::is_row(&header) {
        Layout::Mot
    } else if has("x") && has("y") && (has("object") || has("keypoint"))
        || wide::points(&header).is_empty()
    {
        Layout::Tidy
    } else if has("instance.score") {
        Layout::Sleap
    } else {
        Layout::Wide
    }
}
