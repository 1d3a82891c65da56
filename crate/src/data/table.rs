//! Tidy CSV tables of points: one row a point.
//!
//! Ground truth has the columns `sequence,frame,object,x,y`, keypoints `sequence,frame,keypoint,x,y`; columns
//! may come in any order, further ones are ignored and reported. Comma, semicolon and tab separate; a byte order
//! mark and CRLF are accepted. Points are in ndc. A row with empty (or `nan`) x and y, or a missing row, is a
//! point that is not visible.

use std::collections::HashMap;

use ndarray::Array3;

use crate::error::{Error, Result};
use crate::track::{FrameKey, GroundTruth, KeypointTrack};

/// More keypoints than any detector has; a guard against a table whose columns are mixed up.
const MAX_KEYPOINTS: usize = 4096;

/// A parsed table with what a person should know of how it was read.
#[derive(Debug, Clone, PartialEq)]
pub struct Table<T> {
    /// The content.
    pub content: T,
    /// E.g. that semicolons separate the fields, or how many points are missing.
    pub notices: Vec<String>,
}

/// Parses a ground-truth table. `name` is the file's, for messages.
///
/// # Errors
/// When the header lacks a column, a field is not what it should be, a row stands twice, or there is no row; the
/// message gives line and column.
pub fn parse_ground_truth(bytes: &[u8], name: &str) -> Result<Table<GroundTruth>> {
    let mut objects: Vec<String> = Vec::new();
    let mut numbers: HashMap<String, usize> = HashMap::new();
    let rows = read(bytes, "object", |text| {
        if text.is_empty() {
            return Err("empty; expected the name of the object".to_owned());
        }
        Ok(*numbers.entry(text.to_owned()).or_insert_with(|| {
            objects.push(text.to_owned());
            objects.len() - 1
        }))
    })
    .map_err(|e| e.at(name))?;
    let (keys, points, mut notices) =
        arrange(&rows, objects.len(), |k| format!("object {}", objects[k])).map_err(|e| e.at(name))?;
    if let Some(row) = rows.rows.iter().find(|r| r.xy.iter().any(|v| v.is_infinite())) {
        return Err(Error::input(format!(
            "the position ({}, {}) is infinite; expected numbers, or empty fields where the object is not visible",
            row.xy[0], row.xy[1]
        ))
        .at(format!("{name}: line {}", row.line)));
    }
    notices.extend(point_notices(
        &points,
        "positions are missing: the object counts as not visible in that frame",
    ));
    let content = GroundTruth::new(keys, objects, points).map_err(|e| e.at(name))?;
    Ok(Table { content, notices })
}

/// Parses a keypoint table; keypoints are counted from 0. `name` is the file's, for messages.
///
/// # Errors
/// As [`parse_ground_truth`]; also when the keypoints are not numbered 0 to N - 1.
pub fn parse_keypoints(bytes: &[u8], name: &str) -> Result<Table<KeypointTrack>> {
    let rows = read(bytes, "keypoint", |text| match text.parse::<usize>() {
        Ok(n) if n < MAX_KEYPOINTS => Ok(n),
        _ => Err(format!(
            "`{text}` is not a keypoint; expected its number, 0 to {}",
            MAX_KEYPOINTS - 1
        )),
    })
    .map_err(|e| e.at(name))?;
    let count = rows.rows.iter().map(|r| r.point + 1).max().unwrap_or(0);
    let mut seen = vec![false; count];
    for row in &rows.rows {
        seen[row.point] = true;
    }
    if let Some(missing) = seen.iter().position(|s| !s) {
        return Err(Error::input(format!(
            "keypoint {missing} has no row, although keypoint {} has; expected keypoints numbered from 0",
            count - 1
        ))
        .at(name));
    }
    let (keys, points, mut notices) =
        arrange(&rows, count, |n| format!("keypoint {n}")).map_err(|e| e.at(name))?;
    notices.extend(point_notices(&points, "keypoints are missing or not finite"));
    let content = KeypointTrack::new(keys, points).map_err(|e| e.at(name))?;
    Ok(Table { content, notices })
}

/// How many points are missing, in the words of `missing`, and what looks like another unit than ndc.
pub(super) fn point_notices(points: &Array3<f64>, missing: &str) -> Vec<String> {
    let hidden: usize = points.outer_iter().map(|frame| hidden(&frame)).sum();
    let (frames, count, _) = points.dim();
    let notice = (hidden > 0).then(|| format!("{hidden} of {} {missing}", frames * count));
    notice.into_iter().chain(unit_notice(points)).collect()
}

