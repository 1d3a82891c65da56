//! Results and figures, the same for the terminal and the page.

mod decades;
mod document;
mod evaluation;
mod figure;
mod figures;
mod measured;
mod page;
mod plots;
mod reference;
mod request;
mod runs;
mod runs_page;
mod runs_report;
mod tables;
mod trajectories;
mod unmatched;

pub use evaluation::{
    AssignmentReport, ContextReport, EvaluationReport, HeldOutObjectReport, HeldOutReport,
    IntervalReport, IntervalsReport, JoinReport, JoinSummary, KeypointError, MapReport,
    ObjectReport, RegressionReport, SequenceReport, SequencesReport, Unmatched,
};
pub use figure::{Color, LineFigure, LineSeries, PlotArea, draw_lines, lines_to_svg};
pub use figures::{Drawn, Figure, Theme, capability, evaluation_figures, matrix, sequences};
pub use page::evaluation_page;
pub use plots::figures;
pub use reference::{
    Claim, ClaimReport, Comparison, Pair, Reference, ReferenceNumbers, ReferenceReport,
    ReferenceRow, Statistic,
};
pub use request::{Inputs, Request, shell_line};
pub use runs::{DataSet, Epoch, Group, Grouping, Run, RunFiles, Runs, Unread, data_sets};
pub use runs_page::runs_page;
pub use runs_report::{
    GroupReport, ImprovementReport, IncompleteRun, ObjectRunsReport, RunReport, RunsReport,
};
pub use tables::{errors_csv, runs_csv, runs_markdown};
pub use trajectories::{Path, Scene, trajectories};
pub use unmatched::{UnmatchedSequence, unmatched_sequences};
