//! `tracklens report`.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::painter::Painter;
use super::score::parse_threshold;
use crate::atomic;
use crate::error::{Error, ErrorKind, Result};
use crate::metric::default_threshold;
use crate::report::{Figure, GroupReport, ObjectRunsReport, Run, Runs, RunsReport, STYLE, figures};
use crate::train::{CONFIG, LOG, SUMMARY};

/// Folders below the given ones that are searched for runs.
const DEPTH: usize = 6;

#[derive(Debug, Args)]
pub(super) struct ReportArguments {
    /// Run folders, or folders with run folders in them
    #[arg(required = true, value_name = "RUNS")]
    runs: Vec<PathBuf>,
    /// Folder to write the tables and figures into
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Threshold on an object's error (mean squared distance, ndc); repeatable. Default: cube 0.015, target 0.015,
    /// eef 0.1, others 0.015
    #[arg(long = "threshold", value_name = "NAME=VALUE", value_parser = parse_threshold)]
    thresholds: Vec<(String, f64)>,
    /// Draws of the runs for the intervals
    #[arg(long, value_name = "N", default_value_t = 2000)]
    resamples: usize,
    /// Seeds the draws
    #[arg(long, value_name = "SEED", default_value_t = 0)]
    seed: u64,
}

pub(super) fn run(arguments: &ReportArguments) -> Result<()> {
    let mut folders = Vec::new();
    for path in &arguments.runs {
        if !path.is_dir() {
            return Err(Error::new(
                ErrorKind::Io,
                "is no folder; expected a run folder, or one that holds run folders",
            )
            .at(path.display()));
        }
        find(path, DEPTH, &mut folders)?;
    }
    folders.sort();
    folders.dedup();
    let runs: Vec<Run> = folders.iter().map(|folder| read(folder)).collect::<Result<_>>()?;
    for (name, _) in &arguments.thresholds {
        let known = |run: &Run| run.config.objects.contains(name);
        if let Some(run) = runs.first().filter(|run| !known(run)) {
            return Err(Error::mismatch(format!(
                "a threshold is given for `{name}`; the runs have the objects {}",
                run.config.objects.join(", ")
            )));
        }
    }
    let threshold = |object: &str| {
        let given = arguments.thresholds.iter().find(|(name, _)| name == object);
        given.map_or_else(|| default_threshold(object), |(_, value)| *value)
    };
    let runs = Runs::new(runs, threshold)?;
    let report = RunsReport::new(&runs, arguments.resamples, arguments.seed)?;
    let figures = figures(&runs, &report)?;

    let out = &arguments.out;
    fs::create_dir_all(out).map_err(|e| Error::io(out.display(), &e))?;
    let json = serde_json::to_vec_pretty(&report).map_err(|e| Error::input(e.to_string()))?;
    atomic::write(&out.join("report.json"), &json)?;
    atomic::write(&out.join("runs.csv"), runs_csv(&runs, &report).as_bytes())?;
    atomic::write(&out.join("errors.csv"), errors_csv(&report).as_bytes())?;
    atomic::write(&out.join("report.md"), markdown(&report, &figures).as_bytes())?;
    let painter = Painter::new();
    for figure in &figures {
        atomic::write(&out.join(format!("{}.svg", figure.name)), figure.svg.as_bytes())?;
        atomic::write(
            &out.join(format!("{}.png", figure.name)),
            &painter.png(&figure.svg)?,
        )?;
    }
    let page = page(&report, &figures).into_string();
    atomic::write(&out.join("report.html"), page.as_bytes())?;
    for group in &report.groups {
        for incomplete in &group.incomplete {
            eprintln!("warning: {incomplete}; it does not count");
        }
    }
    let complete: usize = report.groups.iter().map(|group| group.complete).sum();
    eprintln!(
        "{complete} complete runs in {} groups; report written to {}",
        report.groups.len(),
        out.join("report.html").display()
    );
    Ok(())
}

/// Run folders in `folder`, or itself.
fn find(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> Result<()> {
    if folder.join(CONFIG).is_file() {
        found.push(folder.to_owned());
        return Ok(());
    }
    if depth == 0 {
        return Ok(());
    }
    let failed = |e: std::io::Error| Error::io(folder.display(), &e);
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() {
            find(&path, depth - 1, found)?;
        }
    }
    Ok(())
}

fn read(folder: &Path) -> Result<Run> {
    let bytes = |name: &str| fs::read(folder.join(name));
    let need = |name: &str| bytes(name).map_err(|e| Error::io(folder.join(name).display(), &e));
    // A run that was ended in its first epoch has no log yet.
    let log = bytes(LOG).unwrap_or_default();
    let summary = bytes(SUMMARY).ok();
    Run::parse(
        &folder.to_string_lossy(),
        &need(CONFIG)?,
        &log,
        summary.as_deref(),
    )
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |v| format!("{v:.4}"))
}

