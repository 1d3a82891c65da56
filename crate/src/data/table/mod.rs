//! Tables of points: one way in for every layout that is read.
//!
//! - *tidy*: one row a point; ground truth has the columns `sequence,frame,object,x,y`, keypoints
//!   `sequence,frame,keypoint,x,y`;
//! - *wide*: one row a frame, two columns a point, `cube_x,cube_y`;
//! - *DeepLabCut*: CSV with three header rows (`scorer`, `bodyparts`, `coords`) or four
//!   (`individuals` as well), of labels or of an analysis;
//! - *COCO*: JSON with `images`, `annotations` and their `keypoints`, and `categories`.
//!
//! Columns may come in any order, further ones are ignored and reported. Comma, semicolon and tab
//! separate; a byte order mark and CRLF are accepted. A point with empty (or `nan`) x and y, or
//! without a row, is not visible.
//!
//! The result is in ndc. Positions in pixels have the centre of the first pixel at (0, 0), as
//! everywhere here (see [`track`](crate::track)); they need the size of the images, which only COCO
//! files have.

mod coco;
mod deeplabcut;
mod delimited;
mod tidy;
mod wide;

use std::collections::HashMap;
use std::fmt;
use std::str::FromStr;

use ndarray::Array3;

pub(super) use delimited::layout as header_layout;

use super::recording::AxisOrder;
use crate::error::{Error, Result};
use crate::track::{FrameKey, GroundTruth, KeypointTrack};

/// A parsed table with what a person should know of how it was read.
#[derive(Debug, Clone, PartialEq)]
pub struct Table<T> {
    /// The content.
    pub content: T,
    /// What its numbers were taken for.
    pub reading: Reading,
    /// E.g. that semicolons separate the fields, or how many points are missing.
    pub notices: Vec<String>,
}

/// What the numbers of a table were taken for, and what said so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reading {
    /// How the table is written.
    pub layout: Layout,
    /// The unit of the positions.
    pub space: Known<Space>,
    /// The order of the coordinates.
    pub axes: Known<AxisOrder>,
    /// The number of the first frame.
    pub index_base: Known<u64>,
}

/// A value with its ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Known<T> {
    /// The value.
    pub value: T,
    /// What it rests on.
    pub by: Ground,
}

impl<T> Known<T> {
    /// What a person said; without that `otherwise`, on its own ground.
    pub(super) fn of(said: Option<T>, otherwise: T, by: Ground) -> Self {
        match said {
            Some(value) => Self {
                value,
                by: Ground::Said,
            },
            None => Self {
                value: otherwise,
                by,
            },
        }
    }
}

/// What a value rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ground {
    /// A person said so.
    Said,
    /// The file says so, or its layout always has it so.
    File,
    /// Nothing: the usual case is taken.
    Guess,
}

impl Ground {
    /// `said`, `file` or `guess`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Said => "said",
            Self::File => "file",
            Self::Guess => "guess",
        }
    }
}

/// The unit of a table's positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Space {
    /// -1 and +1 at the outer edges of the image.
    Ndc,
    /// Pixels, with the centre of the first one at (0, 0).
    Pixels,
}

impl Space {
    /// `ndc` or `px`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ndc => "ndc",
            Self::Pixels => "px",
        }
    }
}

impl FromStr for Space {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "ndc" => Ok(Self::Ndc),
            "px" => Ok(Self::Pixels),
            _ => Err(Error::input(format!(
                "`{text}` is no space; expected ndc or px"
            ))),
        }
    }
}

/// How a table is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// One row a point.
    Tidy,
    /// One row a frame, two columns a point.
    Wide,
    /// DeepLabCut's CSV.
    DeepLabCut,
    /// COCO keypoints, JSON.
    Coco,
    /// Arrays of a recording, NPZ or HDF5.
    Arrays,
    /// None: the points were extracted here.
    Extraction,
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Tidy => "one row a point",
            Self::Wide => "one row a frame",
            Self::DeepLabCut => "DeepLabCut",
            Self::Coco => "COCO keypoints",
            Self::Arrays => "arrays of a recording",
            Self::Extraction => "an extraction",
        })
    }
}

