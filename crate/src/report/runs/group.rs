//! Runs in groups.

use std::collections::BTreeMap;
use std::str::FromStr;
use std::sync::Arc;

use super::data_set::data_sets;
use super::run::{Run, family};
use crate::error::{Error, Result};
use crate::evaluation::Thresholds;
use crate::metric::Object;

/// What the runs of one group have in common.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Grouping {
    /// All but the seed.
    #[default]
    Settings,
    /// The architecture, whatever else differs.
    Architecture,
    /// Their name without the number at its end: `runs/basic-long/seed-03` belongs to `basic-long`.
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
                    "nothing to group by; expected settings, architecture, name or a setting",
                ));
            }
            key => Self::Setting(key.to_owned()),
        })
    }
}

/// Runs of one group.
#[derive(Debug, Clone)]
pub struct Group {
    /// Its name; by settings the architecture, and where several groups have the same one, the settings
    /// that differ.
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
    /// their errors cannot be compared, when there is no such setting to group by, and when a
    /// threshold is given for an object that the runs do not have.
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
            let shown = settings.iter().filter(differs);
            let shown: Vec<String> = shown.map(|(key, value)| format!("{key} {value}")).collect();
            group.name = match shown.is_empty() {
                true => name.clone(),
                false => format!("{name} ({})", shown.join(", ")),
            };
        }
        all.extend(alike.into_iter().map(|(_, group)| group));
    }
    all.sort_by(|a, b| a.name.cmp(&b.name));
    all
}
