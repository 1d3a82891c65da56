//! Tables with one row a frame and two columns a point.

use super::fields::{Delimited, coordinate, frame, wrong_field};
use super::rows::{Raw, Row, Sequences};
use super::write::unescaped;
use crate::data::names::{cleaned, quote_list};
use crate::data::reading::Layout;
use crate::error::{Error, Result};

/// The names of points with the columns of x and y: `cube_x` and `cube_y`, with `_`, `.`, `-` or a
/// space between.
pub fn points(header: &csv::StringRecord) -> Vec<(String, [usize; 2])> {
    let split = |field: &str, axis: char| {
        let name = field.strip_suffix([axis, axis.to_ascii_uppercase()])?;
        let name = name.strip_suffix(['_', '.', '-', ' '])?.trim_end();
        (!name.is_empty()).then(|| cleaned(name).into_owned())
    };
    let mut points = Vec::new();
    for (x, field) in header.iter().enumerate() {
        let Some(name) = split(field, 'x') else {
            continue;
        };
        let y = header
            .iter()
            .position(|h| split(h, 'y').is_some_and(|n| n == name));
        if let Some(y) = y {
            points.push((name, [x, y]));
        }
    }
    points
}

pub fn read(mut table: Delimited, stem: &str) -> Result<Raw> {
    let header = table.header.clone();
    let points = points(&header);
    let find = |column: &str| header.iter().position(|h| h.eq_ignore_ascii_case(column));
    let Some(frame_column) = find("frame") else {
        let found: Vec<&str> = header.iter().collect();
        return Err(Error::input(format!(
            "line 1: column `frame` missing; expected e.g. `sequence,frame,{0}_x,{0}_y`, found `{1}`",
            points.first().map_or("cube", |(name, _)| name),
            found.join(",")
        )));
    };
    let sequence_column = find("sequence");
    for (i, (name, _)) in points.iter().enumerate() {
        if points[..i].iter().any(|(other, _)| other == name) {
            return Err(Error::input(format!(
                "line 1: column `{name}_x` stands twice"
            )));
        }
    }
    let ignored: Vec<&str> = header
        .iter()
        .enumerate()
        .filter(|(i, _)| {
            let is_point = points.iter().any(|(_, columns)| columns.contains(i));
            !is_point && *i != frame_column && Some(*i) != sequence_column
        })
        .map(|(_, name)| name)
        .collect();
    if !ignored.is_empty() {
        table
            .notices
            .push(format!("ignored: {}", quote_list(&ignored)).into());
    }
    if sequence_column.is_none() {
        table.notices.push(
            format!("there is no column `sequence`; all rows are taken for one, `{stem}`").into(),
        );
    }
    let mut sequences = Sequences::default();
    let mut rows = Vec::new();
    while let Some((record, line)) = table.next()? {
        let field = |column: usize| record.get(column).unwrap_or_default();
        let wrong = |column: usize| {
            let column = header.get(column).unwrap_or_default().to_owned();
            move |message: String| wrong_field(line, &column, message)
        };
        let sequence = match sequence_column {
            Some(column) => sequences
                .number(unescaped(field(column)))
                .map_err(wrong(column))?,
            None => sequences.number(stem).map_err(wrong(0))?,
        };
        let frame = frame(field(frame_column)).map_err(wrong(frame_column))?;
        for (point, (_, [x, y])) in points.iter().enumerate() {
            rows.push(Row {
                line,
                sequence,
                frame,
                point,
                xy: [
                    coordinate(field(*x)).map_err(wrong(*x))?,
                    coordinate(field(*y)).map_err(wrong(*y))?,
                ],
                image_size: None,
            });
        }
    }
    if rows.is_empty() {
        return Err(Error::input(
            "the table has a header and no rows; expected one row a frame",
        ));
    }
    Ok(Raw {
        layout: Layout::Wide,
        sequences: sequences.names,
        points: points.into_iter().map(|(name, _)| name).collect(),
        rows,
        notices: table.notices,
        lacks_size: false,
    })
}
