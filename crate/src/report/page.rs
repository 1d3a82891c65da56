//! An evaluation as one HTML file: figures and style are in it, it runs no script and loads
//! nothing.

use maud::{Markup, PreEscaped, html};

use super::document::document;
use super::figures::evaluation_figures;
use crate::error::Result;
use crate::evaluation::{ContextReport, EvaluationReport, ObjectReport, SequencesReport};
use crate::metric::AffineMap;

/// Sequences that the page lists for an object.
const WORST: usize = 10;

/// The page of an evaluation.
///
/// # Errors
/// When a figure cannot be drawn.
pub fn evaluation_page(report: &EvaluationReport) -> Result<String> {
    let figures = evaluation_figures(report)?;
    let title = format!("Tracking capability {:.3}", report.tc);
    let body = html! {
        p { (report.frames) " frames, " (report.objects.len()) " objects, " (keypoints(report)) " keypoints; tracklens "
            (report.version) }
        p.lead { (lead(report)) }
        @if !report.warnings.is_empty() {
            ul { @for warning in &report.warnings { li { (prose(warning)) } } }
        }
        (objects(report))
        p { (protocol(report)) }
        @for figure in &figures {
            figure {
                div.plate.white role="region" tabindex="0" aria-label=(figure.name) { (PreEscaped(&figure.svg)) }
                figcaption { (figure.caption) }
            }
        }
        (maps(report))
        @if let Some(sequences) = &report.sequences { (worst(sequences)) }
        @if let Some(context) = &report.context { (context_tables(context)) }
        (provenance(report))
    };
    Ok(document(&title, &body))
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

fn number(value: Option<f64>) -> String {
    let digits = |value: f64| match value {
        0.0 => "0".to_owned(),
        v if (1e-4..1e5).contains(&v.abs()) => {
            let digits = (2.0 - v.abs().log10().floor()).clamp(0.0, 8.0) as usize;
            format!("{v:.digits$}")
        }
        v => format!("{v:.2e}"),
    };
    value.map_or_else(|| "–".to_owned(), digits)
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
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

fn protocol(report: &EvaluationReport) -> String {
    let map = if report.transform == "identity" {
        "keypoints are scored as they are, without a fitted map".to_owned()
    } else {
        format!(
            "a time-invariant {} map from keypoint to object is fitted and scored on the same frames, as in the authors’ code \
             (rank rule: {})",
            report.transform, report.rank
        )
    };
    let mut text = format!(
        "The tracking error is the mean squared distance in ndc (−1 to +1 across the image); {map}. An object is tracked when \
         the error of its best keypoint is at most its threshold; the tracking capability (TC) is the share of tracked objects."
    );
    if let Some(held_out) = &report.held_out {
        text += &format!(
            " Held out: maps and best keypoints are of the other sequences, in {} folds; TC {:.3}.",
            held_out.folds, held_out.tc
        );
    }
    if let Some(intervals) = &report.intervals {
        text += &format!(
            " Small figures: {:.0} % intervals of the errors that are fitted and scored on the same frames, {}, {} \
             resamples; of the TC on these frames, {:.3}: {:.3}–{:.3}.",
            100.0 * intervals.level,
            intervals.method,
            intervals.resamples,
            report.tc,
            intervals.tc[0],
            intervals.tc[1]
        );
    }
    if report.excluded > 0 {
        text += &format!(
            " {} frames were left out because a keypoint was not a finite number.",
            report.excluded
        );
    }
    text
}

fn objects(report: &EvaluationReport) -> Markup {
    let interval = |name: &str| {
        let intervals = report
            .intervals
            .iter()
            .flat_map(|intervals| &intervals.objects);
        intervals
            .filter(|object| object.name == name)
            .find_map(|object| object.error)
    };
    let held_out = |name: &str| {
        let held_out = report
            .held_out
            .iter()
            .flat_map(|held_out| &held_out.objects);
        held_out.into_iter().find(|object| object.name == name)
    };
    let pixels = report.objects.iter().any(|object| object.rmse_px.is_some());
    html! {
        div.table role="region" tabindex="0" aria-label="Objects" {
            table {
                thead { tr {
                    th { "object" } th { "tracked" } th { "error" } th { "threshold" }
                    @if report.held_out.is_some() { th { "held-out error" } }
                    th { "best keypoint" } th { "second best" } th { "RMSE" } @if pixels { th { "RMSE, px" } }
                    th { "frames" } th { "outside" }
                } }
                tbody { @for object in &report.objects { tr {
                    td { (object.name) }
                    td.good[object.tracked].bad[!object.tracked] { @if object.tracked { "yes" } @else { "no" } }
                    td {
                        (number(object.error))
                        @if let Some([low, high]) = interval(&object.name) {
                            " " small { (number(Some(low))) "–" (number(Some(high))) }
                        }
                    }
                    td { (object.threshold) }
                    @if report.held_out.is_some() {
                        @let own = held_out(&object.name);
                        td.good[own.is_some_and(|o| o.tracked)].bad[own.is_some_and(|o| !o.tracked)] {
                            (number(own.and_then(|own| own.error)))
                        }
                    }
                    td { @if let Some(n) = object.best_keypoint { (n) } @else { "–" } }
                    td {
                        @if let Some(second) = object.second_best {
                            (second.keypoint) " " small { (number(Some(second.error))) }
                        } @else { "–" }
                    }
                    td { (number(object.rmse)) }
                    @if pixels { td { (number(object.rmse_px)) } }
                    td { (object.frames) }
                    td { (object.outside) }
                } } }
            }
        }
    }
}

fn maps(report: &EvaluationReport) -> Markup {
    let fitted = |object: &'_ ObjectReport| object.map.zip(object.best_keypoint);
    html! {
        @if report.transform != "identity" {
            h2 { "Fitted maps" }
            p { "Position of the object from the keypoint (u, v), in ndc." }
            div.table role="region" tabindex="0" aria-label="Fitted maps" {
                table {
                    thead { tr { th { "object" } th { "keypoint" } th { "x" } th { "y" } } }
                    tbody { @for object in &report.objects { @if let Some((map, n)) = fitted(object) { tr {
                        td { (object.name) } td { (n) }
                        @for row in rows(&map) { td { (row) } }
                    } } } }
                }
            }
        }
    }
}

/// A map row by row, as terms of the keypoint (u, v).
fn rows(map: &AffineMap) -> [String; 2] {
    let signed = |value: f64, what: &str| {
        format!(
            "{} {:.4}{what}",
            if value < 0.0 { "−" } else { "+" },
            value.abs()
        )
    };
    [0, 1].map(|axis| {
        let [u, v] = map.a[axis];
        format!(
            "{}{:.4} u {} {}",
            if u < 0.0 { "−" } else { "" },
            u.abs(),
            signed(v, " v"),
            signed(map.b[axis], "")
        )
    })
}

fn worst(sequences: &[SequencesReport]) -> Markup {
    html! {
        h2 { "Worst sequences" }
        @for of in sequences {
            div.table role="region" tabindex="0" aria-label={ "Sequences of " (of.object) } {
                table {
                    thead { tr {
                        th { (of.object) ", keypoint " (of.keypoint) } th { "error" } th { "frames" } th { "worst frame" }
                        th { "squared distance there" }
                    } }
                    tbody { @for sequence in of.errors.iter().take(WORST) { tr {
                        td { (sequence.sequence) } td { (number(Some(sequence.error))) } td { (sequence.frames) }
                        td { (sequence.worst_frame) } td { (number(Some(sequence.worst_error))) }
                    } } }
                }
            }
            @if of.errors.len() > WORST { p { "The first " (WORST) " of " (of.errors.len()) " sequences." } }
        }
    }
}

fn context_tables(context: &ContextReport) -> Markup {
    let shares = |shares: Option<&Vec<f64>>| -> Vec<String> {
        let count = context.close.len();
        shares.map_or_else(
            || vec!["–".to_owned(); count],
            |shares| shares.iter().map(|share| percent(*share)).collect(),
        )
    };
    let within = || {
        context
            .close
            .iter()
            .map(|share| format!("within {}", percent(*share)))
    };
    html! {
        h2 { "What others measure" }
        p { "Linear regression of every object from all keypoints together, and the percentage of correct positions (PCK) \
             within a share of the side of the image, as Jakab et al. (2018) do." }
        div.table role="region" tabindex="0" aria-label="Linear regression" {
            table {
                thead { tr { th { "object" } th { "predicted frames" } th { "error" } @for label in within() { th { (label) } } } }
                tbody { @for row in &context.regression { tr {
                    td { (row.object) }
                    td { @if row.held_out { "held out" } @else { "fitted" } ", " (row.frames) }
                    td { (number(row.error)) }
                    @for share in shares(row.pck.as_ref()) { td { (share) } }
                } } }
            }
        }
        p { "Keypoints as they are, matched one to one to the objects with the smallest total distance, as Kulkarni et al. (2019) \
             do: precision is the share of keypoints that are matched that closely, recall that of objects." }
        div.table role="region" tabindex="0" aria-label="Assignment" {
            table {
                thead { tr { th { "matched" } th { "" } @for label in within() { th { (label) } } } }
                tbody { @for row in &context.assignment {
                    tr {
                        td { "once a " (row.trajectory) } td { "precision" }
                        @for share in shares(Some(&row.precision)) { td { (share) } }
                    }
                    tr {
                        td { "" } td { "recall" }
                        @for share in shares(Some(&row.recall)) { td { (share) } }
                    }
                } }
            }
        }
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
