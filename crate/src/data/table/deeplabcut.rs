//! DeepLabCut's CSV: labels (`CollectedData_….csv`) and analyses of videos, of one animal or
//! several.
//!
//! The header has the rows `scorer`, `individuals` (several animals only), `bodyparts` and
//! `coords`. A row of labels begins with the path of its image, `labeled-data/VIDEO/img0001.png`,
//! in one field or in three; a row of an analysis with the number of its frame.

use super::fields::{Delimited, coordinate, wrong_field};
use super::rows::{Raw, Row, Sequences};
use crate::data::names::{cleaned, last_number};
use crate::data::reading::Layout;
use crate::error::{Error, Result};

/// What the video is called before the name that an analysis adds to it, `VIDEODLC_resnet50_…`.
const ANALYSIS: &str = "DLC_";

pub fn read(mut table: Delimited, stem: &str) -> Result<Raw> {
    let mut rows_of_header = Vec::new();
    let coords = loop {
        let Some((record, line)) = table.next()? else {
            return Err(Error::input(
                "the header has no row `coords`; expected the rows scorer, bodyparts and coords, as DeepLabCut writes them",
            ));
        };
        match record.get(0).unwrap_or_default() {
            "coords" => break record,
            "individuals" | "bodyparts" => rows_of_header.push(record),
            other => {
                return Err(Error::input(format!(
                    "the row begins with `{other}`; expected `individuals`, `bodyparts` or `coords`, as in DeepLabCut's \
                     header"
                ))
                .at(format!("line {line}")));
            }
        }
    };
    let row = |name: &str| {
        rows_of_header
            .iter()
            .find(|record| record.get(0) == Some(name))
    };
    let Some(bodyparts) = row("bodyparts") else {
        return Err(Error::input("the header has no row `bodyparts`"));
    };
    let individuals = row("individuals");
    // Labels of newer versions have their path in three fields, with nothing above the last two.
    let first = (1..coords.len())
        .find(|i| coords.get(*i).is_some_and(|c| !c.is_empty()))
        .unwrap_or(coords.len());
    let mut points: Vec<(String, [Option<usize>; 2])> = Vec::new();
    let mut likelihoods = 0;
    for i in first..coords.len() {
        let axis = match coords.get(i).unwrap_or_default() {
            "x" => 0,
            "y" => 1,
            "likelihood" => {
                likelihoods += 1;
                continue;
            }
            other => {
                return Err(Error::input(format!(
                    "column {}: the coordinate `{other}`; expected x, y or likelihood",
                    i + 1
                )));
            }
        };
        let part = bodyparts.get(i).unwrap_or_default();
        let name = match individuals.and_then(|record| record.get(i)) {
            // What belongs to no animal, or to the only one.
            None | Some("" | "single") => cleaned(part).into_owned(),
            Some(individual) => cleaned(&format!("{individual}/{part}")).into_owned(),
        };
        let at = match points.iter().position(|(n, _)| *n == name) {
            Some(at) => at,
            None => {
                points.push((name, [None; 2]));
                points.len() - 1
            }
        };
        let column = &mut points[at].1[axis];
        if column.replace(i).is_some() {
            let name = &points[at].0;
            return Err(Error::input(format!(
                "column {}: `{name}` has this coordinate already",
                i + 1
            )));
        }
    }
    let mut columns = Vec::new();
    for (name, found) in &points {
        let [Some(x), Some(y)] = *found else {
            return Err(Error::input(format!(
                "`{name}` has one coordinate; expected x and y"
            )));
        };
        columns.push([x, y]);
    }
    if columns.is_empty() {
        return Err(Error::input("the header names no body part"));
    }
    if likelihoods > 0 {
        table.notices.push(
            "likelihoods are ignored: every position counts"
                .to_owned()
                .into(),
        );
    }

    let video = stem
        .split(ANALYSIS)
        .next()
        .filter(|name| !name.is_empty())
        .unwrap_or(stem);
    let mut sequences = Sequences::default();
    let mut rows = Vec::new();
    while let Some((record, line)) = table.next()? {
        let field = |column: usize| record.get(column).unwrap_or_default();
        let path: Vec<&str> = (0..first)
            .flat_map(|i| field(i).split(['/', '\\']))
            .collect();
        let wrong = |message: String| wrong_field(line, "scorer", message);
        let (sequence, frame) = match path.as_slice() {
            [number]
                if number
                    .parse::<f64>()
                    .is_ok_and(|n| n >= 0.0 && n.fract() == 0.0) =>
            {
                let number: f64 = number.parse().unwrap_or_default();
                (video, number as u64)
            }
            [.., folder, image] => {
                let frame = last_number(image).ok_or_else(|| {
                    wrong(format!(
                        "`{image}` has no number; expected an image with the number of its frame"
                    ))
                })?;
                (*folder, frame)
            }
            _ => {
                return Err(wrong(format!(
                    "`{}` is neither a frame nor the path of an image; expected e.g. `12` or `labeled-data/video/img012.png`",
                    field(0)
                )));
            }
        };
        let sequence = sequences.number(sequence).map_err(wrong)?;
        for (point, [x, y]) in columns.iter().enumerate() {
            let at = |column: usize| {
                let name = format!(
                    "{} {}",
                    points[point].0,
                    coords.get(column).unwrap_or_default()
                );
                coordinate(field(column)).map_err(|message| wrong_field(line, &name, message))
            };
            rows.push(Row {
                line,
                sequence,
                frame,
                point,
                xy: [at(*x)?, at(*y)?],
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
        layout: Layout::DeepLabCut,
        sequences: sequences.names,
        points: points.into_iter().map(|(name, _)| name).collect(),
        rows,
        notices: table.notices,
        lacks_size: false,
    })
}
