//! Tables with one row a frame and two columns a point (three in space); SLEAP's analysis CSV, which has one row a
//! frame and a track, is such a table.

use std::collections::{HashMap, HashSet};

use super::fields::{Beside, Delimited, wrong_field};
use super::rows::{Points, Raw, Row, Sequences};
use super::space::are_in_space;
use super::write::unescaped;
use crate::data::names::cleaned;
use crate::data::reading::{Layout, TableOptions};
use crate::error::{Error, Reason, Result};
use crate::track::MOST_AXES;

/// The columns of a point.
pub struct Columns {
    /// Its name, cleaned.
    pub name: String,
    x: usize,
    y: usize,
    z: Option<usize>,
    sureness: Option<(Beside, usize)>,
}

/// What frames and sequences are called.
const FRAME: [&str; 6] = [
    "frame",
    "frame_idx",
    "frame_index",
    "frame_id",
    "frame_number",
    "fnum",
];

/// What stands between the name of a point and what a column holds of it.
const BETWEEN: [char; 4] = ['_', '.', '-', ' '];

/// The name of a point in the name of its column: before the axis, `cube_x`, or behind it,
/// `x_cube`, with `_`, `.`, `-` or a space between.
fn point_of<'a>(field: &'a str, axis: &str) -> Option<&'a str> {
    let split = |at: usize| Some((field.get(..at)?, field.get(at..)?));
    let ends = field.len().checked_sub(axis.len()).and_then(split);
    let before = ends
        .filter(|(_, end)| end.eq_ignore_ascii_case(axis))
        .and_then(|(name, _)| name.strip_suffix(BETWEEN));
    let behind = || {
        let (start, name) = split(axis.len())?;
        start
            .eq_ignore_ascii_case(axis)
            .then_some(name)?
            .strip_prefix(BETWEEN)
    };
    let name = before.or_else(behind)?.trim();
    (!name.is_empty()).then_some(name)
}

/// The columns of all points.
pub fn points(header: &csv::StringRecord) -> Vec<Columns> {
    let mut points: Vec<Columns> = Vec::new();
    let (mut ys, mut zs, mut sureness) = (HashMap::new(), HashMap::new(), HashMap::new());
    for (at, field) in header.iter().enumerate() {
        if let Some(name) = point_of(field, "y") {
            ys.entry(name).or_insert(at);
        }
        if let Some(name) = point_of(field, "z") {
            zs.entry(name).or_insert(at);
        }
        let beside = field.rsplit_once(BETWEEN);
        if let Some((name, beside)) = beside.and_then(|(name, b)| Some((name, Beside::of(b)?))) {
            sureness.entry(name.trim()).or_insert((beside, at));
        }
    }
    for (x, field) in header.iter().enumerate() {
        let name = point_of(field, "x");
        let Some((name, y)) = name.and_then(|name| Some((name, *ys.get(name)?))) else {
            continue;
        };
        points.push(Columns {
            name: cleaned(name).into_owned(),
            x,
            y,
            z: zs.get(name).copied(),
            sureness: sureness.get(name).copied(),
        });
    }
    points
}

/// Where a table has what.
struct Header {
    points: Vec<Columns>,
    frame: usize,
    sequence: Option<usize>,
    track: Option<usize>,
}

impl Header {
    fn of(table: &Delimited, options: &TableOptions) -> Result<Self> {
        let mut points = points(&table.header);
        let has_z = points.iter().map(|point| (&*point.name, point.z.is_some()));
        let in_space = are_in_space(has_z, options)? && MOST_AXES == 3;
        if !in_space {
            points.iter_mut().for_each(|point| point.z = None);
        }
        let find = |names: &[&str]| names.iter().find_map(|name| table.column(name));
        let frame = find(&FRAME).ok_or_else(|| {
            let found: Vec<&str> = table.header.iter().collect();
            Error::input(format!(
                "line 1: column `frame` missing; expected e.g. `sequence,frame,{0}_x,{0}_y`, \
                 found `{1}`",
                points.first().map_or("cube", |point| &point.name),
                found.join(",")
            ))
            .because(Reason::OtherColumns {
                missing: vec!["frame".to_owned()],
            })
        })?;
        let (sequence, track) = (
            find(&["sequence"]),
            find(&["track", "individual", "individuals"]),
        );
        let mut names = HashSet::new();
        if let Some(point) = points.iter().find(|point| !names.insert(&point.name)) {
            return Err(Error::input(format!(
                "line 1: column `{}_x` stands twice",
                point.name
            )));
        }
        Ok(Self {
            points,
            frame,
            sequence,
            track,
        })
    }

