//! DeepLabCut's CSV: labels (`CollectedData_….csv`) and analyses of videos, of one animal or
//! several.
//!
//! The header has the rows `scorer`, `individuals` (several animals only), `bodyparts` and
//! `coords`. A row of labels begins with the path of its image, `labeled-data/VIDEO/img0001.png`,
//! in one field or in three; a row of an analysis with the number of its frame.

use super::fields::{Beside, Delimited, image_number, is_unnamed, whole_number, wrong_field};
use super::rows::{Points, Raw, Row, Sequences};
use super::space::are_in_space;
use crate::data::names::cleaned;
use crate::data::reading::{Layout, TableOptions};
use crate::error::{Error, Result};
use crate::track::MOST_AXES;

/// What the video is called before the name that an analysis adds to it, `VIDEODLC_resnet50_…`.
const ANALYSIS: &str = "DLC_";

/// The columns of a body part.
struct Part {
    name: String,
    x: Option<usize>,
    y: Option<usize>,
    z: Option<usize>,
    sureness: Option<(Beside, usize)>,
}

/// The rows of the header.
struct Header {
    individuals: Option<csv::StringRecord>,
    bodyparts: csv::StringRecord,
    coords: csv::StringRecord,
}

impl Header {
    fn read(table: &mut Delimited) -> Result<Self> {
        let (mut individuals, mut bodyparts) = (None, None);
        loop {
            let Some((record, line)) = table.next()? else {
                return Err(Error::input(
                    "the header has no row `coords`; expected the rows scorer, bodyparts and coords, as DeepLabCut writes them",
                ));
            };
            match record.get(0).unwrap_or_default() {
                "coords" => {
                    return Ok(Self {
                        individuals,
                        bodyparts: bodyparts
                            .ok_or_else(|| Error::input("the header has no row `bodyparts`"))?,
                        coords: record,
                    });
                }
                "individuals" => individuals = Some(record),
                "bodyparts" => bodyparts = Some(record),
                other => {
                    return Err(Error::input(format!(
                        "the row begins with `{other}`; expected `individuals`, `bodyparts` or `coords`, as in DeepLabCut's \
                         header"
                    ))
                    .at(format!("line {line}")));
                }
            }
        }
    }

    /// The first column of a point. Labels of newer versions have their path in three fields, with
    /// nothing above the last two.
    fn first(&self) -> usize {
        let named = |i: &usize| self.coords.get(*i).is_some_and(|cell| !is_unnamed(cell));
        (1..self.coords.len())
            .find(named)
            .unwrap_or(self.coords.len())
    }

    /// The columns of every body part, in the order of the file, and the names of other columns.
    fn parts(&self) -> Result<(Vec<Part>, Vec<String>)> {
        let mut parts: Vec<Part> = Vec::new();
        let mut names = Points::default();
        let mut others = Points::default();
        for i in self.first()..self.coords.len() {
            let coordinate = self.coords.get(i).unwrap_or_default();
            let part = self.bodyparts.get(i).unwrap_or_default();
            let axis = coordinate.to_ascii_lowercase();
            let beside = Beside::of(coordinate);
            if !["x", "y", "z"].contains(&axis.as_str()) && beside.is_none() {
                let name = match is_unnamed(coordinate) {
                    true => format!("column {}", i + 1),
                    false => coordinate.to_owned(),
                };
                others.number(&name);
                continue;
            }
            let individual = self.individuals.as_ref().and_then(|record| record.get(i));
            let name = match individual {
                // What belongs to no animal, or to the only one.
                None | Some("" | "single") => cleaned(part).into_owned(),
                Some(individual) => cleaned(&format!("{individual}/{part}")).into_owned(),
            };
            let at = names.number(&name) as usize;
            if at == parts.len() {
                parts.push(Part {
                    name,
                    x: None,
                    y: None,
                    z: None,
                    sureness: None,
                });
            }
            let part = &mut parts[at];
            let is_twice = match (beside, axis.as_str()) {
                (Some(beside), _) => part.sureness.replace((beside, i)).is_some(),
                (None, "x") => part.x.replace(i).is_some(),
                (None, "z") => part.z.replace(i).is_some(),
                (None, _) => part.y.replace(i).is_some(),
            };
            if is_twice {
                return Err(Error::input(format!(
                    "column {}: `{}` has this coordinate already",
                    i + 1,
                    part.name
                )));
            }
        }
        Ok((parts, others.names))
    }
}

