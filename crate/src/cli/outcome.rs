//! An evaluation on the terminal.

use super::hints::finding_line;
use super::terminal::drawn;
use crate::error::Result;
use crate::evaluation::{
    ConfidenceReport, ContextReport, EvaluationReport, HeldOutReport, IntervalsReport,
    SequencesReport,
};
use crate::report::evaluation::temporal;
use crate::report::{Cell, Column, NONE, Precision, Table};

/// Sequences that are listed for an object.
const WORST: usize = 3;

/// Prints a table of the objects, a line for everything else that was asked for, and the warnings.
pub(super) fn print(report: &EvaluationReport) -> Result<()> {
    let tracked = report.objects.iter().filter(|o| o.tracked).count();
    let (of, frames) = (report.objects.len(), report.frames);
    match report.tc {
        Some(tc) => say!("TC {tc:.3}: {tracked} of {of} objects tracked over {frames} frames"),
        None => say!(
            "TC unknown, not enough data: {tracked} of {of} objects below their threshold over {frames} frames"
        ),
    }
    say!("{}", drawn(&objects(report)));
    if let Some(intervals) = &report.intervals {
        print_intervals(intervals)?;
    }
    if let Some(held_out) = &report.held_out {
        print_held_out(held_out)?;
    }
    if let Some(confidence) = &report.confidence {
        print_confidence(confidence)?;
    }
    for of in report.sequences.iter().flatten() {
        print_worst(of)?;
    }
    if let Some(context) = &report.context {
        print_context(context)?;
    }
    if let Some(measures) = &report.temporal {
        say!("{}", drawn(&temporal(report, measures)));
    }
    say!(
        "error: mean squared distance in {}; map: {}, rank rule: {}, fitted and scored on the same frames",
        if report.is_in_space() {
            "the squared unit of the ground truth"
        } else {
            "ndc"
        },
        report.transform,
        report.rank
    );
    for warning in &report.warnings {
        say!("warning: {warning}");
    }
    for finding in &report.findings {
        say!("{}", finding_line(finding));
    }
    Ok(())
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(|| NONE.to_owned(), |v| format!("{v:.5}"))
}

fn objects(report: &EvaluationReport) -> Table {
    let columns = [
        Column::text("object"),
        Column::text("tracked"),
        Column::number("error"),
        Column::number("threshold"),
        Column::number("best keypoint"),
        Column::number("RMSE"),
        Column::number("frames"),
    ];
    let mut table = Table::new("objects", "Objects", columns);
    for object in &report.objects {
        let pixels = object.rmse_px.map(|px| format!("{px:.1} px"));
        table.push([
            Cell::text(&object.name),
            Cell::text(if object.tracked { "yes" } else { "no" }),
            Cell::number(object.error, None, Precision::Fixed(5)),
            Cell::number(object.threshold, None, Precision::Full),
            Cell::count(object.best_keypoint.map(|n| n as u64)),
            Cell::number(object.rmse, None, Precision::Fixed(5)).note(pixels),
            Cell::count(object.frames),
        ]);
    }
    table
}

fn print_intervals(intervals: &IntervalsReport) -> Result<()> {
    let range = |name: &str, [low, high]: [f64; 2]| format!("{name} {low:.5} to {high:.5}");
    let objects = intervals.objects.iter();
    let errors: Vec<String> = objects
        .filter_map(|o| Some(range(&o.name, o.error?)))
        .collect();
    say!(
        "95 % intervals over sequences of these errors, fitted and scored on the same frames ({} resamples): {}; {}",
        intervals.resamples,
        range("TC", intervals.tc),
        errors.join("; ")
    );
    Ok(())
}

fn print_held_out(held_out: &HeldOutReport) -> Result<()> {
    let objects = held_out.objects.iter();
    let errors: Vec<String> = objects
        .map(|o| format!("{} {}", o.name, number(o.error)))
        .collect();
    say!(
        "on held-out sequences ({} folds): TC {:.3}; {}",
        held_out.folds,
        held_out.tc,
        errors.join("; ")
    );
    Ok(())
}

fn print_confidence(confidence: &ConfidenceReport) -> Result<()> {
    let levels = confidence.levels.iter().map(|level| {
        let tc = level
            .tc
            .map_or_else(|| "unknown".to_owned(), |tc| format!("{tc:.3}"));
        format!(
            "from {} on TC {tc} ({:.1} %)",
            level.least,
            100.0 * level.kept
        )
    });
    let levels: Vec<String> = levels.collect();
    if !levels.is_empty() {
        say!(
            "TC by the smallest confidence that counts, with the share of keypoints that is left: {}",
            levels.join("; ")
        );
    }
    Ok(())
}

fn print_worst(of: &SequencesReport) -> Result<()> {
    let worst = of.errors.iter().take(WORST).map(|sequence| {
        format!(
            "{} {:.5} (frame {} {:.5})",
            sequence.sequence, sequence.error, sequence.worst_frame, sequence.worst_error
        )
    });
    let worst: Vec<String> = worst.collect();
    say!("worst sequences of {}: {}", of.object, worst.join("; "));
    Ok(())
}

fn print_context(context: &ContextReport) -> Result<()> {
    let shares = |shares: &[f64]| {
        let shares = context.close.iter().zip(shares);
        let shares: Vec<String> = shares
            .map(|(close, share)| format!("{:.1} % within {:.1} %", 100.0 * share, 100.0 * close))
            .collect();
        shares.join(", ")
    };
    for row in &context.regression {
        say!(
            "linear regression from all keypoints, {}, of {}: error {}; PCK {}",
            if row.held_out {
                "held out"
            } else {
                "same frames"
            },
            row.object,
            row.error
                .map_or_else(|| "–".to_owned(), |e| format!("{e:.5}")),
            row.pck
                .as_ref()
                .map_or_else(|| "–".to_owned(), |pck| shares(pck))
        );
    }
    for row in &context.assignment {
        say!(
            "min-cost assignment once a {}: precision {}; recall {}",
            row.trajectory,
            shares(&row.precision),
            shares(&row.recall)
        );
    }
    Ok(())
}
