//! SLEAP's labels and predictions (`.slp`), as its analysis CSV has them.
//!
//! The file holds three tables of records: frames, the instances of each, and the points of each,
//! those of a person and those of the network apart. Skeleton, tracks and videos are JSON beside.

use std::collections::HashSet;

use hdf5_reader::Hdf5File;
use serde_json::Value;

use super::errors::{broken, unreadable};
use super::records::{Field, Records};
use super::scalar::bytes;
use crate::data::export::{Export, number_text};
use crate::error::{Error, Result};

/// The most bytes of JSON that are read of a file.
const MOST_JSON: usize = 16 << 20;
/// Before this version of the format the centre of the first pixel was at (0.5, 0.5).
const CENTRED: f64 = 1.1;
/// What an instance is that the network found.
const PREDICTED: f64 = 1.0;

/// The instances of a file as a table; `None` where it is not SLEAP's.
///
/// Of a frame those count that SLEAP shows: what a person set, and what the network found where
/// nobody corrected it.
///
/// # Errors
/// When there are several skeletons, several instances of a frame belong to no track, or the file
/// is damaged.
pub fn export(file: &Hdf5File) -> Result<Option<Export>> {
    let root = file.root_group().map_err(|e| broken(&e))?;
    let (groups, datasets) = root.member_names().map_err(|e| broken(&e))?;
    let has = |names: &[String], name: &str| names.iter().any(|found| found == name);
    if !has(&groups, "metadata") || !["frames", "instances"].iter().all(|n| has(&datasets, n)) {
        return Ok(None);
    }
    let project = Project::read(file)?;
    let instances = project.shown()?;
    let header = ["sequence", "track", "frame_idx", "instance.score"].map(str::to_owned);
    let of_nodes = project
        .nodes
        .iter()
        .flat_map(|node| ["x", "y", "score"].map(|column| format!("{node}.{column}")));
    let header = header.into_iter().chain(of_nodes).collect();
    let rows = instances.iter().map(|instance| project.row(instance));
    Export::of(std::iter::once(Ok(header)).chain(rows), None).map(Some)
}

/// What a file holds.
struct Project {
    nodes: Vec<String>,
    tracks: Vec<String>,
    /// Their names, by number.
    videos: Vec<(f64, String)>,
    /// What is added to a coordinate.
    shift: f64,
    frames: Frames,
    instances: Instances,
    points: Points,
    predicted: Points,
}

struct Frames {
    records: Records,
    video: Field,
    number: Field,
    start: Field,
    end: Field,
}

struct Instances {
    records: Records,
    kind: Field,
    skeleton: Field,
    track: Field,
    /// Which instance a person began with.
    origin: Field,
    score: Field,
    start: Field,
    end: Field,
}

struct Points {
    records: Records,
    x: Field,
    y: Field,
    visible: Field,
    score: Option<Field>,
}

/// An instance of a frame, by their numbers.
struct Shown {
    frame: usize,
    instance: usize,
}

impl Project {
    fn read(file: &Hdf5File) -> Result<Self> {
        let metadata = file
            .group("metadata")
            .map_err(|e| unreadable("metadata", &e))?;
        let json = metadata
            .attribute("json")
            .and_then(|json| json.read_string());
        let json = json.map_err(|e| unreadable("metadata/json", &e))?;
        let version = metadata
            .attribute("format_id")
            .and_then(|id| id.read_as_f64());
        let records = |name: &str| {
            let dataset = file.dataset(name).map_err(|e| unreadable(name, &e))?;
            Records::read(&dataset, name, file.storage().len())
        };
        Ok(Self {
            nodes: nodes(&parse("metadata/json", &json)?)?,
            tracks: strings(file, "tracks_json")?
                .iter()
                .map(|track| track_name(track))
                .collect(),
            videos: videos(&strings(file, "videos_json")?),
            shift: match version {
                Ok(version) if version >= CENTRED => 0.0,
                _ => -0.5,
            },
            frames: Frames::of(records("frames")?)?,
            instances: Instances::of(records("instances")?)?,
            points: Points::of(records("points")?)?,
            predicted: Points::of(records("pred_points")?)?,
        })
    }

