//! Tables as values, which every output renders: Markdown, CSV, HTML, LaTeX, the terminal, and the
//! page through their serialised form.

mod csv;
mod html;
mod latex;
mod markdown;

use std::fmt;

use serde::ser::{Serialize, SerializeMap as _, SerializeStruct as _, Serializer};

/// Stands for a missing value.
pub const NONE: &str = "–";

/// A table: columns, and rows of as many cells.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// A name for programs, e.g. `capability`.
    pub name: &'static str,
    /// What it shows, without a full stop.
    pub caption: String,
    /// What a reader needs to know, in whole sentences; may be empty.
    pub note: String,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows.
    pub rows: Vec<Vec<Cell>>,
}

/// A column of a [`Table`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Its heading.
    pub label: String,
    /// What its cells hold.
    pub kind: ColumnKind,
}

/// What the cells of a [`Column`] hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnKind {
    /// Text.
    Text,
    /// Text that several rows share: it is printed in the first of them.
    Group,
    /// Numbers.
    Number,
}

/// A cell of a [`Table`].
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// What it holds.
    pub content: Content,
    /// Follows the content, e.g. `✓`.
    pub mark: Option<&'static str>,
    /// Small print after the content.
    pub note: Option<String>,
    /// Lines of small print below the content, where the output has room for them.
    pub details: Vec<String>,
    /// How it stands out.
    pub emphasis: Option<Emphasis>,
}

/// What a [`Cell`] holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// Text.
    Text(String),
    /// An integer.
    Count(u64),
    /// One or more numbers side by side.
    Numbers(Vec<Number>),
}

/// A number as a table shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Number {
    /// `None` where there is none.
    pub value: Option<f64>,
    /// The interval it lies in. Without a value the interval is all there is.
    pub interval: Option<[f64; 2]>,
    /// Its digits.
    pub precision: Precision,
}

/// How many digits of a number are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// As many as it takes to read the same number back.
    Full,
    /// This many after the point.
    Fixed(usize),
    /// This many after the point, and an exponent.
    Scientific(usize),
    /// About three significant ones.
    Short,
}

/// How a [`Cell`] stands out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Emphasis {
    /// It meets its threshold.
    Good,
    /// It does not.
    Bad,
}

impl Table {
    /// A table without rows.
    pub fn new(
        name: &'static str,
        caption: impl Into<String>,
        columns: impl IntoIterator<Item = Column>,
    ) -> Self {
        Self {
            name,
            caption: caption.into(),
            note: String::new(),
            columns: columns.into_iter().collect(),
            rows: Vec::new(),
        }
    }

    /// With a note for the reader.
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Adds a row of as many cells as there are columns.
    pub fn push(&mut self, cells: impl IntoIterator<Item = Cell>) {
        let cells: Vec<Cell> = cells.into_iter().collect();
        debug_assert_eq!(cells.len(), self.columns.len(), "cells of {}", self.name);
        self.rows.push(cells);
    }

    /// Whether row `i` repeats the text of a [`ColumnKind::Group`] in column `j`.
    fn repeats(&self, i: usize, j: usize) -> bool {
        self.columns[j].kind == ColumnKind::Group
            && i > 0
            && self.rows[i][j].content == self.rows[i - 1][j].content
    }

    /// Whether row `i` begins a group.
    fn begins_group(&self, i: usize) -> bool {
        let is_group = |j: &usize| self.columns[*j].kind == ColumnKind::Group;
        (0..self.columns.len())
            .filter(is_group)
            .any(|j| !self.repeats(i, j))
    }
}

impl Column {
    /// A column of text.
    pub fn text(label: impl Into<String>) -> Self {
        Self::of(label, ColumnKind::Text)
    }

    /// A column of text that several rows share.
    pub fn group(label: impl Into<String>) -> Self {
        Self::of(label, ColumnKind::Group)
    }

    /// A column of numbers.
    pub fn number(label: impl Into<String>) -> Self {
        Self::of(label, ColumnKind::Number)
    }

