//! Runs compared with published results.

use std::collections::BTreeSet;

use super::agents::AgentGroupReport;
use super::reference::{
    Claim, ClaimComparison, ClaimReport, Pair, Reference, ReferenceNumbers, ReferenceReport,
    ReferenceRow, Statistic,
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
            (Self::MeanError | Self::ErrorVariance, None) | (Self::Success, _) => None,
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
    let claims = reference.claims.iter().map(|claim| match claim.statistic {
        Statistic::Success => success_claim(claim, report.agent_groups()),
        _ => tracking_claim(claim, &group),
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

/// Tests a claim about architectures by their tracking; `group` finds that of an architecture.
fn tracking_claim<'a>(
    claim: &Claim,
    group: &impl Fn(&str) -> Option<&'a GroupReport>,
) -> ClaimReport {
    let mut missing = Vec::new();
    let mut comparisons = Vec::new();
    for (first, than) in pairs(claim) {
        let (Some(a), Some(b)) = (group(first), group(than)) else {
            let without = [first, than]
                .into_iter()
                .filter(|name| group(name).is_none());
            missing.extend(without.map(str::to_owned));
            continue;
        };
        let objects = claim.objects.iter().map(|name| Some(name.as_str()));
        let each: Vec<Option<&str>> = match claim.objects.is_empty() {
            true => vec![None],
            false => objects.collect(),
        };
        for object in each {
            let values = [a, b].map(|group| claim.statistic.of(group, object));
            let [Some(x), Some(y)] = values else { continue };
            comparisons.push(ClaimComparison {
                object: object.map(str::to_owned),
                first: first.to_owned(),
                than: than.to_owned(),
                values: [x, y],
                holds: match claim.statistic {
                    Statistic::Tc | Statistic::Success => x > y,
                    Statistic::MeanError | Statistic::ErrorVariance => x < y,
                },
            });
        }
    }
    tested(claim, comparisons, missing)
}

/// Tests a claim about the success of agents: that of one over others, or that it follows the TC of
/// their encoders. Agents at different tasks are not compared.
fn success_claim(claim: &Claim, groups: &[AgentGroupReport]) -> ClaimReport {
    let state = claim.state.as_deref();
    let with_encoder = |group: &&AgentGroupReport| group.state.as_deref() == state;
    let mut missing = Vec::new();
    let mut compared: Vec<[&AgentGroupReport; 2]> = Vec::new();
    if claim.first.is_none() {
        let shown: Vec<_> = groups.iter().filter(with_encoder).collect();
        let tc = |group: &AgentGroupReport| group.tc.unwrap_or(f64::NAN);
        for a in &shown {
            let lower = shown.iter().filter(|b| tc(a) > tc(b));
            compared.extend(lower.map(|b| [*a, *b]));
        }
    }
    let named = |name: &str| {
        let is = |group: &&AgentGroupReport| match &group.architecture {
            Some(architecture) => architecture == name && with_encoder(group),
            None => group.state.as_deref() == Some(name),
        };
        let mut found = groups.iter().filter(|group| group.complete > 0).filter(is);
        found.next().filter(|_| found.next().is_none())
    };
    for (first, than) in pairs(claim) {
        match (named(first), named(than)) {
            (Some(a), Some(b)) => compared.push([a, b]),
            _ => {
                let without = [first, than]
                    .into_iter()
                    .filter(|name| named(name).is_none());
                missing.extend(without.map(str::to_owned));
            }
        }
    }
    let comparison = |[a, b]: [&AgentGroupReport; 2]| {
        let (x, y) = (a.success?, b.success?);
        let told = |group: &AgentGroupReport| match group.tc {
            Some(tc) => format!("{} (TC {tc:.3})", group.name),
            None => group.name.clone(),
        };
        (a.task == b.task).then(|| ClaimComparison {
            object: None,
            first: told(a),
            than: told(b),
            values: [x, y],
            holds: x > y,
        })
    };
    let comparisons = compared.into_iter().filter_map(comparison).collect();
    tested(claim, comparisons, missing)
}

/// What a claim says is better, with everything that it is better than.
fn pairs(claim: &Claim) -> impl Iterator<Item = (&str, &str)> {
    let first = claim.first.as_deref();
    let than = claim.than.iter().map(String::as_str);
    than.filter_map(move |than| Some((first?, than)))
}

fn tested(
    claim: &Claim,
    comparisons: Vec<ClaimComparison>,
    mut missing: Vec<String>,
) -> ClaimReport {
    missing.sort();
    missing.dedup();
    ClaimReport {
        text: claim.text.clone(),
        place: claim.place.clone(),
        statistic: claim.statistic,
        comparisons,
        missing,
    }
}

/// Runs and epochs, agents and their steps, in a sentence.
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
    let trained = || {
        format!(
            "{} runs an architecture, {} epochs{input}",
            range(counted().map(|group| group.complete).collect()),
            range(counted().map(|group| group.epochs as usize).collect()),
        )
    };
    let agents = || {
        report
            .agent_groups()
            .iter()
            .filter(|group| group.complete > 0)
    };
    let tasks: BTreeSet<&str> = agents().filter_map(|group| group.task.as_deref()).collect();
    let learned = || {
        format!(
            "{} agents a group, {} steps of {}",
            range(agents().map(|group| group.complete).collect()),
            range(agents().map(|group| group.steps as usize).collect()),
            tasks.iter().copied().collect::<Vec<_>>().join(" and "),
        )
    };
    let parts = [
        (counted().next().is_some()).then(trained),
        (agents().next().is_some()).then(learned),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join("; ")
}
