use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::Losses;
use crate::error::{Error, Result};
use crate::metric::Evaluation;

const CONFIG: &str = "config.json";
const LOG: &str = "log.jsonl";
const SUMMARY: &str = "summary.json";
const FINAL: &str = "checkpoint_final.safetensors";
const BEST: &str = "checkpoint_best.safetensors";

/// The folder of one run.
///
/// | file | what |
/// |---|---|
/// | `config.json` | the whole configuration, the version, the sequences of the split |
/// | `log.jsonl` | one [`EpochRecord`] a line |
/// | `checkpoint_final.safetensors` | the weights after the last epoch so far |
/// | `checkpoint_best.safetensors` | the weights with the lowest validation loss |
/// | `summary.json` | how it ended |
///
/// Files other than the log are written whole or not at all.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
}

/// One line of the log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EpochRecord {
    /// Counted from 1.
    pub epoch: usize,
    /// Wall time of this epoch with its validation.
    pub seconds: f64,
    /// Means over the steps of the epoch, with noise and batch statistics.
    pub train: Losses,
    /// Means over the snippets of the validation sequences.
    pub validation: Losses,
    /// Tracking capability on the validation sequences with the affine map; absent without a ground truth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tc: Option<f64>,
    /// The metric by object; empty without a ground truth.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub objects: Vec<ObjectRecord>,
}

/// The metric for one object in an [`EpochRecord`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectRecord {
    /// Its name.
    pub name: String,
    /// Its threshold `mu_k`.
    pub threshold: f64,
    /// Whether the error is at most the threshold.
    pub tracked: bool,
    /// `n*_k`, from 0; null when the object is visible in no frame.
    pub best_keypoint: Option<usize>,
    /// The mean over time of the squared distance (ndc); null when the object is visible in no frame.
    pub error: Option<f64>,
}

impl ObjectRecord {
    pub(super) fn all(evaluation: &Evaluation) -> Vec<Self> {
        evaluation
            .objects
            .iter()
            .map(|object| Self {
                name: object.name.clone(),
                threshold: object.threshold,
                tracked: object.tracked,
                best_keypoint: object.best.map(|b| b.keypoint),
                error: object.best.map(|b| b.fit.error()),
            })
            .collect()
    }
}

impl RunFolder {
    /// Makes the folder for a new run. With `force` the files of a run that is already there are removed.
    ///
    /// # Errors
    /// When the folder cannot be made, or holds a run and `force` is not set.
    pub fn create(path: &Path, force: bool) -> Result<Self> {
        fs::create_dir_all(path).map_err(|e| Error::io(path.display(), &e))?;
        for name in [CONFIG, LOG, SUMMARY, FINAL, BEST] {
            let file = path.join(name);
            if !file.exists() {
                continue;
            }
            if !force {
                return Err(Error::input(format!(
                    "the folder holds a run already ({name}); give another folder, or --force to replace the run"
                ))
                .at(path.display()));
            }
            fs::remove_file(&file).map_err(|e| Error::io(file.display(), &e))?;
        }
        Ok(Self { path: path.to_owned() })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The weights after the last epoch.
    pub fn final_checkpoint(&self) -> PathBuf {
        self.path.join(FINAL)
    }

    /// The weights with the lowest validation loss.
    pub fn best_checkpoint(&self) -> PathBuf {
        self.path.join(BEST)
    }

    pub(super) fn write_config(&self, config: &impl Serialize) -> Result<()> {
        self.write_json(CONFIG, config)
    }

    pub(super) fn write_summary(&self, summary: &impl Serialize) -> Result<()> {
        self.write_json(SUMMARY, summary)
    }

    pub(super) fn write_final(&self, checkpoint: &[u8]) -> Result<()> {
        self.write(FINAL, checkpoint)
    }

    pub(super) fn write_best(&self, checkpoint: &[u8]) -> Result<()> {
        self.write(BEST, checkpoint)
    }

    /// Appends a line to the log; it is on disk when this returns.
    pub(super) fn append(&self, record: &EpochRecord) -> Result<()> {
        let path = self.path.join(LOG);
        let failed = |e: std::io::Error| Error::io(path.display(), &e);
        let mut line = to_json(LOG, record, serde_json::to_string)?;
        line.push('\n');
        let mut log = OpenOptions::new().create(true).append(true).open(&path).map_err(failed)?;
        log.write_all(line.as_bytes()).map_err(failed)?;
        log.sync_data().map_err(failed)
    }

    fn write_json(&self, name: &str, value: &impl Serialize) -> Result<()> {
        let mut json = to_json(name, value, serde_json::to_string_pretty)?;
        json.push('\n');
        self.write(name, json.as_bytes())
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.path.join(name);
        let failed = |e: std::io::Error| Error::io(path.display(), &e);
        // A name of its own in the same folder: a run that dies here leaves the old file whole.
        let temporary = self.path.join(format!(".{name}.{}", std::process::id()));
        let written = File::create(&temporary).and_then(|mut file| {
            file.write_all(bytes)?;
            file.sync_all()
        });
        let done = written.and_then(|()| fs::rename(&temporary, &path));
        if done.is_err() {
            let _ = fs::remove_file(&temporary);
        }
        done.map_err(failed)
    }
}

fn to_json<T: Serialize>(
    name: &str,
    value: &T,
    serialize: impl Fn(&T) -> serde_json::Result<String>,
) -> Result<String> {
    serialize(value).map_err(|e| Error::input(format!("{name} cannot be written as JSON: {e}")))
}
