//! The tables of many runs.

use super::agents::agents_tables;
use super::reference::{ClaimReport, Pair, ReferenceReport};
use super::statistics::{GroupReport, ObjectRunsReport, RunReport, RunsReport};
use crate::report::{Cell, Column, Emphasis, Number, Precision, Table};

/// Marks an error that is at most its threshold.
const TRACKED: &str = "✓";
/// Digits of errors.
const ERROR: Precision = Precision::Fixed(4);
/// Digits of capabilities.
const CAPABILITY: Precision = Precision::Fixed(3);

/// Every table of the report: of trainings and detectors capabilities and errors (or, where every
/// group has one run at most, their errors), probabilities of improvement and the runs; of agents
/// their success beside the tracking of their encoders; and the comparison with published results.
pub fn runs_tables(report: &RunsReport) -> Vec<Table> {
    let mut tables = Vec::new();
    if !report.groups.is_empty() {
        tables.extend(match report.has_spread() {
            true => vec![capabilities(report), errors(report)],
            false => vec![only_errors(report)],
        });
        if report.has_spread() && !report.improvement.is_empty() {
            tables.push(improvement(report));
        }
        tables.push(runs(report));
    }
    if let Some(agents) = &report.agents {
        tables.extend(agents_tables(agents, &report.intervals));
    }
    if let Some(reference) = &report.reference {
        if !report.groups.is_empty() {
            tables.push(published(report, reference));
        }
        if !reference.claims.is_empty() {
            tables.push(claims(reference));
        }
    }
    tables
}

/// Every table as LaTeX, one float after the other.
pub fn runs_latex(report: &RunsReport) -> String {
    let tables = runs_tables(report);
    let tables: Vec<String> = tables.iter().map(Table::to_latex).collect();
    format!(
        "% Needs \\usepackage{{booktabs}} and \\usepackage{{amssymb}}.\n\n{}",
        tables.join("\n")
    )
}

/// One line a run, as CSV.
pub fn runs_csv(report: &RunsReport) -> String {
    let labels = [
        "group",
        "run",
        "architecture",
        "seed",
        "epochs",
        "complete",
        "tc",
        "reconstruction",
    ];
    let errors = report
        .objects()
        .iter()
        .map(|object| format!("error_{}", object.name));
    let labels = labels.iter().map(|label| (*label).to_owned());
    let labels = labels.chain(errors).chain(["reason".to_owned()]);
    let mut table = Table::new("runs", "Runs", labels.map(Column::text));
    let full = |value: Option<f64>| Cell::number(value, None, Precision::Full);
    // A run that does not count has no values.
    let not_counted = |group: &str, name: &str, seed: Option<u64>, epochs: usize, reason: &str| {
        let mut cells = vec![
            Cell::text(group),
            Cell::text(name),
            Cell::text(""),
            seed_cell(seed),
            Cell::count(epochs as u64),
            Cell::text("false"),
            full(None),
            full(None),
        ];
        cells.extend(report.objects().iter().map(|_| full(None)));
        cells.push(Cell::text(reason));
        cells
    };
    for group in &report.groups {
        for run in &group.runs {
            let mut cells = vec![
                Cell::text(&group.name),
                Cell::text(&run.name),
                Cell::text(&run.architecture),
                seed_cell(run.seed),
                Cell::count(run.epochs as u64),
                Cell::text("true"),
                full(Some(run.tc)),
                full(run.reconstruction),
            ];
            cells.extend(run.errors.iter().map(|error| full(*error)));
            cells.push(Cell::text(""));
            table.push(cells);
        }
        for run in &group.incomplete {
            let (name, reason) = (&run.name, &run.reason);
            table.push(not_counted(&group.name, name, run.seed, run.epochs, reason));
        }
    }
    for run in &report.unread {
        table.push(not_counted("", &run.name, None, 0, &run.reason));
    }
    table.to_csv()
}

/// One line a group and object, as CSV.
pub fn errors_csv(report: &RunsReport) -> String {
    let labels = [
        "group",
        "object",
        "threshold",
        "runs",
        "tc",
        "tc_low",
        "tc_high",
        "mean",
        "variance",
        "min",
        "q1",
        "median",
        "q3",
        "max",
        "iqm_trimmed",
        "iqm_low",
        "iqm_high",
        "iqm_window",
    ];
    let mut table = Table::new("errors", "Tracking errors", labels.map(Column::text));
    let full = |value: Option<f64>| Cell::number(value, None, Precision::Full);
    let ends = |interval: Option<[f64; 2]>| interval.map_or([None; 2], |ends| ends.map(Some));
    for group in &report.groups {
        for object in &group.objects {
            let values = [vec![object.tc], ends(object.tc_interval).to_vec()]
                .concat()
                .into_iter()
                .chain([object.mean, object.variance])
                .chain(object.quartiles.map_or([None; 5], |q| q.map(Some)))
                .chain([object.iqm_trimmed])
                .chain(ends(object.iqm_interval))
                .chain([object.iqm_window]);
            let names = [
                Cell::text(&group.name),
                Cell::text(&object.name),
                full(Some(object.threshold)),
                Cell::count(object.count as u64),
            ];
            table.push(names.into_iter().chain(values.map(full)));
        }
    }
    table.to_csv()
}

