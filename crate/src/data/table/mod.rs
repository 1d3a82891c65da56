//! Tables of points: one way in for every layout that is read.
//!
//! - *tidy*: one row a point; ground truth has the columns `sequence,frame,object,x,y`, keypoints
//!   `sequence,frame,keypoint,x,y`;
//! - *wide*: one row a frame, two columns a point, `cube_x,cube_y`;
//! - *DeepLabCut*: CSV with three header rows (`scorer`, `bodyparts`, `coords`) or four
//!   (`individuals` as well), of labels or of an analysis;
//! - *SLEAP*: the CSV of an analysis, wide with a track and scores;
//! - *MOT*: boxes in rows without a header, whose centres are the points;
//! - *COCO*: JSON with `images`, `annotations` and their `keypoints`, and `categories`, or a list of
//!   results.
//!
//! Columns may come in any order, further ones are ignored and reported. Comma, semicolon and tab
//! separate; a byte order mark, UTF-16 and CRLF are accepted. A point with empty (or `nan`) x and y,
//! or without a row, is not visible. A `likelihood`, `score` or `confidence` (COCO's v) says how sure
//! a point is; `visible` as well, and 0 hides it.
//!
//! Points may have a z (`cube_x,cube_y,cube_z`; a column `z`; DeepLabCut's `z`): they are in space
//! then, and stay in the unit of the file.
//!
//! Otherwise the result is in ndc. Positions in pixels have the centre of the first pixel at (0, 0), as
//! everywhere here (see [`track`](crate::track)); they need the size of the images, which only COCO
//! files have.

mod coco;
mod columns;
mod deeplabcut;
mod delimited;
mod fields;
mod mot;
mod rows;
mod space;
mod tidy;
mod wide;
mod write;
mod write_coco;
mod write_deeplabcut;

use std::borrow::Cow;
use std::num::NonZeroU32;

use ndarray::{Array2, Array3};

pub use columns::Columns;
#[cfg(feature = "report")]
pub(crate) use write::quote_csv;
pub use write::{ground_truth_csv, keypoints_csv};
pub use write_coco::coco_json;
pub use write_deeplabcut::deeplabcut_csv;

use super::names::natural_order;
use super::reading::{
    AxisOrder, Layout, Notice, Parsed, Reading, TableOptions, missing_image_size, point_notices,
};
use crate::error::{Error, Reason, Result};
use crate::memory;
use crate::track::{FrameKey, GroundTruth, KeypointTrack, MOST_AXES};
use rows::{Content, Raw, Row};
use space::check_heights;

/// Bytes of a point in a frame: its position, its confidence, and the row that gives it.
const CELL: u64 = 2 * 8 + 8 + 4;

/// Tables that take no more bytes may be as sparse as they like.
const SPARSE_FROM: u64 = 64 << 20;

/// How many positions there may be for one that is given.
const MAX_SPARSENESS: u64 = 256;

/// Parses a ground-truth table. `name` is the file's, for messages, and of the sequence where the
/// table has none.
///
/// # Errors
/// When the layout is none of those known, a field is not what it should be, a point stands twice,
/// there is no point, or positions are in pixels of unknown images; the message gives line and
/// column.
pub fn parse_ground_truth(
    bytes: &[u8],
    name: &str,
    options: &TableOptions,
) -> Result<Parsed<GroundTruth>> {
    let read = || {
        let (raw, reading) = read(bytes, name, Content::GroundTruth, options)?;
        check_finite(&raw)?;
        let names = raw.points.clone();
        let Arranged {
            keys,
            points,
            confidence,
            mut notices,
        } = arrange(&raw, &|k| format!("object {}", names[k]))?;
        notices.extend(point_notices(
            &points,
            "positions are missing: the object counts as not visible in that frame",
        ));
        check_size(&raw, &reading)?;
        let content = GroundTruth::new(keys, names, points)?.with_confidence(confidence)?;
        Ok(Parsed {
            content,
            reading,
            notices,
        })
    };
    read().map_err(|e: Error| e.at(name))
}

