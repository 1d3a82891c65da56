//! Runs compared with published results.

use super::reference::{
    ClaimComparison, ClaimReport, Pair, Reference, ReferenceNumbers, ReferenceReport, ReferenceRow,
    Statistic,
};
use super::statistics::{GroupReport, RunsReport};

impl Statistic {
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

impl RunsReport {
    /// Compares the runs with published results. An architecture stands for its group; one with
    /// several groups is left out.
    pub fn compare_with(&mut self, reference: &Reference) {
        self.reference = Some(compared(reference, self));
    }
}

fn compared(reference: &Reference, report: &RunsReport) -> ReferenceReport {
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
    let mut architectures: Vec<&str> = reference.architectures.keys().map(String::as_str).collect();
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
    ReferenceReport {
        name: reference.name.clone(),
        citation: reference.citation.clone(),
        setting: reference.setting.clone(),
        own_setting: own_setting(report),
        rows: rows.collect(),
        claims: claims.collect(),
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
