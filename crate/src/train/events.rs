//! TensorBoard event files.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use prost::Message;

use crate::error::{Error, Result};
use crate::run::{EVENTS_PREFIX, EpochLog, Losses};

/// The first event of every file.
const FILE_VERSION: &str = "brain.Event:2";

/// The scalars of a run's epochs, which are the steps of TensorBoard: `training/total` and so on,
/// `validation/total` and so on, `tc`, and `error/MAP/OBJECT`.
pub(super) struct Events {
    path: PathBuf,
    file: File,
}

impl Events {
    /// Writes the epochs so far into a new file, which replaces the run's earlier ones: an event file
    /// that an interrupted run left may be cut anywhere.
    pub fn create(folder: &Path, past: &[EpochLog]) -> Result<Self> {
        let failed = |e: std::io::Error| Error::io(folder.display(), &e);
        let mut earlier = Vec::new();
        for entry in fs::read_dir(folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            if entry
                .file_name()
                .to_string_lossy()
                .starts_with(EVENTS_PREFIX)
            {
                earlier.push(entry.path());
            }
        }
        let seconds = since_epoch().as_secs();
        // TensorBoard reads the files of a folder in the order of their names.
        let path = (0..)
            .map(|n| folder.join(format!("{EVENTS_PREFIX}{seconds:010}.{n}.tracklens")))
            .find(|path| !path.exists())
            .unwrap_or_else(|| folder.join(EVENTS_PREFIX));
        let file = File::create(&path).map_err(|e| Error::io(path.display(), &e))?;
        let mut events = Self { path, file };
        events.append(&record(&Event {
            wall_time: since_epoch().as_secs_f64(),
            file_version: Some(FILE_VERSION.to_owned()),
            ..Event::default()
        }))?;
        for epoch in past {
            events.write(epoch)?;
        }
        for path in earlier {
            fs::remove_file(&path).map_err(|e| Error::io(path.display(), &e))?;
        }
        Ok(events)
    }

    /// Appends the scalars of an epoch.
    pub fn write(&mut self, epoch: &EpochLog) -> Result<()> {
        let mut scalars = vec![("tc".to_owned(), epoch.tc)];
        for (part, losses) in [
            ("training", epoch.training),
            ("validation", epoch.validation),
        ] {
            let Losses {
                total,
                reconstruction,
                velocity,
            } = losses;
            for (name, value) in [
                ("total", total),
                ("reconstruction", reconstruction),
                ("velocity", velocity),
            ] {
                scalars.push((format!("{part}/{name}"), value));
            }
        }
        for (map, errors) in &epoch.errors {
            for (object, error) in errors {
                scalars.extend(error.map(|error| (format!("error/{map}/{object}"), error)));
            }
        }
        let wall_time = since_epoch().as_secs_f64();
        let events = scalars.into_iter().map(|(tag, value)| Event {
            wall_time,
            step: i64::from(epoch.epoch),
            file_version: None,
            summary: Some(Summary {
                values: vec![Scalar {
                    tag,
                    value: Some(value as f32),
                }],
            }),
        });
        let records: Vec<u8> = events.flat_map(|event| record(&event)).collect();
        self.append(&records)
    }

    fn append(&mut self, records: &[u8]) -> Result<()> {
        self.file
            .write_all(records)
            .map_err(|e| Error::io(self.path.display(), &e))
    }
}

fn since_epoch() -> Duration {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default()
}

/// The part of TensorFlow's `event.proto` and `summary.proto` that scalars need.
#[derive(Clone, PartialEq, Message)]
struct Event {
    /// Seconds since 1970.
    #[prost(double, tag = "1")]
    wall_time: f64,
    #[prost(int64, tag = "2")]
    step: i64,
    #[prost(string, optional, tag = "3")]
    file_version: Option<String>,
    #[prost(message, optional, tag = "5")]
    summary: Option<Summary>,
}

#[derive(Clone, PartialEq, Message)]
struct Summary {
    #[prost(message, repeated, tag = "1")]
    values: Vec<Scalar>,
}

#[derive(Clone, PartialEq, Message)]
struct Scalar {
    #[prost(string, tag = "1")]
    tag: String,
    /// Optional, since a zero would be left out otherwise.
    #[prost(float, optional, tag = "2")]
    value: Option<f32>,
}

/// A record of a TFRecord file: the length, its checksum, the event, its checksum.
fn record(event: &Event) -> Vec<u8> {
    let event = event.encode_to_vec();
    let length = (event.len() as u64).to_le_bytes();
    [
        &length[..],
        &checksum(&length),
        &event[..],
        &checksum(&event),
    ]
    .concat()
}

/// CRC-32C, masked as TFRecord files want it: rotated and shifted by a constant.
fn checksum(bytes: &[u8]) -> [u8; 4] {
    let masked = crc32c::crc32c(bytes)
        .rotate_right(15)
        .wrapping_add(0xa282_ead8);
    masked.to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_has_the_bytes_that_tensorboard_writes() {
        let event = Event {
            wall_time: 1.5,
            step: 3,
            file_version: None,
            summary: Some(Summary {
                values: vec![Scalar {
                    tag: "tc".to_owned(),
                    value: Some(0.0),
                }],
            }),
        };
        // From `RecordWriter` of TensorBoard 2.21, for the same event.
        #[rustfmt::skip]
        let expected = [
            24, 0, 0, 0, 0, 0, 0, 0, 163, 127, 75, 34,
            9, 0, 0, 0, 0, 0, 0, 248, 63, 16, 3, 42, 11, 10, 9, 10, 2, 116, 99, 21, 0, 0, 0, 0,
            199, 171, 195, 189,
        ];
        assert_eq!(record(&event), expected);
    }
}
