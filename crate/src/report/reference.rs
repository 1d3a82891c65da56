//! Published numbers and claims beside runs of one's own.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::runs_report::{GroupReport, RunsReport};

/// Published results: what `tracklens report --reference` reads (TOML).
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// What heads its columns, e.g. `paper`.
    pub name: String,
    /// Where the numbers are from.
    pub citation: String,
    /// How they were made: runs, epochs, sizes.
    pub setting: String,
    /// The numbers, by architecture.
    pub architectures: BTreeMap<String, ReferenceNumbers>,
    /// What is claimed to be better than what.
    #[serde(default)]
    pub claims: Vec<Claim>,
}

/// The numbers of one architecture that are published as numbers.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReferenceNumbers {
    /// Mean TC.
    pub tc: Option<f64>,
    /// Mean TC of objects.
    #[serde(default)]
    pub objects: BTreeMap<String, f64>,
}

/// That one architecture is better than others.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// The claim in words.
    pub text: String,
    /// Where it is made.
    pub place: String,
    /// What is compared.
    pub statistic: Statistic,
    /// Of these objects; of TC, without any, the mean over all.
    #[serde(default)]
    pub objects: Vec<String>,
    /// The architecture that is better.
    pub first: String,
    /// Than each of these.
    pub than: Vec<String>,
}

/// A number of a group that can be better or worse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Statistic {
    /// Mean tracking capability; more is better.
    Tc,
    /// Mean of the tracking errors; less is better.
    MeanError,
    /// Variance of the tracking errors; less is better.
    ErrorVariance,
}

/// Published numbers beside those of a [`RunsReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReferenceReport {
    /// What heads its columns.
    pub name: String,
    /// Where the numbers are from.
    pub citation: String,
    /// How they were made.
    pub setting: String,
    /// How these were made.
    pub own_setting: String,
    /// The architectures with published numbers or with runs.
    pub rows: Vec<ReferenceRow>,
    /// The claims.
    pub claims: Vec<ClaimReport>,
}

/// One architecture of a [`ReferenceReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReferenceRow {
    /// Its name.
    pub architecture: String,
    /// Complete runs; 0 where there are none.
    pub runs: usize,
    /// Mean TC.
    pub tc: Pair,
    /// Mean TC of the objects.
    pub objects: Vec<Pair>,
}

/// A published number and ours.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pair {
    /// Null where no number is published.
    pub published: Option<f64>,
    /// Null without a complete run.
    pub own: Option<f64>,
    /// 95 % interval of ours.
    pub interval: Option<[f64; 2]>,
}

/// What runs say to a [`Claim`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClaimReport {
    /// The claim in words.
    pub text: String,
    /// Where it is made.
    pub place: String,
    /// What is compared.
    pub statistic: Statistic,
    /// One a pair of architectures and an object.
    pub comparisons: Vec<ClaimComparison>,
    /// Architectures without runs.
    pub missing: Vec<String>,
}

/// One comparison of a [`ClaimReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClaimComparison {
    /// The object; null for all.
    pub object: Option<String>,
    /// Claimed to be better.
    pub first: String,
    /// Claimed to be worse.
    pub than: String,
    /// The two numbers.
    pub values: [f64; 2],
    /// Whether the first is better here.
    pub holds: bool,
}

impl ClaimReport {
    /// In words: how many of the comparisons hold.
    pub fn verdict(&self) -> String {
        let held = self.comparisons.iter().filter(|c| c.holds).count();
        let all = self.comparisons.len();
        let verdict = match (held, all) {
            (_, 0) => "not tested".to_owned(),
            (held, all) if held == all => "holds".to_owned(),
            (0, _) => "does not hold".to_owned(),
            (held, all) => format!("holds in {held} of {all} comparisons"),
        };
        match self.missing.is_empty() {
            true => verdict,
            false => format!("{verdict}; no runs of {}", self.missing.join(", ")),
        }
    }
}

impl Statistic {
    /// In words.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Tc => "mean TC",
            Self::MeanError => "mean error",
            Self::ErrorVariance => "variance of the error",
        }
    }

    fn of(self, group: &GroupReport, object: Option<&str>) -> Option<f64> {
        let found = |name: &str| group.object(name);
        match (self, object) {
            (Self::Tc, None) => group.tc,
            (Self::Tc, Some(name)) => found(name)?.tc,
            (Self::MeanError, Some(name)) => found(name)?.mean,
            (Self::ErrorVariance, Some(name)) => found(name)?.variance,
            (Self::MeanError | Self::ErrorVariance, None) => None,
        }
    }
}