/// What looks like another unit than ndc.
fn unit_notice(points: &Array3<f64>) -> Option<String> {
    let seen = || points.iter().filter(|v| v.is_finite());
    let far = seen().filter(|v| v.abs() > 16.0).count();
    if far > 0 {
        return Some(format!(
            "{far} coordinates lie beyond ±16: are these pixels? Expected ndc, -1 to +1 across the image"
        ));
    }
    let none_negative = seen().count() >= 20 && seen().all(|v| *v >= 0.0);
    none_negative.then(|| {
        "no coordinate is negative: is this another unit, e.g. 0 to 1 across the image? Expected ndc, -1 to +1"
            .to_owned()
    })
}

/// A keypoint table as CSV, with every digit needed to read the same numbers again.
pub fn keypoints_csv(track: &KeypointTrack) -> String {
    use std::fmt::Write as _;
    let mut out = String::from("sequence,frame,keypoint,x,y\n");
    for (key, points) in track.keys().iter().zip(track.points().outer_iter()) {
        let sequence = quote_csv(&key.sequence);
        for (n, point) in points.rows().into_iter().enumerate() {
            // Writing to a String cannot fail.
            let _ = writeln!(out, "{sequence},{},{n},{},{}", key.frame, point[0], point[1]);
        }
    }
    out
}

/// A ground-truth table as CSV, with every digit needed to read the same numbers again; x and y are empty where an
/// object is not visible.
pub fn ground_truth_csv(truth: &GroundTruth) -> String {
    use std::fmt::Write as _;
    let mut out = String::from("sequence,frame,object,x,y\n");
    for (key, points) in truth.keys().iter().zip(truth.points_ndc().outer_iter()) {
        let sequence = quote_csv(&key.sequence);
        for (name, point) in truth.names().iter().zip(points.rows()) {
            let name = quote_csv(name);
            // Writing to a String cannot fail.
            let _ = match point.iter().all(|v| v.is_finite()) {
                true => writeln!(out, "{sequence},{},{name},{},{}", key.frame, point[0], point[1]),
                false => writeln!(out, "{sequence},{},{name},,", key.frame),
            };
        }
    }
    out
}

