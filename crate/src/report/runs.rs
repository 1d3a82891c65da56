//! Runs by what their folders hold, and by groups.

use std::collections::BTreeMap;
use std::str::FromStr;
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::evaluation::{EvaluationReport, Thresholds};
use crate::metric::{Object, Transform};
use crate::run::{RunConfig, RunFiles, Split, TrainSummary, read_log};

/// One run: a training, or a detector that was scored as it is.
#[derive(Debug, Clone)]
pub struct Run {
    /// What it is called: its folder, or its file.
    pub name: String,
    /// The architecture; of a detector of another kind what it is called.
    pub architecture: String,
    /// What it trained with; `None` where that is not known.
    pub seed: Option<u64>,
    /// The objects, in the order of every table.
    pub objects: Vec<String>,
    /// Its epochs, as far as the log can be read; none of a detector that was scored.
    pub epochs: Vec<Epoch>,
    /// The metric in full, after the last epoch.
    pub evaluation: Option<EvaluationReport>,
    /// Why it does not count; `None` for a complete run.
    pub incomplete: Option<String>,
    /// How it trained; `None` of a detector that was scored.
    pub config: Option<RunConfig>,
}

/// What figures and tables need of an epoch; a log holds several times as much.
#[derive(Debug, Clone, PartialEq)]
pub struct Epoch {
    /// The affine tracking error of every object; `None` where it was visible in no frame.
    pub errors: Vec<Option<f64>>,
    /// Reconstruction loss on the validation sequences.
    pub reconstruction: f64,
}

/// A folder that is none of a run that can be read, and why.
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
    pub fn parse(name: &str, files: &RunFiles) -> std::result::Result<Self, Unread> {
        let failed = files.error.map(|error| {
            let text = String::from_utf8_lossy(error);
            format!(
                "it failed: {}",
                text.trim().lines().next().unwrap_or_default()
            )
        });
        let unread = |reason: String| Unread {
            name: name.to_owned(),
            reason,
        };
        let wrong =
            |file: &str, e: &serde_json::Error| unread(format!("{file} cannot be read: {e}"));
        let Some(config) = files.config else {
            let missing = || "config.json is missing: it ended before it began to train".to_owned();
            return Err(unread(failed.unwrap_or_else(missing)));
        };
        let config: RunConfig =
            serde_json::from_slice(config).map_err(|e| wrong("config.json", &e))?;
        let summary: Option<TrainSummary> = files
            .summary
            .map(serde_json::from_slice)
            .transpose()
            .map_err(|e| wrong("summary.json", &e))?;
        let (log, broken) = read_log(files.log.unwrap_or_default());
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
        let incomplete = match broken {
            Some(error) => Some(format!(
                "its log breaks off ({error}), after epoch {}",
                epochs.len()
            )),
            None if whole => None,
            None => Some(match failed {
                Some(failed) => format!("{failed}, after epoch {} of {planned}", epochs.len()),
                None => format!("it stopped after epoch {} of {planned}", epochs.len()),
            }),
        };
        Ok(Self {
            name: name.to_owned(),
            architecture: config.train.sae.name(),
            seed: Some(config.train.seed),
            objects: config.objects.clone(),
            epochs,
            evaluation: summary.and_then(|summary| summary.evaluation),
            incomplete,
            config: Some(config),
        })
    }

    /// A detector that was scored as it is; without an architecture it is called what its name
    /// begins with.
    pub fn scored(name: &str, architecture: Option<String>, evaluation: EvaluationReport) -> Self {
        Self {
            name: name.to_owned(),
            architecture: architecture.unwrap_or_else(|| family(name)),
            seed: None,
            objects: evaluation.objects.iter().map(|o| o.name.clone()).collect(),
            epochs: Vec::new(),
            evaluation: Some(evaluation),
            incomplete: None,
            config: None,
        }
    }

    /// The tracking error of an object at the end: of a training the affine one of its last epoch.
    /// `None` where it was visible in no frame.
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

    /// Why the errors of two runs cannot be compared, if so.
    fn differs(&self, other: &Self) -> Option<String> {
        if self.objects != other.objects {
            let [a, b] = [self, other].map(|run| run.objects.join(", "));
            return Some(format!("they are of different objects: {a}, and {b}"));
        }
        let (a, b) = match (&self.config, &other.config) {
            (Some(a), Some(b)) => (a, b),
            (None, None) => {
                let map = |run: &Self| run.evaluation.as_ref().map(|e| e.transform.clone());
                let (a, b) = (map(self)?, map(other)?);
                return (a != b)
                    .then(|| format!("one is scored under the map `{a}`, the other under `{b}`"));
            }
            _ => {
                return Some(
                    "one is scored on its validation sequences, the other on the frames here"
                        .to_owned(),
                );
            }
        };
        let sizes = |c: &RunConfig| [c.training_sequences.len(), c.validation_sequences.len()];
        if sizes(a) != sizes(b) {
            let [a, b] = [a, b].map(|c| sizes(c).map(|n| n.to_string()).join(" + "));
            return Some(format!(
                "they are of different numbers of training and validation sequences: {a}, and {b}"
            ));
        }
        // One seed splits one data set in one way.
        let split = |c: &RunConfig| {
            let seed = matches!(c.train.split, Split::Shares { .. }).then_some(c.train.seed);
            (seed, c.train.split, c.version.clone())
        };
        let names = |c: &RunConfig| (c.training_sequences.clone(), c.validation_sequences.clone());
        if split(a) == split(b) && names(a) != names(b) {
            return Some("with one seed and split they are of different sequences".to_owned());
        }
        let known =
            |c: &RunConfig| [c.training_sequences.clone(), c.validation_sequences.clone()].concat();
        let (a, b) = (known(a), known(b));
        let shared = a.is_empty() || a.iter().any(|name| b.contains(name));
        (!shared).then(|| "they have no sequence in common".to_owned())
    }
}

