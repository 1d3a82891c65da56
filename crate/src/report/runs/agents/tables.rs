//! The tables of agents.

use super::statistics::{AgentGroupReport, AgentReport, AgentsReport, CorrelationReport};
use crate::report::runs::statistics::RunsReport;
use crate::report::{Cell, Column, Emphasis, Precision, Table};

/// Digits of shares and correlations.
const SHARE: Precision = Precision::Fixed(3);
/// Digits of tracking errors.
const ERROR: Precision = Precision::Fixed(4);

/// Every table of the agents: success, encoders beside it, and the runs.
pub(in crate::report::runs) fn agents_tables(agents: &AgentsReport, intervals: &str) -> Vec<Table> {
    let mut tables = vec![success(agents, intervals)];
    if agents.encoders.iter().any(|encoder| encoder.tc.is_some()) {
        tables.extend([correlation(agents), encoders(agents)]);
    }
    tables.push(runs(agents));
    tables
}

/// The group with the highest success, in a sentence.
pub(in crate::report::runs) fn agents_lead(agents: &AgentsReport) -> String {
    let best = agents.groups.first();
    let best = best.and_then(|group| Some((group, group.success?)));
    let Some((group, success)) = best else {
        return String::new();
    };
    let solved = (100.0 * success).round();
    format!(
        "Agents of {} solve the most at the end: {solved} % of the episodes.",
        group.name
    )
}

fn success(agents: &AgentsReport, intervals: &str) -> Table {
    let columns = [
        Column::text("agents"),
        Column::number("runs"),
        Column::number("steps"),
        Column::number("TC"),
        Column::number("success at the end"),
        Column::number("mean success"),
    ];
    let mut table = Table::new("success", "Success of agents", columns).note(format!(
        "Interquartile means over the runs (Agarwal et al., 2021) of the share of episodes solved: \
         at the last evaluation, smoothed over the evaluations by a Gaussian of {} as in the paper, \
         and in the mean over all of them, which is higher for agents that learn earlier. TC: mean \
         over the encoders of the runs. Intervals: {intervals}.",
        agents.smoothing
    ));
    for group in &agents.groups {
        let incomplete = match group.incomplete.len() {
            0 => None,
            n => Some(format!("+{n} incomplete")),
        };
        table.push([
            Cell::text(&group.name),
            Cell::count(group.complete as u64).note(incomplete),
            Cell::count(group.steps),
            Cell::number(group.tc, None, SHARE),
            Cell::number(group.success, group.success_interval, SHARE),
            Cell::number(group.mean_success, group.mean_success_interval, SHARE),
        ]);
    }
    table
}

fn correlation(agents: &AgentsReport) -> Table {
    let columns = [
        Column::group("state"),
        Column::text("tracking"),
        Column::number("encoders"),
        Column::number("rank correlation"),
        Column::number("pairs in order"),
    ];
    let mut table = Table::new("correlation", "Tracking and success", columns).note(
        "Spearman's rank correlation of the encoders' tracking with the success at the end, with \
         its 95 % interval by a bootstrap over the encoders. Where tracking tells success it is \
         near 1 for TC and near -1 for errors. Pairs in order: of the pairs of encoders that track \
         differently well, those in which the better one has the higher success.",
    );
    for report in &agents.correlations {
        table.push([
            Cell::text(&report.setting),
            Cell::text(measure(report)),
            Cell::count(report.encoders as u64),
            Cell::number(report.rho, report.interval, Precision::Fixed(2)),
            Cell::text(format!("{} of {}", report.in_order, report.pairs)),
        ]);
    }
    table
}

/// `TC`, or `error of cube`.
fn measure(report: &CorrelationReport) -> String {
    let object = report.object.as_ref();
    object.map_or_else(|| "TC".to_owned(), |object| format!("error of {object}"))
}

