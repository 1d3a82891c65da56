//! Results and figures, the same for the terminal and the page.

mod document;
mod evaluation;
mod figure;
mod measured;
mod plots;
mod reference;
mod runs;
mod runs_page;
mod runs_report;
mod tables;
mod trajectories;

pub use evaluation::{
    EvaluationReport, HeldOutObjectReport, HeldOutReport, IntervalReport, IntervalsReport, JoinReport,
    MapReport, ObjectReport, Unmatched,
};
pub use figure::{Color, LineFigure, LineSeries, draw_lines, lines_to_svg};
pub use plots::{Figure, figures};
pub use reference::{
    Claim, ClaimReport, Comparison, Pair, Reference, ReferenceNumbers, ReferenceReport, ReferenceRow,
    Statistic,
};
pub use runs::{DataSet, Epoch, Group, Grouping, Run, RunFiles, Runs, Unread, data_sets};
pub use runs_page::runs_page;
pub use runs_report::{
    GroupReport, ImprovementReport, IncompleteRun, ObjectRunsReport, RunReport, RunsReport,
};
pub use tables::{errors_csv, runs_csv, runs_markdown};
pub use trajectories::{Path, Scene, trajectories};
