//! Many runs as Markdown.

use super::statistics::RunsReport;
use super::tables::runs_tables;
use crate::report::draw::Figure;

/// Everything as Markdown, with the figures as files in the same folder. The tables of the runs
/// are left out: `runs.csv` and `agents.csv` have them.
pub fn runs_markdown(report: &RunsReport, figures: &[Figure]) -> String {
    let mut out = String::from("# Tracking over runs\n");
    for table in runs_tables(report)
        .iter()
        .filter(|table| !["runs", "agents"].contains(&table.name))
    {
        out += &format!("\n## {}\n\n{}", table.caption, table.to_markdown());
    }
    for note in &report.notes {
        out += &format!("\nNote: {note}.\n");
    }
    if report.not_counted().next().is_some() {
        out += "\n## Runs that do not count\n\n";
        for (name, reason) in report.not_counted() {
            out += &format!("- {name}: {reason}\n");
        }
    }
    for figure in figures {
        let name = &figure.name;
        out += &format!("\n![{name}]({name}.svg)\n\n{}\n", figure.caption);
    }
    out
}