fn encoders(agents: &AgentsReport) -> Table {
    let columns = [
        Column::group("state"),
        Column::text("encoder"),
        Column::number("runs"),
        Column::number("TC"),
    ];
    let errors = agents.objects.iter();
    let errors = errors.map(|object| Column::number(format!("error {object}")));
    let columns = columns.into_iter().chain(errors);
    let columns = columns.chain([Column::number("success at the end")]);
    let mut table = Table::new("encoders", "Encoders of the agents", columns);
    for encoder in &agents.encoders {
        let cells = [
            Cell::text(&encoder.setting),
            Cell::text(&encoder.name),
            Cell::count(encoder.runs as u64),
            Cell::number(encoder.tc, None, SHARE),
        ];
        let errors = encoder.errors.iter().zip(&encoder.tracked);
        let errors = errors.map(|(error, tracked)| {
            Cell::number(*error, None, ERROR).emphasis(Emphasis::good(*tracked))
        });
        let success = Cell::number(encoder.success, encoder.success_interval, SHARE);
        table.push(cells.into_iter().chain(errors).chain([success]));
    }
    table
}

fn runs(agents: &AgentsReport) -> Table {
    let columns = [
        Column::text("run"),
        Column::text("agents"),
        Column::number("seed"),
        Column::number("steps"),
        Column::number("TC"),
        Column::number("success at the end"),
        Column::number("last evaluation"),
        Column::number("mean success"),
    ];
    let mut table = Table::new("agents", "Runs of agents", columns);
    for group in &agents.groups {
        for run in &group.runs {
            table.push([
                Cell::text(&run.name),
                Cell::text(&group.name),
                Cell::count(run.seed),
                Cell::count(run.steps),
                Cell::number(run.tc, None, SHARE),
                Cell::number(run.success, None, SHARE),
                Cell::number(run.last_success, None, Precision::Fixed(2)),
                Cell::number(run.mean_success, None, SHARE),
            ]);
        }
    }
    table
}

/// One line an agent, as CSV.
pub fn agents_csv(report: &RunsReport) -> String {
    let labels = [
        "group",
        "run",
        "task",
        "state",
        "encoder",
        "seed",
        "steps",
        "complete",
        "tc",
        "success",
        "last_success",
        "mean_success",
        "reason",
    ];
    let mut table = Table::new("agents", "Agents", labels.map(Column::text));
    for group in report.agent_groups() {
        for run in &group.runs {
            table.push(counted(group, run));
        }
        for run in &group.incomplete {
            let head = [&group.name, &run.name].map(Cell::text);
            let unknown = || Cell::text("");
            let cells = [
                Cell::count(run.seed),
                Cell::count(run.steps),
                Cell::text("false"),
            ];
            let cells = head
                .into_iter()
                .chain([unknown(), unknown(), unknown()])
                .chain(cells);
            let values = [unknown(), unknown(), unknown(), unknown()];
            table.push(cells.chain(values).chain([Cell::text(&run.reason)]));
        }
    }
    table.to_csv()
}

/// The cells of a run that counts.
fn counted<'a>(
    group: &'a AgentGroupReport,
    run: &'a AgentReport,
) -> impl Iterator<Item = Cell> + 'a {
    let encoder = run.encoder.as_deref().unwrap_or_default();
    let names = [&group.name, &run.name, &run.task, &run.state, encoder].map(Cell::text);
    let counts = [
        Cell::count(run.seed),
        Cell::count(run.steps),
        Cell::text("true"),
    ];
    let values = [
        run.tc,
        Some(run.success),
        Some(run.last_success),
        Some(run.mean_success),
    ];
    let values = values.map(|value| Cell::number(value, None, Precision::Full));
    let cells = names.into_iter().chain(counts);
    cells.chain(values).chain([Cell::text("")])
}

/// One line a group and step, as CSV.
pub fn success_csv(report: &RunsReport) -> String {
    let labels = ["group", "runs", "step", "success_iqm", "low", "high"];
    let mut table = Table::new("success", "Success over steps", labels.map(Column::text));
    for group in report.agent_groups() {
        for point in &group.curve {
            let ends = point.interval.map_or([None; 2], |ends| ends.map(Some));
            let numbers = [Some(point.iqm), ends[0], ends[1]];
            let cells = [
                Cell::text(&group.name),
                Cell::count(group.complete as u64),
                Cell::count(point.step),
            ];
            let numbers = numbers.map(|number| Cell::number(number, None, Precision::Full));
            table.push(cells.into_iter().chain(numbers));
        }
    }
    table.to_csv()
}