/// Runs of one data set, and why they are kept apart from those before.
#[derive(Debug, Clone)]
pub struct DataSet {
    /// The runs.
    pub runs: Vec<Arc<Run>>,
    /// Two runs, and why their errors cannot be compared; `None` for the first data set.
    pub reason: Option<String>,
}

/// Puts runs of one data set together: the same objects and sequences, as far as their
/// configurations tell.
pub fn data_sets(runs: Vec<Arc<Run>>) -> Vec<DataSet> {
    let mut sets: Vec<DataSet> = Vec::new();
    for run in runs {
        let mut reason = None;
        let place = sets.iter().position(|set| {
            // The first stands for all; those of its seed can be compared name by name.
            let (first, rest) = (&set.runs[..1], &set.runs[1..]);
            let alike = rest.iter().filter(|other| other.seed == run.seed);
            let found = first.iter().chain(alike).find_map(|other| {
                let why = other.differs(&run)?;
                Some(format!("{} and {}: {why}", other.name, run.name))
            });
            let belongs = found.is_none();
            reason = found.or(reason.take());
            belongs
        });
        match place {
            Some(place) => sets[place].runs.push(run),
            None => sets.push(DataSet {
                runs: vec![run],
                reason,
            }),
        }
    }
    sets
}

/// What the runs of one group have in common.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Grouping {
    /// All but the seed.
    #[default]
    Settings,
    /// The architecture, whatever else differs.
    Architecture,
    /// Their name without the number at its end: `runs/basic-long/seed-03` is of `basic-long`.
    Name,
    /// One setting.
    Setting(String),
}

impl FromStr for Grouping {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Ok(match text {
            "settings" => Self::Settings,
            "architecture" => Self::Architecture,
            "name" => Self::Name,
            "" => {
                return Err(Error::input(
                    "groups by nothing; expected settings, architecture, name or a setting",
                ));
            }
            key => Self::Setting(key.to_owned()),
        })
    }
}

/// Runs of one group.
#[derive(Debug, Clone)]
pub struct Group {
    /// Its name; by settings the architecture, with what else tells it from another group where
    /// there are several of one.
    pub name: String,
    /// The runs, complete ones first.
    pub runs: Vec<Arc<Run>>,
}

impl Group {
    /// The complete runs.
    pub fn complete(&self) -> impl Iterator<Item = &Run> + Clone {
        self.runs
            .iter()
            .map(Arc::as_ref)
            .filter(|run| run.incomplete.is_none())
    }
}

/// Runs in groups, and the objects that all of them have.
#[derive(Debug, Clone)]
pub struct Runs {
    /// The objects with their thresholds.
    pub objects: Vec<Object>,
    /// The groups, by name.
    pub groups: Vec<Group>,
}

