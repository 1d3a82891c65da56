//! Tables with one row a point.

use super::fields::{Beside, Delimited, whole_number, wrong_field};
use super::rows::{Content, Points, Raw, Row, Sequences};
use super::space::are_in_space;
use super::write::unescaped;
use crate::data::names::{cleaned, quote_list};
use crate::data::reading::{Layout, TableOptions};
use crate::error::{Error, Reason, Result};
use crate::track::MOST_AXES;

/// More keypoints than any detector has; a guard against a table whose columns are mixed up.
const MAX_KEYPOINTS: u64 = 4096;

/// The number of the point that a field names. Keypoints are their own numbers, from `base`.
fn point(points: &mut Points, text: &str, content: Content, base: u64) -> Result<u32, String> {
    if content == Content::GroundTruth {
        return match text {
            "" => Err("empty; expected the name of the object".to_owned()),
            name => Ok(points.number(&cleaned(unescaped(name)))),
        };
    }
    let number = whole_number(text).and_then(|n| n.checked_sub(base));
    match number {
        Some(n) if n < MAX_KEYPOINTS => {
            for missing in points.names.len() as u64..=n {
                points.number(&missing.to_string());
            }
            Ok(n as u32)
        }
        _ => Err(format!(
            "`{text}` is not a keypoint; expected its number, {base} to {}",
            base.saturating_add(MAX_KEYPOINTS - 1)
        )),
    }
}

/// The columns that a table needs.
pub fn columns(content: Content) -> [&'static str; 5] {
    let point = match content {
        Content::GroundTruth => "object",
        Content::Keypoints => "keypoint",
    };
    ["sequence", "frame", point, "x", "y"]
}

/// Where the [`columns`] are.
///
/// # Errors
/// When one is missing.
fn find_columns(table: &Delimited, content: Content) -> Result<[usize; 5]> {
    let columns = columns(content);
    let places = columns.map(|column| table.column(column));
    if let [Some(sequence), Some(frame), Some(point), Some(x), Some(y)] = places {
        return Ok([sequence, frame, point, x, y]);
    }
    let missing: Vec<&str> = std::iter::zip(columns, places)
        .filter(|(_, place)| place.is_none())
        .map(|(column, _)| column)
        .collect();
    let (other, what) = match content {
        Content::GroundTruth => ("keypoint", "keypoints"),
        Content::Keypoints => ("object", "ground truth"),
    };
    let swapped = match table.column(other) {
        Some(_) => format!("; this is a table of {what}: are the two tables swapped?"),
        None => String::new(),
    };
    let found: Vec<&str> = table.header.iter().collect();
    Err(Error::input(format!(
        "line 1: column{} {} missing; expected `{}` (or two columns a point, e.g. \
         `frame,cube_x,cube_y`), found `{}`{swapped}",
        if missing.len() == 1 { "" } else { "s" },
        quote_list(&missing),
        columns.join(","),
        found.join(",")
    ))
    .because(Reason::OtherColumns {
        missing: missing.into_iter().map(str::to_owned).collect(),
    }))
}

pub fn read(mut table: Delimited, content: Content, options: &TableOptions) -> Result<Raw> {
    let columns = columns(content);
    let header = table.header.clone();
    let at = find_columns(&table, content)?;
    let sureness = header
        .iter()
        .enumerate()
        .find_map(|(at, name)| Some((Beside::of(name)?, at)));
    let z = table.column("z");
    let has_z = are_in_space(std::iter::once(("a point", z.is_some())), options)? && MOST_AXES == 3;
    let z = z.filter(|_| has_z);
    let beside = sureness.map(|(_, column)| column);
    table.read_only(at.into_iter().chain(z).chain(beside));
    if let Some(twice) = columns
        .iter()
        .find(|c| header.iter().filter(|h| h.eq_ignore_ascii_case(c)).count() > 1)
    {
        return Err(Error::input(format!(
            "line 1: column `{twice}` stands twice"
        )));
    }

    let base = options.first_keypoint();
    let mut points = Points::default();
    let mut sequences = Sequences::default();
    let (mut rows, mut heights) = (Vec::new(), Vec::new());
    while let Some((record, line)) = table.next()? {
        let field = |column: usize| record.get(at[column]).unwrap_or_default();
        let wrong =
            |column: usize| move |message: String| wrong_field(line, columns[column], message);
        let sequence = sequences.number(unescaped(field(0))).map_err(wrong(0))?;
        let frame = table.frame(field(1)).map_err(wrong(1))?;
        let point = point(&mut points, field(2), content, base).map_err(wrong(2))?;
        let mut xy = [
            table.coordinate(field(3)).map_err(wrong(3))?,
            table.coordinate(field(4)).map_err(wrong(4))?,
        ];
        let mut confidence = f64::NAN;
        if let Some((beside, column)) = sureness {
            let name = header.get(column).unwrap_or_default();
            confidence = table
                .sureness(record.get(column).unwrap_or_default())
                .map_err(|message| wrong_field(line, name, message))?;
            xy = beside.position(xy, confidence);
        }
        if let Some(column) = z {
            let height = table.coordinate(record.get(column).unwrap_or_default());
            heights.push(height.map_err(|message| wrong_field(line, "z", message))?);
        }
        rows.push(Row {
            line,
            sequence,
            frame,
            point,
            xy,
            confidence,
            size: None,
        });
    }
    if rows.is_empty() {
        return Err(Error::input(format!(
            "the table has a header and no rows; expected one row a point (`{}`)",
            columns.join(",")
        )));
    }
    Ok(Raw {
        layout: Layout::Tidy,
        sequences: sequences.names,
        points: points.names,
        rows,
        heights,
        sizes: Vec::new(),
        notices: table.into_notices(),
        lacks_size: false,
    })
}