/// A seed in a CSV file, empty where it is not known.
fn seed_cell(seed: Option<u64>) -> Cell {
    seed.map_or_else(|| Cell::text(""), Cell::count)
}

/// A column for every object.
fn object_columns<'a>(
    report: &'a RunsReport,
    label: impl Fn(&str) -> String + 'a,
) -> impl Iterator<Item = Column> + 'a {
    let objects = report.objects().iter();
    objects.map(move |object| Column::number(label(&object.name)))
}

/// `cube 0.015, eef 0.1`.
fn thresholds(report: &RunsReport) -> String {
    let objects = report.objects().iter();
    let named: Vec<String> = objects
        .map(|object| format!("{} {}", object.name, object.threshold))
        .collect();
    named.join(", ")
}

/// An error, marked where it is at most the threshold.
fn error_cell(error: Option<f64>, object: &ObjectRunsReport) -> Cell {
    let is_tracked = object.is_tracked(error);
    Cell::number(error, None, ERROR).emphasis(Emphasis::good(is_tracked))
}

fn capabilities(report: &RunsReport) -> Table {
    let columns = [
        Column::text("group"),
        Column::number("runs"),
        Column::number("epochs"),
        Column::number("mean TC"),
    ];
    let objects = object_columns(report, |name| format!("TC {name}"));
    let mut table = Table::new(
        "capability",
        "Tracking capability",
        columns.into_iter().chain(objects),
    )
    .note(format!(
        "The tracking capability of an object is the share of runs whose tracking error is at most its threshold ({}). \
         Intervals: {}.",
        thresholds(report),
        report.intervals
    ));
    for group in &report.groups {
        let incomplete = match group.incomplete.len() {
            0 => None,
            n => Some(format!("+{n} incomplete")),
        };
        let cells = [
            Cell::text(&group.name),
            Cell::count(group.complete as u64).note(incomplete),
            Cell::count(u64::from(group.epochs)),
            Cell::number(group.tc, group.tc_interval, CAPABILITY),
        ];
        let objects = group.objects.iter().map(|object| {
            let is_good = object.tc.is_some_and(|tc| tc >= 0.5);
            Cell::number(object.tc, object.tc_interval, CAPABILITY)
                .emphasis(Emphasis::good(is_good))
        });
        table.push(cells.into_iter().chain(objects));
    }
    table
}

/// The error of every object, where a group has one run at most.
fn only_errors(report: &RunsReport) -> Table {
    let columns = [Column::text("group"), Column::number("TC")];
    let objects = object_columns(report, str::to_owned);
    let mut table = Table::new("only-errors", "Tracking errors", columns.into_iter().chain(objects))
        .note(format!(
            "Mean squared distance in ndc; {TRACKED}: at most the threshold ({}). No group has more than one run, so \
             there are no statistics over runs.",
            thresholds(report)
        ));
    for group in &report.groups {
        let cells = [
            Cell::text(&group.name),
            Cell::number(group.tc, None, CAPABILITY),
        ];
        let errors = group.only_errors().map(|(error, object)| {
            let mark = object.is_tracked(error).then_some(TRACKED);
            error_cell(error, object).mark(mark)
        });
        table.push(cells.into_iter().chain(errors));
    }
    table
}

fn errors(report: &RunsReport) -> Table {
    let columns = [
        Column::group("group"),
        Column::text("object"),
        Column::number("mean"),
        Column::number("variance"),
        Column::number("median"),
        Column::number("quartiles"),
        Column::number("IQM trimmed"),
        Column::number("IQM between quartiles"),
    ];
    let mut table = Table::new("errors", "Tracking errors by object", columns).note(
        "Mean squared distance in ndc at the last epoch, after the fitted affine map. IQM: interquartile mean, trimmed \
         as in rliable (Agarwal et al., 2021), with its interval, and between the quartiles.",
    );
    for group in &report.groups {
        for object in &group.objects {
            let quartiles = object.quartiles;
            table.push([
                Cell::text(&group.name),
                Cell::text(&object.name),
                Cell::number(object.mean, None, ERROR),
                Cell::number(object.variance, None, Precision::Scientific(2)),
                Cell::number(quartiles.map(|q| q[2]), None, ERROR),
                Cell::number(
                    None::<f64>,
                    quartiles.map(|[_, q1, _, q3, _]| [q1, q3]),
                    ERROR,
                ),
                Cell::number(object.iqm_trimmed, object.iqm_interval, ERROR),
                Cell::number(object.iqm_window, None, ERROR),
            ]);
        }
    }
    table
}