impl ReferenceReport {
    /// Published numbers beside those of `report`. An architecture stands for its group; where it
    /// has several, for none.
    pub fn new(reference: &Reference, report: &RunsReport) -> Self {
        let group = |architecture: &str| {
            let is = |group: &&GroupReport| {
                group
                    .runs
                    .first()
                    .is_some_and(|run| run.architecture == architecture)
            };
            let mut found = report.groups.iter().filter(is);
            found.next().filter(|_| found.next().is_none())
        };
        let objects: Vec<&str> = report
            .groups
            .first()
            .map(|group| group.objects.iter().map(|o| o.name.as_str()).collect())
            .unwrap_or_default();
        let mut architectures: Vec<&str> =
            reference.architectures.keys().map(String::as_str).collect();
        for run in report.groups.iter().filter_map(|group| group.runs.first()) {
            if !architectures.contains(&run.architecture.as_str()) {
                architectures.push(&run.architecture);
            }
        }
        architectures.sort_unstable();
        let none = ReferenceNumbers::default();
        let rows = architectures.iter().map(|architecture| {
            let published = reference.architectures.get(*architecture).unwrap_or(&none);
            let own = group(architecture);
            let object = |name: &&str| {
                let own = own.and_then(|group| group.object(name));
                Pair {
                    published: published.objects.get(*name).copied(),
                    own: own.and_then(|o| o.tc),
                    interval: own.and_then(|o| o.tc_interval),
                }
            };
            ReferenceRow {
                architecture: (*architecture).to_owned(),
                runs: own.map_or(0, |group| group.complete),
                tc: Pair {
                    published: published.tc,
                    own: own.and_then(|group| group.tc),
                    interval: own.and_then(|group| group.tc_interval),
                },
                objects: objects.iter().map(object).collect(),
            }
        });
        let claims = reference.claims.iter().map(|claim| {
            let mut missing = Vec::new();
            let mut comparisons = Vec::new();
            for than in &claim.than {
                let (Some(a), Some(b)) = (group(&claim.first), group(than)) else {
                    let without = [&claim.first, than]
                        .into_iter()
                        .filter(|name| group(name).is_none());
                    missing.extend(without.cloned());
                    continue;
                };
                let each = match claim.objects.is_empty() {
                    true => vec![None],
                    false => claim
                        .objects
                        .iter()
                        .map(|name| Some(name.as_str()))
                        .collect(),
                };
                for object in each {
                    let values = [a, b].map(|group| claim.statistic.of(group, object));
                    let [Some(x), Some(y)] = values else { continue };
                    comparisons.push(ClaimComparison {
                        object: object.map(str::to_owned),
                        first: claim.first.clone(),
                        than: than.clone(),
                        values: [x, y],
                        holds: match claim.statistic {
                            Statistic::Tc => x > y,
                            Statistic::MeanError | Statistic::ErrorVariance => x < y,
                        },
                    });
                }
            }
            missing.sort();
            missing.dedup();
            ClaimReport {
                text: claim.text.clone(),
                place: claim.place.clone(),
                statistic: claim.statistic,
                comparisons,
                missing,
            }
        });
        Self {
            name: reference.name.clone(),
            citation: reference.citation.clone(),
            setting: reference.setting.clone(),
            own_setting: own_setting(report),
            rows: rows.collect(),
            claims: claims.collect(),
        }
    }
}

/// Runs and epochs in a sentence.
fn own_setting(report: &RunsReport) -> String {
    let range = |values: Vec<usize>| {
        let (low, high) = (values.iter().min(), values.iter().max());
        match (low, high) {
            (Some(low), Some(high)) if low == high => low.to_string(),
            (Some(low), Some(high)) => format!("{low} to {high}"),
            _ => "no".to_owned(),
        }
    };
    let counted = || report.groups.iter().filter(|group| group.complete > 0);
    let mut settings: Vec<String> = counted().filter_map(|group| group.input.clone()).collect();
    settings.sort();
    settings.dedup();
    let input = match settings.is_empty() {
        true => String::new(),
        false => format!(", inputs of {} px", settings.join(" and ")),
    };
    format!(
        "{} runs an architecture, {} epochs{input}",
        range(counted().map(|group| group.complete).collect()),
        range(counted().map(|group| group.epochs as usize).collect()),
    )
}