impl Runs {
    /// Puts runs into groups.
    ///
    /// # Errors
    /// When there is no complete run, when runs are not of one data set ([`data_sets`]), so that
    /// their errors cannot be compared, when a setting to group by is none, and when a threshold is
    /// given for an object that the runs do not have.
    pub fn new(runs: Vec<Arc<Run>>, thresholds: &Thresholds, grouping: &Grouping) -> Result<Self> {
        let mut sets = data_sets(runs);
        if let Some(reason) = sets.iter().find_map(|set| set.reason.as_ref()) {
            return Err(Error::mismatch(format!(
                "the runs are of {} different data sets, whose errors cannot be compared ({reason}); report on them one by one",
                sets.len()
            )));
        }
        let mut runs = sets.pop().map(|set| set.runs).unwrap_or_default();
        if !runs.iter().any(|run| run.incomplete.is_none()) {
            let why: Vec<String> = runs
                .iter()
                .take(3)
                .filter_map(|run| Some(format!("{}: {}", run.name, run.incomplete.as_ref()?)))
                .collect();
            return Err(Error::numeric(match why.is_empty() {
                true => "there is no run; expected folders that `tracklens train` wrote, or folders with such folders"
                    .to_owned(),
                false => format!(
                    "none of the {} runs is complete ({}); finish them with --resume",
                    runs.len(),
                    why.join("; ")
                ),
            }));
        }
        runs.sort_by(|a, b| {
            (a.incomplete.is_some(), a.seed, &a.name).cmp(&(
                b.incomplete.is_some(),
                b.seed,
                &b.name,
            ))
        });
        let objects = thresholds.objects(&runs[0].objects, "the runs have")?;
        let groups = match grouping {
            Grouping::Settings => by_settings(runs),
            Grouping::Architecture => by(runs, |run| Ok(run.architecture.clone()))?,
            Grouping::Name => by(runs, |run| Ok(family(&run.name)))?,
            Grouping::Setting(key) => by(runs, |run| {
                let settings = run.settings();
                let names = || {
                    settings
                        .iter()
                        .map(|(key, _)| key.as_str())
                        .collect::<Vec<_>>()
                };
                let found = settings.iter().find(|(name, _)| name == key);
                found
                    .map(|(key, value)| format!("{key} {value}"))
                    .ok_or_else(|| {
                        Error::input(format!(
                            "{} has no setting `{key}` to group by; expected one of {}",
                            run.name,
                            names().join(", ")
                        ))
                    })
            })?,
        };
        Ok(Self { objects, groups })
    }
}

fn by(runs: Vec<Arc<Run>>, name: impl Fn(&Run) -> Result<String>) -> Result<Vec<Group>> {
    let mut groups: BTreeMap<String, Vec<Arc<Run>>> = BTreeMap::new();
    for run in runs {
        groups.entry(name(&run)?).or_default().push(run);
    }
    let group = |(name, runs)| Group { name, runs };
    Ok(groups.into_iter().map(group).collect())
}

/// Settings by name.
type Described = Vec<(String, String)>;

fn by_settings(runs: Vec<Arc<Run>>) -> Vec<Group> {
    let mut all = Vec::new();
    let mut architectures: BTreeMap<String, Vec<(Described, Group)>> = BTreeMap::new();
    for run in runs {
        let settings = run.settings();
        let alike = architectures.entry(run.architecture.clone()).or_default();
        match alike.iter_mut().find(|(other, _)| *other == settings) {
            Some((_, group)) => group.runs.push(run),
            None => alike.push((
                settings,
                Group {
                    name: run.architecture.clone(),
                    runs: vec![run],
                },
            )),
        }
    }
    for (name, mut alike) in architectures {
        let described: Vec<Described> =
            alike.iter().map(|(settings, _)| settings.clone()).collect();
        for (settings, group) in alike.iter_mut().filter(|_| described.len() > 1) {
            let differs = |setting: &&(String, String)| {
                described.iter().any(|other| !other.contains(setting))
            };
            let told = settings.iter().filter(differs);
            let told: Vec<String> = told.map(|(key, value)| format!("{key} {value}")).collect();
            group.name = match told.is_empty() {
                true => name.clone(),
                false => format!("{name} ({})", told.join(", ")),
            };
        }
        all.extend(alike.into_iter().map(|(_, group)| group));
    }
    all.sort_by(|a, b| a.name.cmp(&b.name));
    all
}

/// What a run belongs to by its name: the last part without the file's ending and the number at its
/// end, or the folder where that says no more than which seed or checkpoint it is.
fn family(name: &str) -> String {
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