/// The columns of x and y of every body part.
fn columns(parts: &[Part]) -> Result<Vec<[usize; 2]>> {
    if parts.is_empty() {
        return Err(Error::input("the header names no body part"));
    }
    let both = |part: &Part| {
        let both = part.x.zip(part.y).map(|(x, y)| [x, y]);
        both.ok_or_else(|| {
            Error::input(format!(
                "`{}` has one coordinate; expected x and y",
                part.name
            ))
        })
    };
    parts.iter().map(both).collect()
}

/// The sequence and the frame of a row, by the parts of the path before its points. `video` is the
/// sequence where there is but a number; `first` is the first field, for errors.
fn place<'a>(path: &[&'a str], video: &'a str, first: &str) -> Result<(&'a str, u64), String> {
    if let [.., folder, image] = path {
        let frame = image_number(image).ok_or_else(|| {
            format!("`{image}` has no number; expected an image with the number of its frame")
        })?;
        return Ok((folder, frame));
    }
    let frame = path.first().and_then(|number| whole_number(number));
    frame.map(|frame| (video, frame)).ok_or_else(|| {
        format!(
            "`{first}` is neither a frame nor the path of an image; expected e.g. `12` or \
             `labeled-data/video/img012.png`"
        )
    })
}

pub fn read(mut table: Delimited, stem: &str, options: &TableOptions) -> Result<Raw> {
    let header = Header::read(&mut table)?;
    let first = header.first();
    let (parts, mut others) = header.parts()?;
    let has_z = parts.iter().map(|part| (&*part.name, part.z.is_some()));
    let in_space = are_in_space(has_z, options)? && MOST_AXES == 3;
    if !in_space && parts.iter().any(|part| part.z.is_some()) {
        others.push("z".to_owned());
    }
    let columns = columns(&parts)?;
    let others: Vec<&str> = others.iter().map(String::as_str).collect();
    table.leave_out(&others);

    let video = stem
        .split(ANALYSIS)
        .next()
        .filter(|name| !name.is_empty())
        .unwrap_or(stem);
    let mut sequences = Sequences::default();
    let (mut rows, mut heights) = (Vec::new(), Vec::new());
    while let Some((record, line)) = table.next()? {
        let field = |column: usize| record.get(column).unwrap_or_default();
        // pandas writes a row with the name of the index.
        if rows.is_empty()
            && record.iter().skip(1).all(str::is_empty)
            && whole_number(field(0)).is_none()
        {
            continue;
        }
        let path: Vec<&str> = (0..first)
            .flat_map(|i| field(i).split(['/', '\\']))
            .filter(|part| !part.is_empty())
            .collect();
        let wrong = |message: String| wrong_field(line, "scorer", message);
        let (sequence, frame) = place(&path, video, field(0)).map_err(wrong)?;
        let sequence = sequences.number(sequence).map_err(wrong)?;
        for (number, (part, [x, y])) in parts.iter().zip(&columns).enumerate() {
            let wrong = |column: usize| {
                let coordinate = header.coords.get(column).unwrap_or_default();
                let name = format!("{} {coordinate}", part.name);
                move |message| wrong_field(line, &name, message)
            };
            let mut xy = [
                table.coordinate(field(*x)).map_err(wrong(*x))?,
                table.coordinate(field(*y)).map_err(wrong(*y))?,
            ];
            let mut confidence = f64::NAN;
            if let Some((beside, column)) = part.sureness {
                confidence = table.sureness(field(column)).map_err(wrong(column))?;
                xy = beside.position(xy, confidence);
            }
            // What is hidden needs no row but the one that shows that the frame is there.
            if number > 0 && xy.iter().all(|v| v.is_nan()) {
                continue;
            }
            if let Some(column) = part.z.filter(|_| in_space) {
                heights.push(table.coordinate(field(column)).map_err(wrong(column))?);
            }
            rows.push(Row {
                line,
                sequence,
                frame,
                point: number as u32,
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
        layout: Layout::DeepLabCut,
        sequences: sequences.names,
        points: parts.into_iter().map(|part| part.name).collect(),
        rows,
        heights,
        sizes: Vec::new(),
        notices: table.into_notices(),
        lacks_size: false,
    })
}
