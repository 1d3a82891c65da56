//! Which frames of LeRobot's videos are which episode: the tables below `meta/episodes/`.

use bytes::Bytes;
use serde::Serialize;

use super::columns::Column;
use super::{EPISODE, File, episode};
use crate::error::{Error, Result};

const LENGTH: &str = "length";
/// What stands before the name of a camera, and after it what is said of its videos.
const VIDEOS: &str = "videos/";
const CHUNK: &str = "/chunk_index";
const FILE: &str = "/file_index";
const START: &str = "/from_timestamp";

/// The frames of a video that are one episode.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VideoEpisode {
    /// The sequence, as [`export_parquet`](super::export_parquet) calls it in the data.
    pub sequence: String,
    /// The folder below `videos/`.
    pub camera: String,
    /// The video in that folder, without its ending: `chunk-000/file-000`.
    pub video: String,
    /// When its first frame is shown, in seconds of the video.
    pub start: f64,
    /// How many frames it has.
    pub frames: u32,
}

/// The episodes of all cameras, as a table below `meta/episodes/` of LeRobot's data (version 3)
/// lists them. There are none where the data have no videos.
///
/// # Errors
/// As [`export_parquet`](super::export_parquet), and when the table does not say which episodes
/// there are and how long they are; the message names the row.
pub fn read_video_episodes(bytes: Vec<u8>) -> Result<Vec<VideoEpisode>> {
    let file = File::open(Bytes::from(bytes))?;
    let (mut columns, _) = file.columns();
    columns.retain(|column| !column.is_list && is_needed(&column.name));
    let position = |name: &str| columns.iter().position(|column| column.name == name);
    let needed = |name: &str| {
        position(name).ok_or_else(|| {
            Error::input(format!(
                "there is no column `{name}`; expected the episodes of LeRobot's data, version 3"
            ))
        })
    };
    let (number, length) = (needed(EPISODE)?, needed(LENGTH)?);
    let camera = |column: &Column| {
        let name = column.name.strip_prefix(VIDEOS)?.strip_suffix(START)?;
        let chunk = position(&format!("{VIDEOS}{name}{CHUNK}"))?;
        let file = position(&format!("{VIDEOS}{name}{FILE}"))?;
        Some((name.to_owned(), chunk, file, position(&column.name)?))
    };
    let cameras: Vec<_> = columns.iter().filter_map(camera).collect();
    file.check(&columns)?;
    let mut episodes = Vec::new();
    let mut row = 0;
    file.batches(&columns, |readers, rows| {
        let cells = file.cells(&columns, readers, rows, file.allowed())?;
        for i in 0..rows {
            row += 1;
            let text = |column: usize| cells[column][i].as_str();
            let cell = |column: usize, parse: fn(&str) -> Result<f64>| {
                let place = || format!("row {row}, {}", columns[column].place());
                parse(text(column)).map_err(|e| e.at(place()))
            };
            let frames = cell(length, whole)? as u32;
            for (camera, chunk, file, start) in &cameras {
                // An episode need not have a video of every camera.
                if text(*start).is_empty() {
                    continue;
                }
                let (chunk, file) = (cell(*chunk, whole)? as u32, cell(*file, whole)? as u32);
                episodes.push(VideoEpisode {
                    sequence: episode(text(number)),
                    camera: camera.clone(),
                    video: format!("chunk-{chunk:03}/file-{file:03}"),
                    start: cell(*start, seconds)?,
                    frames,
                });
            }
        }
        Ok(())
    })?;
    Ok(episodes)
}

fn is_needed(name: &str) -> bool {
    let of_video = |name: &str| [CHUNK, FILE, START].iter().any(|end| name.ends_with(end));
    name == EPISODE || name == LENGTH || (name.starts_with(VIDEOS) && of_video(name))
}

/// A whole number of 32 bits, which pandas may have made a float.
fn whole(text: &str) -> Result<f64> {
    let number: Option<f64> = text.parse().ok();
    number
        .filter(|number| number.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(number))
        .ok_or_else(|| Error::input(format!("`{text}` is not a whole number of 32 bits")))
}

fn seconds(text: &str) -> Result<f64> {
    let number: Option<f64> = text.parse().ok();
    number
        .filter(|number| number.is_finite() && *number >= 0.0)
        .ok_or_else(|| Error::input(format!("`{text}` is not a time in seconds")))
}
