//! Many runs as one self-contained page.

use maud::{Markup, html};

use super::document::{document, figure, with_interval};
use super::figures::Figure;
use super::reference::{ClaimReport, ReferenceReport};
use super::runs_report::{GroupReport, ObjectRunsReport, RunsReport};
use super::tables::{NO_SPREAD, TRACKED, number, quartiles, variance};

/// Tables and figures of many runs as an HTML document that needs nothing else.
pub fn runs_page(report: &RunsReport, figures: &[Figure]) -> String {
    let objects: &[ObjectRunsReport] = report.groups.first().map_or(&[], |group| &group.objects);
    let not_counted: Vec<(&str, &str)> = report.not_counted().collect();
    let body = html! {
        p {
            (report.complete()) " complete runs in " (report.groups.len()) " groups"
            @if !not_counted.is_empty() { ", " (not_counted.len()) " more that " a href="#not-counted" { "do not count" } }
            "; tracklens " (report.version)
        }
        p.lead { (lead(report)) }
        @for note in &report.notes { p.note { (note) "." } }
        @if report.has_spread() { (capability_table(report, objects)) } @else { (only_errors_table(report, objects)) }
        @if let Some(reference) = &report.reference { (beside(reference, objects)) }
        h2 { "Figures" }
        @for one in figures { (figure(one)) }
        @if report.has_spread() { (statistics_tables(report, objects)) }
        h2 { "Runs" }
        div.table role="region" tabindex="0" aria-label="Runs" {
            table {
                thead { tr {
                    th { "run" } th.text { "group" } th { "seed" } th { "epochs" } th { "TC" }
                    @for object in objects { th { "error " (object.name) } }
                    th { "reconstruction" }
                } }
                tbody { (run_rows(report)) }
            }
        }
        @if !not_counted.is_empty() {
            h2 id="not-counted" { "Runs that do not count" }
            ul { @for (name, reason) in &not_counted { li { (name) ": " (reason) } } }
        }
    };
    document("Tracking over runs", &body)
}

fn capability_table(report: &RunsReport, objects: &[ObjectRunsReport]) -> Markup {
    html! {
        div.table role="region" tabindex="0" aria-label="Tracking capability" {
            table {
                thead { tr {
                    th { "group" } th { "runs" } th { "epochs" } th { "mean TC" }
                    @for object in objects { th { "TC " (object.name) } }
                } }
                tbody { @for group in &report.groups { (capability_row(group)) } }
            }
        }
        p { "The tracking capability of an object is the share of runs whose tracking error is at most its threshold ("
            (thresholds(objects)) "). Small figures: " (report.intervals) "." }
    }
}

/// The error of every object and run, where a group has one run at most.
fn only_errors_table(report: &RunsReport, objects: &[ObjectRunsReport]) -> Markup {
    html! {
        div.table role="region" tabindex="0" aria-label="Tracking errors" {
            table {
                thead { tr { th { "group" } th { "TC" } @for object in objects { th { "error " (object.name) } } } }
                tbody { @for group in &report.groups { tr {
                    td { (group.name) }
                    td { (with_interval(group.tc, None, 3)) }
                    @for (error, object) in group.only_errors() {
                        td.good[object.is_tracked(error)] {
                            (number(error)) @if object.is_tracked(error) { " " (TRACKED) }
                        }
                    }
                } } }
            }
        }
        p { "Tracking errors: mean squared distance in ndc. " (TRACKED) ": at most the threshold ("
            (thresholds(objects)) "). " (NO_SPREAD) "." }
    }
}

/// The errors over the runs of the groups, and how probably those of one are lower than those of
/// another.
fn statistics_tables(report: &RunsReport, objects: &[ObjectRunsReport]) -> Markup {
    html! {
        h2 { "Tracking errors" }
        p { "Mean squared distance in ndc at the last epoch, after the fitted affine map. IQM: interquartile mean, trimmed \
             as in rliable (Agarwal et al., 2021), with its interval, and between the quartiles." }
        div.table role="region" tabindex="0" aria-label="Tracking errors" {
            table {
                thead { tr {
                    th { "group" } th.text { "object" } th { "mean" } th { "variance" } th { "median" }
                    th { "quartiles" } th { "IQM trimmed" } th { "IQM between quartiles" }
                } }
                tbody {
                    @for group in &report.groups {
                        @for (k, object) in group.objects.iter().enumerate() { (error_row(group, object, k == 0)) }
                    }
                }
            }
        }
        @if !report.improvement.is_empty() {
            h2 { "Probability of improvement" }
            p { "How probable it is that a run of the first has a lower error than a run of the second." }
            div.table role="region" tabindex="0" aria-label="Probability of improvement" {
                table {
                    thead { tr { th { "group" } th.text { "over" } @for object in objects { th { (object.name) } } } }
                    tbody { (improvement_rows(report)) }
                }
            }
        }
    }
}

fn thresholds(objects: &[ObjectRunsReport]) -> String {
    let named: Vec<String> = objects
        .iter()
        .map(|o| format!("{} {}", o.name, o.threshold))
        .collect();
    named.join(", ")
}