    /// The columns that say something.
    fn columns(&self) -> impl Iterator<Item = usize> {
        let of_points = self.points.iter().flat_map(|point| {
            let sureness = point.sureness.map(|(_, at)| at);
            [Some(point.x), Some(point.y), point.z, sureness]
        });
        let of_rows = [Some(self.frame), self.sequence, self.track];
        of_points.chain(of_rows).flatten()
    }
}

pub fn read(
    mut table: Delimited,
    stem: &str,
    layout: Layout,
    options: &TableOptions,
) -> Result<Raw> {
    let header = Header::of(&table, options)?;
    table.read_only(header.columns());
    if header.sequence.is_none() {
        table.notices.push(
            format!("there is no column `sequence`; all rows are taken for one, `{stem}`").into(),
        );
    }
    let names = table.header.clone();
    let mut sequences = Sequences::default();
    let mut points = Points::default();
    let mut tracks = Sequences::default();
    // For each track the numbers of its points.
    let mut numbers: Vec<Vec<u32>> = Vec::new();
    let (mut rows, mut heights) = (Vec::new(), Vec::new());
    while let Some((record, line)) = table.next()? {
        let field = |column: usize| record.get(column).unwrap_or_default();
        let wrong = |column: usize| {
            let name = names.get(column).unwrap_or_default();
            move |message: String| wrong_field(line, name, message)
        };
        let sequence = match header.sequence {
            Some(column) => sequences
                .number(unescaped(field(column)))
                .map_err(wrong(column))?,
            None => sequences.number(stem).map_err(wrong(0))?,
        };
        let frame = table
            .frame(field(header.frame))
            .map_err(wrong(header.frame))?;
        // Without a name, what belongs to no track.
        let track = header.track.map(field).filter(|name| !name.is_empty());
        let track = track
            .map(|name| tracks.number(unescaped(name)))
            .transpose()
            .map_err(wrong(0))?;
        let slot = track.map_or(0, |track| track as usize + 1);
        if numbers.len() <= slot {
            numbers.resize_with(slot + 1, Vec::new);
        }
        if numbers[slot].is_empty() {
            let of_track = track.map(|track| format!("{}/", tracks.names[track as usize]));
            let prefix = of_track.unwrap_or_default();
            let number = |point: &Columns| points.number(&format!("{prefix}{}", point.name));
            numbers[slot] = header.points.iter().map(number).collect();
        }
        for (point, columns) in numbers[slot].iter().zip(&header.points) {
            let mut at = |column: usize| table.coordinate(field(column)).map_err(wrong(column));
            let mut xy = [at(columns.x)?, at(columns.y)?];
            let z = columns.z.map(at).transpose()?;
            let mut confidence = f64::NAN;
            if let Some((beside, column)) = columns.sureness {
                confidence = table.sureness(field(column)).map_err(wrong(column))?;
                xy = beside.position(xy, confidence);
            }
            // What is hidden needs no row but the one that shows that the frame is there.
            if xy.iter().all(|v| v.is_nan()) && *point != numbers[slot][0] {
                continue;
            }
            heights.extend(z);
            rows.push(Row {
                line,
                sequence,
                frame,
                point: *point,
                xy,
                confidence,
                size: None,
            });
        }
    }
    if rows.is_empty() {
        return Err(Error::input(
            "the table has a header and no rows; expected one row a frame",
        ));
    }
    Ok(Raw {
        layout,
        sequences: sequences.names,
        points: only_track(points.names, &tracks.names),
        rows,
        heights,
        sizes: Vec::new(),
        notices: table.into_notices(),
        lacks_size: false,
    })
}

/// The names of points without the track where there is only one.
fn only_track(points: Vec<String>, tracks: &[String]) -> Vec<String> {
    let [track] = tracks else { return points };
    let short = |name: &String| {
        let name = name.strip_prefix(track.as_str())?.strip_prefix('/')?;
        Some(name.to_owned())
    };
    let all: Option<Vec<String>> = points.iter().map(short).collect();
    all.unwrap_or(points)
}
