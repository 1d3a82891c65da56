//! TensorBoard event files.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use syntaxdot_summary::SummaryWriter;

use crate::error::{Error, Result};
use crate::run::{EVENTS_PREFIX, EpochLog, Losses};

/// The scalars of a run's epochs, which are the steps of TensorBoard: `training/total` and so on,
/// `validation/total` and so on, `tc`, and `error/MAP/OBJECT`.
pub(super) struct Events {
    path: PathBuf,
    writer: SummaryWriter<File>,
}

impl Events {
    /// Writes the epochs so far into a new file, which takes the place of the run's earlier ones: a
    /// part of an event file that an interrupted run left may be cut anywhere.
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
        let seconds = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |now| now.as_secs());
        // TensorBoard reads the files of a folder in the order of their names.
        let path = (0..)
            .map(|n| folder.join(format!("{EVENTS_PREFIX}{seconds:010}.{n}.tracklens")))
            .find(|path| !path.exists())
            .unwrap_or_else(|| folder.join(EVENTS_PREFIX));
        let failed = |e: std::io::Error| Error::io(path.display(), &e);
        let writer = File::create(&path)
            .and_then(SummaryWriter::new)
            .map_err(failed)?;
        let mut events = Self { path, writer };
        for epoch in past {
            events.write(epoch)?;
        }
        for path in earlier {
            fs::remove_file(&path).map_err(|e| Error::io(path.display(), &e))?;
        }
        Ok(events)
    }

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
        for (tag, value) in scalars {
            self.writer
                .write_scalar(tag, i64::from(epoch.epoch), value as f32)
                .map_err(|e| Error::io(self.path.display(), &e))?;
        }
        Ok(())
    }
}