    /// The instances that count, frame by frame.
    fn shown(&self) -> Result<Vec<Shown>> {
        let Instances {
            records,
            kind,
            skeleton,
            track,
            origin,
            ..
        } = &self.instances;
        let number = |instance: usize, field: &Field| records.number(instance, *field, 0);
        let mut shown = Vec::new();
        for frame in 0..self.frames.records.len() {
            let all = self.frames.instances(frame, records.len())?;
            let is_predicted = |i: &usize| number(*i, kind) == PREDICTED;
            let mut corrected = HashSet::new();
            for instance in all.clone().filter(|i| !is_predicted(i)) {
                corrected.insert((true, number(instance, origin) as i64));
                corrected.insert((false, number(instance, track) as i64));
            }
            let counts = |i: &usize| {
                let track = number(*i, track) as i64;
                !is_predicted(i)
                    || !corrected.contains(&(true, *i as i64))
                        && (track < 0 || !corrected.contains(&(false, track)))
            };
            let before = shown.len();
            for instance in all.filter(counts) {
                if number(instance, skeleton) != 0.0 {
                    return Err(Error::input(
                        "there are several skeletons; expected one: export them one by one",
                    ));
                }
                shown.push(Shown { frame, instance });
            }
            let of_none = shown[before..].iter();
            let of_none = of_none
                .filter(|shown| number(shown.instance, track) < 0.0)
                .count();
            if of_none > 1 {
                return Err(Error::input(format!(
                    "frame {} shows {of_none} instances that belong to no track; expected one, or tracks: run SLEAP's \
                     tracker, or give every instance a track",
                    self.frames.number(frame)
                )));
            }
        }
        match shown.is_empty() {
            true => Err(Error::input(
                "no frame has an instance; expected labels or predictions",
            )),
            false => Ok(shown),
        }
    }

    /// A row of the table.
    fn row(&self, shown: &Shown) -> Result<Vec<String>> {
        let Instances {
            records,
            kind,
            track,
            score,
            start,
            end,
            ..
        } = &self.instances;
        let number = |field: &Field| records.number(shown.instance, *field, 0);
        let is_predicted = number(kind) == PREDICTED;
        let points = match is_predicted {
            true => &self.predicted,
            false => &self.points,
        };
        let (start, end) = (number(start) as usize, number(end) as usize);
        if end.checked_sub(start) != Some(self.nodes.len()) || end > points.records.len() {
            return Err(Error::input(format!(
                "instance {} has the points {start} to {end} of {}; expected {}, one a node of the skeleton",
                shown.instance,
                points.records.len(),
                self.nodes.len()
            )));
        }
        // -1 where it belongs to none.
        let track = number(track);
        let track = (track >= 0.0).then(|| {
            let name = self.tracks.get(track as usize);
            name.cloned().unwrap_or_else(|| number_text(track))
        });
        let score = match is_predicted {
            true => number_text(number(score)),
            false => String::new(),
        };
        let mut row = vec![
            self.video(shown.frame),
            track.unwrap_or_default(),
            number_text(self.frames.number(shown.frame)),
            score,
        ];
        for point in start..end {
            row.extend(points.texts(point, self.shift));
        }
        Ok(row)
    }

    fn video(&self, frame: usize) -> String {
        let number = self.frames.records.number(frame, self.frames.video, 0);
        let name = self.videos.iter().find(|(video, _)| *video == number);
        name.map_or_else(|| format!("video_{number}"), |(_, name)| name.clone())
    }
}

impl Frames {
    fn of(records: Records) -> Result<Self> {
        Ok(Self {
            video: records.field("video")?,
            number: records.field("frame_idx")?,
            start: records.field("instance_id_start")?,
            end: records.field("instance_id_end")?,
            records,
        })
    }

    fn number(&self, frame: usize) -> f64 {
        self.records.number(frame, self.number, 0)
    }

    /// The instances of a frame, of `count` of all.
    fn instances(&self, frame: usize, count: usize) -> Result<std::ops::Range<usize>> {
        let [start, end] = [self.start, self.end].map(|field| self.records.number(frame, field, 0));
        // An instance belongs to one frame, so that the rows are no more than the instances.
        let after = match frame {
            0 => 0.0,
            _ => self.records.number(frame - 1, self.end, 0),
        };
        match after <= start && start <= end && end <= count as f64 {
            true => Ok(start as usize..end as usize),
            false => Err(Error::input(format!(
                "frame {} has the instances {start} to {end} of {count}, after {after}; is the file damaged?",
                self.number(frame)
            ))),
        }
    }
}

