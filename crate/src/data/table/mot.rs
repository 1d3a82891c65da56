//! Boxes as the MOT challenge writes them, <https://motchallenge.net/instructions>: rows without a
//! header, `frame, id, left, top, width, height, confidence, …`. Their centres are the points.

use super::fields::{Delimited, whole_number, wrong_field};
use super::rows::{Points, Raw, Row, Sequences};
use crate::data::reading::Layout;
use crate::error::{Error, Result};

const COLUMNS: [&str; 7] = [
    "frame",
    "id",
    "left",
    "top",
    "width",
    "height",
    "confidence",
];

/// Whether the first line of a table is such a row: nothing but numbers.
pub fn is_row(fields: &csv::StringRecord) -> bool {
    fields.len() >= COLUMNS.len()
        && fields.iter().all(|field| field.parse::<f64>().is_ok())
        && fields
            .iter()
            .take(2)
            .all(|field| whole_number(field).is_some())
}

pub fn read(mut table: Delimited, stem: &str) -> Result<Raw> {
    let mut sequences = Sequences::default();
    let mut points = Points::default();
    let mut rows = Vec::new();
    while let Some((record, line)) = table.next()? {
        let mut number = |column: usize| {
            let text = record.get(column).unwrap_or_default();
            let wrong = |message| wrong_field(line, COLUMNS[column], message);
            table.coordinate(text).map_err(wrong)
        };
        let [left, top, width, height] = [number(2)?, number(3)?, number(4)?, number(5)?];
        let confidence = number(6)?;
        let whole = |column: usize| {
            let text = record.get(column).unwrap_or_default();
            whole_number(text).ok_or_else(|| {
                let message = format!("`{text}` is no whole number from 0");
                wrong_field(line, COLUMNS[column], message)
            })
        };
        rows.push(Row {
            line,
            sequence: sequences
                .number(stem)
                .map_err(|message| wrong_field(line, COLUMNS[0], message))?,
            frame: whole(0)?,
            point: points.number(&whole(1)?.to_string()),
            xy: [left + width / 2.0, top + height / 2.0],
            // -1 stands for none.
            confidence: match confidence < 0.0 {
                true => f64::NAN,
                false => confidence,
            },
            size: None,
        });
    }
    if rows.is_empty() {
        return Err(Error::input("the table has no rows"));
    }
    table.notices.push(
        "points are the centres of the boxes; these files count frames from 1: read them with first frame 1 \
         where the other file counts from 0"
            .to_owned()
            .into(),
    );
    Ok(Raw {
        layout: Layout::Mot,
        sequences: sequences.names,
        points: points.names,
        rows,
        heights: Vec::new(),
        sizes: Vec::new(),
        notices: table.into_notices(),
        lacks_size: false,
    })
}
