//! One run, by what its folder holds.

use serde::de::DeserializeOwned;

use crate::error::Error;
use crate::evaluation::EvaluationReport;
use crate::metric::Transform;
use crate::run::{EpochLog, RunConfig, RunFiles, TrainSummary, read_log};

/// One run: a training, or a detector that was scored as it is.
#[derive(Debug, Clone)]
pub struct Run {
    /// Its folder or file.
    pub name: String,
    /// The architecture; for a detector that was not trained here, the name of its family.
    pub architecture: String,
    /// Its seed; `None` where that is not known.
    pub seed: Option<u64>,
    /// The objects, in the order of every table.
    pub objects: Vec<String>,
    /// Its epochs, as far as the log can be read; empty for a detector that was scored.
    pub epochs: Vec<Epoch>,
    /// The epoch, counted from 1, with the lowest validation loss; `None` where that is not known.
    pub best_epoch: Option<u32>,
    /// The metric in full, after the last epoch.
    pub evaluation: Option<EvaluationReport>,
    /// Why it does not count; `None` for a complete run.
    pub incomplete: Option<String>,
    /// How it trained; `None` for a detector that was scored.
    pub config: Option<RunConfig>,
}

/// What figures and tables need to know about an epoch.
#[derive(Debug, Clone, PartialEq)]
pub struct Epoch {
    /// The affine tracking error of every object; `None` where it was visible in no frame.
    pub errors: Vec<Option<f64>>,
    /// Reconstruction loss on the validation sequences.
    pub reconstruction: f64,
}

/// A run folder that cannot be read, and why.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Unread {
    /// The folder.
    pub name: String,
    /// Why it does not count.
    pub reason: String,
}

impl Run {
    /// A run from what its folder holds. A log that is cut is read up to the break; the run is
    /// incomplete then, and also when it failed or was stopped.
    ///
    /// # Errors
    /// When there is no configuration, or the configuration or the summary is not what a run
    /// writes.
    pub fn parse(name: &str, files: &RunFiles) -> Result<Self, Unread> {
        let failed = failure(files);
        let config: RunConfig = read_json(name, "config.json", config_of(name, files)?)?;
        let summary = files
            .summary
            .map(|bytes| read_json(name, "summary.json", bytes));
        let summary: Option<TrainSummary> = summary.transpose()?;
        let (log, broken) = read_log::<EpochLog>(files.log.unwrap_or_default());
        let epochs: Vec<Epoch> = log
            .iter()
            .map(|epoch| {
                let affine = epoch.errors.get(Transform::Affine.name());
                let error = |object: &String| {
                    affine.and_then(|errors| errors.get(object).copied().flatten())
                };
                Epoch {
                    errors: config.objects.iter().map(error).collect(),
                    reconstruction: epoch.validation.reconstruction,
                }
            })
            .collect();
        let planned = config.train.epochs;
        let whole = summary
            .as_ref()
            .is_some_and(|summary| !summary.interrupted && epochs.len() as u32 >= planned);
        let so_far = format!("epoch {} of {planned}", epochs.len());
        let incomplete = incomplete(broken, whole, failed, &so_far);
        Ok(Self {
            name: name.to_owned(),
            architecture: config.train.sae.name(),
            seed: Some(config.train.seed),
            objects: config.objects.clone(),
            epochs,
            best_epoch: summary.as_ref().map(|summary| summary.best_epoch),
            evaluation: summary.and_then(|summary| summary.evaluation),
            incomplete,
            config: Some(config),
        })
    }

    /// A detector that was scored as it is. Without an architecture its family is taken from its
    /// name.
    pub fn scored(name: &str, architecture: Option<String>, evaluation: EvaluationReport) -> Self {
        Self {
            name: name.to_owned(),
            architecture: architecture.unwrap_or_else(|| family(name)),
            seed: None,
            objects: evaluation.objects.iter().map(|o| o.name.clone()).collect(),
            epochs: Vec::new(),
            best_epoch: None,
            evaluation: Some(evaluation),
            incomplete: None,
            config: None,
        }
    }

    /// The final tracking error of an object; for a training, that of its last epoch under the affine
    /// map. `None` where it was visible in no frame.
    pub fn error(&self, object: &str) -> Option<f64> {
        match (self.epochs.last(), &self.evaluation) {
            (Some(epoch), _) => {
                let at = self.objects.iter().position(|name| name == object)?;
                epoch.errors[at]
            }
            (None, Some(evaluation)) => evaluation.objects.iter().find(|o| o.name == object)?.error,
            (None, None) => None,
        }
    }