impl Instances {
    fn of(records: Records) -> Result<Self> {
        Ok(Self {
            kind: records.field("instance_type")?,
            skeleton: records.field("skeleton")?,
            track: records.field("track")?,
            origin: records.field("from_predicted")?,
            score: records.field("score")?,
            start: records.field("point_id_start")?,
            end: records.field("point_id_end")?,
            records,
        })
    }
}

impl Points {
    fn of(records: Records) -> Result<Self> {
        Ok(Self {
            x: records.field("x")?,
            y: records.field("y")?,
            visible: records.field("visible")?,
            score: records.find("score")?,
            records,
        })
    }

    /// x, y and score of a point; empty where it is not visible.
    fn texts(&self, point: usize, shift: f64) -> [String; 3] {
        let number = |field: Field| self.records.number(point, field, 0);
        if number(self.visible) == 0.0 {
            return Default::default();
        }
        let score = self.score.map(|score| number_text(number(score)));
        let [x, y] = [self.x, self.y].map(|field| number_text(number(field) + shift));
        [x, y, score.unwrap_or_default()]
    }
}

fn parse(name: &str, text: &str) -> Result<Value> {
    serde_json::from_str(text)
        .map_err(|e| Error::input(format!("`{name}` is not JSON ({e}); is the file damaged?")))
}

/// Texts, which JSON is kept in; none where there is no such array.
fn strings(file: &Hdf5File, name: &str) -> Result<Vec<String>> {
    let Ok(dataset) = file.dataset(name) else {
        return Ok(Vec::new());
    };
    if bytes(&dataset, name, file.storage().len())?.len() > MOST_JSON {
        return Err(Error::input(format!(
            "`{name}` has more than {MOST_JSON} bytes; is the file damaged?"
        )));
    }
    dataset.read_strings().map_err(|e| unreadable(name, &e))
}

/// The names of the skeleton's nodes in the order of an instance's points.
fn nodes(metadata: &Value) -> Result<Vec<String>> {
    let named = |place: &Value| {
        let node = &metadata["nodes"][usize::try_from(place["id"].as_u64()?).ok()?];
        Some(node["name"].as_str()?.to_owned())
    };
    let nodes = metadata["skeletons"][0]["nodes"].as_array();
    let names: Option<Vec<String>> = nodes.and_then(|nodes| nodes.iter().map(named).collect());
    names.filter(|names| !names.is_empty()).ok_or_else(|| {
        Error::input(
            "`metadata/json` names no nodes of a skeleton; expected `nodes` and `skeletons`, as SLEAP writes them",
        )
    })
}

/// The name in a track's JSON, `[first frame, name]`.
fn track_name(text: &str) -> String {
    let parsed: Value = serde_json::from_str(text).unwrap_or_default();
    let name = parsed[1].as_str().or(parsed["name"].as_str());
    name.unwrap_or(text).to_owned()
}

/// The number and the name of every video: of its file without folder and ending, unless two have
/// the same or the images lie in the project.
fn videos(texts: &[String]) -> Vec<(f64, String)> {
    let name = |text: &String| {
        let parsed: Value = serde_json::from_str(text).unwrap_or_default();
        let path = parsed["backend"]["filename"]
            .as_str()
            .or(parsed["filename"].as_str())?;
        let file = path.rsplit(['/', '\\']).next().unwrap_or(path);
        let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
        (!stem.is_empty()).then(|| stem.to_owned())
    };
    let names: Vec<Option<String>> = texts.iter().map(name).collect();
    let distinct: HashSet<&String> = names.iter().flatten().collect();
    let is_clear = distinct.len() == names.len();
    let numbered = names.iter().enumerate().map(|(number, name)| {
        let clear = name.clone().filter(|_| is_clear);
        let name = clear.unwrap_or_else(|| format!("video_{number}"));
        (number as f64, name)
    });
    numbered.collect()
}