    fn of(label: impl Into<String>, kind: ColumnKind) -> Self {
        Self {
            label: label.into(),
            kind,
        }
    }
}

impl From<Content> for Cell {
    fn from(content: Content) -> Self {
        Self {
            content,
            mark: None,
            note: None,
            details: Vec::new(),
            emphasis: None,
        }
    }
}

impl Cell {
    /// Text.
    pub fn text(text: impl Into<String>) -> Self {
        Content::Text(text.into()).into()
    }

    /// An integer, where there is one.
    pub fn count(count: impl Into<Option<u64>>) -> Self {
        let count = count.into();
        count.map_or_else(|| Self::text(NONE), |count| Content::Count(count).into())
    }

    /// A number with its interval.
    pub fn number(
        value: impl Into<Option<f64>>,
        interval: Option<[f64; 2]>,
        precision: Precision,
    ) -> Self {
        Self::numbers([Number {
            value: value.into(),
            interval,
            precision,
        }])
    }

    /// Numbers side by side.
    pub fn numbers(numbers: impl IntoIterator<Item = Number>) -> Self {
        Content::Numbers(numbers.into_iter().collect()).into()
    }

    /// With a mark after the content.
    pub fn mark(mut self, mark: Option<&'static str>) -> Self {
        self.mark = mark;
        self
    }

    /// With small print after the content.
    pub fn note(mut self, note: Option<String>) -> Self {
        self.note = note;
        self
    }

    /// With small print below the content.
    pub fn details(mut self, details: Vec<String>) -> Self {
        self.details = details;
        self
    }

    /// Made to stand out.
    pub fn emphasis(mut self, emphasis: Option<Emphasis>) -> Self {
        self.emphasis = emphasis;
        self
    }

    /// The content with its mark.
    fn main_text(&self) -> String {
        let pieces = self.pieces().into_iter().map(|(text, _)| text);
        let text = pieces.collect::<Vec<_>>().join(" / ");
        match self.mark {
            Some(mark) => format!("{text} {mark}"),
            None => text,
        }
    }

    /// The interval, or the small print.
    fn small_text(&self) -> Option<String> {
        let ends = self.pieces().into_iter().find_map(|(_, ends)| ends);
        let interval = ends.map(|[low, high]| format!("{low}–{high}"));
        interval.or_else(|| self.note.clone())
    }

    /// The pieces of the content with the ends of their intervals, as text.
    fn pieces(&self) -> Vec<(String, Option<[String; 2]>)> {
        match &self.content {
            Content::Text(text) => vec![(text.clone(), None)],
            Content::Count(count) => vec![(count.to_string(), None)],
            Content::Numbers(numbers) => numbers.iter().map(Number::text).collect(),
        }
    }
}

impl Number {
    /// The number and the ends of its interval, as text.
    fn text(&self) -> (String, Option<[String; 2]>) {
        let write = |value: f64| self.precision.write(value);
        match (self.value, self.interval) {
            (Some(value), interval) => (write(value), interval.map(|ends| ends.map(write))),
            (None, Some([low, high])) => (format!("{}–{}", write(low), write(high)), None),
            (None, None) => (NONE.to_owned(), None),
        }
    }
}

impl Precision {
    /// The number as text.
    pub(super) fn write(self, value: f64) -> String {
        match self {
            Self::Full => value.to_string(),
            Self::Fixed(digits) => format!("{value:.digits$}"),
            Self::Scientific(digits) => format!("{value:.digits$e}"),
            Self::Short if value == 0.0 => "0".to_owned(),
            Self::Short if (1e-4..1e5).contains(&value.abs()) => {
                let digits = (2.0 - value.abs().log10().floor()).clamp(0.0, 8.0) as usize;
                format!("{value:.digits$}")
            }
            Self::Short => format!("{value:.2e}"),
        }
    }
}

impl Emphasis {
    /// `Good` where `is_good`.
    pub fn good(is_good: bool) -> Option<Self> {
        is_good.then_some(Self::Good)
    }

    /// `Good` or `Bad`.
    pub fn verdict(is_good: bool) -> Option<Self> {
        Some(if is_good { Self::Good } else { Self::Bad })
    }

    fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Bad => "bad",
        }
    }
}

impl fmt::Display for Cell {
    /// The content, and the small print in parentheses.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.main_text())?;
        self.small_text()
            .map_or(Ok(()), |small| write!(f, " ({small})"))
    }
}

impl Serialize for Table {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut table = serializer.serialize_struct("Table", 5)?;
        table.serialize_field("name", self.name)?;
        table.serialize_field("caption", &self.caption)?;
        table.serialize_field("note", &self.note)?;
        table.serialize_field("columns", &self.columns)?;
        table.serialize_field("rows", &self.rows)?;
        table.end()
    }
}

impl Serialize for Column {
    /// With the label, and whether it is text or a group.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut column = serializer.serialize_struct("Column", 3)?;
        column.serialize_field("label", &self.label)?;
        column.serialize_field("isText", &(self.kind != ColumnKind::Number))?;
        column.serialize_field("isGroup", &(self.kind == ColumnKind::Group))?;
        column.end()
    }
}

impl Serialize for Cell {
    /// The value to sort by, and what to show: text, small print, details and emphasis.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut cell = serializer.serialize_map(None)?;
        match &self.content {
            Content::Text(text) if text == NONE => cell.serialize_entry("value", &None::<f64>)?,
            Content::Text(text) => cell.serialize_entry("value", text)?,
            Content::Count(count) => cell.serialize_entry("value", count)?,
            Content::Numbers(numbers) => {
                let value = numbers.iter().find_map(|number| number.value);
                cell.serialize_entry("value", &value)?;
            }
        }
        cell.serialize_entry("text", &self.main_text())?;
        cell.serialize_entry("small", &self.small_text())?;
        cell.serialize_entry("details", &self.details)?;
        cell.serialize_entry("emphasis", &self.emphasis.map(Emphasis::name))?;
        cell.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table with everything that a cell can have.
    pub(super) fn sample() -> Table {
        let mut table = Table::new(
            "sample",
            "Errors & more",
            [
                Column::group("group"),
                Column::text("a|b"),
                Column::number("TC"),
            ],
        )
        .note("Mean of 2 runs.");
        let tc = |value, interval| Number {
            value,
            interval,
            precision: Precision::Fixed(2),
        };
        table.push([
            Cell::text("basic_1"),
            Cell::text("100 %, \"x\""),
            Cell::numbers([tc(None, None), tc(Some(0.5), Some([0.25, 0.75]))])
                .emphasis(Emphasis::good(true)),
        ]);
        table.push([
            Cell::text("basic_1"),
            Cell::text("<i>"),
            Cell::count(3)
                .mark(Some("✓"))
                .note(Some("+2".to_owned()))
                .details(vec!["below".to_owned()]),
        ]);
        table
    }

    #[test]
    fn a_serialised_table_says_what_to_show_and_what_to_sort_by() {
        let value = serde_json::to_value(sample()).expect("JSON");
        assert_eq!(
            value["columns"][0],
            serde_json::json!({ "label": "group", "isText": true, "isGroup": true })
        );
        assert_eq!(
            value["rows"][0][2],
            serde_json::json!({
                "value": 0.5, "text": "– / 0.50", "small": "0.25–0.75", "details": [], "emphasis": "good"
            })
        );
        assert_eq!(
            value["rows"][1][2],
            serde_json::json!({
                "value": 3, "text": "3 ✓", "small": "+2", "details": ["below"], "emphasis": null
            })
        );
    }

    #[test]
    fn numbers_have_the_digits_that_are_asked_for() {
        let written =
            |precision: Precision| [0.0, 0.012_345, 123_456.0].map(|v| precision.write(v));
        assert_eq!(written(Precision::Full), ["0", "0.012345", "123456"]);
        assert_eq!(written(Precision::Fixed(2)), ["0.00", "0.01", "123456.00"]);
        assert_eq!(written(Precision::Short), ["0", "0.0123", "1.23e5"]);
        assert_eq!(Precision::Scientific(1).write(0.012), "1.2e-2");
    }
}