fn with_interval(value: Option<f64>, interval: Option<[f64; 2]>, digits: usize) -> String {
    match (value, interval) {
        (None, _) => "–".to_owned(),
        (Some(v), None) => format!("{v:.digits$}"),
        (Some(v), Some([low, high])) => format!("{v:.digits$} [{low:.digits$}, {high:.digits$}]"),
    }
}

/// One line a run.
fn runs_csv(runs: &Runs, report: &RunsReport) -> String {
    let mut out = String::from("group,run,seed,tc,reconstruction");
    for (name, _) in &runs.objects {
        out += &format!(",{}", crate::data::quote_csv(&format!("error_{name}")));
    }
    out.push('\n');
    for group in &report.groups {
        for run in &group.runs {
            let fields = [&group.name, &run.name].map(|name| crate::data::quote_csv(name));
            out += &format!(
                "{},{},{},{},{}",
                fields[0], fields[1], run.seed, run.tc, run.reconstruction
            );
            for error in &run.errors {
                out += &error.map_or_else(|| ",".to_owned(), |e| format!(",{e}"));
            }
            out.push('\n');
        }
    }
    out
}

/// One line a group and object.
fn errors_csv(report: &RunsReport) -> String {
    let mut out = String::from(
        "group,object,threshold,runs,tc,tc_low,tc_high,mean,variance,min,q1,median,q3,max,iqm_trimmed,iqm_low,iqm_high,\
         iqm_window\n",
    );
    for group in &report.groups {
        for object in &group.objects {
            let ends = |interval: Option<[f64; 2]>| interval.map_or([None; 2], |ends| ends.map(Some));
            let quartiles = object.quartiles.map_or([None; 5], |q| q.map(Some));
            let numbers = [object.tc]
                .into_iter()
                .chain(ends(object.tc_interval))
                .chain([object.mean, object.variance]);
            let numbers = numbers
                .chain(quartiles)
                .chain([object.iqm_trimmed])
                .chain(ends(object.iqm_interval));
            let names = [&group.name, &object.name].map(|name| crate::data::quote_csv(name));
            out += &format!("{},{},{},{}", names[0], names[1], object.threshold, object.count);
            for value in numbers.chain([object.iqm_window]) {
                out.push(',');
                out += &value.map(|v| v.to_string()).unwrap_or_default();
            }
            out.push('\n');
        }
    }
    out
}