/// What the groups come to, in a sentence.
fn lead(report: &RunsReport) -> String {
    let ranked = report
        .groups
        .iter()
        .filter_map(|group| Some((group.tc?, group)));
    let Some((tc, best)) = ranked.max_by(|a, b| a.0.total_cmp(&b.0)) else {
        return String::new();
    };
    let objects: Vec<String> = best
        .objects
        .iter()
        .map(|o| {
            format!(
                "{} in {}",
                o.name,
                (o.tc.unwrap_or(0.0) * o.count as f64).round()
            )
        })
        .collect();
    let runs = match best.complete {
        1 => "its one run".to_owned(),
        n => format!("its {n} runs"),
    };
    let alone = match report
        .groups
        .iter()
        .filter(|group| group.tc == Some(tc))
        .count()
    {
        1 => "has the highest mean tracking capability",
        _ => "is among those with the highest mean tracking capability",
    };
    format!(
        "{} {alone}, {tc:.3}: of {runs} it tracks {}.",
        best.name,
        objects.join(", ")
    )
}

fn capability_row(group: &GroupReport) -> Markup {
    html! {
        tr {
            td { (group.name) }
            td { (group.complete) @if !group.incomplete.is_empty() { " " small { "+" (group.incomplete.len()) " incomplete" } } }
            td { (group.epochs) }
            td { (with_interval(group.tc, group.tc_interval, 3)) }
            @for object in &group.objects {
                td.good[object.tc.is_some_and(|tc| tc >= 0.5)] { (with_interval(object.tc, object.tc_interval, 2)) }
            }
        }
    }
}

fn error_row(group: &GroupReport, object: &ObjectRunsReport, first: bool) -> Markup {
    html! {
        tr.first[first] {
            td { @if first { (group.name) } }
            td.text { (object.name) }
            td { (number(object.mean)) }
            td { (variance(object)) }
            td { (number(object.quartiles.map(|q| q[2]))) }
            td { (quartiles(object)) }
            td { (with_interval(object.iqm_trimmed, object.iqm_interval, 4)) }
            td { (number(object.iqm_window)) }
        }
    }
}

fn improvement_rows(report: &RunsReport) -> Markup {
    html! {
        @for group in &report.groups {
            @for over in report.groups.iter().filter(|over| over.name != group.name) {
                tr {
                    td { (group.name) }
                    td.text { (over.name) }
                    @for object in &group.objects {
                        td {
                            @match report.improvement.iter()
                                .find(|i| i.object == object.name && i.group == group.name && i.over == over.name) {
                                Some(found) => { (format!("{:.2}", found.probability)) }
                                None => { "–" }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn run_rows(report: &RunsReport) -> Markup {
    html! {
        @for group in &report.groups {
            @for run in &group.runs {
                tr {
                    td { (run.name) }
                    td.text { (group.name) }
                    td { @if let Some(seed) = run.seed { (seed) } @else { "–" } }
                    td { (run.epochs) }
                    td { (format!("{:.2}", run.tc)) }
                    @for (error, object) in run.errors.iter().zip(&group.objects) {
                        td.good[object.is_tracked(*error)] { (number(*error)) }
                    }
                    td { (number(run.reconstruction)) }
                }
            }
        }
    }
}

/// Published numbers beside ours.
fn beside(reference: &ReferenceReport, objects: &[ObjectRunsReport]) -> Markup {
    html! {
        h2 { "Beside " (reference.name) }
        p { (reference.citation) ". " (reference.name) ": " (reference.setting) ". Here: " (reference.own_setting)
            ". –: no number is published, or there is no run." }
        div.table role="region" tabindex="0" aria-label="Published numbers" {
            table {
                thead {
                    tr {
                        th rowspan="2" { "architecture" } th rowspan="2" { "runs" }
                        th colspan="2" { "mean TC" }
                        @for object in objects { th colspan="2" { "TC " (object.name) } }
                    }
                    tr { @for _ in 0..=objects.len() { th { (reference.name) } th { "here" } } }
                }
                tbody {
                    @for row in &reference.rows {
                        tr {
                            td { (row.architecture) }
                            td { (row.runs) }
                            @for pair in std::iter::once(&row.tc).chain(&row.objects) {
                                td { (with_interval(pair.published, None, 3)) }
                                td { (with_interval(pair.own, pair.interval, 3)) }
                            }
                        }
                    }
                }
            }
        }
        @if !reference.claims.is_empty() {
            div.table role="region" tabindex="0" aria-label="Claims" {
                table {
                    thead { tr { th { "claim" } th.text { "place" } th.text { "compared" } th.text { "here" } } }
                    tbody { @for claim in &reference.claims { (claim_row(claim)) } }
                }
            }
            p { "A claim holds where the number is better in every comparison; whether runs so few could show it, the intervals \
                 and the probabilities of improvement below say." }
        }
    }
}

fn claim_row(claim: &ClaimReport) -> Markup {
    let tested = !claim.comparisons.is_empty();
    let held = claim.comparisons.iter().all(|c| c.holds);
    html! {
        tr {
            td.text { (claim.text) }
            td.text { (claim.place) }
            td.text { (claim.statistic.describe()) }
            td.text.good[tested && held].bad[tested && !held] {
                (claim.verdict())
                @for c in &claim.comparisons {
                    br;
                    small {
                        @if let Some(object) = &c.object { (object) ": " }
                        (c.first) " " (format!("{:.4}", c.values[0])) @if c.holds { ", " } @else { ", not better than " }
                        (c.than) " " (format!("{:.4}", c.values[1]))
                    }
                }
            }
        }
    }
}
