//! Tables of many runs: CSV and Markdown.

use std::fmt::Write as _;

use super::figures::Figure;
use super::reference::{Pair, ReferenceReport};
use super::runs_report::{GroupReport, ObjectRunsReport, RunsReport};
use crate::data::quote_csv;

/// What marks an error that is at most its threshold.
pub(super) const TRACKED: &str = "✓";
/// What tables of groups that have one run each leave out, and why.
pub(super) const NO_SPREAD: &str =
    "Every group has one run at most, so statistics over runs are left out";

/// What stands for a number that there is not.
pub(super) const NONE: &str = "–";

/// A number of four digits after the point, or none.
pub(super) fn number(value: Option<f64>) -> String {
    value.map_or_else(|| NONE.to_owned(), |v| format!("{v:.4}"))
}

/// A variance, whose size is far from that of its errors.
pub(super) fn variance(object: &ObjectRunsReport) -> String {
    object
        .variance
        .map_or_else(|| NONE.to_owned(), |v| format!("{v:.2e}"))
}

/// The quartiles below and above the median.
pub(super) fn quartiles(object: &ObjectRunsReport) -> String {
    match object.quartiles {
        Some([_, q1, _, q3, _]) => format!("{q1:.4}–{q3:.4}"),
        None => NONE.to_owned(),
    }
}

/// A published number and ours.
pub(super) fn pair(pair: &Pair) -> String {
    let digits = |value: Option<f64>| value.map_or_else(|| NONE.to_owned(), |v| format!("{v:.3}"));
    format!(
        "{} / {}",
        digits(pair.published),
        with_interval(pair.own, pair.interval, 3)
    )
}

fn with_interval(value: Option<f64>, interval: Option<[f64; 2]>, digits: usize) -> String {
    match (value, interval) {
        (None, _) => NONE.to_owned(),
        (Some(v), None) => format!("{v:.digits$}"),
        (Some(v), Some([low, high])) => format!("{v:.digits$} [{low:.digits$}, {high:.digits$}]"),
    }
}

/// One line a run, as CSV.
pub fn runs_csv(report: &RunsReport) -> String {
    let mut out = String::from("group,run,architecture,seed,epochs,complete,tc,reconstruction");
    let objects = report
        .groups
        .first()
        .map_or(&[][..], |group| &group.objects);
    for object in objects {
        out += &format!(",{}", quote_csv(&format!("error_{}", object.name)));
    }
    out += ",reason\n";
    let seed = |seed: Option<u64>| seed.map(|s| s.to_string()).unwrap_or_default();
    let value = |value: Option<f64>| value.map(|v| v.to_string()).unwrap_or_default();
    // Writing to a String cannot fail.
    for group in &report.groups {
        let group_name = quote_csv(&group.name);
        for run in &group.runs {
            let names = [&run.name, &run.architecture].map(|name| quote_csv(name));
            let _ = write!(
                out,
                "{group_name},{},{},{},{},true,{},{}",
                names[0],
                names[1],
                seed(run.seed),
                run.epochs,
                run.tc,
                value(run.reconstruction)
            );
            for error in &run.errors {
                let _ = write!(out, ",{}", value(*error));
            }
            out += ",\n";
        }
        for run in &group.incomplete {
            let (name, reason) = (quote_csv(&run.name), quote_csv(&run.reason));
            let empty = ",".repeat(objects.len());
            let _ = writeln!(
                out,
                "{group_name},{name},,{},{},false,,{empty},{reason}",
                seed(run.seed),
                run.epochs
            );
        }
    }
    for run in &report.unread {
        let (name, reason) = (quote_csv(&run.name), quote_csv(&run.reason));
        let _ = writeln!(
            out,
            ",{name},,,0,false,,{},{reason}",
            ",".repeat(objects.len())
        );
    }
    out
}

/// One line a group and object, as CSV.
pub fn errors_csv(report: &RunsReport) -> String {
    let mut out = String::from(
        "group,object,threshold,runs,tc,tc_low,tc_high,mean,variance,min,q1,median,q3,max,iqm_trimmed,iqm_low,iqm_high,\
         iqm_window\n",
    );
    for group in &report.groups {
        for object in &group.objects {
            let ends =
                |interval: Option<[f64; 2]>| interval.map_or([None; 2], |ends| ends.map(Some));
            let quartiles = object.quartiles.map_or([None; 5], |q| q.map(Some));
            let numbers = [object.tc]
                .into_iter()
                .chain(ends(object.tc_interval))
                .chain([object.mean, object.variance]);
            let numbers = numbers
                .chain(quartiles)
                .chain([object.iqm_trimmed])
                .chain(ends(object.iqm_interval));
            let names = [&group.name, &object.name].map(|name| quote_csv(name));
            out += &format!(
                "{},{},{},{}",
                names[0], names[1], object.threshold, object.count
            );
            for value in numbers.chain([object.iqm_window]) {
                out.push(',');
                out += &value.map(|v| v.to_string()).unwrap_or_default();
            }
            out.push('\n');
        }
    }
    out
}