    /// The settings that tell runs apart, but for the seed, with their values: the same ones in the
    /// same order for all trainings.
    pub fn settings(&self) -> Vec<(String, String)> {
        let Some(config) = &self.config else {
            return vec![("architecture".to_owned(), self.architecture.clone())];
        };
        let mut settings = vec![
            ("architecture".to_owned(), self.architecture.clone()),
            ("version".to_owned(), config.version.clone()),
            (
                "input_size".to_owned(),
                config.input_size.map(|s| s.to_string()).join("x"),
            ),
        ];
        let value = serde_json::to_value(&config.train).unwrap_or_default();
        let mut add = |key: &String, value: &serde_json::Value| {
            // What is left out means its default.
            if !["seed", "architecture", "input_size"].contains(&key.as_str()) && !value.is_null() {
                let text = value
                    .as_str()
                    .map_or_else(|| value.to_string(), str::to_owned);
                settings.push((key.clone(), text));
            }
        };
        for (key, value) in value.as_object().into_iter().flatten() {
            match (key.as_str(), value.as_object()) {
                ("sae", Some(sae)) => sae.iter().for_each(|(key, value)| add(key, value)),
                _ => add(key, value),
            }
        }
        settings
    }
}

/// Why the last attempt of a run of a sweep failed, in words.
pub(super) fn failure(files: &RunFiles) -> Option<String> {
    files.error.map(|error| {
        let text = String::from_utf8_lossy(error);
        let first = text.trim().lines().next().unwrap_or_default();
        format!("it failed: {first}")
    })
}

/// The configuration of the run `name`, which it cannot be read without.
pub(super) fn config_of<'a>(name: &str, files: &RunFiles<'a>) -> Result<&'a [u8], Unread> {
    let missing = || match files.log.or(files.summary) {
        Some(_) => "config.json is missing".to_owned(),
        None => "config.json is missing: it ended before it began to train".to_owned(),
    };
    files.config.ok_or_else(|| Unread {
        name: name.to_owned(),
        reason: failure(files).unwrap_or_else(missing),
    })
}

/// A file of the run `name`.
pub(super) fn read_json<T: DeserializeOwned>(
    name: &str,
    file: &str,
    bytes: &[u8],
) -> Result<T, Unread> {
    serde_json::from_slice(bytes).map_err(|e| Unread {
        name: name.to_owned(),
        reason: format!("{file} cannot be read: {e}"),
    })
}

/// Why a run does not count that has come `so_far`, e.g. `epoch 3 of 4`; `None` for a whole one.
pub(super) fn incomplete(
    broken_log: Option<Error>,
    is_whole: bool,
    failed: Option<String>,
    so_far: &str,
) -> Option<String> {
    match (broken_log, failed) {
        (Some(error), _) => Some(format!("its log breaks off ({error}), after {so_far}")),
        (None, _) if is_whole => None,
        (None, Some(failed)) => Some(format!("{failed}, after {so_far}")),
        (None, None) => Some(format!("it stopped after {so_far}")),
    }
}

/// The family of a run by its name: the last part without the file's ending and the number at its
/// end, or the folder where that says no more than which seed or checkpoint it is.
pub(super) fn family(name: &str) -> String {
    let mut parts = name
        .split(['/', '\\'])
        .filter(|part| !part.is_empty())
        .rev();
    let last = parts.next().unwrap_or(name);
    let separators = ['-', '_', ' ', '.', '='];
    let stem = last.rsplit_once('.').map_or(last, |(stem, _)| stem);
    let stem = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    let stem = stem.trim_end_matches(separators);
    let own = ["seed", "run", "checkpoint_best", "checkpoint_final"]
        .iter()
        .find_map(|word| stem.strip_suffix(word))
        .map_or(stem, |stem| stem.trim_end_matches(separators));
    match (own.is_empty(), parts.next()) {
        (false, _) => own.to_owned(),
        (true, folder) => folder.unwrap_or(name).to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_without_their_numbers_are_families() {
        for (name, expected) in [
            ("runs/basic-kp32/seed-03", "basic-kp32"),
            ("runs/basic/seed-03.partial", "basic"),
            ("detector_b_seed12.csv", "detector_b"),
            ("mine/checkpoint_final.safetensors", "mine"),
            ("ours/run7/", "ours"),
            ("7", "7"),
        ] {
            assert_eq!(family(name), expected, "{name}");
        }
    }
}