fn improvement(report: &RunsReport) -> Table {
    let columns = [Column::group("group"), Column::text("over")];
    let objects = object_columns(report, str::to_owned);
    let mut table = Table::new(
        "improvement",
        "Probability of improvement",
        columns.into_iter().chain(objects),
    )
    .note(
        "The probability that a run of the first group has a lower error than a run of the second.",
    );
    for group in &report.groups {
        for over in report.groups.iter().filter(|over| over.name != group.name) {
            let probability = |object: &ObjectRunsReport| {
                let found = report.improvement.iter().find(|i| {
                    (&i.object, &i.group, &i.over) == (&object.name, &group.name, &over.name)
                });
                Cell::number(found.map(|i| i.probability), None, Precision::Fixed(2))
            };
            let cells = [Cell::text(&group.name), Cell::text(&over.name)];
            table.push(
                cells
                    .into_iter()
                    .chain(group.objects.iter().map(probability)),
            );
        }
    }
    table
}

fn runs(report: &RunsReport) -> Table {
    let columns = [
        Column::text("run"),
        Column::text("group"),
        Column::text("architecture"),
        Column::number("seed"),
        Column::number("epochs"),
        Column::number("TC"),
    ];
    let errors = object_columns(report, |name| format!("error {name}"));
    let columns = columns.into_iter().chain(errors);
    let columns = columns.chain([Column::number("reconstruction")]);
    let mut table = Table::new("runs", "Runs", columns);
    for group in &report.groups {
        for run in &group.runs {
            table.push(run_cells(group, run));
        }
    }
    table
}

fn run_cells<'a>(group: &'a GroupReport, run: &'a RunReport) -> impl Iterator<Item = Cell> + 'a {
    let errors = run.errors.iter().zip(&group.objects);
    let cells = [
        Cell::text(&run.name),
        Cell::text(&group.name),
        Cell::text(&run.architecture),
        Cell::count(run.seed),
        // A detector that was scored has none.
        Cell::count(Some(run.epochs as u64).filter(|epochs| *epochs > 0)),
        Cell::number(run.tc, None, Precision::Fixed(2)),
    ];
    cells
        .into_iter()
        .chain(errors.map(|(error, object)| error_cell(*error, object)))
        .chain([Cell::number(run.reconstruction, None, ERROR)])
}

fn published(report: &RunsReport, reference: &ReferenceReport) -> Table {
    let name = &reference.name;
    let heading = |what: &str| format!("{what}: {name} / here");
    let columns = [
        Column::text("architecture"),
        Column::number("runs"),
        Column::number(heading("mean TC")),
    ];
    let objects = object_columns(report, |object| heading(&format!("TC {object}")));
    let mut table = Table::new(
        "published",
        format!("Compared with {name}"),
        columns.into_iter().chain(objects),
    )
    .note(format!(
        "{name}: {}. {}. Here: {}. –: no number is published, or there is no run.",
        reference.citation, reference.setting, reference.own_setting
    ));
    let pair = |pair: &Pair| {
        let number = |value, interval| Number {
            value,
            interval,
            precision: CAPABILITY,
        };
        Cell::numbers([
            number(pair.published, None),
            number(pair.own, pair.own.and(pair.interval)),
        ])
    };
    for row in &reference.rows {
        let cells = [
            Cell::text(&row.architecture),
            Cell::count(row.runs as u64),
            pair(&row.tc),
        ];
        table.push(cells.into_iter().chain(row.objects.iter().map(pair)));
    }
    table
}

fn claims(reference: &ReferenceReport) -> Table {
    let columns = [
        Column::text(format!("claim of {}", reference.name)),
        Column::text("place"),
        Column::text("compared"),
        Column::text("here"),
    ];
    let mut table = Table::new("claims", format!("Claims of {}", reference.name), columns).note(
        "A claim holds where the value is better in every comparison. The intervals and the probabilities of \
         improvement say whether so few runs can show it.",
    );
    for claim in &reference.claims {
        table.push([
            Cell::text(&claim.text),
            Cell::text(&claim.place),
            Cell::text(claim.statistic.describe()),
            verdict_cell(claim),
        ]);
    }
    table
}

fn verdict_cell(claim: &ClaimReport) -> Cell {
    let holds = claim.comparisons.iter().all(|comparison| comparison.holds);
    let emphasis = match claim.comparisons.is_empty() {
        true => None,
        false => Emphasis::verdict(holds),
    };
    let details = claim.comparisons.iter().map(|comparison| {
        let object = comparison.object.as_ref();
        let object = object
            .map(|object| format!("{object}: "))
            .unwrap_or_default();
        let [first, than] = comparison.values;
        let relation = match comparison.holds {
            true => ",",
            false => ", not better than",
        };
        format!(
            "{object}{} {first:.4}{relation} {} {than:.4}",
            comparison.first, comparison.than
        )
    });
    Cell::text(claim.verdict())
        .emphasis(emphasis)
        .details(details.collect())
}