/// Parses a keypoint table; keypoints are counted from 0, in the order of the columns where they
/// have names. `name` is the file's.
///
/// # Errors
/// As [`parse_ground_truth`]; also when the keypoints of a tidy table are not numbered 0 to N - 1.
pub fn parse_keypoints(
    bytes: &[u8],
    name: &str,
    options: &TableOptions,
) -> Result<Parsed<KeypointTrack>> {
    let read = || {
        let (raw, reading) = read(bytes, name, Content::Keypoints, options)?;
        let count = raw.points.len();
        let mut seen = vec![raw.layout != Layout::Tidy; count];
        for row in &raw.rows {
            seen[row.point as usize] = true;
        }
        if let Some(missing) = seen.iter().position(|s| !s) {
            let first = reading.first_keypoint;
            let last = count - 1;
            let from_one = missing == 0 && first == 0 && last > 0 && seen[1..].iter().all(|s| *s);
            let range = match from_one {
                true => format!(": the keypoints run 1 to {last}"),
                false => String::new(),
            };
            let error = Error::input(format!(
                "keypoint {missing} has no row, although keypoint {last} has{range}; expected keypoints numbered from \
                 {first}"
            ));
            return Err(match from_one {
                true => error.because(Reason::KeypointsFromOne),
                false => error,
            });
        }
        let Arranged {
            keys,
            points,
            confidence,
            mut notices,
        } = arrange(&raw, &|n| format!("keypoint {n}"))?;
        notices.extend(point_notices(
            &points,
            "keypoints are missing or not finite",
        ));
        check_size(&raw, &reading)?;
        let content = KeypointTrack::new(keys, points)?.with_confidence(confidence)?;
        Ok(Parsed {
            content,
            reading,
            notices,
        })
    };
    read().map_err(|e: Error| e.at(name))
}

/// Fails where a position is infinite.
fn check_finite(raw: &Raw) -> Result<()> {
    let is_infinite = |row: &&Row| row.xy.iter().any(|v| v.is_infinite());
    if let Some(row) = raw.rows.iter().find(is_infinite) {
        return Err(Error::input(format!(
            "the position ({}, {}) is infinite; expected numbers, or empty fields where the object is not visible",
            row.xy[0], row.xy[1]
        ))
        .at(raw.place(row)));
    }
    let is_high = |z: &f64| MOST_AXES == 3 && z.is_infinite();
    match raw.heights.iter().position(is_high) {
        Some(at) => Err(Error::input(format!(
            "the z {} is infinite; expected numbers, or empty fields where the object is not visible",
            raw.heights[at]
        ))
        .at(raw.place(&raw.rows[at]))),
        None => Ok(()),
    }
}

/// Fails where positions are in pixels of images of unknown size: last of all, so that the size is
/// all that is missing.
fn check_size(raw: &Raw, reading: &Reading) -> Result<()> {
    match raw.lacks_size {
        true => Err(missing_image_size("the positions", reading.space.by)),
        false => Ok(()),
    }
}