/// A CSV field, quoted where it must be.
pub(crate) fn quote_csv(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) || field.trim() != field {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

fn hidden(points: &ndarray::ArrayView2<f64>) -> usize {
    let unseen = |p: &ndarray::ArrayView1<f64>| p.iter().any(|v| !v.is_finite());
    points.rows().into_iter().filter(|p| unseen(p)).count()
}

struct Row {
    line: u64,
    sequence: usize,
    frame: u64,
    point: usize,
    xy: [f64; 2],
}

struct Rows {
    sequences: Vec<String>,
    rows: Vec<Row>,
    notices: Vec<String>,
}

/// Reads the rows of a tidy table whose points are named in the column `point_column`.
fn read(
    bytes: &[u8],
    point_column: &str,
    mut parse_point: impl FnMut(&str) -> Result<usize, String>,
) -> Result<Rows> {
    let columns = ["sequence", "frame", point_column, "x", "y"];
    let expected = columns.join(",");
    let text = decode(bytes)?;
    let mut notices = Vec::new();
    let first_line = text.lines().next().unwrap_or_default();
    if first_line.trim().is_empty() {
        return Err(Error::input(format!(
            "the table has no header; expected `{expected}` in the first line"
        )));
    }
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
    let find = |column: &str| header.iter().position(|h| h.eq_ignore_ascii_case(column));
    let missing: Vec<&str> = columns.into_iter().filter(|c| find(c).is_none()).collect();
    if !missing.is_empty() {
        let found: Vec<&str> = header.iter().collect();
        let (other, what) = match point_column {
            "object" => ("keypoint", "keypoints"),
            _ => ("object", "ground truth"),
        };
        let swapped = match find(other) {
            Some(_) => format!("; this is a table of {what}: are the two tables swapped?"),
            None => String::new(),
        };
        return Err(Error::input(format!(
            "line 1: column{} {} missing; expected `{expected}`, found `{}`{swapped}",
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
        notices.push(format!("ignored: {}", quote_list(&ignored)));
    }
    if let Some(twice) = columns
        .iter()
        .find(|c| header.iter().filter(|h| h.eq_ignore_ascii_case(c)).count() > 1)
    {
        return Err(Error::input(format!("line 1: column `{twice}` stands twice")));
    }

    let mut sequences: Vec<String> = Vec::new();
    let mut sequence_numbers: HashMap<String, usize> = HashMap::new();
    let mut rows = Vec::new();
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(|e| unreadable(&e))? {
        let line = record.position().map_or(0, csv::Position::line);
        if record.len() != header.len() {
            return Err(Error::input(format!(
                "{} fields; expected {} as in the header{}",
                record.len(),
                header.len(),
                if reader.is_done() {
                    " (is the file cut short?)"
                } else {
                    ""
                }
            ))
            .at(format!("line {line}")));
        }
        let field = |column: usize| record.get(at[column]).unwrap_or_default();
        let wrong = |column: usize, message: String| {
            Error::input(message).at(format!("line {line}, column `{}`", columns[column]))
        };
        let sequence = match sequence_numbers.get(field(0)) {
            Some(known) => *known,
            None => {
                let name = field(0).to_owned();
                if name.is_empty() {
                    return Err(wrong(
                        0,
                        "empty; expected the name or number of the sequence".to_owned(),
                    ));
                }
                sequences.push(name.clone());
                sequence_numbers.insert(name, sequences.len() - 1);
                sequences.len() - 1
            }
        };
        let frame = field(1).parse().map_err(|_| {
            wrong(
                1,
                format!("`{}` is not a frame; expected a whole number from 0", field(1)),
            )
        })?;
        let point = parse_point(field(2)).map_err(|message| wrong(2, message))?;
        let mut xy = [f64::NAN; 2];
        for axis in 0..2 {
            let text = field(3 + axis);
            if text.is_empty() || text.eq_ignore_ascii_case("na") {
                continue;
            }
            xy[axis] = text.parse().map_err(|_| {
                let hint = if text.contains(',') {
                    " with a decimal point"
                } else {
                    ""
                };
                wrong(
                    3 + axis,
                    format!("`{text}` is not a number; expected a number{hint}"),
                )
            })?;
        }
        rows.push(Row {
            line,
            sequence,
            frame,
            point,
            xy,
        });
    }
    if rows.is_empty() {
        return Err(Error::input(format!(
            "the table has a header and no rows; expected one row a point (`{expected}`)"
        )));
    }
    Ok(Rows {
        sequences,
        rows,
        notices,
    })
}

/// The points as T x P x 2 in the order of sequence (natural) and frame, NaN where no row gives one.
fn arrange(
    table: &Rows,
    points: usize,
    name_of: impl Fn(usize) -> String,
) -> Result<(Vec<FrameKey>, Array3<f64>, Vec<String>)> {
    let mut order: Vec<usize> = (0..table.sequences.len()).collect();
    order.sort_by(|a, b| natural(&table.sequences[*a], &table.sequences[*b]));
    let mut rank = vec![0; order.len()];
    for (position, sequence) in order.iter().enumerate() {
        rank[*sequence] = position;
    }
    let place = |row: &Row| (rank[row.sequence], row.frame);
    let mut frames: Vec<(usize, u64)> = table.rows.iter().map(place).collect();
    frames.sort_unstable();
    frames.dedup();
    let mut values = Array3::from_elem((frames.len(), points, 2), f64::NAN);
    let mut lines = vec![0u64; frames.len() * points];
    for row in &table.rows {
        let Ok(t) = frames.binary_search(&place(row)) else {
            continue;
        };
        let line = &mut lines[t * points + row.point];
        if *line != 0 {
            return Err(Error::input(format!(
                "sequence {}, frame {}, {} stands already in line {line}; expected one row a point",
                table.sequences[row.sequence],
                row.frame,
                name_of(row.point)
            ))
            .at(format!("line {}", row.line)));
        }
        *line = row.line;
        for axis in 0..2 {
            values[[t, row.point, axis]] = row.xy[axis];
        }
    }
    let keys = frames
        .into_iter()
        .map(|(position, frame)| FrameKey {
            sequence: table.sequences[order[position]].clone(),
            frame,
        })
        .collect();
    Ok((keys, values, table.notices.clone()))
}

pub(super) fn natural(a: &str, b: &str) -> std::cmp::Ordering {
    alphanumeric_sort::compare_str(a, b)
}

fn quote_list(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|n| format!("`{n}`")).collect();
    quoted.join(", ")
}

fn decode(bytes: &[u8]) -> Result<&str> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(Error::input(
            "the table is UTF-16; save it as \"CSV UTF-8\" and try again",
        ));
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if bytes.contains(&0) {
        return Err(Error::input("not a text file; expected a CSV table"));
    }
    std::str::from_utf8(bytes).map_err(|e| {
        let line = bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count() + 1;
        Error::input("not valid UTF-8; save the table as \"CSV UTF-8\" and try again")
            .at(format!("line {line}"))
    })
}

fn unreadable(error: &csv::Error) -> Error {
    Error::input(format!("not a readable CSV table: {error}"))
}
