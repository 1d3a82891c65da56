//! Many runs as one self-contained page.

use maud::html;

use super::agents::agents_lead;
use super::statistics::RunsReport;
use super::tables::runs_tables;
use crate::report::draw::{Figure, document, figure};

/// Tables and figures of many runs as an HTML document that needs nothing else.
pub fn runs_page(report: &RunsReport, figures: &[Figure]) -> String {
    let not_counted: Vec<(&str, &str)> = report.not_counted().collect();
    let tables = runs_tables(report);
    // Results first, then the figures, then what they are made of.
    let results = [
        "capability",
        "only-errors",
        "success",
        "correlation",
        "published",
        "claims",
    ];
    let (first, rest): (Vec<_>, Vec<_>) = tables
        .iter()
        .partition(|table| results.contains(&table.name));
    let groups = report.groups.len() + report.agent_groups().len();
    let body = html! {
        p {
            (report.complete()) " complete runs in " (groups) " groups"
            @if !not_counted.is_empty() { ", " (not_counted.len()) " more that " a href="#not-counted" { "do not count" } }
            "; tracklens " (report.version)
        }
        p.lead { (lead(report)) }
        @if let Some(agents) = &report.agents { p.lead { (agents_lead(agents)) } }
        @for note in &report.notes { p.note { (note) "." } }
        @for table in first { h2 { (table.caption) } (table.to_html()) }
        h2 { "Figures" }
        @for one in figures { (figure(one, false)) }
        @for table in rest { h2 { (table.caption) } (table.to_html()) }
        @if !not_counted.is_empty() {
            h2 id="not-counted" { "Runs that do not count" }
            ul { @for (name, reason) in &not_counted { li { (name) ": " (reason) } } }
        }
    };
    document("Tracking over runs", &body)
}

/// The best group, in a sentence.
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