/// Reads a table of any layout, in ndc where the size of the images is known.
fn read(
    bytes: &[u8],
    name: &str,
    content: Content,
    options: &TableOptions,
) -> Result<(Raw, Reading)> {
    let (text, note) = decode(bytes)?;
    let mut raw = match text.trim_start().starts_with(['{', '[']) {
        true => coco::read(&text, delimited::stem(name))?,
        false => delimited::read(&text, name, content, options)?,
    };
    raw.notices.extend(note);
    let lost = raw
        .rows
        .iter()
        .filter(|row| is_lost(row, raw.layout))
        .count();
    if lost > 0 {
        raw.notices.push(Notice::because(
            format!(
                "{lost} points lie at exactly (0, 0) with the least confidence: are they lost?"
            ),
            Reason::LostPoints { points: lost },
        ));
    }
    if raw.layout != Layout::Tidy {
        raw.notices.insert(
            0,
            format!("read as a table of the layout: {}", raw.layout).into(),
        );
        if content == Content::Keypoints {
            let (first, last) = (raw.points.first(), raw.points.last());
            if let (Some(first), Some(last)) = (first, last) {
                let range = format!(
                    "keypoint 0 is `{first}`, keypoint {} is `{last}`",
                    raw.points.len() - 1
                );
                raw.notices.push(range.into());
            }
        }
    }
    let mut reading = Reading::new(raw.layout, options);
    if MOST_AXES == 3 && !raw.heights.is_empty() {
        check_heights(&raw)?;
        reading.in_space(options)?;
    }
    if reading.axes.value == AxisOrder::Yx {
        for row in &mut raw.rows {
            row.xy.swap(0, 1);
        }
    }
    let base = reading.index_base.value;
    if let Some(row) = raw.rows.iter().find(|row| row.frame < base) {
        let message = format!("the frame {}; expected frames from {base}", row.frame);
        return Err(Error::input(message).at(raw.place(row)));
    }
    for row in &mut raw.rows {
        row.frame -= base;
    }
    if MOST_AXES == 3 && !raw.heights.is_empty() {
        for (row, z) in raw.rows.iter_mut().zip(&mut raw.heights) {
            [row.xy[0], row.xy[1], *z] = options.place_in_space([row.xy[0], row.xy[1], *z]);
        }
        return Ok((raw, reading));
    }
    for row in &mut raw.rows {
        let own = row.size.map(|size| raw.sizes[size.get()]);
        match options.place(row.xy, reading.space.value, own.or(options.image_size)) {
            Some(placed) => row.xy = placed,
            None => raw.lacks_size = true,
        }
    }
    reading.image_size = match raw.sizes[..] {
        [size] if raw.rows.iter().all(|row| row.size.is_some()) => Some(size),
        _ => None,
    };
    Ok((raw, reading))
}

/// Whether a point stands where some programs write what they lost.
fn is_lost(row: &Row, layout: Layout) -> bool {
    // COCO's v is 1 for what is there and hidden by something.
    let least = if layout == Layout::Coco { 1.0 } else { 0.0 };
    row.xy == [0.0; 2] && row.confidence <= least
}

/// Points in the order of sequence (natural) and frame.
struct Arranged {
    keys: Vec<FrameKey>,
    /// T x P x 2, NaN where no row gives one.
    points: Array3<f64>,
    /// T x P, where the table has any; NaN where there is none.
    confidence: Option<Array2<f64>>,
    notices: Vec<Notice>,
}

fn arrange(table: &Raw, name_of: &dyn Fn(usize) -> String) -> Result<Arranged> {
    let points = table.points.len();
    let sequences: Vec<&str> = table.sequences.iter().map(|name| &**name).collect();
    let order = natural_order(&sequences);
    let mut rank = vec![0; order.len()];
    for (position, sequence) in order.iter().enumerate() {
        rank[*sequence] = position;
    }
    let place = |row: &Row| (rank[row.sequence as usize], row.frame);
    let mut frames: Vec<(usize, u64)> = table.rows.iter().map(place).collect();
    frames.sort_unstable();
    frames.dedup();
    if u32::try_from(table.rows.len()).is_err() {
        return Err(Error::input("more than 4294967295 points; split the table"));
    }
    check_density(frames.len(), points, table.rows.len())?;
    let axes = if MOST_AXES == 2 || table.heights.is_empty() {
        2
    } else {
        3
    };
    let mut values = Array3::from_elem((frames.len(), points, axes), f64::NAN);
    let confidences = || {
        table
            .rows
            .iter()
            .map(|row| row.confidence)
            .filter(|c| !c.is_nan())
    };
    // Of 0 throughout nothing follows.
    let says_nothing = confidences().all(|confidence| confidence == 0.0);
    let mut confidence =
        (!says_nothing).then(|| Array2::from_elem((frames.len(), points), f64::NAN));
    // By frame and point, the row that gives it.
    let mut given: Vec<Option<NonZeroU32>> = vec![None; frames.len() * points];
    for (number, row) in numbered(&table.rows) {
        let Ok(t) = frames.binary_search(&place(row)) else {
            continue;
        };
        let point = row.point as usize;
        let before = given[t * points + point].replace(number);
        if let Some(before) = before {
            return Err(Error::input(format!(
                "sequence {}, frame {}, {} is already in {}; expected one row a point",
                table.sequences[row.sequence as usize],
                row.frame,
                name_of(point),
                table.place(&table.rows[before.get() as usize - 1]),
            ))
            .at(table.place(row)));
        }
        for axis in 0..2 {
            values[[t, point, axis]] = row.xy[axis];
        }
        if axes == 3 {
            values[[t, point, 2]] = table.heights[number.get() as usize - 1];
        }
        if let Some(confidence) = &mut confidence {
            confidence[[t, point]] = row.confidence;
        }
    }
    let keys = frames
        .into_iter()
        .map(|(position, frame)| FrameKey {
            sequence: table.sequences[order[position]].clone(),
            frame,
        })
        .collect();
    let mut notices = table.notices.clone();
    // Where nothing is visible, that is said by itself.
    let is_seen = values.iter().any(|v| !v.is_nan());
    if says_nothing && is_seen && confidences().next().is_some() {
        notices.push(
            "the confidence is 0 throughout, and is not used"
                .to_owned()
                .into(),
        );
    }
    Ok(Arranged {
        keys,
        points: values,
        confidence,
        notices,
    })
}