/// What a person knows about a table and the file does not say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TableOptions {
    /// The unit of the positions; default: pixels for DeepLabCut and COCO, otherwise ndc.
    pub space: Option<Space>,
    /// The order of the two coordinates under the names x and y; default: (x, y).
    pub axes: Option<AxisOrder>,
    /// The number of the first frame, and in a tidy table of the first keypoint; default: 0.
    pub index_base: Option<u64>,
    /// `[width, height]` of the images; needed for positions in pixels, but for COCO.
    pub image_size: Option<[u32; 2]>,
}

/// Points as a file gives them.
struct Raw {
    layout: Layout,
    sequences: Vec<String>,
    /// The names of the points.
    points: Vec<String>,
    rows: Vec<Row>,
    notices: Vec<String>,
}

/// One point.
struct Row {
    /// Where it is in the file; an annotation's position for JSON.
    line: u64,
    sequence: usize,
    frame: u64,
    point: usize,
    xy: [f64; 2],
    /// Of its image, where the file says so.
    image_size: Option<[u32; 2]>,
}

/// The names of sequences, numbered as they come.
#[derive(Default)]
struct Sequences {
    names: Vec<String>,
    numbers: HashMap<String, usize>,
}

impl Sequences {
    fn number(&mut self, name: &str) -> Result<usize, String> {
        if name.is_empty() {
            return Err("empty; expected the name or number of the sequence".to_owned());
        }
        if let Some(known) = self.numbers.get(name) {
            return Ok(*known);
        }
        self.names.push(name.to_owned());
        self.numbers.insert(name.to_owned(), self.names.len() - 1);
        Ok(self.names.len() - 1)
    }
}

