//! An evaluation as one HTML file: figures, images and style are in it, it runs no script and loads
//! nothing.

use maud::{Markup, html};

use super::evaluation_figures;
use super::film::Film;
use super::tables::{assignment, maps, objects, regression, temporal, worst_sequences};
use super::words::protocol;
use crate::error::Result;
use crate::evaluation::EvaluationReport;
use crate::report::draw::{document, figure, part};

/// The page of an evaluation, with a sequence that plays in it where there is one.
///
/// # Errors
/// When a figure cannot be drawn.
pub fn evaluation_page(report: &EvaluationReport, film: Option<&Film>) -> Result<String> {
    let figures = evaluation_figures(report)?;
    let body = html! {
        p { (report.frames) " frames, " (report.objects.len()) " objects, " (keypoints(report)) " keypoints; tracklens "
            (report.version) }
        (summary(report))
        p { (protocol(report)) }
        @if let Some(film) = film { (film.to_html()?) }
        @for one in &figures { (figure(one, true)) }
        @if report.transform != "identity" { h2 { "Fitted maps" } (maps(report).to_html()) }
        @if let Some(sequences) = &report.sequences {
            h2 { "Worst sequences" }
            @for of in sequences { (worst_sequences(of).to_html()) }
        }
        @if let Some(measures) = &report.temporal {
            h2 { "Temporal quality" }
            (temporal(report, measures).to_html())
        }
        @if let Some(context) = &report.context {
            h2 { "Other metrics" }
            (regression(context).to_html())
            (assignment(context).to_html())
        }
        (provenance(report))
    };
    Ok(document(&title(report), &body))
}

/// The evaluation as a part of another page, such as the output of a notebook: what is tracked, the
/// table of the objects, and the figures.
///
/// # Errors
/// When a figure cannot be drawn.
pub fn evaluation_part(report: &EvaluationReport) -> Result<String> {
    let figures = evaluation_figures(report)?;
    let body = html! {
        (summary(report))
        @for one in &figures { (figure(one, true)) }
    };
    Ok(part(&title(report), &body))
}

fn title(report: &EvaluationReport) -> String {
    match report.tc {
        Some(tc) => format!("Tracking capability {tc:.3}"),
        None => "Tracking capability unknown".to_owned(),
    }
}

/// What is tracked, findings and warnings, and the errors of the objects.
fn summary(report: &EvaluationReport) -> Markup {
    html! {
        p.lead { (lead(report)) }
        @if !report.warnings.is_empty() || !report.findings.is_empty() {
            ul {
                @for finding in &report.findings { li { (prose(&finding.text)) } }
                @for warning in &report.warnings { li { (prose(warning)) } }
            }
        }
        (objects(report).to_html())
    }
}

/// Text with names between backticks.
fn prose(text: &str) -> Markup {
    html! {
        @for (i, part) in text.split('`').enumerate() {
            @if i % 2 == 1 { code { (part) } } @else { (part) }
        }
    }
}

fn keypoints(report: &EvaluationReport) -> usize {
    report.errors.first().map_or(0, Vec::len)
}

fn lead(report: &EvaluationReport) -> String {
    let names = |tracked: bool| {
        let objects = report
            .objects
            .iter()
            .filter(|object| object.tracked == tracked);
        objects
            .map(|object| object.name.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    };
    let (yes, no) = (names(true), names(false));
    match (yes.is_empty(), no.is_empty()) {
        (false, true) => format!("Every object is tracked: {yes}."),
        (true, _) => format!("No object is tracked: {no}."),
        (false, false) => format!("Tracked: {yes}. Not tracked: {no}."),
    }
}

fn provenance(report: &EvaluationReport) -> Markup {
    html! {
        @if report.join.is_some() || report.command.is_some() { h2 { "Where it comes from" } }
        @if let Some(join) = &report.join {
            p {
                (join.matched) " frames have both keypoints and ground truth; " (join.unmatched_frames.count)
                " frames of keypoints and " (join.unmatched_rows.count) " of the ground truth have no partner. "
                (join.rules.join(". "))
            }
        }
        @if let Some([width, height]) = report.image_size {
            p { "Images of " (width) " × " (height) " pixels." }
        }
        @if let Some(command) = &report.command {
            p { "The same again:" }
            pre { (command) }
        }
    }
}
