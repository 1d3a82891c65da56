//! Tables with one row a point.

use std::collections::HashMap;

use super::fields::{Delimited, coordinate, frame, wrong_field};
use super::rows::{Content, Raw, Row, Sequences};
use super::write::unescaped;
use crate::data::names::{cleaned, quote_list};
use crate::data::reading::{Layout, TableOptions};
use crate::error::{Error, Result};

/// More keypoints than any detector has; a guard against a table whose columns are mixed up.
const MAX_KEYPOINTS: u64 = 4096;

/// Gives the points of a table their numbers.
struct Points {
    content: Content,
    base: u64,
    names: Vec<String>,
    numbers: HashMap<String, usize>,
}

impl Points {
    fn number(&mut self, text: &str) -> Result<usize, String> {
        match self.content {
            Content::GroundTruth if text.is_empty() => {
                Err("empty; expected the name of the object".to_owned())
            }
            Content::GroundTruth => Ok(*self
                .numbers
                .entry(cleaned(unescaped(text)).into_owned())
                .or_insert_with_key(|name| {
                    self.names.push(name.clone());
                    self.names.len() - 1
                })),
            Content::Keypoints => match text
                .parse::<u64>()
                .ok()
                .and_then(|n| n.checked_sub(self.base))
            {
                Some(n) if n < MAX_KEYPOINTS => {
                    let n = n as usize;
                    for missing in self.names.len()..=n {
                        self.names.push(missing.to_string());
                    }
                    Ok(n)
                }
                _ => Err(format!(
                    "`{text}` is not a keypoint; expected its number, {} to {}",
                    self.base,
                    self.base + MAX_KEYPOINTS - 1
                )),
            },
        }
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

pub fn read(mut table: Delimited, content: Content, options: &TableOptions) -> Result<Raw> {
    let columns = columns(content);
    let expected = columns.join(",");
    let header = table.header.clone();
    let find = |column: &str| header.iter().position(|h| h.eq_ignore_ascii_case(column));
    let missing: Vec<&str> = columns.into_iter().filter(|c| find(c).is_none()).collect();
    if !missing.is_empty() {
        let found: Vec<&str> = header.iter().collect();
        let (other, what) = match content {
            Content::GroundTruth => ("keypoint", "keypoints"),
            Content::Keypoints => ("object", "ground truth"),
        };
        let swapped = match find(other) {
            Some(_) => format!("; this is a table of {what}: are the two tables swapped?"),
            None => String::new(),
        };
        return Err(Error::input(format!(
            "line 1: column{} {} missing; expected `{expected}` (or two columns a point, e.g. `frame,cube_x,cube_y`), \
             found `{}`{swapped}",
            if missing.len() == 1 { "" } else { "s" },
            quote_list(&missing),
            found.join(",")
        )));
    }
    let at = columns.map(|c| find(c).unwrap_or_default());
    let ignored: Vec<&str> = header
        .iter()
        .filter(|h| !columns.iter().any(|c| h.eq_ignore_ascii_case(c)))
        .collect();
    if !ignored.is_empty() {
        table
            .notices
            .push(format!("ignored: {}", quote_list(&ignored)).into());
    }
    if let Some(twice) = columns
        .iter()
        .find(|c| header.iter().filter(|h| h.eq_ignore_ascii_case(c)).count() > 1)
    {
        return Err(Error::input(format!(
            "line 1: column `{twice}` stands twice"
        )));
    }

    let mut points = Points {
        content,
        base: options.first_keypoint(),
        names: Vec::new(),
        numbers: HashMap::new(),
    };
    let mut sequences = Sequences::default();
    let mut rows = Vec::new();
    while let Some((record, line)) = table.next()? {
        let field = |column: usize| record.get(at[column]).unwrap_or_default();
        let wrong =
            |column: usize| move |message: String| wrong_field(line, columns[column], message);
        let sequence = sequences.number(unescaped(field(0))).map_err(wrong(0))?;
        let frame = frame(field(1)).map_err(wrong(1))?;
        let point = points.number(field(2)).map_err(wrong(2))?;
        let x = coordinate(field(3)).map_err(wrong(3))?;
        let y = coordinate(field(4)).map_err(wrong(4))?;
        rows.push(Row {
            line,
            sequence,
            frame,
            point,
            xy: [x, y],
            image_size: None,
        });
    }
    if rows.is_empty() {
        return Err(Error::input(format!(
            "the table has a header and no rows; expected one row a point (`{expected}`)"
        )));
    }
    Ok(Raw {
        layout: Layout::Tidy,
        sequences: sequences.names,
        points: points.names,
        rows,
        notices: table.notices,
        lacks_size: false,
    })
}