fn markdown(report: &RunsReport, figures: &[Figure]) -> String {
    let mut out = String::from("# Tracking over runs\n\n");
    // Writing to a String cannot fail.
    let _ = writeln!(out, "Intervals: {}.\n", report.intervals);
    let names: Vec<&str> = report
        .groups
        .first()
        .map(|group| group.objects.iter().map(|o| o.name.as_str()).collect())
        .unwrap_or_default();
    let mut columns = vec!["architecture".to_owned(), "runs".to_owned(), "mean TC".to_owned()];
    columns.extend(names.iter().map(|name| format!("TC {name}")));
    columns.extend(names.iter().map(|name| format!("error {name} (IQM)")));
    let _ = writeln!(
        out,
        "| {} |\n|{}",
        columns.join(" | "),
        "---|".repeat(columns.len())
    );
    for group in &report.groups {
        let mut cells = vec![
            group.name.clone(),
            match group.incomplete.len() {
                0 => group.complete.to_string(),
                n => format!("{} (+ {n} incomplete)", group.complete),
            },
            with_interval(group.tc, group.tc_interval, 3),
        ];
        cells.extend(
            group
                .objects
                .iter()
                .map(|o| with_interval(o.tc, o.tc_interval, 3)),
        );
        cells.extend(
            group
                .objects
                .iter()
                .map(|o| with_interval(o.iqm_trimmed, o.iqm_interval, 4)),
        );
        let _ = writeln!(out, "| {} |", cells.join(" | "));
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

fn interval_cell(value: Option<f64>, interval: Option<[f64; 2]>, digits: usize) -> Markup {
    html! {
        @match value {
            Some(value) => {
                (format!("{value:.digits$}"))
                @if let Some([low, high]) = interval {
                    " " small { (format!("{low:.digits$}–{high:.digits$}")) }
                }
            }
            None => { "–" }
        }
    }
}

/// What the groups come to, in a sentence.
fn lead(report: &RunsReport) -> String {
    let ranked = report.groups.iter().filter_map(|group| Some((group.tc?, group)));
    let Some((tc, best)) = ranked.max_by(|a, b| a.0.total_cmp(&b.0)) else {
        return String::new();
    };
    let often = |object: &&ObjectRunsReport| object.tc.is_some_and(|tc| tc >= 0.5);
    let names = |objects: Vec<&ObjectRunsReport>| {
        objects
            .iter()
            .map(|o| format!("{} in {:.0} %", o.name, 100.0 * o.tc.unwrap_or(0.0)))
            .collect::<Vec<_>>()
    };
    let tracked = names(best.objects.iter().filter(often).collect());
    let missed = names(best.objects.iter().filter(|object| !often(object)).collect());
    let mut sentence = format!(
        "{} has the highest mean tracking capability, {tc:.3}: of its {} runs it tracks ",
        best.name, best.complete
    );
    sentence += &match (tracked.is_empty(), missed.is_empty()) {
        (false, true) => tracked.join(", "),
        (false, false) => format!("{}; but {}", tracked.join(", "), missed.join(", ")),
        (true, _) => missed.join(", "),
    };
    sentence + "."
}

fn page(report: &RunsReport, figures: &[Figure]) -> Markup {
    let objects: &[ObjectRunsReport] = report.groups.first().map_or(&[], |group| &group.objects);
    let incomplete: Vec<&String> = report.groups.iter().flat_map(|group| &group.incomplete).collect();
    let complete: usize = report.groups.iter().map(|group| group.complete).sum();
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "Tracking over runs" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { "Tracking over runs" }
                p { (complete) " complete runs of " (report.groups.len()) " groups; tracklens " (report.version) }
                p.lead { (lead(report)) }
                div.table {
                    table {
                        thead { tr {
                            th { "architecture" } th { "runs" } th { "epochs" } th { "mean TC" }
                            @for object in objects { th { "TC " (object.name) } }
                        } }
                        tbody { @for group in &report.groups { (capability_row(group)) } }
                    }
                }
                p { "The tracking capability of an object is the share of runs whose tracking error is at most its threshold ("
                    @for (i, object) in objects.iter().enumerate() {
                        @if i > 0 { ", " } (object.name) " " (object.threshold)
                    }
                    "). Small figures: " (report.intervals) "." }
                @if !incomplete.is_empty() {
                    h2 { "Runs that do not count" }
                    ul { @for run in &incomplete { li { (run) } } }
                }
                @for figure in figures {
                    figure {
                        div.plate { (PreEscaped(&figure.svg)) }
                        figcaption { (figure.caption) }
                    }
                }
                h2 { "Tracking errors" }
                p { "Mean squared distance in ndc at the last epoch, after the fitted affine map. IQM: interquartile mean, trimmed \
                     as in rliable (Agarwal et al., 2021), with its interval, and between the quartiles." }
                div.table {
                    table {
                        thead { tr {
                            th { "architecture" } th { "object" } th { "mean" } th { "variance" } th { "median" }
                            th { "quartiles" } th { "IQM trimmed" } th { "IQM between quartiles" }
                        } }
                        tbody { @for group in &report.groups { @for object in &group.objects { (error_row(group, object)) } } }
                    }
                }
                @if !report.improvement.is_empty() {
                    h2 { "Probability of improvement" }
                    p { "How probable it is that a run of the first has a lower error than a run of the second." }
                    div.table {
                        table {
                            thead { tr { th { "architecture" } th { "over" } @for object in objects { th { (object.name) } } } }
                            tbody { (improvement_rows(report)) }
                        }
                    }
                }
            }
        }
    }
}

fn capability_row(group: &GroupReport) -> Markup {
    html! {
        tr {
            td { (group.name) }
            td { (group.complete) @if !group.incomplete.is_empty() { " " small { "+" (group.incomplete.len()) " incomplete" } } }
            td { (group.epochs) }
            td { (interval_cell(group.tc, group.tc_interval, 3)) }
            @for object in &group.objects {
                td.good[object.tc.is_some_and(|tc| tc >= 0.5)] { (interval_cell(object.tc, object.tc_interval, 2)) }
            }
        }
    }
}

fn error_row(group: &GroupReport, object: &ObjectRunsReport) -> Markup {
    html! {
        tr {
            td { (group.name) }
            td { (object.name) }
            td { (number(object.mean)) }
            td { (object.variance.map_or_else(|| "–".to_owned(), |v| format!("{v:.2e}"))) }
            td { (number(object.quartiles.map(|q| q[2]))) }
            td { @if let Some([_, q1, _, q3, _]) = object.quartiles { (format!("{q1:.4}–{q3:.4}")) } @else { "–" } }
            td { (interval_cell(object.iqm_trimmed, object.iqm_interval, 4)) }
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
                    td { (over.name) }
                    @for object in &group.objects {
                        td {
                            (number(report.improvement.iter()
                                .find(|i| i.object == object.name && i.group == group.name && i.over == over.name)
                                .map(|i| i.probability)))
                        }
                    }
                }
            }
        }
    }
}
