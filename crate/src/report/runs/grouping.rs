//! What runs of any kind are grouped by.

use std::collections::BTreeMap;
use std::str::FromStr;
use std::sync::Arc;

use super::run::{Run, family};
use crate::error::{Error, Result};

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

/// What a run is grouped by.
pub(super) trait Member {
    /// Its folder or file.
    fn name(&self) -> &str;
    /// What its group by settings is called.
    fn kind(&self) -> String;
    /// What its group by architecture is called.
    fn architecture(&self) -> String;
    /// Its settings but for the seed.
    fn settings(&self) -> Settings;
}

/// Settings by name.
pub(super) type Settings = Vec<(String, String)>;

impl Member for Arc<Run> {
    fn name(&self) -> &str {
        &self.name
    }

    fn kind(&self) -> String {
        self.architecture.clone()
    }

    fn architecture(&self) -> String {
        self.architecture.clone()
    }

    fn settings(&self) -> Settings {
        Run::settings(self)
    }
}

/// Whether every run has the setting that is to be grouped by, if it is one.
pub(super) fn has_setting<R: Member>(runs: &[R], grouping: &Grouping) -> bool {
    let Grouping::Setting(key) = grouping else {
        return true;
    };
    let has = |run: &R| run.settings().iter().any(|(name, _)| name == key);
    !runs.is_empty() && runs.iter().all(has)
}

/// Runs in groups, by name.
///
/// # Errors
/// When a run does not have the setting that is to be grouped by.
pub(super) fn grouped<R: Member>(
    runs: Vec<R>,
    grouping: &Grouping,
) -> Result<Vec<(String, Vec<R>)>> {
    match grouping {
        Grouping::Settings => Ok(by_settings(runs)),
        Grouping::Architecture => by(runs, |run| Ok(run.architecture())),
        Grouping::Name => by(runs, |run| Ok(family(run.name()))),
        Grouping::Setting(key) => by(runs, |run| {
            let settings = run.settings();
            let found = settings.iter().find(|(name, _)| name == key);
            let names = settings.iter().map(|(key, _)| key.as_str());
            found
                .map(|(key, value)| format!("{key} {value}"))
                .ok_or_else(|| {
                    Error::input(format!(
                        "{} has no setting `{key}` to group by; expected one of {}",
                        run.name(),
                        names.collect::<Vec<_>>().join(", ")
                    ))
                })
        }),
    }
}

fn by<R>(runs: Vec<R>, name: impl Fn(&R) -> Result<String>) -> Result<Vec<(String, Vec<R>)>> {
    let mut groups: BTreeMap<String, Vec<R>> = BTreeMap::new();
    for run in runs {
        groups.entry(name(&run)?).or_default().push(run);
    }
    Ok(groups.into_iter().collect())
}

pub(super) fn by_settings<R: Member>(runs: Vec<R>) -> Vec<(String, Vec<R>)> {
    let mut kinds: BTreeMap<String, Vec<(Settings, Vec<R>)>> = BTreeMap::new();
    for run in runs {
        let settings = run.settings();
        let alike = kinds.entry(run.kind()).or_default();
        match alike.iter_mut().find(|(other, _)| *other == settings) {
            Some((_, group)) => group.push(run),
            None => alike.push((settings, vec![run])),
        }
    }
    let mut all = Vec::new();
    for (kind, alike) in kinds {
        let described: Vec<Settings> = alike.iter().map(|(settings, _)| settings.clone()).collect();
        for (settings, group) in alike {
            let differs =
                |setting: &&(String, String)| described.iter().any(|o| !o.contains(setting));
            let shown = settings.iter().filter(differs);
            let shown: Vec<String> = shown.map(|(key, value)| format!("{key} {value}")).collect();
            let name = match shown.is_empty() {
                true => kind.clone(),
                false => format!("{kind} ({})", shown.join(", ")),
            };
            all.push((name, group));
        }
    }
    all.sort_by(|a, b| a.0.cmp(&b.0));
    all
}