/// Which points a table is to hold.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Content {
    GroundTruth,
    Keypoints,
}

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
) -> Result<Table<GroundTruth>> {
    let read = || {
        let (raw, reading) = read(bytes, name, Content::GroundTruth, options)?;
        if let Some(row) = raw
            .rows
            .iter()
            .find(|r| r.xy.iter().any(|v| v.is_infinite()))
        {
            return Err(Error::input(format!(
                "the position ({}, {}) is infinite; expected numbers, or empty fields where the object is not visible",
                row.xy[0], row.xy[1]
            ))
            .at(format!("line {}", row.line)));
        }
        let names = raw.points.clone();
        let (keys, points, mut notices) = arrange(&raw, |k| format!("object {}", names[k]))?;
        notices.extend(point_notices(
            &points,
            "positions are missing: the object counts as not visible in that frame",
        ));
        let content = GroundTruth::new(keys, names, points)?;
        Ok(Table {
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
) -> Result<Table<KeypointTrack>> {
    let read = || {
        let (raw, reading) = read(bytes, name, Content::Keypoints, options)?;
        let count = raw.points.len();
        let mut seen = vec![false; count];
        for row in &raw.rows {
            seen[row.point] = true;
        }
        if let Some(missing) = seen.iter().position(|s| !s) {
            return Err(Error::input(format!(
                "keypoint {missing} has no row, although keypoint {} has; expected keypoints numbered from {}",
                count - 1,
                reading.index_base.value
            )));
        }
        let (keys, points, mut notices) = arrange(&raw, |n| format!("keypoint {n}"))?;
        notices.extend(point_notices(
            &points,
            "keypoints are missing or not finite",
        ));
        let content = KeypointTrack::new(keys, points)?;
        Ok(Table {
            content,
            reading,
            notices,
        })
    };
    read().map_err(|e: Error| e.at(name))
}

/// Reads a table of any layout, in ndc.
fn read(
    bytes: &[u8],
    name: &str,
    content: Content,
    options: &TableOptions,
) -> Result<(Raw, Reading)> {
    let text = decode(bytes)?;
    let mut raw = match text.trim_start().starts_with('{') {
        true => coco::read(text)?,
        false => delimited::read(text, name, content, options)?,
    };
    if raw.layout != Layout::Tidy {
        raw.notices
            .insert(0, format!("read as a table of the layout: {}", raw.layout));
        if content == Content::Keypoints {
            let (first, last) = (raw.points.first(), raw.points.last());
            if let (Some(first), Some(last)) = (first, last) {
                let range = format!(
                    "keypoint 0 is `{first}`, keypoint {} is `{last}`",
                    raw.points.len() - 1
                );
                raw.notices.push(range);
            }
        }
    }
    let reading = Reading::new(raw.layout, options);
    if reading.axes.value == AxisOrder::Yx {
        for row in &mut raw.rows {
            row.xy.swap(0, 1);
        }
    }
    let base = reading.index_base.value;
    for row in &mut raw.rows {
        row.frame = row.frame.checked_sub(base).ok_or_else(|| {
            Error::input(format!(
                "the frame {}; expected frames from {base}",
                row.frame
            ))
            .at(format!("line {}", row.line))
        })?;
    }
    if reading.space.value == Space::Pixels {
        for row in &mut raw.rows {
            let Some(size) = row.image_size.or(options.image_size) else {
                return Err(Error::input(format!(
                    "the positions are in pixels ({}), and the size of the images is not known; give the frames along, or the \
                     size (--image-size 256x256), or say that the positions are in ndc (--space ndc)",
                    match options.space {
                        Some(_) => "as was said",
                        None => "as always in this layout",
                    }
                )));
            };
            row.xy = ndc_from_pixels(row.xy, size);
        }
    }
    Ok((raw, reading))
}

/// A position in pixels, the centre of the first one at (0, 0), in ndc.
pub(super) fn ndc_from_pixels(px: [f64; 2], image_size: [u32; 2]) -> [f64; 2] {
    [0, 1].map(|axis| (2.0 * px[axis] + 1.0) / f64::from(image_size[axis]) - 1.0)
}

impl Reading {
    /// What a table of this layout is taken for.
    fn new(layout: Layout, options: &TableOptions) -> Self {
        let (space, by) = match layout {
            Layout::Tidy | Layout::Wide => (Space::Ndc, Ground::Guess),
            Layout::DeepLabCut | Layout::Coco => (Space::Pixels, Ground::File),
            Layout::Arrays | Layout::Extraction => (Space::Ndc, Ground::File),
        };
        Self {
            layout,
            space: Known::of(options.space, space, by),
            // All of these name their columns or say which number is which.
            axes: Known::of(options.axes, AxisOrder::Xy, Ground::File),
            index_base: Known::of(options.index_base, 0, Ground::Guess),
        }
    }

    /// Of points that were extracted here.
    pub fn of_extraction() -> Self {
        let mut reading = Self::new(Layout::Extraction, &TableOptions::default());
        reading.index_base.by = Ground::File;
        reading
    }
}

/// How many points are missing, in the words of `missing`, and what looks like another unit than
/// ndc.
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
            "{far} coordinates lie beyond ±16: are these pixels? Expected ndc, -1 to +1 across the image, or to be told of pixels: \
             `--space px` for a ground truth, `--keypoints-space px` for keypoints, with `--image-size WxH`; on the page, the unit \
             in the list of files"
        ));
    }
    // A pixel of 256 x 256 is 1/128 wide.
    if seen().count() >= 20 && seen().all(|v| *v < -0.97) {
        return Some(
            "all coordinates lie in the first corner of the image: are they ndc already, and read as pixels?"
                .to_owned(),
        );
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
            let _ = writeln!(
                out,
                "{sequence},{},{n},{},{}",
                key.frame, point[0], point[1]
            );
        }
    }
    out
}

/// A ground-truth table as CSV, with every digit needed to read the same numbers again; x and y are
/// empty where an object is not visible.
pub fn ground_truth_csv(truth: &GroundTruth) -> String {
    use std::fmt::Write as _;
    let mut out = String::from("sequence,frame,object,x,y\n");
    for (key, points) in truth.keys().iter().zip(truth.points_ndc().outer_iter()) {
        let sequence = quote_csv(&key.sequence);
        for (name, point) in truth.names().iter().zip(points.rows()) {
            let name = quote_csv(name);
            // Writing to a String cannot fail.
            let _ = match point.iter().all(|v| v.is_finite()) {
                true => writeln!(
                    out,
                    "{sequence},{},{name},{},{}",
                    key.frame, point[0], point[1]
                ),
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

/// The points as T x P x 2 in the order of sequence (natural) and frame, NaN where no row gives
/// one.
fn arrange(
    table: &Raw,
    name_of: impl Fn(usize) -> String,
) -> Result<(Vec<FrameKey>, Array3<f64>, Vec<String>)> {
    let points = table.points.len();
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
        let line = bytes[..e.valid_up_to()]
            .iter()
            .filter(|b| **b == b'\n')
            .count()
            + 1;
        Error::input("not valid UTF-8; save the table as \"CSV UTF-8\" and try again")
            .at(format!("line {line}"))
    })
}