/// Everything as Markdown, with the figures as files beside it.
pub fn runs_markdown(report: &RunsReport, figures: &[Figure]) -> String {
    let mut out = String::from("# Tracking over runs\n\n");
    let names: Vec<&str> = report
        .groups
        .first()
        .map(|group| group.objects.iter().map(|o| o.name.as_str()).collect())
        .unwrap_or_default();
    if report.has_spread() {
        statistics_tables(&mut out, report, &names);
    } else {
        only_errors_table(&mut out, report, &names);
    }
    if let Some(reference) = &report.reference {
        reference_tables(&mut out, reference, &names);
    }
    // Writing to a String cannot fail.
    for note in &report.notes {
        let _ = write!(out, "\nNote: {note}.\n");
    }
    if report.not_counted().next().is_some() {
        out += "\n## Runs that do not count\n\n";
        for (name, reason) in report.not_counted() {
            let _ = writeln!(out, "- {name}: {reason}");
        }
    }
    for figure in figures {
        let _ = write!(
            out,
            "\n![{}]({}.svg)\n\n{}\n",
            figure.name, figure.name, figure.caption
        );
    }
    out
}

/// Capabilities and errors of groups with several runs.
fn statistics_tables(out: &mut String, report: &RunsReport, names: &[&str]) {
    // Writing to a String cannot fail.
    let _ = writeln!(out, "Intervals: {}.\n", report.intervals);
    let mut columns = vec![
        "group".to_owned(),
        "runs".to_owned(),
        "epochs".to_owned(),
        "mean TC".to_owned(),
    ];
    columns.extend(names.iter().map(|name| format!("TC {name}")));
    header(out, &columns);
    for group in &report.groups {
        let mut cells = vec![
            group.name.clone(),
            counted(group),
            group.epochs.to_string(),
            with_interval(group.tc, group.tc_interval, 3),
        ];
        cells.extend(
            group
                .objects
                .iter()
                .map(|o| with_interval(o.tc, o.tc_interval, 3)),
        );
        row(out, &cells);
    }
    *out += "\n## Tracking errors\n\nMean squared distance in ndc at the last epoch.\n\n";
    let columns = [
        "group",
        "object",
        "mean",
        "variance",
        "median",
        "quartiles",
        "IQM trimmed",
        "IQM between quartiles",
    ];
    header(out, &columns.map(str::to_owned));
    for group in &report.groups {
        for object in &group.objects {
            row(
                out,
                &[
                    group.name.clone(),
                    object.name.clone(),
                    number(object.mean),
                    variance(object),
                    number(object.quartiles.map(|q| q[2])),
                    quartiles(object),
                    with_interval(object.iqm_trimmed, object.iqm_interval, 4),
                    number(object.iqm_window),
                ],
            );
        }
    }
}

/// The error of every object and run, where a group has one run at most.
fn only_errors_table(out: &mut String, report: &RunsReport, names: &[&str]) {
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "Tracking errors: mean squared distance in ndc. {TRACKED}: at most the threshold. {NO_SPREAD}.\n"
    );
    let mut columns = vec!["group".to_owned(), "TC".to_owned()];
    columns.extend(names.iter().map(|name| (*name).to_owned()));
    header(out, &columns);
    for group in &report.groups {
        let mut cells = vec![group.name.clone(), with_interval(group.tc, None, 3)];
        cells.extend(group.only_errors().map(|(error, object)| {
            let mark = if object.is_tracked(error) {
                TRACKED
            } else {
                ""
            };
            format!("{} {mark}", number(error)).trim_end().to_owned()
        }));
        row(out, &cells);
    }
}

fn reference_tables(out: &mut String, reference: &ReferenceReport, objects: &[&str]) {
    let name = &reference.name;
    let _ = write!(
        out,
        "\n## Beside {name}\n\n{name}: {}. {}. Here: {}. {NONE}: no number is published, or there is no run.\n\n",
        reference.citation, reference.setting, reference.own_setting
    );
    let heading = |what: &str| format!("{what}: {name} / here");
    let mut columns = vec![
        "architecture".to_owned(),
        "runs".to_owned(),
        heading("mean TC"),
    ];
    columns.extend(
        objects
            .iter()
            .map(|object| heading(&format!("TC {object}"))),
    );
    header(out, &columns);
    for line in &reference.rows {
        let mut cells = vec![
            line.architecture.clone(),
            line.runs.to_string(),
            pair(&line.tc),
        ];
        cells.extend(line.objects.iter().map(pair));
        row(out, &cells);
    }
    if !reference.claims.is_empty() {
        out.push('\n');
        header(
            out,
            &[
                format!("claim of {name}"),
                "place".to_owned(),
                "compared".to_owned(),
                "here".to_owned(),
            ],
        );
        for claim in &reference.claims {
            row(
                out,
                &[
                    claim.text.clone(),
                    claim.place.clone(),
                    claim.statistic.describe().to_owned(),
                    claim.verdict(),
                ],
            );
        }
    }
}

fn header(out: &mut String, columns: &[String]) {
    let _ = writeln!(
        out,
        "| {} |\n|{}",
        columns.join(" | "),
        "---|".repeat(columns.len())
    );
}

fn row(out: &mut String, cells: &[String]) {
    // A bar in a name would end its cell.
    let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
    let _ = writeln!(out, "| {} |", cells.join(" | "));
}

/// The complete runs, and how many are not.
fn counted(group: &GroupReport) -> String {
    match group.incomplete.len() {
        0 => group.complete.to_string(),
        n => format!("{} (+ {n} incomplete)", group.complete),
    }
}