/// The rows with their numbers from 1.
fn numbered(rows: &[Row]) -> impl Iterator<Item = (NonZeroU32, &Row)> {
    let numbers = (1..).map_while(NonZeroU32::new);
    numbers.zip(rows)
}

/// Points of which so few are given that the table cannot mean it: every frame holds every point,
/// so that memory would grow with the product of both.
fn check_density(frames: usize, points: usize, rows: usize) -> Result<()> {
    let cells = (frames as u64).saturating_mul(points as u64);
    let bytes = cells.saturating_mul(CELL);
    if bytes > SPARSE_FROM && cells / MAX_SPARSENESS > rows as u64 {
        return Err(Error::input(format!(
            "{rows} rows name {points} points in {frames} frames; expected at least one position in \
             {MAX_SPARSENESS} to be given: are the columns mixed up?"
        )));
    }
    memory::check(bytes, "positions", "score fewer frames or points at a time")
}

/// The layout of a delimited table and the fields of its header, by its first bytes.
pub(crate) fn look_at_table(head: &[u8]) -> (Layout, csv::StringRecord) {
    let even = &head[..head.len() / 2 * 2];
    let text = match utf16(even).flatten() {
        Some(text) => Cow::Owned(text),
        None => String::from_utf8_lossy(head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head)),
    };
    delimited::look_at(&text)
}

/// The text of a table, with what should be known of it.
fn decode(bytes: &[u8]) -> Result<(Cow<'_, str>, Option<Notice>)> {
    if let Some(wide) = utf16(bytes) {
        let text = wide.ok_or_else(|| {
            Error::input(
                "the table is UTF-16 with errors in it; save it as \"CSV UTF-8\" and try again",
            )
        })?;
        return Ok((text.into(), Some("the table is UTF-16".to_owned().into())));
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if bytes.contains(&0) {
        return Err(Error::input("not a text file; expected a CSV table"));
    }
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = bytes[..e.valid_up_to()]
            .iter()
            .filter(|b| **b == b'\n')
            .count()
            + 1;
        Error::input("not valid UTF-8; save the table as \"CSV UTF-8\" and try again")
            .at(format!("line {line}"))
    })?;
    Ok((text.into(), None))
}

/// The text of a table in UTF-16, with a byte order mark or, as every other byte of its beginning
/// shows, without; `None` in the inner place where it has errors.
fn utf16(bytes: &[u8]) -> Option<Option<String>> {
    let is_little = match bytes {
        [0xff, 0xfe, ..] => true,
        [0xfe, 0xff, ..] => false,
        [a, 0, b, 0, ..] if *a != 0 && *b != 0 => true,
        [0, a, 0, b, ..] if *a != 0 && *b != 0 => false,
        _ => return None,
    };
    let unit = |pair: &[u8]| match is_little {
        true => u16::from_le_bytes([pair[0], pair[1]]),
        false => u16::from_be_bytes([pair[0], pair[1]]),
    };
    let units = bytes.chunks_exact(2).map(unit);
    let text: Result<String, _> = char::decode_utf16(units).collect();
    Some(
        text.ok()
            .map(|text| text.trim_start_matches('\u{feff}').to_owned()),
    )
}
