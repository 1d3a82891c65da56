//! Published results, and how runs compare with them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Published results: what `tracklens report --reference` reads (TOML).
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// What heads its columns, e.g. `paper`.
    pub name: String,
    /// Where the numbers come from.
    pub citation: String,
    /// How they were obtained: runs, epochs, sizes.
    pub setting: String,
    /// The numbers, by architecture.
    pub architectures: BTreeMap<String, ReferenceNumbers>,
    /// The claims.
    #[serde(default)]
    pub claims: Vec<Claim>,
}

/// The published numbers of one architecture.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReferenceNumbers {
    /// Mean TC.
    pub tc: Option<f64>,
    /// Mean TC of objects.
    #[serde(default)]
    pub objects: BTreeMap<String, f64>,
}

/// The claim that one architecture is better than others, or of success also a state, or that the
/// order by TC is that by success.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// The claim in words.
    pub text: String,
    /// Where it is made.
    pub place: String,
    /// The statistic that is compared.
    pub statistic: Statistic,
    /// The objects that it is about. Without any it is about the mean TC of all objects.
    #[serde(default)]
    pub objects: Vec<String>,
    /// What agents see, where it is about their success.
    pub state: Option<String>,
    /// The architecture that is better; of success also a state without keypoints, as `full`.
    /// Without one the claim is that encoders with a higher TC lead to a higher success.
    pub first: Option<String>,
    /// What it is better than, each of them.
    #[serde(default)]
    pub than: Vec<String>,
}

impl Reference {
    /// Checks what a claim needs.
    ///
    /// # Errors
    /// Names the claim, and what is missing or too much.
    pub fn validate(&self) -> Result<()> {
        for claim in &self.claims {
            let is_success = claim.statistic == Statistic::Success;
            let wrong = match (&claim.first, claim.than.is_empty()) {
                (Some(_), true) => "has `first` and no `than`, which it is better than",
                (None, false) => "has `than` and no `first`, which is better",
                (None, true) if !is_success => "has no `first` and `than`, which it compares",
                _ if is_success && claim.state.is_none() => {
                    "is about success and has no `state`, e.g. state = \"keypoints\""
                }
                _ if !is_success && claim.state.is_some() => {
                    "has a `state` and is not about success"
                }
                _ => continue,
            };
            return Err(Error::input(format!(
                "the claim \"{}\" {wrong}",
                claim.text
            )));
        }
        Ok(())
    }
}

/// A statistic of a group that can be better or worse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Statistic {
    /// Mean tracking capability; more is better.
    Tc,
    /// Mean of the tracking errors; less is better.
    MeanError,
    /// Variance of the tracking errors; less is better.
    ErrorVariance,
    /// Success of agents at the end; more is better.
    Success,
}

/// Published numbers and those of a [`RunsReport`](super::RunsReport).
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ReferenceReport {
    /// What heads its columns.
    pub name: String,
    /// Where the numbers come from.
    pub citation: String,
    /// How they were obtained.
    pub setting: String,
    /// How the runs were made.
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

/// A published number and that of the runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pair {
    /// Null where no number is published.
    pub published: Option<f64>,
    /// Null without a complete run.
    pub own: Option<f64>,
    /// 95 % interval of `own`.
    pub interval: Option<[f64; 2]>,
}

/// A [`Claim`] tested on the runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClaimReport {
    /// The claim in words.
    pub text: String,
    /// Where it is made.
    pub place: String,
    /// The statistic that is compared.
    pub statistic: Statistic,
    /// The comparisons, one for each pair of architectures and object.
    pub comparisons: Vec<ClaimComparison>,
    /// What has no runs.
    pub missing: Vec<String>,
}

/// One comparison of a [`ClaimReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClaimComparison {
    /// The object; null for all.
    pub object: Option<String>,
    /// What is claimed to be better.
    pub first: String,
    /// What is claimed to be worse.
    pub than: String,
    /// The values of the two.
    pub values: [f64; 2],
    /// Whether the first is better here.
    pub holds: bool,
}

impl ClaimReport {
    /// How many of the comparisons hold, in words.
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
    /// The statistic in words.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Tc => "mean TC",
            Self::MeanError => "mean error",
            Self::ErrorVariance => "variance of the error",
            Self::Success => "success",
        }
    }
}
